"""Bounded walls in tables for compiled code: first hits of rays, distances of points."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from greybed.core import _kernels
from greybed.core.walls import Cone, Cylinder, Disc, Mesh, Polygon, Wall

Array = NDArray[np.float64]


class Patches(NamedTuple):
    """Bounded walls, one row each; ``*_number`` says which wall of the packing a row is."""

    discs: Array  # (d, 7): point [m], normal, radius [m]
    disc_number: NDArray[np.int64]  # (d,)
    cones: Array  # (c, 9): point [m], axis, radius, end radius, length [m]; tubes as well
    cone_number: NDArray[np.int64]  # (c,)
    corners: Array  # (m, 9): triangles of polygons and meshes, in the order of the tree [m]
    triangle_number: NDArray[np.int64]  # (m,)
    boxes: Array  # (nodes, 6): lower and upper corner [m]
    links: NDArray[np.int64]  # (nodes, 3): see greybed.core._kernels.build_tree


def bounded(wall: Wall) -> bool:
    """Whether a wall ends somewhere."""
    return math.isfinite(wall.area)


def tables(walls: Sequence[Wall]) -> Patches:
    """The tables of the bounded ones among these walls; the others are left out."""
    discs: list[tuple[float, ...]] = []
    cones: list[tuple[float, ...]] = []
    numbers: tuple[list[int], list[int]] = ([], [])
    triangles, owners = [np.empty((0, 3, 3))], [np.empty(0, np.int64)]
    for k, wall in enumerate(walls):
        if isinstance(wall, Disc):
            discs.append((*wall.point, *wall.normal, wall.radius))
            numbers[0].append(k)
        elif isinstance(wall, Cone):
            cones.append((*wall.point, *wall.axis, wall.radius, wall.end_radius, wall.length))
            numbers[1].append(k)
        elif isinstance(wall, Cylinder) and wall.length is not None:
            cones.append((*wall.point, *wall.axis, wall.radius, wall.radius, wall.length))
            numbers[1].append(k)
        elif isinstance(wall, Polygon | Mesh):
            triangles.append(wall.triangles)
            owners.append(np.full(len(triangles[-1]), k, dtype=np.int64))
    corners = np.concatenate(triangles).reshape(-1, 9)
    order = np.empty(len(corners), np.int64)
    room = max(2 * len(corners), 1)
    boxes, links = np.empty((room, 6)), np.empty((room, 3), np.int64)
    nodes = _kernels.build_tree(corners, order, boxes, links) if len(corners) else 0
    return Patches(
        np.array(discs, dtype=np.float64).reshape(-1, 7),
        np.array(numbers[0], dtype=np.int64),
        np.array(cones, dtype=np.float64).reshape(-1, 9),
        np.array(numbers[1], dtype=np.int64),
        corners[order],
        np.concatenate(owners)[order],
        boxes[:nodes].copy(),
        links[:nodes].copy(),
    )


def distances(walls: Sequence[Wall], points: Array) -> Array:
    """Distance of points to the nearest of the bounded walls, from either side.

    Parameters
    ----------
    walls : sequence of walls
        Unbounded ones are left out.
    points : array, shape (n, 3)
        Places [m].

    Returns
    -------
    distance : array, shape (n,)
        Infinite where no wall is bounded [m].
    """
    distance = np.empty(len(points))
    # Writable, for read-only points would have the kernel compiled once more.
    points = np.require(points, np.float64, ["C", "W"])
    _kernels.patch_distances(points, tables(walls), distance)
    return distance


def ray_distances(wall: Wall, origins: Array, directions: Array) -> Array:
    """Distance along rays to one bounded wall, (m, 3) each; infinite where they miss it [m]."""
    distance = np.empty(len(origins))
    _kernels.patch_hits(
        np.ascontiguousarray(origins), np.ascontiguousarray(directions), tables([wall]), distance
    )
    return distance
