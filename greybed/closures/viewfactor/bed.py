"""A closure over a whole bed: neighbour search, markers, sparse factors, shares of the walls."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from greybed.closures.viewfactor.markers import pair_markers
from greybed.closures.viewfactor.neighbourhood import neighbourhood
from greybed.closures.viewfactor.walls import WallMarkers, wall_markers
from greybed.core import InputError, Packing, RangeError
from greybed.core.exact import pair_factor

if TYPE_CHECKING:
    from greybed.closures.viewfactor.closure import ViewFactorClosure

Array = NDArray[np.float64]
Index = NDArray[np.int64]

# Reach of the pair sum where nothing else is asked for, in mean radii: at solid fractions of
# settled beds the pairs beyond it hold less than one percent of a row.
REACH = 10.0
CHORDS = 4.0
# Beyond it pairs are counted in a mean field, down to this share of light and up to this reach.
UNSEEN = 5e-3
FAR_REACH = 40.0


@dataclass(frozen=True, eq=False)
class BedFactors:
    """View factors of a bed from a closure; the same names as traced ones.

    Attributes
    ----------
    factors : csr_array, shape (n, n)
        Sphere to sphere [-], symmetric after multiplication with ``areas``.
    wall_factors : ndarray, shape (n, n_walls)
        Sphere to wall [-].
    escaped : ndarray, shape (n,)
        Sphere to opening [-].
    areas : ndarray, shape (n,)
        Sphere surfaces [m2].
    extrapolated : float
        Share of the pairs whose markers lie outside the training data [-].
    """

    factors: sparse.csr_array
    wall_factors: Array
    escaped: Array
    areas: Array
    extrapolated: float


def bed_factors(
    closure: ViewFactorClosure,
    packing: Packing,
    *,
    wall_closure: ViewFactorClosure | None = None,
    reach: float | None = None,
    solid_fraction: float | None = None,
) -> BedFactors:
    """Evaluate a closure for all pairs of a bed.

    Parameters
    ----------
    closure : ViewFactorClosure
        The closure.
    packing : Packing
        The bed, with its walls.
    wall_closure : ViewFactorClosure, optional
        Closure on the markers ``wall``; without it the free share of the lines is taken as it is.
    reach : float, optional
        Largest distance between the centres of a pair [m]. By default 10 mean radii for the
        closure, and a mean field, F_exact exp(-gap / mean chord), for pairs further apart.
    solid_fraction : float, optional
        Solid fraction inside the bed [-]; measured by default (see :func:`inner_fraction`).

    Returns
    -------
    BedFactors

    Raises
    ------
    InputError
        If the closure is not one of pairs of spheres.
    RangeError
        If ``reach`` or ``solid_fraction`` is out of range, or two spheres have one centre.

    Notes
    -----
    Each wall's exact free share is multiplied with its visibility along 4096 fixed lines a
    sphere, blocked by the real neighbours; the opening is what those lines see of it. Rows add up
    to one within the errors; :meth:`ViewFactorClosure.factors` balances them.
    """
    if closure.quantity != "viewfactor":
        raise InputError(
            f"this closure gives {closure.quantity}, not the view factors of pairs that a whole "
            "bed is made of; take shipped('viewfactor_mlp_pencil')."
        )
    phi = inner_fraction(packing) if solid_fraction is None else solid_fraction
    if not 0.0 < phi < 1.0:
        raise RangeError(f"solid_fraction = {phi:g} [-] must lie in (0, 1); check the packing.")
    size = near_reach(packing, phi) if reach is None else float(reach)
    if not (np.isfinite(size) and size > 0.0):
        raise RangeError(f"reach = {size:g} [m] must be finite and above 0; leave it out for 10 r.")
    hood = neighbourhood(packing, size)
    owner = hood.owner
    if (hood.distance == 0.0).any():
        k = int((hood.distance == 0.0).argmax())
        raise RangeError(
            f"{packing.source}: spheres {owner[k]} and {hood.sphere[k]} have one centre; remove "
            "one of them."
        )
    # Each pair once: markers and factor of j -> i follow from those of i -> j.
    image = hood.image
    ahead = np.where(
        image[:, 0] != 0,
        image[:, 0] > 0,
        np.where(image[:, 1] != 0, image[:, 1] > 0, image[:, 2] > 0),
    )
    once = hood.within & ((owner < hood.sphere) | ((owner == hood.sphere) & ahead))
    markers = pair_markers(packing, hood, once, solid_fraction=phi)
    predicted = closure.predict(**markers.of(closure.marker_names))
    i, j = owner[once], hood.sphere[once]
    areas = packing.areas
    exchange = areas[i] * predicted.view_factor
    if reach is None:
        far = _far_pairs(packing, size, phi)
        i, j = np.concatenate([i, far[0]]), np.concatenate([j, far[1]])
        exchange = np.concatenate([exchange, far[2]])
    n = len(packing)
    both = sparse.coo_array(
        (np.concatenate([exchange, exchange]), (np.concatenate([i, j]), np.concatenate([j, i]))),
        shape=(n, n),
    )
    factors = sparse.csr_array(sparse.diags_array(1.0 / areas) @ both.tocsr())
    if all(packing.periodic):
        walls, opening = np.zeros((n, 0)), np.zeros(n)
    else:
        walls, opening = _wall_factors(wall_markers(packing, hood, size, phi), wall_closure)
    return BedFactors(
        factors,
        walls,
        opening,
        areas,
        float(predicted.extrapolates.mean()) if len(i) else 0.0,
    )


def mean_chord(packing: Packing, solid_fraction: float) -> float:
    """Mean length of free lines between the spheres, 4 (1 - phi) r32 / (3 phi) [m]."""
    r = packing.radii
    r32 = float((r**3).sum() / (r**2).sum())
    return 4.0 * (1.0 - solid_fraction) * r32 / (3.0 * solid_fraction)


def near_reach(packing: Packing, phi: float) -> float:
    """Distance up to which pairs are evaluated one by one [m]: longer where the bed is open."""
    mean = float(packing.radii.mean())
    return float(
        np.clip(2.0 * mean + CHORDS * mean_chord(packing, phi), REACH * mean, 2.0 * REACH * mean)
    )


def _far_pairs(packing: Packing, near: float, phi: float) -> tuple[Index, Index, Array]:
    """Pairs beyond ``near``, each once, and their exchange areas A_i F_ij [m2] in a mean field.

    F = F_exact exp(-gap / chord): so far apart there are so many spheres in between that their
    places do not matter. Pairs that less than UNSEEN of the light reaches are left out.
    """
    chord, largest = mean_chord(packing, phi), float(packing.radii.max())
    far = min(2.0 * largest + chord * np.log(1.0 / UNSEEN), FAR_REACH * float(packing.radii.mean()))
    if far <= near:
        return np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0)
    hood = neighbourhood(packing, far)
    owner, sphere = hood.owner, hood.sphere
    chosen = hood.within & (hood.distance > near) & (owner <= sphere)
    i, j, d = owner[chosen], sphere[chosen], hood.distance[chosen]
    r_i, r_j = packing.radii[i], packing.radii[j]
    factor = pair_factor(r_j / d, r_j / r_i) * np.exp(-(d - r_i - r_j) / chord)
    # A sphere and its own image stand in the list in both directions.
    return i, j, packing.areas[i] * factor * np.where(i == j, 0.5, 1.0)


def _wall_factors(m: WallMarkers, closure: ViewFactorClosure | None) -> tuple[Array, Array]:
    """Factors to walls, (n, n_walls), and to the opening, (n,) [-]."""
    if closure is None:
        return m.wall_share * (1.0 - m.blocked_fraction), m.opening
    # A wall that no line reaches: no share at all, and the closure's factor needs some.
    share = np.maximum(m.wall_share, 1e-12)
    markers = {**vars(m), "wall_share": share}
    return closure.evaluate(**{name: markers[name] for name in closure.marker_names}), m.opening


def inner_fraction(packing: Packing) -> float:
    """Solid fraction inside the bed, away from walls and free surfaces [-].

    The median, over the tenth of the spheres that lie deepest, of the sphere volume inside a
    ball of five mean radii around each; spheres cut by the ball count by their exact part.
    """
    from scipy.spatial import cKDTree

    if all(packing.periodic):
        return packing.solid_fraction
    centres, radii = packing.centres, packing.radii
    ball = 5.0 * float(radii.mean())
    tree = cKDTree(centres)
    reach = ball + float(radii.max())
    # Deep is where many neighbours are.
    crowd = tree.query_ball_point(centres, reach, return_length=True)
    deep = np.argsort(-crowd, kind="stable")[: max(1, len(packing) // 10)]
    fractions = []
    for near, i in zip(tree.query_ball_point(centres[deep], reach), deep, strict=True):
        index = np.asarray(near)
        d = np.sqrt(((centres[index] - centres[i]) ** 2).sum(axis=1))
        fractions.append(
            _common_volume(ball, radii[index], d).sum() / (4.0 / 3.0 * np.pi * ball**3)
        )
    return float(np.median(fractions))


def _common_volume(ball: float, radii: Array, distance: Array) -> Array:
    """Volume that spheres share with a ball around the origin [m3]."""
    whole = 4.0 / 3.0 * np.pi * radii**3
    d = np.maximum(distance, 1e-9 * ball)  # nearer, one lies inside the other
    lens = (
        np.pi
        * (ball + radii - d) ** 2
        * (d**2 + 2.0 * d * (ball + radii) - 3.0 * (ball - radii) ** 2)
        / (12.0 * d)
    )
    inside, outside = distance <= ball - radii, distance >= ball + radii
    around = distance <= radii - ball
    apart = np.where(outside, 0.0, np.where(around, 4.0 / 3.0 * np.pi * ball**3, lens))
    return np.where(inside, whole, apart)
