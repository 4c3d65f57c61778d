"""Compiled emission from bounded walls: uniform points, directions with a cosine law."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from greybed.core.jit import njit
from greybed.core.walls import Cone, Cylinder, Disc, Mesh, Polygon, Wall

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}

NONE, DISC, CONE, TRIANGLES = 0, 1, 2, 3
# Rays start this far off their patch, over its size, so that rounding cannot put them behind it.
LIFT = 1e-10


class Emitters(NamedTuple):
    """Tables from which rays start, one row for every wall of the packing."""

    kind: np.ndarray  # (n_walls,) int64: NONE where the wall has no end
    area: np.ndarray  # (n_walls,): surface of the side that radiates [m2]; inf without end
    lift: np.ndarray  # (n_walls,): how far off the patch rays start [m]
    shape: np.ndarray  # (n_walls, 9): disc or cone, as in greybed.core.patches
    first: np.ndarray  # (n_walls + 1,) int64: triangles of a wall are first[w] to first[w + 1]
    corners: np.ndarray  # (m, 9) [m]
    share: np.ndarray  # (m,): area of a wall's triangles up to this one, over the wall's [-]


def emitters(walls: Sequence[Wall]) -> Emitters:
    """The tables of these walls; unbounded ones cannot emit."""
    n = len(walls)
    kind, shape, lift = np.zeros(n, np.int64), np.zeros((n, 9)), np.zeros(n)
    first = np.zeros(n + 1, np.int64)
    corners, shares = [np.empty((0, 9))], [np.empty(0)]
    for k, wall in enumerate(walls):
        if isinstance(wall, Disc):
            kind[k], lift[k] = DISC, LIFT * wall.radius
            shape[k, :7] = (*wall.point, *wall.normal, wall.radius)
        elif isinstance(wall, Cone):
            kind[k], lift[k] = CONE, LIFT * max(wall.radius, wall.end_radius)
            shape[k] = (*wall.point, *wall.axis, wall.radius, wall.end_radius, wall.length)
        elif isinstance(wall, Cylinder) and wall.length is not None:
            kind[k], lift[k] = CONE, LIFT * wall.radius
            shape[k] = (*wall.point, *wall.axis, wall.radius, wall.radius, wall.length)
        elif isinstance(wall, Polygon | Mesh):
            kind[k] = TRIANGLES
            t = wall.triangles
            lift[k] = LIFT * float(np.ptp(t.reshape(-1, 3), axis=0).max())
            double = np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1)
            share = np.cumsum(double) / double.sum()
            share[-1] = 1.0
            corners.append(t.reshape(-1, 9))
            shares.append(share)
            first[k + 1] = len(t)
    return Emitters(
        kind,
        np.array([wall.area for wall in walls], dtype=np.float64),
        lift,
        shape,
        np.cumsum(first),
        np.concatenate(corners),
        np.concatenate(shares),
    )


@njit(**_OPTIONS)
def emit(wall_number, u1, u2, u3, u4, tables):
    """Ray that leaves a bounded wall on the bed's side: origin [m] and unit direction.

    The four numbers in [0, 1) give the place (u1, u2) and the direction (u3, u4), without
    rejection and each piecewise continuously, so that a Sobol sequence may be used. All NaN for a
    wall without end.
    """
    shape = tables.shape[wall_number]
    kind = tables.kind[wall_number]
    turn = 2.0 * math.pi * u2
    if kind == TRIANGLES:
        x, y, z, nx, ny, nz = _on_triangles(wall_number, u1, u2, tables)
    elif kind == DISC:
        nx, ny, nz = shape[3], shape[4], shape[5]
        ex, ey, ez, fx, fy, fz = _across(nx, ny, nz)
        rho = shape[6] * math.sqrt(u1)
        a, b = rho * math.cos(turn), rho * math.sin(turn)
        x = shape[0] + a * ex + b * fx
        y = shape[1] + a * ey + b * fy
        z = shape[2] + a * ez + b * fz
    elif kind == CONE:
        ax, ay, az = shape[3], shape[4], shape[5]
        begin, end, length = shape[6], shape[7], shape[8]
        # Rings of equal area: the square of the radius is even in u1. Written so that a tube,
        # where begin == end, needs no branch.
        rho = math.sqrt(begin * begin + u1 * (end - begin) * (end + begin))
        below = rho + begin
        along = length * u1 * (end + begin) / below if below > 0.0 else 0.0
        ex, ey, ez, fx, fy, fz = _across(ax, ay, az)
        c, s = math.cos(turn), math.sin(turn)
        ox, oy, oz = c * ex + s * fx, c * ey + s * fy, c * ez + s * fz
        x = shape[0] + along * ax + rho * ox
        y = shape[1] + along * ay + rho * oy
        z = shape[2] + along * az + rho * oz
        # Inwards, and towards the wider end.
        rise = (end - begin) / length
        scale = 1.0 / math.sqrt(1.0 + rise * rise)
        nx, ny, nz = (rise * ax - ox) * scale, (rise * ay - oy) * scale, (rise * az - oz) * scale
    else:
        return np.nan, np.nan, np.nan, np.nan, np.nan, np.nan
    ex, ey, ez, fx, fy, fz = _across(nx, ny, nz)
    # Malley: a uniform point of the disc, lifted to the hemisphere.
    rho, up, turn = math.sqrt(u3), math.sqrt(1.0 - u3), 2.0 * math.pi * u4
    a, b = rho * math.cos(turn), rho * math.sin(turn)
    lift = tables.lift[wall_number]
    return (
        x + lift * nx,
        y + lift * ny,
        z + lift * nz,
        a * ex + b * fx + up * nx,
        a * ey + b * fy + up * ny,
        a * ez + b * fz + up * nz,
    )


@njit(**_OPTIONS)
def _on_triangles(wall_number, u1, u2, tables):
    """Uniform point of a wall of triangles, and the normal there."""
    share, corners = tables.share, tables.corners
    begin = tables.first[wall_number]
    low, high = begin, tables.first[wall_number + 1] - 1
    while low < high:
        middle = (low + high) // 2
        if share[middle] > u1:
            high = middle
        else:
            low = middle + 1
    before = share[low - 1] if low > begin else 0.0
    # What is left of u1 within this triangle is even again.
    left = min((u1 - before) / (share[low] - before), 1.0)
    root = math.sqrt(left)
    f, g = root * (1.0 - u2), root * u2
    c = corners[low]
    ux, uy, uz = c[3] - c[0], c[4] - c[1], c[5] - c[2]
    vx, vy, vz = c[6] - c[0], c[7] - c[1], c[8] - c[2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    scale = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz)
    return (
        c[0] + f * ux + g * vx,
        c[1] + f * uy + g * vy,
        c[2] + f * uz + g * vz,
        nx * scale,
        ny * scale,
        nz * scale,
    )


@njit(**_OPTIONS)
def _across(x, y, z):
    """Two unit vectors across a unit vector: Duff et al. 2017, jcgt.org/published/0006/01/01."""
    sign = math.copysign(1.0, z)
    a = -1.0 / (sign + z)
    b = x * y * a
    return 1.0 + sign * x * x * a, sign * b, -sign * x, b, sign + y * y * a, -y


@njit(**_OPTIONS)
def emit_many(wall_number, numbers, tables, rays):
    """Rays (n, 6), origins [m] and directions, from numbers (n, 4) of the unit cube."""
    for k in range(numbers.shape[0]):
        (
            rays[k, 0], rays[k, 1], rays[k, 2], rays[k, 3], rays[k, 4], rays[k, 5],
        ) = emit(
            wall_number, numbers[k, 0], numbers[k, 1], numbers[k, 2], numbers[k, 3], tables
        )  # fmt: skip
