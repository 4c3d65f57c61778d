"""Walls of straight edges: polygons, triangle meshes, and boxes of six polygons."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.core.errors import InputError
from greybed.core.vectors import Vector, vector

Array = NDArray[np.float64]

# Corners may stand this far off their plane, over the size of the polygon: files carry six digits.
PLANAR = 1e-5
# A triangle of less area than this times the square of its longest edge is a line.
DEGENERATE = 1e-14
# Corners beyond are an error of the file; fourth powers of much more would overflow [m].
FARTHEST = 1e9


@dataclass(frozen=True)
class Polygon:
    """Flat polygon, met from both sides; it radiates to the side of its right-hand normal.

    Parameters
    ----------
    vertices : sequence of three or more vectors
        Corners in order, counter-clockwise as seen from the bed; convex or not, not crossing
        itself [m].
    name : str
        Name of the patch in results and reports.

    Raises
    ------
    InputError
        For fewer than three corners, corners off their plane by more than 1e-5 of the size, no
        area, or edges that cross.
    """

    vertices: tuple[Vector, ...]
    name: str = "polygon"

    def __post_init__(self) -> None:
        what = f"wall {self.name!r}"
        try:
            corners = tuple(
                vector(v, f"{what}: corner {k} [m]") for k, v in enumerate(self.vertices)
            )
        except TypeError:
            raise InputError(f"{what}: vertices is not a list of corners; give three.") from None
        if len(corners) < 3:
            raise InputError(f"{what}: {len(corners)} corners are no polygon; give at least three.")
        object.__setattr__(self, "vertices", corners)
        points = np.array(corners)
        size = float(np.ptp(points, axis=0).max())
        double = np.linalg.norm(self._double_area)
        if not double > DEGENERATE * size**2:
            raise InputError(f"{what}: its corners enclose no area; mend or remove the polygon.")
        off = float(np.abs((points - points.mean(axis=0)) @ np.array(self.normal)).max())
        if off > PLANAR * size:
            raise InputError(
                f"{what}: its corners stand up to {off:g} [m] off a plane, more than {PLANAR:g} of "
                "its size; split it into triangles or give a mesh."
            )
        object.__setattr__(self, "_triangles", cut(points, np.array(self.normal), what))

    @property
    def _double_area(self) -> Array:
        return newell(np.array(self.vertices))

    @property
    def normal(self) -> Vector:
        """Right-hand unit normal [-]."""
        double = self._double_area
        x, y, z = (double / np.linalg.norm(double)).tolist()
        return x, y, z

    @property
    def area(self) -> float:
        """Surface of one side [m2]."""
        return 0.5 * float(np.linalg.norm(self._double_area))

    @property
    def triangles(self) -> Array:
        """Corners of triangles that make up the polygon, shape (k - 2 at most, 3, 3) [m]."""
        return np.array(self.vertices)[getattr(self, "_triangles")]  # noqa: B009


def newell(points: Array) -> Array:
    """Vector along the right-hand normal of a polygon (k, 3), of twice its area [m2]."""
    points = points - points[0]
    return np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0)


def cut(points: Array, normal: Array, what: str) -> NDArray[np.int64]:
    """Triangles of a polygon, as seen along its normal, by cutting off ears.

    Parameters
    ----------
    points : array, shape (k, 3)
        Corners in order [m].
    normal : array, shape (3,)
        Right-hand unit normal [-].
    what : str
        Its name in messages.

    Returns
    -------
    triangles : array of int, shape (m, 3)
        Numbers of corners; fewer than k - 2 where corners lie on straight edges.

    Raises
    ------
    InputError
        If edges cross or touch.
    """
    first = np.eye(3)[int(np.abs(normal).argmin())]
    u = np.cross(normal, first)
    u /= np.linalg.norm(u)
    flat = (points - points[0]) @ np.stack([u, np.cross(normal, u)], axis=1)
    # Python's numbers: corners are few, and single elements of arrays are slow.
    xy = [(float(a), float(b)) for a, b in flat]
    tiny = DEGENERATE * float(np.ptp(flat, axis=0).max()) ** 2

    def side(a: int, b: int, c: int) -> float:
        (ax, ay), (bx, by), (cx, cy) = xy[a], xy[b], xy[c]
        return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)

    n = len(xy)
    for i in range(n):
        for j in range(i + 2, n - (i == 0)):
            a, b, c, d = i, i + 1, j, (j + 1) % n
            if side(a, b, c) * side(a, b, d) < -(tiny**2) and (
                side(c, d, a) * side(c, d, b) < -(tiny**2)
            ):
                raise InputError(f"{what}: edges {i} and {j} cross; put its corners in order.")
    left, triangles = list(range(n)), []
    while len(left) > 2:
        for k in range(len(left)):
            a, b, c = left[k - 1], left[k], left[(k + 1) % len(left)]
            turn = side(a, b, c)
            if turn < -tiny:
                continue
            inside = any(
                side(a, b, p) >= -tiny and side(b, c, p) >= -tiny and side(c, a, p) >= -tiny
                for p in left
                if xy[p] not in (xy[a], xy[b], xy[c])
            )
            if turn <= tiny or not inside:  # a corner on a straight edge goes without a triangle
                break
        else:
            raise InputError(f"{what}: its edges touch or cross; put its corners in order.")
        if turn > tiny:
            triangles.append((a, b, c))
        del left[k]
    return np.array(triangles, dtype=np.int64)


@dataclass(frozen=True, eq=False, repr=False)
class Mesh:
    """Triangle mesh, met from both sides; it radiates to the side of its right-hand normals.

    Corners in the same place become one, triangles without area go; both change no ray.

    Parameters
    ----------
    vertices : array_like, shape (n, 3)
        Corners [m].
    faces : array_like of int, shape (m, 3)
        Numbers of the corners of every triangle, counter-clockwise as seen from the bed.
    name : str
        Name of the patch in results and reports.

    Attributes
    ----------
    dropped : int
        Triangles left out because they had no area [-].
    watertight : bool
        Whether every edge belongs to exactly two triangles.
    winding_consistent : bool
        Whether neighbours run through their common edge in opposite directions, so that all
        normals point to the same side.

    Raises
    ------
    InputError
        For wrong shapes, corners that are not finite or do not exist, or no area at all.
    """

    vertices: Array
    faces: NDArray[np.int64]
    name: str
    dropped: int
    watertight: bool
    winding_consistent: bool

    def __init__(self, vertices: ArrayLike, faces: ArrayLike, name: str = "mesh") -> None:
        what = f"wall {name!r}"
        try:
            points = np.array(vertices, dtype=np.float64)
            index = np.array(faces)
        except (TypeError, ValueError):
            raise InputError(f"{what}: vertices and faces must be arrays of numbers.") from None
        if index.size == 0 or points.size == 0:
            raise InputError(f"{what}: the mesh is empty; give at least one triangle.")
        if points.ndim != 2 or points.shape[1] != 3 or index.ndim != 2 or index.shape[1] != 3:
            raise InputError(
                f"{what}: vertices {points.shape} and faces {index.shape} must be (n, 3), (m, 3)."
            )
        if index.dtype.kind not in "iu" or index.min() < 0 or index.max() >= len(points):
            raise InputError(f"{what}: faces must be corner numbers 0 to {len(points) - 1}.")
        if not np.isfinite(points).all():
            bad = int((~np.isfinite(points)).any(axis=1).argmax())
            raise InputError(f"{what}: corner {bad} is not finite; mend or remove its triangles.")
        if np.abs(points).max() > FARTHEST:
            bad = int((np.abs(points) > FARTHEST).any(axis=1).argmax())
            raise InputError(
                f"{what}: corner {bad} is farther than {FARTHEST:g} m from the origin; mend it, or "
                "state the unit of the file."
            )
        # Adding zero turns -0.0 into 0.0: corners are told apart by their bytes.
        points, place = np.unique(points + 0.0, axis=0, return_inverse=True)
        index = place.reshape(-1)[index.astype(np.int64)]
        a, b, c = index.T
        proper = index[(a != b) & (b != c) & (c != a)]
        corner = points[proper]
        edges = np.roll(corner, -1, axis=1) - corner
        double = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
        solid = 0.5 * double > DEGENERATE * (edges**2).sum(axis=2).max(axis=1, initial=0.0)
        if not solid.any():
            raise InputError(f"{what}: the mesh has no area; mend the file or remove the wall.")
        tight, consistent = _seams(proper, len(points))
        used, numbers = np.unique(proper[solid], return_inverse=True)
        kept_points, kept_faces = points[used], numbers.reshape(-1, 3).astype(np.int64)
        for array in (kept_points, kept_faces):
            array.setflags(write=False)
        object.__setattr__(self, "vertices", kept_points)
        object.__setattr__(self, "faces", kept_faces)
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "dropped", len(index) - int(solid.sum()))
        object.__setattr__(self, "watertight", tight)
        object.__setattr__(self, "winding_consistent", consistent)

    @property
    def triangles(self) -> Array:
        """Corners of the triangles, shape (m, 3, 3) [m]."""
        return self.vertices[self.faces]

    @cached_property
    def area(self) -> float:
        """Surface of one side [m2]."""
        t = self.triangles
        cross = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
        return 0.5 * float(np.linalg.norm(cross, axis=1).sum())

    @property
    def volume(self) -> float:
        """Enclosed volume, above zero where normals point outwards [m3]; for watertight meshes."""
        t = self.triangles - self.vertices[0]
        return float((t[:, 0] * np.cross(t[:, 1], t[:, 2])).sum()) / 6.0

    def flipped(self) -> Mesh:
        """The same mesh with its normals on the other side."""
        return Mesh(self.vertices, self.faces[:, ::-1], self.name)

    @cached_property
    def digest(self) -> str:
        """SHA-256 of corners and faces, not of the name."""
        digest = hashlib.sha256(np.ascontiguousarray(self.vertices, dtype="<f8").tobytes())
        digest.update(np.ascontiguousarray(self.faces, dtype="<i8").tobytes())
        return digest.hexdigest()

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Mesh):
            return NotImplemented
        return (self.name, self.digest) == (other.name, other.digest)

    def __hash__(self) -> int:
        return hash((self.name, self.digest))

    def __repr__(self) -> str:
        return f"Mesh({len(self.faces)} triangles, {self.name!r}, {self.digest[:16]})"


def _seams(faces: NDArray[np.int64], n: int) -> tuple[bool, bool]:
    """Whether every edge has exactly two triangles, and whether they pass it in opposite ways."""
    tail, head = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    _, times = np.unique(np.minimum(tail, head) * n + np.maximum(tail, head), return_counts=True)
    _, same_way = np.unique(tail * n + head, return_counts=True)
    return bool((times == 2).all()), bool((same_way == 1).all())


def box_walls(low: object, high: object, name: str = "box") -> tuple[Polygon, ...]:
    """Six polygons around a box, their normals inwards.

    Parameters
    ----------
    low, high : three floats
        Lower and upper corner [m].
    name : str
        Beginning of the names ``{name}_x_low``, ``{name}_x_high``, ``{name}_y_low``, ...

    Raises
    ------
    InputError
        Where an upper bound does not exceed its lower bound.
    """
    bounds = np.array([vector(low, f"{name}: low [m]"), vector(high, f"{name}: high [m]")])
    if not (bounds[1] > bounds[0]).all():
        raise InputError(
            f"{name}: from {bounds[0].tolist()} to {bounds[1].tolist()} [m] is empty; each upper "
            "bound must exceed its lower bound."
        )
    walls = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for end, word in enumerate(("low", "high")):
            turns = [(0, 0), (1, 0), (1, 1), (0, 1)]
            corners = []
            for a, b in turns if end == 0 else turns[::-1]:
                corner = [0.0, 0.0, 0.0]
                corner[axis], corner[u], corner[v] = bounds[end, axis], bounds[a, u], bounds[b, v]
                corners.append((float(corner[0]), float(corner[1]), float(corner[2])))
            walls.append(Polygon(tuple(corners), f"{name}_{'xyz'[axis]}_{word}"))
    return tuple(walls)
