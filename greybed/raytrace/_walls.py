"""Compiled walls: which wall a ray meets first, what lies behind one, how far they are."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from greybed.core import patches as bounded
from greybed.core._kernels import patch_hit, triangle_hit
from greybed.core.jit import njit
from greybed.core.walls import Cylinder, Plane, Wall

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}


class Walls(NamedTuple):
    """Tables of walls, one row each; ``*_number`` says which wall of the packing a row is."""

    total: int  # walls of the packing [-]
    planes: np.ndarray  # (p, 6): point [m], normal
    plane_number: np.ndarray  # (p,) int64
    cylinders: np.ndarray  # (c, 7): point [m], axis, radius [m]
    cylinder_number: np.ndarray  # (c,) int64
    patches: bounded.Patches  # the bounded walls


def tables(walls: Sequence[Wall]) -> Walls:
    """The tables of these walls."""
    planes = [(k, w) for k, w in enumerate(walls) if isinstance(w, Plane)]
    cylinders = [
        (k, w) for k, w in enumerate(walls) if isinstance(w, Cylinder) and w.length is None
    ]
    return Walls(
        len(walls),
        np.array([w.point + w.normal for _, w in planes]).reshape(-1, 6),
        np.array([k for k, _ in planes], dtype=np.int64),
        np.array([(*w.point, *w.axis, w.radius) for _, w in cylinders]).reshape(-1, 7),
        np.array([k for k, _ in cylinders], dtype=np.int64),
        bounded.tables(walls),
    )


def clearance(walls: Sequence[Wall], centres: np.ndarray) -> np.ndarray:
    """Distance from each of (n, 3) centres to the nearest wall, shape (n,) [m].

    Exact. Below zero behind an unbounded wall; infinite without walls.
    """
    free = bounded.distances(walls, centres)
    for wall in walls:
        if isinstance(wall, Plane):
            room = (centres - np.array(wall.point)) @ np.array(wall.normal)
        elif isinstance(wall, Cylinder) and wall.length is None:
            offset, axis = centres - np.array(wall.point), np.array(wall.axis)
            room = wall.radius - np.linalg.norm(offset - np.outer(offset @ axis, axis), axis=1)
        else:
            continue
        free = np.minimum(free, room)
    return free


@njit(**_OPTIONS)
def wall_hit_within(ox, oy, oz, dx, dy, dz, limit, walls):
    """Nearest wall ahead and nearer than ``limit``: distance (``limit``: none) and number (-1)."""
    nearest, wall = limit, -1
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
    patches = walls.patches
    # Without the call where there are none: its arrays are reference-counted at every ray.
    if patches.disc_number.size + patches.cone_number.size + patches.triangle_number.size > 0:
        nearest, number = patch_hit(ox, oy, oz, dx, dy, dz, nearest, patches)
        if number >= 0:
            wall = number
    return nearest, wall


@njit(**_OPTIONS)
def wall_hit(ox, oy, oz, dx, dy, dz, walls):
    """Nearest wall ahead: distance (inf where none) and its number in the packing (-1)."""
    return wall_hit_within(ox, oy, oz, dx, dy, dz, np.inf, walls)


@njit(**_OPTIONS)
def walls_ahead(m, rays, centre, walls, bound, wall):
    """Nearest wall of ``m`` rays, where it is nearer than their ``bound`` [m], which it lowers.

    ``rays`` (6, n) holds directions and starts relative to ``centre`` [m].
    """
    for q in range(m):
        t, number = wall_hit_within(
            centre[0] + rays[3, q], centre[1] + rays[4, q], centre[2] + rays[5, q],
            rays[0, q], rays[1, q], rays[2, q], bound[q], walls,
        )  # fmt: skip
        if number >= 0:
            bound[q], wall[q] = t, number


@njit(**_OPTIONS)
def behind(x, y, z, walls):
    """Whether a point lies behind an unbounded wall, that is not on the bed's side of it."""
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


@njit(**_OPTIONS)
def crosses(cx, cy, cz, x, y, z, walls):
    """Whether a bounded wall stands between a sphere's centre and a point of its surface.

    Bounded walls have no back side; so this, and not a half space, says which surface they hide.
    """
    dx, dy, dz = x - cx, y - cy, z - cz
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    _, number = patch_hit(cx, cy, cz, dx / length, dy / length, dz / length, length, walls.patches)
    return number >= 0


@njit(**_OPTIONS)
def patch_normal(ox, oy, oz, dx, dy, dz, t, wall, patches):
    """Normal of a bounded wall where a ray meets it after ``t`` [m], on the ray's side."""
    nx, ny, nz = 0.0, 0.0, 0.0
    known = False
    for k in range(patches.disc_number.size):
        if patches.disc_number[k] == wall:
            nx, ny, nz = patches.discs[k, 3], patches.discs[k, 4], patches.discs[k, 5]
            known = True
    for k in range(patches.cone_number.size):
        if patches.cone_number[k] == wall:
            c = patches.cones[k]
            qx, qy, qz = ox + t * dx - c[0], oy + t * dy - c[1], oz + t * dz - c[2]
            along = qx * c[3] + qy * c[4] + qz * c[5]
            qx, qy, qz = qx - along * c[3], qy - along * c[4], qz - along * c[5]
            rho = math.sqrt(qx * qx + qy * qy + qz * qz)
            rise = (c[7] - c[6]) / c[8]
            scale = 1.0 / math.sqrt(1.0 + rise * rise)
            nx = (rise * c[3] - qx / rho) * scale
            ny = (rise * c[4] - qy / rho) * scale
            nz = (rise * c[5] - qz / rho) * scale
            known = True
    if not known:
        # The search once more, which ends at once: the place of the triangle was not kept.
        _, place = triangle_hit(
            ox, oy, oz, dx, dy, dz, t * (1.0 + 1e-9) + 1e-300, patches.boxes, patches.links,
            patches.corners,
        )  # fmt: skip
        c = patches.corners[place]
        ux, uy, uz = c[3] - c[0], c[4] - c[1], c[5] - c[2]
        vx, vy, vz = c[6] - c[0], c[7] - c[1], c[8] - c[2]
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        scale = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz)
        nx, ny, nz = nx * scale, ny * scale, nz * scale
    if nx * dx + ny * dy + nz * dz > 0.0:
        nx, ny, nz = -nx, -ny, -nz
    return nx, ny, nz
