"""A closure over a whole bed: neighbour search, markers, sparse factors, shares of the walls."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from greybed.closures.viewfactor import _kernels
from greybed.closures.viewfactor.markers import RIM, golden_steps, pair_markers
from greybed.closures.viewfactor.neighbourhood import Neighbourhood, neighbourhood
from greybed.core import Cylinder, Packing, Plane, RangeError, Wall
from greybed.core.patches import bounded, ray_distances

if TYPE_CHECKING:
    from greybed.closures.viewfactor.closure import ViewFactorClosure

Array = NDArray[np.float64]

# Reach of the pair sum where nothing else is asked for, in mean radii: at solid fractions of
# settled beds the pairs beyond it hold less than one percent of a row.
REACH = 10.0
# Lines along which a sphere looks for walls.
N_LINES = 128


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
    reach : float, optional
        Largest distance between the centres of a pair [m]; 10 mean radii by default.
    solid_fraction : float, optional
        Solid fraction inside the bed [-]; measured by default (see :func:`inner_fraction`).

    Returns
    -------
    BedFactors

    Notes
    -----
    Walls and openings are seen along 128 fixed lines a sphere, blocked by the real neighbours: a
    geometric estimate with about 0.02 error a sphere, not a learnt one, that averages out over
    the bed. Rows add up to one within the errors; balance them before use (the thermal bed does).
    """
    size = REACH * float(packing.radii.mean()) if reach is None else reach
    if not (np.isfinite(size) and size > 0.0):
        raise RangeError(f"reach = {size:g} [m] must be finite and above 0; leave it out for 10 r.")
    phi = inner_fraction(packing) if solid_fraction is None else solid_fraction
    if not 0.0 < phi < 1.0:
        raise RangeError(f"solid_fraction = {phi:g} [-] must lie in (0, 1); check the packing.")
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
    n = len(packing)
    both = sparse.coo_array(
        (np.concatenate([exchange, exchange]), (np.concatenate([i, j]), np.concatenate([j, i]))),
        shape=(n, n),
    )
    factors = sparse.csr_array(sparse.diags_array(1.0 / areas) @ both.tocsr())
    shares = boundary_shares(packing, hood, size, phi)
    return BedFactors(
        factors,
        shares[:, : packing.n_walls],
        shares[:, packing.n_walls],
        areas,
        float(predicted.extrapolates.mean()) if len(i) else 0.0,
    )


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


def boundary_shares(
    packing: Packing, hood: Neighbourhood, reach: float, solid_fraction: float
) -> Array:
    """View of every wall and, last, of the opening, shape (n, n_walls + 1) [-]."""
    n, shares = len(packing), np.zeros((len(packing), packing.n_walls + 1))
    if all(packing.periodic):
        return shares
    r = packing.radii
    chord = 4.0 * (1.0 - solid_fraction) * (r**3).sum() / (r**2).sum() / (3.0 * solid_fraction)
    directions, offsets = _leaving_lines(n)
    offsets *= r[:, None, None]
    origin = packing.centres[:, None, :] + offsets
    length = np.full((n, N_LINES), np.inf)
    hit = np.full((n, N_LINES), packing.n_walls)
    for w, wall in enumerate(packing.walls):
        t = _distance(origin, directions, wall)
        if bounded(wall):
            # As behind a plane: what starts beyond the wall has met it.
            middle = np.broadcast_to(packing.centres[:, None, :], offsets.shape)
            t[_distance(middle, offsets / r[:, None, None], wall) < r[:, None]] = 0.0
        nearer = t < length
        length, hit = np.where(nearer, t, length), np.where(nearer, w, hit)
    through = np.empty((n, N_LINES))
    _kernels.free_lines(
        hood.emitters, hood.vector, r[hood.sphere], hood.start, directions, offsets, length, RIM,
        through,
    )  # fmt: skip
    # Beyond reach the bed is a mean field; beyond the spheres' own extent the way is free.
    low, high = (
        (packing.centres - r[:, None]).min(axis=0),
        (packing.centres + r[:, None]).max(axis=0),
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        out = np.where(directions > 0.0, (high - origin) / directions, (low - origin) / directions)
    out = np.where(packing.periodic, np.inf, np.nan_to_num(out, nan=np.inf)).min(axis=2)
    unseen = np.maximum(np.minimum(length, out) - reach, 0.0)
    through *= np.exp(-unseen / chord)
    np.add.at(shares, (np.arange(n)[:, None], hit), through / N_LINES)
    return shares


def _leaving_lines(n: int) -> tuple[Array, Array]:
    """Directions and starting points (n, 128, 3) of lines that leave unit spheres evenly.

    The same lattice of lines for every sphere, shifted by an irrational step from one to the
    next, so that what the lattice misses at one sphere is made up for by the others.
    """
    steps = golden_steps(4)
    shift = (np.arange(n)[:, None] * np.sqrt([2.0, 3.0, 5.0, 7.0])) % 1.0
    u = (np.arange(N_LINES)[:, None] * steps + shift[:, None, :]) % 1.0
    polar = 1.0 - 2.0 * u[..., 0]
    across = np.sqrt(np.maximum(1.0 - polar**2, 0.0))
    turn = 2.0 * np.pi * u[..., 1]
    d = np.stack([across * np.cos(turn), across * np.sin(turn), polar], axis=-1)
    # A point of the disc across the line, lifted to the sphere: a cosine law at its surface.
    e1 = np.stack([-np.sin(turn), np.cos(turn), np.zeros_like(turn)], axis=-1)
    e2 = np.cross(d, e1)
    radius, angle = np.sqrt(u[..., 2])[..., None], 2.0 * np.pi * u[..., 3][..., None]
    lift = np.sqrt(1.0 - radius**2)
    return d, radius * (np.cos(angle) * e1 + np.sin(angle) * e2) + lift * d


def _distance(origin: Array, d: Array, wall: Wall) -> Array:
    """Distance from points along directions, (..., 3) each, to a wall; inf if not ahead [m]."""
    with np.errstate(divide="ignore", invalid="ignore"):
        if isinstance(wall, Plane):
            normal = np.array(wall.normal)
            towards = d @ normal
            t = np.maximum(-((origin - np.array(wall.point)) @ normal) / towards, 0.0)
            return np.where(towards < 0.0, t, np.inf)
        if not isinstance(wall, Cylinder) or bounded(wall):
            flat = ray_distances(wall, origin.reshape(-1, 3), d.reshape(-1, 3))
            return flat.reshape(d.shape[:-1])
        axis = np.array(wall.axis)
        offset = origin - np.array(wall.point)
        u = d - (d @ axis)[..., None] * axis
        q = offset - (offset @ axis)[..., None] * axis
        a, b = (u**2).sum(axis=-1), (q * u).sum(axis=-1)
        c = (q**2).sum(axis=-1) - wall.radius**2
        t = (np.sqrt(np.maximum(b * b - a * c, 0.0)) - b) / a
        return np.where(a > 1e-24, np.maximum(t, 0.0), np.inf)
