"""Cell grid over a packing: every cell lists, side by side, the spheres that reach into it."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}


class Frame(NamedTuple):
    """Where the cells lie. Scalars and tuples only: an array here would be reference-counted for
    every ray, with a locked instruction that all threads wait for."""

    low: tuple[float, float, float]  # lower corner [m]
    edge: tuple[float, float, float]  # extent [m]
    cell: tuple[float, float, float]  # cell edges [m]
    inverse: tuple[float, float, float]  # 1 / cell [m-1]
    nx: int  # cells along x [-]
    ny: int
    nz: int
    periodic: tuple[bool, bool, bool]


class Grid(NamedTuple):
    """Uniform cells and the spheres that reach into them; see :func:`build`.

    Items ``start[c]`` to ``start[c + 1]`` are the spheres of cell ``c``; each takes four places in
    ``items``: x, y, z [m] as seen from that cell (shifted by whole boxes across periodic faces)
    and radius squared [m2]. ``owner`` is the sphere's number, ``image`` the shift in boxes.
    """

    frame: Frame
    start: np.ndarray  # (cells + 1,) uint32
    items: np.ndarray  # (4 m,) float64
    owner: np.ndarray  # (m,) int32
    image: np.ndarray  # (3 m,) int8


@njit(**_OPTIONS)
def _fill(centres, radii, low, edge, cell, shape, periodic, start, items, owner, image, write):
    """Count (write False) or store (write True) the spheres of every cell; returns the total."""
    first = np.empty(3, np.int64)
    last = np.empty(3, np.int64)
    total = 0
    for j in range(radii.size):
        r = radii[j]
        for k in range(3):
            # A hair wider than the sphere, so that rounding cannot lose a grazing cell.
            reach = r * (1.0 + 1e-9)
            first[k] = math.floor((centres[j, k] - low[k] - reach) / cell[k])
            last[k] = math.floor((centres[j, k] - low[k] + reach) / cell[k])
            if not periodic[k]:
                first[k] = max(first[k], 0)
                last[k] = min(last[k], shape[k] - 1)
        for ix in range(first[0], last[0] + 1):
            bx = low[0] + ix * cell[0]
            ex = max(max(bx - centres[j, 0], centres[j, 0] - bx - cell[0]), 0.0)
            for iy in range(first[1], last[1] + 1):
                by = low[1] + iy * cell[1]
                ey = max(max(by - centres[j, 1], centres[j, 1] - by - cell[1]), 0.0)
                for iz in range(first[2], last[2] + 1):
                    bz = low[2] + iz * cell[2]
                    ez = max(max(bz - centres[j, 2], centres[j, 2] - bz - cell[2]), 0.0)
                    if ex * ex + ey * ey + ez * ez > r * r * (1.0 + 1e-8):
                        continue
                    # Python's floor division, so that -1 belongs to the box before.
                    wx, wy, wz = ix // shape[0], iy // shape[1], iz // shape[2]
                    c = (
                        ((ix - wx * shape[0]) * shape[1] + iy - wy * shape[1]) * shape[2]
                        + iz
                        - wz * shape[2]
                    )
                    total += 1
                    if not write:
                        start[c + 1] += 1
                        continue
                    m = start[c]
                    start[c] = m + 1
                    items[m, 0] = centres[j, 0] - wx * edge[0]
                    items[m, 1] = centres[j, 1] - wy * edge[1]
                    items[m, 2] = centres[j, 2] - wz * edge[2]
                    items[m, 3] = r * r
                    owner[m] = j
                    image[m, 0], image[m, 1], image[m, 2] = -wx, -wy, -wz
    return total


def build(
    centres: np.ndarray,
    radii: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    periodic: np.ndarray,
    cell_size: float,
) -> Grid:
    """Build the grid over [low, high] with cells of about ``cell_size`` [m]."""
    edge = high - low
    shape = np.maximum(np.round(edge / cell_size).astype(np.int64), 1)
    cell = edge / shape
    n_cells = int(shape.prod())
    start = np.zeros(n_cells + 1, np.int64)
    none4, none1, none3 = np.empty((0, 4)), np.empty(0, np.int32), np.empty((0, 3), np.int8)
    geometry = (centres, radii, low, edge, cell, shape, periodic)
    total = _fill(*geometry, start, none4, none1, none3, False)
    np.cumsum(start, out=start)
    items = np.empty((total, 4))
    owner = np.empty(total, np.int32)
    image = np.empty((total, 3), np.int8)
    cursor = start.copy()
    _fill(*geometry, cursor, items, owner, image, True)
    nx, ny, nz = shape.tolist()
    frame = Frame(
        tuple(low.tolist()), tuple(edge.tolist()), tuple(cell.tolist()),
        tuple((1.0 / cell).tolist()), nx, ny, nz, tuple(periodic.tolist()),
    )  # fmt: skip
    return Grid(frame, start.astype(np.uint32), items.ravel(), owner, image.ravel())
