"""Compiled bundles: all rays of one sphere traced together against the spheres around it.

Rays of one sphere meet the same few neighbours again and again. So they are sorted by direction,
and each block of sixteen takes along only the neighbours inside its cone, nearest first: the inner
loop then runs over rays, without branches, and fills the vector registers. A ray that leaves the
ball of the neighbours goes on alone through the cell grid.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}

BLOCK = 16  # rays that share a list of neighbours
GROUP = 256  # rays whose blocks choose from one first selection
MOST = 1024  # neighbours of one sphere; where there are more, its rays go through the grid alone
CROWD = 48.0  # neighbours a block may expect; beyond, the grid is faster
SHELLS = 64  # shells by which neighbours are sorted


class Places(NamedTuple):
    """Centres sorted into cells, each sphere in one cell only; see :func:`sort_places`."""

    start: np.ndarray  # (cells + 1,) int64
    sphere: np.ndarray  # (n,) int64
    low: tuple[float, float, float]  # lower corner [m]
    cell: tuple[float, float, float]  # cell edges [m]
    edge: tuple[float, float, float]  # box edges [m]
    shape: tuple[int, int, int]
    periodic: tuple[bool, bool, bool]
    largest: float  # radius [m]
    reach: float  # thickness of the shell of neighbours around a mean sphere [m]


def sort_places(
    centres: np.ndarray,
    radii: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    periodic: np.ndarray,
    neighbours: float,
) -> Places:
    """Sort spheres into cells of about two mean radii; ``neighbours`` sets the reach."""
    edge = high - low
    mean = float(radii.mean())
    # A ball that holds so many spheres, on average over the box.
    ball = (neighbours * float(np.prod(edge)) / len(radii) * 3.0 / (4.0 * np.pi)) ** (1.0 / 3.0)
    size = max(2.0 * mean, float((np.prod(edge) / (8.0 * len(radii))) ** (1.0 / 3.0)))
    shape = np.maximum(np.floor(edge / size).astype(np.int64), 1)
    cell = edge / shape
    index = np.clip(np.floor((centres - low) / cell).astype(np.int64), 0, shape - 1)
    flat = (index[:, 0] * shape[1] + index[:, 1]) * shape[2] + index[:, 2]
    order = np.argsort(flat, kind="stable")
    start = np.searchsorted(flat[order], np.arange(int(shape.prod()) + 1))
    return Places(
        start.astype(np.int64), order.astype(np.int64), tuple(low.tolist()), tuple(cell.tolist()),
        tuple(edge.tolist()), tuple(shape.tolist()), tuple(periodic.tolist()),
        float(radii.max()), max(ball - mean, mean),
    )  # fmt: skip


class Around(NamedTuple):
    """Room for the neighbours of one sphere, nearest first."""

    table: np.ndarray  # (9, MOST): vector, radius^2, unit vector, cosine and sine of half shadow
    near: np.ndarray  # (MOST,): no point of it and of what follows lies nearer to the centre [m]
    sphere: np.ndarray  # (MOST,) int64
    image: np.ndarray  # (3, MOST) int64, in boxes
    raw: np.ndarray  # (5, MOST): vector, radius, distance of the nearest point
    shell: np.ndarray  # (2, MOST) int64
    ends: np.ndarray  # (SHELLS + 1,) int64


@njit(**_OPTIONS)
def room_for_neighbours():
    """Empty room, made once a block of work."""
    return Around(
        np.empty((9, MOST)),
        np.empty(MOST),
        np.empty(MOST, np.int64),
        np.empty((3, MOST), np.int64),
        np.empty((5, MOST)),
        np.empty((4, MOST), np.int64),
        np.empty(SHELLS + 1, np.int64),
    )


@njit(**_OPTIONS)
def gather(i, centres, radii, places, ball, around):
    """Neighbours whose nearest point lies within ``ball`` of the centre of sphere ``i``.

    Returns their number, or -1 where there are too many for bundles to pay.
    """
    shape, cell, low, edge = places.shape, places.cell, places.low, places.edge
    wraps = places.periodic
    cx, cy, cz = centres[i, 0], centres[i, 1], centres[i, 2]
    own = radii[i]
    reach = ball + places.largest
    x0 = math.floor((cx - reach - low[0]) / cell[0])
    x1 = math.floor((cx + reach - low[0]) / cell[0])
    y0 = math.floor((cy - reach - low[1]) / cell[1])
    y1 = math.floor((cy + reach - low[1]) / cell[1])
    z0 = math.floor((cz - reach - low[2]) / cell[2])
    z1 = math.floor((cz + reach - low[2]) / cell[2])
    if not wraps[0]:
        x0, x1 = max(x0, 0), min(x1, shape[0] - 1)
    if not wraps[1]:
        y0, y1 = max(y0, 0), min(y1, shape[1] - 1)
    if not wraps[2]:
        z0, z1 = max(z0, 0), min(z1, shape[2] - 1)
    raw, shell, ends = around.raw, around.shell, around.ends
    for s in range(SHELLS + 1):
        ends[s] = 0
    found = 0
    crowd = 0.0
    scale = SHELLS / ball
    for ix in range(x0, x1 + 1):
        wx = ix // shape[0]
        for iy in range(y0, y1 + 1):
            wy = iy // shape[1]
            line = ((ix - wx * shape[0]) * shape[1] + iy - wy * shape[1]) * shape[2]
            for iz in range(z0, z1 + 1):
                wz = iz // shape[2]
                c = line + iz - wz * shape[2]
                for p in range(places.start[c], places.start[c + 1]):
                    j = places.sphere[p]
                    x = centres[j, 0] + wx * edge[0] - cx
                    y = centres[j, 1] + wy * edge[1] - cy
                    z = centres[j, 2] + wz * edge[2] - cz
                    r = radii[j]
                    square = x * x + y * y + z * z
                    if square >= (ball + r) ** 2 or (j == i and wx == 0 and wy == 0 and wz == 0):
                        continue
                    if found == MOST:
                        return -1
                    distance = math.sqrt(square)
                    near = max(distance - r, 0.0)
                    raw[0, found], raw[1, found], raw[2, found] = x, y, z
                    raw[3, found], raw[4, found] = r, distance
                    at = min(np.int64(near * scale), SHELLS - 1)
                    shell[0, found] = at
                    shell[1, found] = j
                    around.image[0, found] = wx
                    around.image[1, found] = wy
                    around.image[2, found] = wz
                    ends[at + 1] += 1
                    # Half the sphere of directions less the part that its shadow misses.
                    sine = min((own + r) / max(distance, 1e-300), 1.0)
                    crowd += 0.5 * (1.0 - math.sqrt(1.0 - sine * sine))
                    found += 1
    if crowd > CROWD:
        return -1
    _by_shell(found, own, ball, around)
    return found


@njit(**_OPTIONS)
def _by_shell(found, own, ball, around):
    """Bring the neighbours found into the order of their shells, ready for the blocks."""
    raw, shell, ends, table = around.raw, around.shell, around.ends, around.table
    for s in range(SHELLS):
        ends[s + 1] += ends[s]
    for k in range(found):
        at = shell[0, k]
        p = ends[at]
        ends[at] = p + 1
        shell[2, k] = p
        r, distance = raw[3, k], max(raw[4, k], 1e-300)
        for axis in range(3):
            table[axis, p] = raw[axis, k]
            table[4 + axis, p] = raw[axis, k] / distance
        table[3, p] = r * r
        sine = min((own + r) / distance, 1.0)
        table[7, p], table[8, p] = math.sqrt(1.0 - sine * sine), sine
        around.near[p] = at * ball / SHELLS
        around.sphere[p] = shell[1, k]
    # The images go the same way, through the room of the shells that is free by now.
    for axis in range(3):
        for k in range(found):
            shell[3, shell[2, k]] = around.image[axis, k]
        for k in range(found):
            around.image[axis, k] = shell[3, k]


@njit(**_OPTIONS)
def _interleaved(x, y):
    """Bits of two numbers below 256 in turn: neighbours in the plane stay close in the order."""
    x = (x | (x << 4)) & 0x0F0F
    x = (x | (x << 2)) & 0x3333
    x = (x | (x << 1)) & 0x5555
    y = (y | (y << 4)) & 0x0F0F
    y = (y | (y << 2)) & 0x3333
    y = (y | (y << 1)) & 0x5555
    return x | (y << 1)


@njit(**_OPTIONS)
def sort_by_direction(n, rays, code, count, order):
    """Numbers of the first ``n`` rays by place of their direction on an octahedron, unfolded."""
    # About four rays a field: finer fields scatter the memory, coarser ones widen the cones.
    half = 4
    while half < 32 and 16 * half * half < n:
        half *= 2
    fields = 4 * half * half
    for f in range(fields + 1):
        count[f] = 0
    for k in range(n):
        dx, dy, dz = rays[0, k], rays[1, k], rays[2, k]
        scale = 1.0 / (abs(dx) + abs(dy) + abs(dz))
        u, v = dx * scale, dy * scale
        if dz < 0.0:
            u, v = (
                math.copysign(1.0 - abs(v), u),
                math.copysign(1.0 - abs(u), v),
            )
        iu = min(np.int64((u + 1.0) * half), 2 * half - 1)
        iv = min(np.int64((v + 1.0) * half), 2 * half - 1)
        code[k] = _interleaved(iu, iv)
    for k in range(n):
        count[code[k] + 1] += 1
    for f in range(fields):
        count[f + 1] += count[f]
    for k in range(n):
        p = count[code[k]]
        count[code[k]] = p + 1
        order[p] = k


@njit(**_OPTIONS)
def _cone(rays, first, last):
    """Unit axis of some directions, cosine and sine of the angle that holds them all."""
    x, y, z = 0.0, 0.0, 0.0
    for k in range(first, last):
        x += rays[0, k]
        y += rays[1, k]
        z += rays[2, k]
    length = math.sqrt(x * x + y * y + z * z)
    if length < 1e-3:  # directions all round: no cone
        return 0.0, 0.0, 1.0, -1.0, 0.0
    x, y, z = x / length, y / length, z / length
    cosine = 1.0
    for k in range(first, last):
        cosine = min(cosine, x * rays[0, k] + y * rays[1, k] + z * rays[2, k])
    # A hair wider, against rounding.
    cosine = max(cosine - 1e-12, -1.0)
    return x, y, z, cosine, math.sqrt(1.0 - cosine * cosine)


@njit(**_OPTIONS)
def _choose(pool, size, all_of_them, cone, table, out):
    """Neighbours whose shadow the cone meets: of the pool, or of the first ``size``."""
    x, y, z, cosine, sine = cone
    if cosine <= 0.0:  # so wide that half angles may add up to more than a straight angle
        for k in range(size):
            out[k] = k if all_of_them else pool[k]
        return size
    chosen = 0
    for k in range(size):
        p = k if all_of_them else pool[k]
        dot = x * table[4, p] + y * table[5, p] + z * table[6, p]
        out[chosen] = p
        chosen += dot >= table[7, p] * cosine - table[8, p] * sine
    return chosen


@njit(**_OPTIONS)
def _meet(list_, size, table, near, own, rays, base, best, who):
    """First neighbour met by each of the sixteen rays from ``base`` on."""
    for k in range(BLOCK):
        best[k] = np.inf
        who[k] = -1
    first = np.uint64(base)
    far = np.inf
    for c in range(size):
        p = list_[c]
        if near[p] - own >= far:
            break
        qx, qy, qz, square = table[0, p], table[1, p], table[2, p], table[3, p]
        for k in range(BLOCK):
            m = first + np.uint64(k)
            ax, ay, az = qx - rays[3, m], qy - rays[4, m], qz - rays[5, m]
            b = ax * rays[0, m] + ay * rays[1, m] + az * rays[2, m]
            root = b * b - (ax * ax + ay * ay + az * az) + square
            t = b - math.sqrt(max(root, 0.0))
            meets = (root > 0.0) & (b > 0.0) & (t < best[k])
            best[k] = t if meets else best[k]
            who[k] = p if meets else who[k]
        # Looking for the furthest costs more than a test: not after each one.
        if (c & 3) == 3:
            far = 0.0
            for k in range(BLOCK):
                far = max(far, best[k])


@njit(**_OPTIONS)
def first_neighbours(n, own, found, around, rays, distance, index, room, best, who):
    """First neighbour of each of ``n`` rays sorted by direction: distance and number, or -1.

    ``rays`` (6, m) holds directions and places relative to the centre [m], with room for BLOCK
    more after the last one; ``room`` (2, MOST) int64, ``best`` and ``who`` (BLOCK,) are scratch.
    """
    # Fill the last block with copies, so that none runs short.
    for k in range(n, -(-n // BLOCK) * BLOCK):
        for row in range(6):
            rays[row, k] = rays[row, n - 1]
    table = around.table
    for group in range(0, n, GROUP):
        end = min(group + GROUP, n)
        cone = _cone(rays, group, end)
        pool = _choose(room[0], found, True, cone, table, room[0])
        for base in range(group, end, BLOCK):
            cone = _cone(rays, base, base + BLOCK)
            size = _choose(room[0], pool, False, cone, table, room[1])
            _meet(room[1], size, table, around.near, own, rays, base, best, who)
            for k in range(min(BLOCK, n - base)):
                distance[base + k] = best[k]
                index[base + k] = who[k]
