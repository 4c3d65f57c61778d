"""Cell grid over a packing: every cell lists, side by side, the spheres that reach into it."""

import math
from typing import NamedTuple

import numpy as np

from greybed.core.jit import njit

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


class Items(NamedTuple):
    """What the cells list. Each sphere stands once, so that tables of large beds stay in cache."""

    entry: np.ndarray  # (m,) uint32, entry of each item
    table: np.ndarray  # (4 entries,) float64: x, y, z [m] as seen from inside the box, radius^2


class Grid(NamedTuple):
    """Uniform cells and the spheres that reach into them; see :func:`build`.

    Items ``start[c]`` to ``start[c + 1]`` are those of cell ``c``. An entry is a sphere, or its
    image across a periodic face: ``owner`` is its number, ``image`` the shift in boxes.
    """

    frame: Frame
    start: np.ndarray  # (cells + 1,) uint32
    items: Items
    owner: np.ndarray  # (entries,) int32
    image: np.ndarray  # (3 entries,) int8


@njit(**_OPTIONS)
def _fill(
    centres, radii, low, edge, cell, shape, periodic, start, index, table, owner, image, write
):  # fmt: skip
    """Count (write False) or store (write True) the spheres of every cell; returns the totals."""
    first = np.empty(3, np.int64)
    last = np.empty(3, np.int64)
    seen = np.empty(27, np.int64)
    items, entries = 0, 0
    for j in range(radii.size):
        r = radii[j]
        seen[:] = -1
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
                    # Python's floor division, so that -1 belongs to the box before. A sphere is
                    # no wider than the box, so it reaches into the next ones at most.
                    wx, wy, wz = ix // shape[0], iy // shape[1], iz // shape[2]
                    code = (9 * wx + 3 * wy + wz) + 13
                    entry = seen[code]
                    if entry < 0:
                        entry = entries
                        seen[code] = entry
                        entries += 1
                        if write:
                            table[4 * entry] = centres[j, 0] - wx * edge[0]
                            table[4 * entry + 1] = centres[j, 1] - wy * edge[1]
                            table[4 * entry + 2] = centres[j, 2] - wz * edge[2]
                            table[4 * entry + 3] = r * r
                            owner[entry] = j
                            image[3 * entry] = -wx
                            image[3 * entry + 1] = -wy
                            image[3 * entry + 2] = -wz
                    c = (
                        ((ix - wx * shape[0]) * shape[1] + iy - wy * shape[1]) * shape[2]
                        + iz
                        - wz * shape[2]
                    )
                    items += 1
                    if not write:
                        start[c + 1] += 1
                        continue
                    m = start[c]
                    start[c] = m + 1
                    index[m] = entry
    return items, entries


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
    # Spheres side by side in space side by side in memory: a ray then finds many of them in cache.
    place = np.clip(np.floor((centres - low) / cell).astype(np.int64), 0, shape - 1)
    order = np.argsort((place[:, 0] * shape[1] + place[:, 1]) * shape[2] + place[:, 2])
    start = np.zeros(n_cells + 1, np.int64)
    geometry = (centres[order], radii[order], low, edge, cell, shape, periodic)
    none = np.empty(0, np.uint32), np.empty(0), np.empty(0, np.int32), np.empty(0, np.int8)
    items, entries = _fill(*geometry, start, *none, False)
    np.cumsum(start, out=start)
    index, table = np.empty(items, np.uint32), np.empty(4 * entries)
    owner, image = np.empty(entries, np.int32), np.empty(3 * entries, np.int8)
    cursor = start.copy()
    _fill(*geometry, cursor, index, table, owner, image, True)
    owner = order.astype(np.int32)[owner]
    nx, ny, nz = shape.tolist()
    frame = Frame(
        tuple(low.tolist()), tuple(edge.tolist()), tuple(cell.tolist()),
        tuple((1.0 / cell).tolist()), nx, ny, nz, tuple(periodic.tolist()),
    )  # fmt: skip
    return Grid(frame, start.astype(np.uint32), Items(index, table), owner, image)
