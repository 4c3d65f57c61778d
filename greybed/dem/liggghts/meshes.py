"""Triangles of walls for LIGGGHTS: shapes cut into facets, cut at periodic faces, as STL text."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.core.walls import Cone, Cylinder, Disc, Mesh, Plane, Polygon, Wall

Array = NDArray[np.float64]

# Depth of an arc over a facet, in the smallest radius of a particle.
_DEPTH = 0.01
_FEWEST, _MOST = 24, 360


def facets(radius: float, smallest: float) -> int:
    """Number of flat facets of a circle that small spheres do not feel."""
    share = min(_DEPTH * smallest / radius, 0.5)
    return min(_MOST, max(_FEWEST, math.ceil(math.pi / math.acos(1.0 - share))))


def triangles(shape: Wall, box: Array, smallest: float) -> Array:
    """Triangles of a wall, shape (m, 3, 3).

    Parameters
    ----------
    shape : Wall
        Any wall; a plane and an endless cylinder are cut off at the box.
    box : ndarray, shape (2, 3)
        Lower and upper corner [m].
    smallest : float
        Radius of the smallest particle, for the number of facets [m].
    """
    if isinstance(shape, Plane):
        return _fan(_cut_plane(np.array(shape.point), np.array(shape.normal), box))
    if isinstance(shape, Polygon | Mesh):
        return np.array(shape.triangles, dtype=np.float64).reshape(-1, 3, 3)
    if isinstance(shape, Disc):
        ring = _ring(shape.point, shape.normal, shape.radius, facets(shape.radius, smallest))
        return _fan(ring)
    assert isinstance(shape, Cylinder | Cone)
    axis, point = np.array(shape.axis), np.array(shape.point)
    if shape.length is None:
        along = (_corners(box) - point) @ axis
        point, length = point + along.min() * axis, float(np.ptp(along))
    else:
        length = shape.length
    first = shape.radius
    last = shape.end_radius if isinstance(shape, Cone) else shape.radius
    count = facets(max(first, last), smallest)
    # Rings so far apart that triangles are not much longer than wide.
    slant = math.hypot(length, last - first)
    rings = max(1, min(100, round(slant / (20.0 * math.pi * max(first, last) / count))))
    share = np.linspace(0.0, 1.0, rings + 1)
    loops = [
        _ring(point + s * length * axis, axis, (1.0 - s) * first + s * last, count) for s in share
    ]
    parts = []
    for low, high in itertools.pairwise(loops):
        after_low, after_high = np.roll(low, -1, axis=0), np.roll(high, -1, axis=0)
        parts += [np.stack([low, after_low, after_high], 1), np.stack([low, after_high, high], 1)]
    found = np.concatenate(parts)
    # The tip of a cone has no area in one of each two.
    return found[_areas(found) > 1e-12 * max(first, last) ** 2]


def cut(found: Array, box: ArrayLike, axes: tuple[bool, bool, bool]) -> Array:
    """The part of triangles that lies in a box along some axes, shape (m, 3, 3)."""
    low, high = np.asarray(box, dtype=np.float64)
    for axis in np.flatnonzero(axes):
        parts = []
        for triangle in found:
            polygon = _half(triangle, triangle[:, axis] - low[axis])
            polygon = _half(polygon, high[axis] - polygon[:, axis])
            if len(polygon) >= 3:
                parts.append(_fan(polygon))
        found = np.concatenate(parts) if parts else np.empty((0, 3, 3))
    return found[_areas(found) > 0.0]


def stl(found: Array, name: str) -> str:
    """Triangles as an STL text with all digits."""
    normal = np.cross(found[:, 1] - found[:, 0], found[:, 2] - found[:, 0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    lines = [f"solid {name}"]
    for n, triangle in zip(normal.tolist(), found.tolist(), strict=True):
        lines += ["facet normal " + " ".join(map(repr, n)), "outer loop"]
        lines += ["vertex " + " ".join(map(repr, corner)) for corner in triangle]
        lines += ["endloop", "endfacet"]
    return "\n".join([*lines, f"endsolid {name}"]) + "\n"


def _half(polygon: Array, side: Array) -> Array:
    """The part of a polygon where ``side`` of its corners is at least 0 (Sutherland & Hodgman)."""
    kept = []
    for k in range(len(polygon)):
        here, there, a, b = polygon[k - 1], polygon[k], side[k - 1], side[k]
        if (a < 0.0) != (b < 0.0):
            kept.append(here + a / (a - b) * (there - here))
        if b >= 0.0:
            kept.append(there)
    return np.array(kept).reshape(-1, 3)


def _cut_plane(point: Array, normal: Array, box: Array) -> Array:
    """The polygon that a box cuts out of a plane."""
    middle = box.mean(axis=0)
    point = middle - ((middle - point) @ normal) * normal
    u, v = _across(normal)
    reach = float(np.linalg.norm(box[1] - box[0]))
    square = [point + reach * (a * u + b * v) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    polygon = np.array(square)
    for axis in range(3):
        polygon = _half(polygon, polygon[:, axis] - box[0, axis])
        polygon = _half(polygon, box[1, axis] - polygon[:, axis])
    return polygon


def _fan(polygon: Array) -> Array:
    """A convex polygon as triangles that share its middle; four corners as two."""
    n = len(polygon)
    if n < 3:
        return np.empty((0, 3, 3))
    if n <= 4:
        return np.array([[polygon[0], polygon[k], polygon[k + 1]] for k in range(1, n - 1)])
    middle = polygon.mean(axis=0)
    return np.array([[middle, polygon[k - 1], polygon[k]] for k in range(n)])


def _ring(point: ArrayLike, axis: ArrayLike, radius: float, count: int) -> Array:
    """Corners of a polygon with the area of a circle, shape (count, 3)."""
    turn = 2.0 * math.pi / count
    size = radius * math.sqrt(turn / math.sin(turn))
    u, v = _across(np.asarray(axis))
    angle = turn * np.arange(count)
    return np.asarray(point) + size * (np.outer(np.cos(angle), u) + np.outer(np.sin(angle), v))


def _across(axis: Array) -> tuple[Array, Array]:
    """Two directions that make a right-handed frame with an axis."""
    other = np.eye(3)[int(np.abs(axis).argmin())]
    u = np.cross(axis, other)
    u /= np.linalg.norm(u)
    return u, np.cross(axis, u) / np.linalg.norm(axis)


def _areas(found: Array) -> Array:
    sides = np.cross(found[:, 1] - found[:, 0], found[:, 2] - found[:, 0])
    return 0.5 * np.linalg.norm(sides, axis=1)


def _corners(box: Array) -> Array:
    return np.array(list(itertools.product(*box.T)))
