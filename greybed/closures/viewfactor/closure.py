"""View-factor closure: exact pair factor times a learnt visibility, with its own uncertainty."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.closures.markers import checked_markers
from greybed.closures.predictors import PREDICTORS, Predictor
from greybed.closures.viewfactor.visibility import (
    MARKER_SETS,
    MarkerSet,
    spread,
    unblocked_share,
)
from greybed.core import Packing, RangeError
from greybed.core.exact import TOUCHING

if TYPE_CHECKING:
    from greybed.closures.viewfactor.bed import BedFactors
    from greybed.core.diffuse import DiffuseExchange
    from greybed.core.rows import Rows

Array = NDArray[np.float64]


class Prediction(NamedTuple):
    """What a closure says of each pair.

    Attributes
    ----------
    view_factor : ndarray
        F_ij [-].
    stderr : ndarray
        The closure's own standard error [-]; zero where nothing stands between.
    extrapolates : ndarray of bool
        Whether the markers lie outside the training data. Never where nothing stands between:
        the exact law holds there.
    """

    view_factor: Array
    stderr: Array
    extrapolates: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Domain:
    """Where the training data lie, in features.

    Attributes
    ----------
    low, high : (n_features,) float
        Range of each feature.
    centre : (n_features,) float
        Their mean.
    precision : (n_features, n_features) float
        Inverse covariance.
    limit : float
        Largest Mahalanobis distance that counts as inside [-].
    """

    low: Array
    high: Array
    centre: Array
    precision: Array
    limit: float

    @classmethod
    def everywhere(cls, n_features: int) -> Domain:
        """The domain of an untrained closure: nothing is outside."""
        infinite = np.full(n_features, np.inf)
        zeros = np.zeros(n_features)
        return cls(-infinite, infinite, zeros, np.zeros((n_features, n_features)), np.inf)

    @classmethod
    def of(cls, features: Array) -> Domain:
        """The domain that holds these features (m, n_features)."""
        centre = features.mean(axis=0)
        spread_ = np.cov(features.T) + 1e-12 * np.eye(features.shape[1])
        precision = np.asarray(np.linalg.inv(spread_), dtype=np.float64)
        away = features - centre
        distance2 = np.einsum("ij,jk,ik->i", away, precision, away)
        limit = float(np.sqrt(np.quantile(distance2, 0.9999)))
        return cls(
            features.min(axis=0),
            features.max(axis=0),
            centre,
            precision,
            limit,
        )

    def outside(self, features: Array) -> NDArray[np.bool_]:
        """Whether each of the features (m, n_features) lies outside."""
        box = ((features < self.low) | (features > self.high)).any(axis=-1)
        away = features - self.centre
        distance2 = np.einsum("ij,jk,ik->i", away, self.precision, away)
        return box | (distance2 > self.limit**2)

    def arrays(self) -> dict[str, NDArray]:
        """Arrays to store, by name."""
        return {
            "domain_low": self.low,
            "domain_high": self.high,
            "domain_centre": self.centre,
            "domain_precision": self.precision,
            "domain_limit": np.array([self.limit]),
        }

    @classmethod
    def from_arrays(cls, arrays: dict[str, NDArray]) -> Domain:
        """Rebuild from :meth:`arrays`."""
        low, high, centre, precision, limit = (
            arrays[f"domain_{name}"] for name in ("low", "high", "centre", "precision", "limit")
        )
        return cls(low, high, centre, precision, float(limit[0]))


@dataclass(frozen=True, eq=False)
class ViewFactorClosure:
    """F_ij = F_exact(r_i, r_j, d) V with V = 1 - gate (1 - v), v learnt.

    Parameters
    ----------
    markers : MarkerSet
        Which markers, and their gate, baseline and features.
    predictor : Network or Forest
        The learnt part.
    domain : Domain
        Where it was trained.
    card : dict
        Plain facts about the closure: data-set hash, scores, versions.
    """

    markers: MarkerSet
    predictor: Predictor
    domain: Domain
    card: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def untrained(
        cls, kind: str = "mlp", markers: str = "pencil", seed: int = 0
    ) -> ViewFactorClosure:
        """A closure with random weights: useless factors, but every limit already holds."""
        marker_set = MARKER_SETS[markers]
        n = len(marker_set.feature_names)
        predictor = PREDICTORS[kind].random(n, seed=seed)
        return cls(marker_set, predictor, Domain.everywhere(n))

    @property
    def quantity(self) -> str:
        """``viewfactor`` between spheres, ``wallfactor`` to a wall, or ``exchange`` factor."""
        return self.markers.quantity

    @property
    def kind(self) -> str:
        """``mlp`` or ``forest``."""
        return self.predictor.kind

    @property
    def marker_names(self) -> tuple[str, ...]:
        """Names of the markers that :meth:`evaluate` takes."""
        return self.markers.names

    def arrays(self) -> dict[str, NDArray]:
        """Arrays besides those of the predictor that a file holds."""
        return self.domain.arrays()

    def evaluate(self, **markers: ArrayLike) -> Array:
        """View factors from i to j.

        Parameters
        ----------
        **markers : array_like
            The markers by name (see :attr:`marker_names`), broadcast against each other [-].
            ``radius_over_distance`` is r_j / d and ``radius_ratio`` r_j / r_i.

        Returns
        -------
        factor : ndarray
            F_ij [-], above 0 and at most the exact unobstructed factor.

        Raises
        ------
        RangeError
            If a marker is missing, unknown, not finite or outside its range, or the spheres
            overlap by more than soft contact does.
        """
        return self.predict(**markers).view_factor

    def predict(self, **markers: ArrayLike) -> Prediction:
        """View factors with the closure's own standard error and a flag for extrapolation.

        Takes the markers of :meth:`evaluate`.
        """
        m = self._checked(markers)
        shape = next(iter(m.values())).shape
        flat = {name: np.ravel(value) for name, value in m.items()}
        features = self.markers.features(flat)
        gate = self.markers.gate(flat)
        raw = self.predictor(features)
        share = unblocked_share(self.kind, self.markers.baseline(flat), raw[:, 0])
        exact = self.markers.exact(flat)
        # A sum of two positive parts: 1 - gate (1 - share) would cancel where little is visible,
        # and with it reciprocity.
        clear = 1.0 - gate if self.markers.clear is None else self.markers.clear(flat)
        factor = exact * (clear + gate * share)
        error = exact * gate * spread(self.kind, raw[:, 1])
        outside = self.domain.outside(features) & (gate > 0.0)
        return Prediction(factor.reshape(shape), error.reshape(shape), outside.reshape(shape))

    def bed_factors(self, packing: Packing, **options: Any) -> BedFactors:
        """View factors of a whole bed; see :func:`greybed.closures.viewfactor.bed.bed_factors`."""
        from greybed.closures.viewfactor.bed import bed_factors

        return bed_factors(self, packing, **options)

    def factors(self, packing: Packing, **options: Any) -> Rows:
        """View factors of a whole bed, balanced: reciprocal, and every row sums to one.

        Parameters
        ----------
        packing : Packing
            The bed, with its walls.
        **options
            Those of :func:`greybed.closures.viewfactor.bed.bed_factors`: ``wall_closure``,
            ``reach`` [m], ``solid_fraction`` [-].

        Returns
        -------
        Rows
            ``factors`` (n, n) sparse, ``wall_factors`` (n, n_walls), ``escaped`` (n,) [-] and
            ``areas`` (n,) [m2], ready for :class:`greybed.coupling.ThermalBed`.

        Raises
        ------
        InputError
            If no scaling closes the rows.
        """
        from greybed.core.rows import Rows, balanced

        bed = self.bed_factors(packing, **options)
        return balanced(Rows.of(bed, packing))

    def exchange(
        self,
        packing: Packing,
        emissivity: ArrayLike,
        *,
        wall_emissivity: ArrayLike = 1.0,
        wall_exchange: ArrayLike | None = None,
        sides: int = 24,
        **options: Any,
    ) -> DiffuseExchange:
        """Exchange factors of a whole bed, each sphere cut into sides that reflect evenly.

        Parameters
        ----------
        packing : Packing
            The bed, with its walls.
        emissivity : array_like, shape () or (n,)
            Of the spheres, 0.001 ... 1 [-].
        wall_emissivity : array_like, shape () or (n_walls,)
            Of the walls, 0 ... 1 [-].
        wall_exchange : array_like, shape (n_walls, n_walls), optional
            Exchange areas A F between the walls themselves [m2], for grey walls.
        sides : int
            Sides of each sphere [-]; 1 for one radiosity per sphere, quicker and biased.
        **options
            Those of :meth:`factors`.

        Returns
        -------
        DiffuseExchange
            ``emitted_by(spheres)`` gives rows, ``rows()`` all of them, ``heats(power)`` net heats.

        Raises
        ------
        InputError
            As :meth:`factors` and :func:`greybed.core.diffuse.diffuse_exchange`.
        """
        from greybed.core.diffuse import diffuse_exchange

        return diffuse_exchange(
            self.factors(packing, **options),
            emissivity,
            wall_emissivity=wall_emissivity,
            wall_exchange=wall_exchange,
            packing=packing,
            sides=sides,
        )

    def _checked(self, markers: dict[str, ArrayLike]) -> dict[str, Array]:
        m = checked_markers(self.markers.markers, markers)
        if self.quantity == "wallfactor":
            return m
        x = m["radius_over_distance"]
        reach = x * (1.0 + 1.0 / m["radius_ratio"])
        deep = reach > 1.0 / (1.0 - TOUCHING)
        if deep.any():
            raise RangeError(
                f"(r_i + r_j) / d = {reach[deep].flat[0]:.4g} [-] exceeds 1 by more than soft "
                f"contact does ({TOUCHING:.0%}): the spheres overlap; separate them."
            )
        return m
