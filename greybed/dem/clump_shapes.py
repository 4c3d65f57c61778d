"""Shapes of clumps: tetrapods, spherocylinders, and spheres fitted into a scanned surface."""

from __future__ import annotations

import heapq
import math

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from greybed.core.errors import InputError
from greybed.core.walls import Mesh
from greybed.dem.clump import Clump, sphere_union

Array = NDArray[np.float64]

# Points across the longest side of a mesh from which centres of spheres are chosen.
_ACROSS = 48
# Points on the surface, by area.
_SURFACE = 20_000


def tetrapod(diameter: float, spacing: float, *, name: str = "tetrapod") -> Clump:
    """Four spheres at the corners of a tetrahedron, joined by a skeleton without mass.

    Parameters
    ----------
    diameter : float
        Of each sphere, above 0 [m].
    spacing : float
        Between two centres, above 0 [m]; below ``diameter`` the spheres overlap.
    name : str
        For messages.
    """
    _above_zero(name, diameter=diameter, spacing=spacing)
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / math.sqrt(8.0)
    return sphere_union(spacing * corners, np.full(4, 0.5 * diameter), name=name)


def spherocylinder(
    diameter: float, length: float, *, spheres: int = 5, name: str = "spherocylinder"
) -> Clump:
    """A cylinder along z with half spheres on its ends.

    Parameters
    ----------
    diameter : float
        Above 0 [m].
    length : float
        Overall, at least ``diameter`` [m].
    spheres : int
        That stand for it, evenly spaced, at least 2 [-]. They leave grooves, whose depth is in
        ``shape_error``; mass and inertia are those of the smooth shape.
    name : str
        For messages.
    """
    _above_zero(name, diameter=diameter)
    if not (length >= diameter and math.isfinite(length)):
        raise InputError(
            f"{name}: length = {length:g} [m] must be at least the diameter {diameter:g} [m]."
        )
    if spheres < 2:
        raise InputError(f"{name}: spheres = {spheres} must be at least 2.")
    r, high = 0.5 * diameter, length - diameter
    at = np.zeros((spheres, 3))
    at[:, 2] = np.linspace(-0.5 * high, 0.5 * high, spheres)
    tube, ball = math.pi * r**2 * high, 4.0 / 3.0 * math.pi * r**3
    along = 0.5 * tube * r**2 + 0.4 * ball * r**2
    # The centre of mass of half a ball lies 3/8 r beyond the end of the tube.
    out = 0.5 * high + 0.375 * r
    across = tube * (r**2 / 4.0 + high**2 / 12.0)
    across += ball * (83.0 / 320.0 * r**2 + out**2)
    gap = high / (spheres - 1)
    groove = r - math.sqrt(max(r**2 - 0.25 * gap**2, 0.0))
    error = {"deepest_groove_over_radius": groove / r}
    return Clump(
        name, at, np.full(spheres, r), tube + ball, np.diag([across, across, along]), error
    )


def fitted_clump(
    mesh: Mesh,
    *,
    spheres: int = 20,
    bulge: float = 0.02,
    name: str = "fitted",
) -> Clump:
    """Spheres that stand for a closed surface, such as a scan of a particle.

    They are chosen one by one: always the one, among those that touch the surface from inside,
    that fills most of what is still empty.

    Parameters
    ----------
    mesh : Mesh
        Closed surface.
    spheres : int
        At most so many, at least 1 [-].
    bulge : float
        How far spheres may stand out, over the radius of the sphere of equal volume, 0 to 0.5 [-].
    name : str
        For messages.

    Returns
    -------
    Clump
        Mass and inertia are those of the surface's inside; ``shape_error`` has
        ``rms_over_radius`` and ``largest_over_radius``, distances of the surface's points to the
        nearest sphere's surface over the radius of the sphere of equal volume; and
        ``volume_ratio``, volume of the spheres' union over that of the shape.

    Raises
    ------
    InputError
        For a surface with holes, or numbers out of range.
    """
    import trimesh

    if spheres < 1 or not 0.0 <= bulge <= 0.5:
        raise InputError(
            f"{name}: spheres = {spheres} must be at least 1, and bulge = {bulge:g} in 0 ... 0.5."
        )
    solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    if not mesh.watertight:
        raise InputError(
            f"{name}: the surface has holes, so that it has no inside; close them, for instance "
            "with the repair of a mesh program."
        )
    trimesh.repair.fix_normals(solid)  # outwards, or the volume would be negative
    volume, middle = float(solid.volume), np.array(solid.center_mass)
    inertia = np.array(solid.moment_inertia)
    radius = (0.75 * volume / math.pi) ** (1.0 / 3.0)
    skin = _surface_points(solid.triangles)
    tree = cKDTree(skin)
    inside = _inside_points(solid.triangles)
    room, _ = tree.query(inside)
    x, r = _choose(inside, room + bulge * radius, spheres)
    gap = np.full(len(skin), np.inf)
    for centre, size in zip(x, r, strict=True):
        gap = np.minimum(gap, np.sqrt(((skin - centre) ** 2).sum(axis=1)) - size)
    union = sphere_union(x, r, name=name, columns=300)
    error = {
        "rms_over_radius": float(np.sqrt((gap**2).mean())) / radius,
        "largest_over_radius": float(abs(gap).max()) / radius,
        "volume_ratio": union.volume / volume,
    }
    return Clump(name, x - middle, r, volume, inertia, error)


