r"""Filtered drag as a vector, and its derivative with respect to the slip.

.. math:: F = (1 - w)\,\beta K s + w P,\quad K = h_\parallel g g + h_\perp (I - g g),\quad
          P = -\epsilon (\nabla p - \rho_g g)

The share w is 0 unless the closure has a linear part. Any w that is above 0 where the slip
vanishes would let some gradient drive the gas, so it fades as the drag's own work A = beta s.K.s
falls below what the gradient's force takes out,

.. math:: w = w_0 \frac{A}{A + w_0 n},\quad
          n = \tfrac12\Bigl(\sqrt{(P\cdot s)^2 + (\eta u_t |P|)^2} - P\cdot s\Bigr) \ge -P\cdot s

which gives F.s >= A^2 (1 - w_0) / (A + w_0 n) >= 0 for every gradient, without a switch.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.closures.drag.filtered.closure import DragPrediction, DragSlopes
from greybed.closures.drag.filtered.markers import across, along, drag_markers, frame_of
from greybed.closures.drag.filtered.materials import Material
from greybed.closures.drag.law import DragLaw
from greybed.core.errors import InputError

Array = NDArray[np.float64]
Law = DragLaw | Callable[[Array, Array], Any]

# eta: how far below u_t the slip must be for the gradient's force to fade.
FADE = 0.05


class KeptDrag(Protocol):
    """A learnt closure or a published model: what fraction of drag is kept."""

    @property
    def marker_names(self) -> tuple[str, ...]:
        """Markers that it takes."""
        ...

    @property
    def needs_gradient(self) -> bool:
        """Whether it needs the pressure gradient."""
        ...

    def predict(self, **markers: ArrayLike) -> DragPrediction:
        """Kept fractions."""
        ...

    def with_slopes(self, **markers: ArrayLike) -> tuple[DragPrediction, DragSlopes]:
        """Kept fractions and their derivatives."""
        ...


@dataclass(frozen=True, eq=False)
class FilteredForce:
    """Filtered drag of n places.

    Attributes
    ----------
    force : (n, 3) float
        On the particles in a unit volume [N m-3].
    derivative : (n, 3, 3) float
        Of the force with respect to the slip; derivative[k, i, j] = dF_i / ds_j [N s m-4].
    unfiltered : (n, 3) float
        The drag law at the filtered fields [N m-3].
    beta : (n,) float
        Its coefficient [N s m-4].
    share : (n,) float
        Of the pressure gradient's force that is in it [-].
    prediction : DragPrediction
        Of the closure.
    """

    force: Array
    derivative: Array
    unfiltered: Array
    beta: Array
    share: Array
    prediction: DragPrediction


def law_with_slope(law: Law, phi: Array, reynolds: Array) -> tuple[Array, Array]:
    """F and Re dF/dRe of a law; by a small difference where it has no slope of its own."""
    if isinstance(law, DragLaw):
        return law.with_slope(phi, reynolds)
    force = np.asarray(law(phi, reynolds), dtype=np.float64)
    further = 1e-3 * np.maximum(reynolds, 1e-6)
    beyond = np.asarray(law(phi, reynolds + further), dtype=np.float64)
    return force, reynolds * (beyond - force) / further


def filtered_force(
    closure: KeptDrag,
    material: Material,
    law: Law,
    gravity: ArrayLike,
    solid_fraction: ArrayLike,
    slip: ArrayLike,
    filter_size: ArrayLike,
    pressure_gradient: ArrayLike | None = None,
    parcels: ArrayLike = 1.0,
) -> FilteredForce:
    """Filtered drag and its derivative with respect to the slip.

    Parameters
    ----------
    closure : KeptDrag
        A :class:`FilteredDragClosure` or a published model from ``baselines``.
    material : Material
        Gas and particles.
    law : DragLaw or callable
        Drag law F(phi, Re) of the resolved scale.
    gravity : array_like, shape (3,)
        Its direction; the magnitude is the material's.
    solid_fraction : array_like, shape (n,)
        Filtered, 0 to below 1 [-].
    slip : array_like, shape (n, 3)
        Filtered gas less solids velocity, each weighted with its phase [m s-1].
    filter_size : array_like, shape () or (n,)
        Edge of the filter [m].
    pressure_gradient : array_like, shape (n, 3), optional
        Filtered, with its mean in a periodic box [Pa m-1]; for closures that need it.
    parcels : array_like, shape () or (n,)
        Diameter of a parcel over that of its particles [-].

    Raises
    ------
    InputError
        If the closure needs a pressure gradient that is not there, or shapes do not fit.
    RangeError
        If a marker is out of range.
    """
    if closure.needs_gradient and pressure_gradient is None:
        raise InputError(
            "filtered drag: this closure needs the pressure gradient and none is given; give it, "
            "or take a closure with plain markers."
        )
    frame = frame_of(material, gravity, slip, pressure_gradient)
    s, up, u_t = frame.slip, frame.up, material.terminal_velocity
    phi = np.broadcast_to(np.asarray(solid_fraction, dtype=np.float64), (len(s),))
    speed2 = (s * s).sum(axis=1)
    scale = material.gas_density * material.diameter / material.gas_viscosity
    f, steep = law_with_slope(law, phi, (1.0 - phi) * scale * np.sqrt(speed2))
    beta = 18.0 * material.gas_viscosity * (1.0 - phi) * phi * f / material.diameter**2
    # Relative slope of beta over s: s (Re F' / F) / s^2, which is 0 without slip.
    relative = (steep / f / np.maximum(speed2, 1e-300))[:, None] * s
    found = drag_markers(material, frame, phi, filter_size, f, parcels)
    prediction, slopes = closure.with_slopes(**{n: found[n] for n in closure.marker_names})
    lateral = across(s, up)
    numbers = np.zeros((len(s), 4, 3))  # derivatives of slip up, across^2, work, ratio
    numbers[:, 0] = up / u_t
    numbers[:, 1] = 2.0 * lateral / u_t**2
    if frame.fall is not None:
        numbers[:, 2] = across(frame.fall, up) / (material.weight * u_t)
    numbers[:, 3] = (f / material.terminal_drag)[:, None] * relative
    change = [np.einsum("nk,nkj->nj", part, numbers) for part in slopes]
    outer = np.einsum("i,j->ij", up, up)
    along_, across_ = prediction.kept_along, prediction.kept_across
    force_up = (beta * along_ * along(s, up))[:, None] * up
    force_across = (beta * across_)[:, None] * lateral
    kept = force_up + force_across
    derivative = (
        (beta * along_)[:, None, None] * outer
        + (beta * across_)[:, None, None] * (np.eye(3) - outer)
        + np.einsum("ni,nj->nij", force_up, change[0])
        + np.einsum("ni,nj->nij", force_across, change[1])
        + np.einsum("ni,nj->nij", kept, relative)
    )
    share = np.zeros(len(s))
    if frame.fall is not None and prediction.share.any():
        pull = (1.0 - phi)[:, None] * frame.fall
        share, of_share = _faded(
            prediction.share, change[2], (kept * s).sum(axis=1),
            np.einsum("nij,ni->nj", derivative, s) + kept, pull, s, u_t,
        )  # fmt: skip
        derivative = (1.0 - share)[:, None, None] * derivative + np.einsum(
            "ni,nj->nij", pull - kept, of_share
        )
        kept = (1.0 - share)[:, None] * kept + share[:, None] * pull
    return FilteredForce(kept, derivative, beta[:, None] * s, beta, share, prediction)


def _opposing(against: Array, size2: Array) -> tuple[Array, Array]:
    """A smooth bound n of -against, and the root that it is made of."""
    root = np.sqrt(against**2 + size2)
    # The product of both roots is size2: no cancellation where the gradient's force drives.
    total = np.where(root > 0.0, root + np.abs(against), 1.0)
    return np.where(against < 0.0, 0.5 * total, 0.5 * size2 / total), root


def faded_share(whole: Array, work: Array, pull: Array, s: Array, u_t: float) -> Array:
    """The share (n,) that keeps F.s >= 0, of work A (n,) and forces and slips (n, 3)."""
    n, _ = _opposing((pull * s).sum(axis=1), (FADE * u_t) ** 2 * (pull * pull).sum(axis=1))
    below = work + whole * n
    return np.asarray(whole * work / np.where(below > 0.0, below, 1.0))


def _faded(
    whole: Array, of_whole: Array, work: Array, of_work: Array, pull: Array, s: Array, u_t: float
) -> tuple[Array, Array]:
    """The same share, and its derivative (n, 3)."""
    against = (pull * s).sum(axis=1)
    n, root = _opposing(against, (FADE * u_t) ** 2 * (pull * pull).sum(axis=1))
    below = work + whole * n
    safe = np.where(below > 0.0, below, 1.0)
    of_n = 0.5 * (against / np.where(root > 0.0, root, 1.0) - 1.0)[:, None] * pull
    of_share = (
        ((work / safe) ** 2)[:, None] * of_whole
        + (whole**2 * n / safe**2)[:, None] * of_work
        - (whole**2 * work / safe**2)[:, None] * of_n
    )
    return whole * work / safe, of_share
