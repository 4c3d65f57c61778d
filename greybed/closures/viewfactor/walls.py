r"""Spheres and walls: the exact share of a wall that nothing hides, and what stands before it.

A sphere inside a convex container sees of every element of wall the factor of a point source at
its centre, because no tangent plane of the wall cuts it: seen from an element at distance l under
the angle :math:`\beta`, a sphere wholly above the horizon has the factor
:math:`r^2\cos\beta/l^2` (Howell, A Catalog of Radiation Heat Transfer Configuration Factors,
B-type), so by reciprocity

.. math:: F_{iw} = \frac{1}{4\pi r^2}\int \frac{r^2\cos\beta}{l^2}\,dA = \frac{\Omega_w}{4\pi},

the solid angle of the wall over that of the whole sphere, whatever the radius.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from greybed.closures.viewfactor import _kernels
from greybed.closures.viewfactor.markers import RIM, golden_steps
from greybed.closures.viewfactor.neighbourhood import Neighbourhood
from greybed.closures.viewfactor.patches import sphere_to_polygon
from greybed.core import Cylinder, Packing, Plane, Polygon, Wall
from greybed.core.patches import bounded, distances, ray_distances

Array = NDArray[np.float64]

# Lines along which a sphere looks for walls: with 128 of them one sphere's share of a wall is off
# by 0.02 rms, with 2048 by 0.003 and with 4096 by 0.002.
N_LINES = 4096
# Fewer lines deep in the bed, where hardly any gets out: depth in mean chords, lines.
DEEPER = ((1.5, 1024), (4.0, 256))
# Spheres whose lines are laid at once: more would only fill the memory.
BLOCK = 32
# Angles of the rule for a disc; its integrand repeats, so that equal steps converge fast.
DISC_ANGLES = 128


@dataclass(frozen=True, eq=False)
class WallMarkers:
    """Markers of (emitter, wall), shape (e, n_walls) each.

    Attributes
    ----------
    wall_share : float
        Factor with nothing in between, the wall's solid angle over 4 pi [-].
    distance_over_radius : float
        Distance of the centre from the wall over the radius [-].
    blocked_fraction : float
        Share of the lines to the wall that is blocked [-].
    solid_fraction : float
        Solid fraction of the bed [-].
    opening : (e,) float
        View of the opening [-], along the same lines.
    """

    wall_share: Array
    distance_over_radius: Array
    blocked_fraction: Array
    solid_fraction: Array
    opening: Array


def rectangle_share(low: Array, high: Array, height: Array) -> Array:
    r"""Exact factor from a sphere to a rectangle that nothing hides [-].

    Parameters
    ----------
    low, high : array, shape (..., 2)
        Edges along the rectangle's two sides, from the foot of the centre [m]; may be infinite.
    height : array, shape (...)
        Distance of the centre from the plane, at least the radius [m].

    Notes
    -----
    Each corner (a, b) adds :math:`\arctan(ab/(h\sqrt{a^2+b^2+h^2}))/4\pi`, the solid angle of the
    rectangle between foot and corner. Infinite plane: 1/2.
    """
    total = np.zeros(np.shape(height))
    for a, sign_a in ((low[..., 0], -1.0), (high[..., 0], 1.0)):
        for b, sign_b in ((low[..., 1], -1.0), (high[..., 1], 1.0)):
            total = total + sign_a * sign_b * _corner(a, b, height)
    return total / (4.0 * np.pi)


def _corner(a: Array, b: Array, h: Array) -> Array:
    """Solid angle of the rectangle from the foot to the corner (a, b), signed [sr]."""
    a, b, h = np.broadcast_arrays(a, b, h)
    # A far edge in place of an infinite one: the rest is below the last digit.
    far = 1e15 * h
    a, b = np.clip(a, -far, far), np.clip(b, -far, far)
    return np.arctan2(a * b, h * np.sqrt(a * a + b * b + h * h))


def disc_share(offset: Array, height: Array, radius: float) -> Array:
    """Exact factor from a sphere to a disc that nothing hides [-].

    Parameters
    ----------
    offset : array
        Distance of the centre from the disc's axis, below ``radius`` [m].
    height : array
        Distance of the centre from the disc's plane, at least the sphere's radius [m].
    radius : float
        Radius of the disc [m].

    Notes
    -----
    The solid angle is the integral of 1 - cos of the rim's polar angle over the azimuth. On the
    axis: (1 - 1 / sqrt(1 + (R / h)^2)) / 2.
    """
    turn = 2.0 * np.pi * (np.arange(DISC_ANGLES) + 0.5) / DISC_ANGLES
    rho, h = np.asarray(offset)[..., None], np.asarray(height)[..., None]
    rim = np.sqrt(np.maximum(radius**2 - (rho * np.sin(turn)) ** 2, 0.0)) - rho * np.cos(turn)
    return (1.0 - h / np.hypot(h, rim)).mean(axis=-1) / 2.0


def free_shares(packing: Packing, emitters: NDArray[np.int64]) -> Array | None:
    """Exact share of every wall with no sphere in between, shape (e, n_walls) [-].

    For planes at right angles to each other (boxes, floor and lid), and for a cylinder with flat
    ends. None for other containers.
    """
    walls, c = packing.walls, packing.centres[emitters]
    planes = [w for w in walls if isinstance(w, Plane)]
    cylinders = [w for w in walls if isinstance(w, Cylinder) and not bounded(w)]
    if len(planes) + len(cylinders) != len(walls) or len(cylinders) > 1:
        return None
    normals = [np.array(w.normal) for w in planes]
    for k, one in enumerate(normals):
        for other in normals[:k]:
            along = float(one @ other)
            if abs(along) > 1e-12 and along > -1.0 + 1e-12:
                return None  # oblique, or one behind the other
    height = [(c - np.array(w.point)) @ n for w, n in zip(planes, normals, strict=True)]
    shares = np.zeros((len(c), len(walls)))
    if cylinders:
        side = cylinders[0]
        axis = np.array(side.axis)
        if any(abs(abs(float(n @ axis)) - 1.0) > 1e-12 for n in normals):
            return None
        away = c - np.array(side.point)
        away -= np.outer(away @ axis, axis)
        offset = np.minimum(np.sqrt((away**2).sum(axis=1)), side.radius)
        for w, wall in enumerate(walls):
            if isinstance(wall, Plane):
                shares[:, w] = disc_share(offset, height[planes.index(wall)], side.radius)
        shares[:, walls.index(side)] = 1.0 - shares.sum(axis=1)
        return shares
    for k, wall in enumerate(planes):
        across = _across(normals[k], normals)
        low = np.full((len(c), 2), -np.inf)
        high = np.full((len(c), 2), np.inf)
        for away, normal in zip(height, normals, strict=True):
            for side_number in range(2):
                along = float(normal @ across[side_number])
                if along > 0.5:
                    low[:, side_number] = -away
                elif along < -0.5:
                    high[:, side_number] = away
        shares[:, walls.index(wall)] = rectangle_share(low, high, height[k])
    return shares


def _across(normal: Array, normals: list[Array]) -> tuple[Array, Array]:
    """Two unit vectors across a normal, along other normals where there are any."""
    others = [n for n in normals if abs(float(n @ normal)) < 0.5]
    if others:
        first = others[0]
    else:
        first = np.cross(normal, np.eye(3)[int(np.abs(normal).argmin())])
        first = first / np.sqrt(first @ first)
    return first, np.cross(normal, first)


def wall_markers(
    packing: Packing,
    hood: Neighbourhood,
    reach: float,
    solid_fraction: float,
    *,
    sparing: bool = True,
    threads: int | None = None,
) -> WallMarkers:
    """Markers of every emitter of a neighbourhood and every wall of its packing.

    Parameters
    ----------
    packing : Packing
        The bed, with its walls.
    hood : Neighbourhood
        Neighbours of the emitters, within ``reach``.
    reach : float
        Beyond it the bed is a mean field: exp(-length / mean chord) [m].
    solid_fraction : float
        Solid fraction inside the bed [-].
    sparing : bool
        Fewer lines deep in the bed, which is right on the mean; training takes them all, for a
        marker with noise pulls what is learnt towards the mean.
    threads : int, optional
        Threads; all available ones by default. Does not change the result.
    """
    from concurrent.futures import ThreadPoolExecutor

    from greybed.core.processors import available_threads

    who, n_walls = hood.emitters, packing.n_walls
    lines = np.zeros((len(who), n_walls + 1))
    seen = np.zeros((len(who), n_walls + 1))
    hidden = np.zeros((len(who), n_walls), bool)  # a wall behind another one
    r = packing.radii
    chord = 4.0 * (1.0 - solid_fraction) * (r**3).sum() / (r**2).sum() / (3.0 * solid_fraction)
    low = (packing.centres - r[:, None]).min(axis=0)
    high = (packing.centres + r[:, None]).max(axis=0)
    near_radii = r[hood.sphere]

    distance = np.zeros((len(who), n_walls))
    for w, wall in enumerate(packing.walls):
        distance[:, w] = wall_distance(packing, wall, who)
    lines_of = np.full(len(who), N_LINES)
    if sparing:
        lines_of = _lines_of(packing, who, distance, low, high, chord)
    blocks = [
        (part, int(n))
        for n in np.unique(lines_of)
        for part in np.array_split(
            np.flatnonzero(lines_of == n),
            -(-int((lines_of == n).sum()) * int(n) // (BLOCK * N_LINES)),
        )
    ]

    def some(job: tuple[NDArray[np.int64], int]) -> None:
        block, n_lines = job
        index = who[block]
        directions, offsets = leaving_lines(index, n_lines)
        offsets *= r[index][:, None, None]
        origin = packing.centres[index][:, None, :] + offsets
        length = np.full(directions.shape[:2], np.inf)
        hit = np.full(directions.shape[:2], n_walls)
        met = np.zeros((*directions.shape[:2], n_walls), bool)
        for w, wall in enumerate(packing.walls):
            t = distance_to_wall(origin, directions, wall)
            if bounded(wall):
                # As behind a plane: what starts beyond the wall has met it.
                middle = np.broadcast_to(packing.centres[index][:, None, :], offsets.shape)
                out = distance_to_wall(middle, offsets / r[index][:, None, None], wall)
                t[out < r[index][:, None]] = 0.0
            met[..., w] = np.isfinite(t)
            nearer = t < length
            length, hit = np.where(nearer, t, length), np.where(nearer, w, hit)
        met &= (hit[..., None] != np.arange(n_walls)) & (length[..., None] > 0.0)
        hidden[block] = met.any(axis=1)
        through = np.empty(directions.shape[:2])
        _kernels.free_lines(
            index, hood.vector, near_radii, hood.start[block], hood.start[block + 1], directions,
            offsets, length, RIM, through,
        )  # fmt: skip
        # Beyond reach the bed is a mean field; beyond the spheres' own extent the way is free.
        with np.errstate(divide="ignore", invalid="ignore"):
            out = np.where(
                directions > 0.0, (high - origin) / directions, (low - origin) / directions
            )
        out = np.where(packing.periodic, np.inf, np.nan_to_num(out, nan=np.inf)).min(axis=2)
        through *= np.exp(-np.maximum(np.minimum(length, out) - reach, 0.0) / chord)
        np.add.at(lines, (block[:, None], hit), 1.0 / n_lines)
        np.add.at(seen, (block[:, None], hit), through / n_lines)

    # Each block fills its own rows: the threads change no bit.
    with ThreadPoolExecutor(threads or available_threads()) as pool:
        list(pool.map(some, blocks))
    exact = free_shares(packing, who)
    share = lines[:, :n_walls].copy() if exact is None else exact
    for w, wall in enumerate(packing.walls):
        if exact is None and isinstance(wall, Polygon):
            alone = sphere_to_polygon(packing.centres[who], wall.vertices)
            share[:, w] = np.where(hidden[:, w], share[:, w], alone)
    with np.errstate(divide="ignore", invalid="ignore"):
        free = np.where(lines > 0.0, seen / lines, 1.0)
    rest = np.clip(1.0 - share.sum(axis=1), 0.0, 1.0)
    return WallMarkers(
        np.clip(share, 0.0, 1.0),
        distance / r[who][:, None],
        np.clip(1.0 - free[:, :n_walls], 0.0, 1.0),
        np.full((len(who), n_walls), solid_fraction),
        rest * free[:, n_walls],
    )


def wall_distance(packing: Packing, wall: Wall, emitters: NDArray[np.int64]) -> Array:
    """Distance of centres from a wall, at least their radius, shape (e,) [m]."""
    if isinstance(wall, Plane):
        height = (packing.centres[emitters] - np.array(wall.point)) @ np.array(wall.normal)
    elif isinstance(wall, Cylinder) and not bounded(wall):
        away, axis = packing.centres[emitters] - np.array(wall.point), np.array(wall.axis)
        height = wall.radius - np.sqrt(((away - np.outer(away @ axis, axis)) ** 2).sum(axis=1))
    else:
        height = distances([wall], packing.centres[emitters])
    return np.maximum(height, packing.radii[emitters])


def _lines_of(
    packing: Packing, who: NDArray[np.int64], walls: Array, low: Array, high: Array, chord: float
) -> NDArray[np.int64]:
    """Lines for each emitter: fewer, the deeper it lies below walls and open faces."""
    centres = packing.centres[who]
    faces = np.minimum(centres - low, high - centres)
    faces = np.where(packing.periodic, np.inf, faces).min(axis=1)
    depth = np.minimum(walls.min(axis=1, initial=np.inf), faces) - packing.radii[who]
    lines = np.full(len(who), N_LINES)
    for chords, fewer in DEEPER:
        lines[depth > chords * chord] = min(fewer, N_LINES)
    return lines


def leaving_lines(spheres: NDArray[np.int64], n_lines: int) -> tuple[Array, Array]:
    """Directions and starting points (n, n_lines, 3) of lines that leave unit spheres evenly.

    The same lattice of lines for every sphere, shifted by an irrational step from one to the
    next, so that what the lattice misses at one sphere is made up for by the others.
    """
    steps = golden_steps(3)
    shift = (spheres[:, None] * np.sqrt([2.0, 3.0, 5.0, 7.0])) % 1.0
    k = np.arange(n_lines)[:, None]
    lattice = np.concatenate([(k + 0.5) / n_lines, (k + 0.5) * steps % 1.0], axis=1)
    u = (lattice + shift[:, None, :]) % 1.0
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


def distance_to_wall(origin: Array, d: Array, wall: Wall) -> Array:
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