def _above_zero(name: str, **values: float) -> None:
    for what, value in values.items():
        if not (value > 0.0 and math.isfinite(value)):
            raise InputError(f"{name}: {what} = {value:g} [m] must be finite and above 0.")


def _surface_points(triangles: Array) -> Array:
    """Points on triangles, by area; the same ones each time."""
    a, b, c = (triangles[:, k] for k in range(3))
    area = 0.5 * np.sqrt((np.cross(b - a, c - a) ** 2).sum(axis=1))
    rng = np.random.default_rng(1)
    which = np.searchsorted(
        np.cumsum(area), (np.arange(_SURFACE) + 0.5) / _SURFACE * area.sum()
    ).clip(0, len(area) - 1)
    u, v = rng.random((2, _SURFACE))
    u = np.sqrt(u)
    s, t, w = 1.0 - u, u * (1.0 - v), u * v
    points: Array = s[:, None] * a[which] + t[:, None] * b[which] + w[:, None] * c[which]
    return points


def _inside_points(triangles: Array) -> Array:
    """Points of a grid inside a closed surface: along z a column enters it and leaves it."""
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    step = float((high - low).max()) / _ACROSS
    x, y, z = (np.arange(a + 0.5 * step, b, step) for a, b in zip(low, high, strict=True))
    # Off the grid by an odd share: corners and edges of drawn shapes lie on round numbers.
    x, y = x + 0.0137 * step, y + 0.0229 * step
    inside = []
    a, b, c = (triangles[:, k] for k in range(3))
    twice = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    upright = twice == 0.0
    twice = np.where(upright, 1.0, twice)
    for at in x:
        p = at - a[:, 0]
        for beside in y:
            q = beside - a[:, 1]
            u = (p * (c[:, 1] - a[:, 1]) - q * (c[:, 0] - a[:, 0])) / twice
            v = (q * (b[:, 0] - a[:, 0]) - p * (b[:, 1] - a[:, 1])) / twice
            hit = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & ~upright
            height = a[hit, 2] + u[hit] * (b - a)[hit, 2] + v[hit] * (c - a)[hit, 2]
            below = z[np.searchsorted(np.sort(height), z) % 2 == 1]
            inside.append(
                np.stack([np.full(len(below), at), np.full(len(below), beside), below], 1)
            )
    return np.concatenate(inside)


def _choose(inside: Array, room: Array, spheres: int) -> tuple[Array, Array]:
    """Spheres that fill most, one after the other."""
    tree = cKDTree(inside)
    empty = np.ones(len(inside), dtype=bool)
    # What a sphere adds can only shrink: the best one is known when its number is up to date.
    queue = [(-(room[k] ** 3), -1, k) for k in range(len(inside))]
    heapq.heapify(queue)
    step = float(np.ptp(np.unique(inside[:, 0])) / max(len(np.unique(inside[:, 0])) - 1, 1))
    chosen: list[int] = []
    while queue and len(chosen) < spheres and empty.any():
        gain, known, k = heapq.heappop(queue)
        if known == len(chosen):
            covered = np.array(tree.query_ball_point(inside[k], room[k]), dtype=np.int64)
            if not empty[covered].any():
                break
            empty[covered] = False
            chosen.append(k)
            continue
        covered = np.array(tree.query_ball_point(inside[k], room[k]), dtype=np.int64)
        gain = -float(empty[covered].sum()) * step**3 * 3.0 / (4.0 * np.pi)
        heapq.heappush(queue, (gain, len(chosen), k))
    return inside[chosen], room[chosen]
