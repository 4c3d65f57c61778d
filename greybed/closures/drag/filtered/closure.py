"""Filtered drag closure: how much of the drag law is kept along gravity and across it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.closures.drag.filtered.features import MARKER_SETS, DragMarkerSet, Slope, bend
from greybed.closures.drag.filtered.gate import Gate
from greybed.closures.drag.filtered.markers import flat_markers
from greybed.closures.predictors import Forest, Network, Predictor
from greybed.closures.viewfactor.closure import Domain

Array = NDArray[np.float64]

QUANTITY = "filtereddrag"
CONVENTION = "fraction kept"
# Neurons of the layers of a network: few, for it is evaluated in every cell and step. Two layers
# of 12 or 24 neurons score alike.
HIDDEN = (16,)
# Bound of ln H: the kept fraction stays between e^-4 = 0.018 and e^4.
LOG_BOUND = 4.0
# Largest standard error of ln H, and largest share of the pressure gradient's force.
SPREAD_BOUND = 1.0
SHARE_BOUND = 0.9
# Parcels of alpha diameters keep exp(-0.05 (alpha - 1)) besides (Radl & Sundaresan 2014).
PARCEL_RATE = 0.05


class DragPrediction(NamedTuple):
    """What a closure says of each place. Fractions of drag are kept ones everywhere.

    Attributes
    ----------
    kept_along, kept_across : ndarray
        H along gravity and across it: filtered drag over the drag law at the filtered fields [-].
    share : ndarray
        Of the force that the pressure gradient gives; 0 without a linear part [-].
    stderr : ndarray
        The closure's own standard error of ``kept_along``; of ``kept_across`` it is as much in
        proportion [-]. 0 where the gate is shut.
    extrapolates : ndarray of bool
        Whether the markers lie outside the training data; never where the gate is shut.
    """

    kept_along: Array
    kept_across: Array
    share: Array
    stderr: Array
    extrapolates: NDArray[np.bool_]


class DragSlopes(NamedTuple):
    """Derivatives (n, 4) for slip up, slip across squared, work of the gradient, drag ratio.

    Attributes
    ----------
    along, across : ndarray
        Of the logarithms of the kept fractions.
    share : ndarray
        Of the share itself.
    """

    along: Array
    across: Array
    share: Array


@dataclass(frozen=True, eq=False)
class FilteredDragClosure:
    """ln H = gate (bounded(model) - parcels), one H along gravity and one across it.

    Parameters
    ----------
    markers : DragMarkerSet
        What the model sees.
    predictor : Network or Forest
        The learnt part.
    domain : Domain
        Where the training features lie.
    gate : Gate
        Exactly 0, so that H = 1, for no particles, packed particles and filters of size 0.
    card : dict
        Where it comes from and what it is good for.
    """

    quantity: ClassVar[str] = QUANTITY
    markers: DragMarkerSet
    predictor: Predictor
    domain: Domain
    gate: Gate = field(default_factory=Gate)
    card: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def untrained(
        cls, kind: str = "mlp", markers: str = "plain", seed: int = 0
    ) -> FilteredDragClosure:
        """A closure with random weights: useless numbers, but every limit already holds."""
        chosen = MARKER_SETS[markers]
        n = len(chosen.feature_names)
        predictor: Predictor
        if kind == "mlp":
            predictor = Network.random(n, HIDDEN, seed, chosen.outputs, bent=True)
        else:
            predictor = Forest.random(n, seed=seed, outputs=chosen.outputs)
        return cls(chosen, predictor, Domain.everywhere(n))

    @property
    def kind(self) -> str:
        """``mlp`` or ``forest``."""
        return self.predictor.kind

    @property
    def marker_names(self) -> tuple[str, ...]:
        """Names of the markers that :meth:`predict` takes; ``parcels`` may be left out."""
        return self.markers.names

    @property
    def needs_gradient(self) -> bool:
        """Whether it needs the pressure gradient."""
        return self.markers.pressure

    def arrays(self) -> dict[str, NDArray]:
        """Arrays besides those of the predictor that decide the answers."""
        return {**self.domain.arrays(), **self.gate.arrays()}

    def predict(self, **markers: ArrayLike) -> DragPrediction:
        """Kept fractions of markers.

        Parameters
        ----------
        **markers : array_like
            The markers by name (:attr:`marker_names`), broadcast against each other [-].

        Raises
        ------
        RangeError
            If a marker is missing, unknown, not finite or out of range.
        """
        return self._answer(markers, False)[0]

    def with_slopes(self, **markers: ArrayLike) -> tuple[DragPrediction, DragSlopes]:
        """Kept fractions (n,) and their derivatives for the slip; markers as for ``predict``.

        A forest is constant between its cuts: its derivatives are 0.
        """
        prediction, slopes = self._answer(markers, True)
        assert slopes is not None  # asked for
        return prediction, slopes

    def _answer(
        self, markers: dict[str, ArrayLike], slopes: bool
    ) -> tuple[DragPrediction, DragSlopes | None]:
        m, shape = flat_markers(self.markers.markers, markers)
        features, moving = self.markers.with_slopes(m)
        gate = self.gate(m["solid_fraction"], m["filter_size"])
        inner: Array | None = None
        if slopes and isinstance(self.predictor, Network):
            raw, inner = self.predictor.with_slopes(features)
        else:
            raw = self.predictor(features)
        parcels = PARCEL_RATE * (m["parcels"] - 1.0)
        along = np.exp(gate * (bounded(self.kind, raw[:, 0]) - parcels))
        across = np.exp(gate * (bounded(self.kind, raw[:, 1]) - parcels))
        share = np.zeros_like(gate)
        if self.markers.linear:
            share = gate * SHARE_BOUND * logistic(raw[:, 2])
        stderr = along * (gate * spread(self.kind, raw[:, -1]))
        outside = self.domain.outside(features) & (gate > 0.0)
        prediction = DragPrediction(
            along.reshape(shape), across.reshape(shape), share.reshape(shape),
            stderr.reshape(shape), outside.reshape(shape),
        )  # fmt: skip
        if not slopes:
            return prediction, None
        return prediction, self._slopes(raw, inner, moving, gate)

    def _slopes(
        self, raw: Array, inner: Array | None, moving: list[Slope], gate: Array
    ) -> DragSlopes:
        found = np.zeros((3, len(gate), 4))
        if inner is not None:
            for k in range(self.markers.outputs - 1):
                if k < 2:
                    outer = gate * bend(raw[:, k], LOG_BOUND)[1]
                else:
                    part = logistic(raw[:, 2])
                    outer = gate * SHARE_BOUND * part * (1.0 - part)
                for slope in moving:
                    found[k, :, slope.number] += outer * inner[:, k, slope.feature] * slope.value
        return DragSlopes(*found)


def bounded(kind: str, raw: Array) -> Array:
    """ln H before the gate, inside +- 4; leaves of a forest lie there by themselves."""
    return raw if kind == "forest" else bend(raw, LOG_BOUND)[0]


def logistic(x: Array) -> Array:
    """1 / (1 + e^-x) without overflow."""
    e = np.exp(-np.abs(x))
    return np.asarray(np.where(x >= 0.0, 1.0, e) / (1.0 + e))


def spread(kind: str, raw: Array) -> Array:
    """Standard error of ln H before the gate, from a predictor's last output [-]."""
    return raw if kind == "forest" else SPREAD_BOUND * logistic(raw)
