"""Compiled bundles: the neighbours of one sphere, and its rays in the order of their directions.

Rays of one sphere meet the same few neighbours again and again. So they are sorted by direction,
and each block of sixteen takes along only the neighbours inside its cone, nearest first: the inner
loop then runs over rays, without branches, and fills the vector registers (see _blocks). A ray that
leaves the ball of the neighbours goes on alone through the cell grid.
"""

import math
from typing import NamedTuple

import numpy as np

from greybed.core.jit import njit

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}

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

    exact: np.ndarray  # (4, MOST): vector [m], radius^2 [m2]
    table: np.ndarray  # (8 MOST + 8,) float32: the same in radii of the sphere, widened; nearest t
    cones: np.ndarray  # (5, MOST) float32: unit vector, cosine and sine of half the shadow
    margins: np.ndarray  # (3,): widening of radius^2 and error of t, in radii; radius [m]
    sphere: np.ndarray  # (MOST,) int64
    image: np.ndarray  # (3, MOST) int64, in boxes
    raw: np.ndarray  # (5, MOST): vector, radius, distance of the nearest point
    shell: np.ndarray  # (4, MOST) int64
    ends: np.ndarray  # (SHELLS + 1,) int64


@njit(**_OPTIONS)
def room_for_neighbours():
    """Empty room, made once a block of work."""
    table = np.zeros(8 * MOST + 8, np.float32)
    table[8 * MOST + 3] = -1.0  # what follows the last one is met by no ray
    return Around(
        np.empty((4, MOST)),
        table,
        np.empty((5, MOST), np.float32),
        np.empty(3),
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
                    # One slot of the tallies is left for the rays that escape.
                    if found == MOST - 1:
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
    _by_shell(found, own, ball, places.largest, around)
    return found


@njit(**_OPTIONS)
def _by_shell(found, own, ball, largest, around):
    """Bring the neighbours found into the order of their shells, ready for the blocks."""
    raw, shell, ends = around.raw, around.shell, around.ends
    exact, table, cones = around.exact, around.table, around.cones
    # All vectors are shorter than this many radii, and single precision rounds by up to 2^-24 of
    # them: b, along the ray, is off by 6 such, radius^2 less the distance across squared by 25 at
    # the rim. Half the widening covers that with room to spare, and t is off by its root at most.
    span, widest = (ball + largest) / own + 1.0, largest / own
    widened = 5e-6 * span * (widest + 1e-6 * span)
    slack = 0.8 * math.sqrt(widened) + 2e-6 * span
    around.margins[0], around.margins[1], around.margins[2] = widened, slack, own
    for s in range(SHELLS):
        ends[s + 1] += ends[s]
    scale = 1.0 / own
    for k in range(found):
        at = shell[0, k]
        p = ends[at]
        ends[at] = p + 1
        shell[2, k] = p
        r, distance = raw[3, k], max(raw[4, k], 1e-300)
        for axis in range(3):
            exact[axis, p] = raw[axis, k]
            table[8 * p + axis] = raw[axis, k] * scale
            cones[axis, p] = raw[axis, k] / distance
        exact[3, p] = r * r
        table[8 * p + 3] = (r * scale) ** 2 + widened
        # A ray starts one radius out. With the error of t taken off, what follows matters no more.
        table[8 * p + 4] = at * ball / SHELLS * scale - 1.0 - 2.0 * slack
        sine = min((own + r) / distance, 1.0)
        cones[3, p], cones[4, p] = math.sqrt(1.0 - sine * sine), sine
        around.sphere[p] = shell[1, k]
    # The images go the same way, through the room of the shells that is free by now.
    for axis in range(3):
        for k in range(found):
            shell[3, shell[2, k]] = around.image[axis, k]
        for k in range(found):
            around.image[axis, k] = shell[3, k]


def _hilbert(side: int) -> np.ndarray:
    """Place of each field of a square on Hilbert's curve, (side^2,) int16: it never jumps."""
    order = np.zeros((1, 1), np.int64)
    while len(order) < side:
        quarter = order.size
        flipped = order[::-1, ::-1].T
        low = np.hstack([order.T, order + quarter])
        order = np.vstack([low, np.hstack([flipped + 3 * quarter, order + 2 * quarter])])
    return order.ravel().astype(np.int16)


_SIDE = 64
_CURVE = _hilbert(_SIDE)


@njit(**_OPTIONS)
def sort_by_direction(n, rays, code, count, order):
    """Numbers of the first ``n`` rays by place of their direction on an octahedron, unfolded."""
    # About four rays a field: finer fields scatter the memory, coarser ones widen the cones.
    shift = 6
    while shift > 0 and (_SIDE * _SIDE >> shift) * 4 < n:
        shift -= 2
    fields = _SIDE * _SIDE >> shift
    half = _SIDE // 2
    for f in range(np.uint64(fields + 1)):
        count[f] = 0
    for k in range(np.uint64(n)):
        dx, dy, dz = rays[0, k], rays[1, k], rays[2, k]
        scale = 1.0 / (abs(dx) + abs(dy) + abs(dz))
        u, v = dx * scale, dy * scale
        fold_u, fold_v = math.copysign(1.0 - abs(v), u), math.copysign(1.0 - abs(u), v)
        u, v = (u if dz >= 0.0 else fold_u), (v if dz >= 0.0 else fold_v)
        iu = min(np.int32((u + 1.0) * half), np.int32(_SIDE - 1))
        iv = min(np.int32((v + 1.0) * half), np.int32(_SIDE - 1))
        # Unsigned indices: signed ones are tested for a count from the end.
        code[k] = _CURVE[np.uint64(_SIDE * iu + iv)] >> shift
    for k in range(np.uint64(n)):
        count[np.uint64(code[k]) + np.uint64(1)] += 1
    for f in range(np.uint64(fields)):
        count[f + np.uint64(1)] += count[f]
    for k in range(np.uint64(n)):
        field = np.uint64(code[k])
        p = count[field]
        count[field] = p + 1
        order[np.uint64(p)] = k
