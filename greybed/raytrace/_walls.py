"""Compiled walls: which wall a ray meets first, and whether a point lies behind one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit

from greybed.core.walls import Cylinder, Plane, Wall

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}


class Walls(NamedTuple):
    """Tables of walls, one row each; ``*_number`` says which wall of the packing a row is."""

    total: int  # walls of the packing [-]
    planes: np.ndarray  # (p, 6): point [m], normal
    plane_number: np.ndarray  # (p,) int64
    cylinders: np.ndarray  # (c, 7): point [m], axis, radius [m]
    cylinder_number: np.ndarray  # (c,) int64


def tables(walls: Sequence[Wall]) -> Walls:
    """The tables of these walls."""
    planes = [(k, w) for k, w in enumerate(walls) if isinstance(w, Plane)]
    cylinders = [(k, w) for k, w in enumerate(walls) if isinstance(w, Cylinder)]
    return Walls(
        len(walls),
        np.array([w.point + w.normal for _, w in planes]).reshape(-1, 6),
        np.array([k for k, _ in planes], dtype=np.int64),
        np.array([(*w.point, *w.axis, w.radius) for _, w in cylinders]).reshape(-1, 7),
        np.array([k for k, _ in cylinders], dtype=np.int64),
    )


@njit(**_OPTIONS)
def wall_hit(ox, oy, oz, dx, dy, dz, walls):
    """Nearest wall ahead: distance (inf where none) and its number in the packing (-1)."""
    nearest, wall = np.inf, -1
    planes, cylinders = walls.planes, walls.cylinders
    for k in range(planes.shape[0]):
        towards = dx * planes[k, 3] + dy * planes[k, 4] + dz * planes[k, 5]
        if towards < 0.0:
            height = (
                (ox - planes[k, 0]) * planes[k, 3]
                + (oy - planes[k, 1]) * planes[k, 4]
                + (oz - planes[k, 2]) * planes[k, 5]
            )
            t = -height / towards
            if t < nearest:
                nearest, wall = t, walls.plane_number[k]
    for k in range(cylinders.shape[0]):
        ax, ay, az = cylinders[k, 3], cylinders[k, 4], cylinders[k, 5]
        rx, ry, rz = ox - cylinders[k, 0], oy - cylinders[k, 1], oz - cylinders[k, 2]
        along_d = dx * ax + dy * ay + dz * az
        along_r = rx * ax + ry * ay + rz * az
        ux, uy, uz = dx - along_d * ax, dy - along_d * ay, dz - along_d * az
        qx, qy, qz = rx - along_r * ax, ry - along_r * ay, rz - along_r * az
        a = ux * ux + uy * uy + uz * uz
        if a > 0.0:
            b = qx * ux + qy * uy + qz * uz
            c = qx * qx + qy * qy + qz * qz - cylinders[k, 6] ** 2
            root = b * b - a * c
            if root > 0.0:
                t = (math.sqrt(root) - b) / a
                if t < nearest:
                    nearest, wall = t, walls.cylinder_number[k]
    return nearest, wall


@njit(**_OPTIONS)
def walls_ahead(m, pending, rays, centre, walls, bound, wall):
    """Nearest wall of ``m`` rays, where it is nearer than their ``bound`` [m], which it lowers.

    ``rays`` (6, n) holds directions and starts relative to ``centre`` [m].
    """
    for q in range(m):
        k = pending[q]
        t, number = wall_hit(
            centre[0] + rays[3, k], centre[1] + rays[4, k], centre[2] + rays[5, k],
            rays[0, k], rays[1, k], rays[2, k], walls,
        )  # fmt: skip
        if t <= bound[q]:
            bound[q], wall[q] = t, number


@njit(**_OPTIONS)
def behind(x, y, z, walls):
    """Whether a point lies behind a wall, that is not on the bed's side of it."""
    planes, cylinders = walls.planes, walls.cylinders
    for k in range(planes.shape[0]):
        height = (
            (x - planes[k, 0]) * planes[k, 3]
            + (y - planes[k, 1]) * planes[k, 4]
            + (z - planes[k, 2]) * planes[k, 5]
        )
        if height < 0.0:
            return True
    for k in range(cylinders.shape[0]):
        qx, qy, qz = x - cylinders[k, 0], y - cylinders[k, 1], z - cylinders[k, 2]
        along = qx * cylinders[k, 3] + qy * cylinders[k, 4] + qz * cylinders[k, 5]
        if qx * qx + qy * qy + qz * qz - along * along > cylinders[k, 6] ** 2:
            return True
    return False
