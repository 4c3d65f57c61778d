"""Compiled blocks: sixteen rays at a time against the neighbours in their cone.

Which neighbour a ray meets first is found in single precision, which runs twice as many rays at
once and halves the memory. The spheres are widened by more than the rounding, so that no hit is
lost; where the first one then stands out by more than the rounding, it is the first one in double
precision too. A ray in doubt, one of some hundred, is traced again in double precision.
"""

import math
from typing import NamedTuple

import numpy as np

from greybed.core.jit import njit
from greybed.raytrace._bundle import MOST

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}
# Where the rounding is covered by a margin, the order of the sums is free.
_LOOSE = {**_OPTIONS, "fastmath": {"reassoc", "contract", "nsz", "arcp", "nnan"}}

BLOCK = 16  # rays that share a list of neighbours
GROUP = 256  # rays whose blocks choose from one first selection
# Cosines come out wrong by less than this in single precision.
_HAIR = np.float32(2e-6)
# Where the rows of a block begin; unsigned, for signed indices are tested for a count from the end.
_Y, _Z, _PX, _PY, _PZ = (np.uint64(row * BLOCK) for row in range(1, 6))
_U1, _U2, _U3, _U4 = (np.uint64(k) for k in range(1, 5))
_ZERO, _ONE, _INF = np.float32(0.0), np.float32(1.0), np.float32(np.inf)


class Room(NamedTuple):
    """Scratch of :func:`first_neighbours`."""

    pool: np.ndarray  # (5, MOST) float32: cones of the neighbours that a group may meet
    picked: np.ndarray  # (MOST,) int32
    number: np.ndarray  # (MOST,) int32: which they are
    list: np.ndarray  # (MOST + 1,) int32: neighbours that a block may meet
    meets: np.ndarray  # (MOST,) int32
    state: np.ndarray  # (4 BLOCK,) float32, see _meet
    spare: np.ndarray  # (4 BLOCK,) float32


@njit(**_OPTIONS)
def room_for_blocks():
    """Empty room, made once a block of work."""
    return Room(
        np.empty((5, MOST), np.float32),
        np.empty(MOST, np.int32),
        np.empty(MOST, np.int32),
        np.empty(MOST + 1, np.int32),
        np.empty(MOST, np.int32),
        np.empty(4 * BLOCK, np.float32),
        np.empty(4 * BLOCK, np.float32),
    )


@njit(**_OPTIONS)
def in_blocks(n, order, raw, row, rays):
    """Copy columns ``order`` of ``raw`` (6, m) to ``rays``, block by block, in single precision.

    A block is sixteen numbers of each row, row by row. The last one is filled with copies. ``row``
    (n,) float32 is scratch: one row at a time stays in the nearest cache while it is permuted.
    """
    whole = n // BLOCK * BLOCK
    for axis in range(6):
        for k in range(n):
            row[k] = raw[axis, k]
        at = np.uint64(axis * BLOCK)
        for base in range(np.uint64(0), np.uint64(whole), np.uint64(BLOCK)):
            for k in range(np.uint64(BLOCK)):
                rays[at + k] = row[np.uint64(order[base + k])]
            at += np.uint64(6 * BLOCK)
        for k in range(BLOCK if whole < n else 0):
            rays[at + np.uint64(k)] = row[order[min(whole + k, n - 1)]]


@njit(**_LOOSE)
def _cone(rays, first, last):
    """Unit axis of the directions of some blocks, cosine and sine of the angle that holds them."""
    x, y, z = _ZERO, _ZERO, _ZERO
    for base in range(first, last, BLOCK):
        at = np.uint64(6 * base)
        for k in range(np.uint64(BLOCK)):
            x += rays[at + k]
            y += rays[at + k + _Y]
            z += rays[at + k + _Z]
    length = math.sqrt(x * x + y * y + z * z)
    if length < 1e-3:  # directions all round: no cone
        return _ZERO, _ZERO, _ONE, -_ONE, _ZERO
    scale = _ONE / length
    x, y, z = x * scale, y * scale, z * scale
    cosine = _ONE
    for base in range(first, last, BLOCK):
        at = np.uint64(6 * base)
        for k in range(np.uint64(BLOCK)):
            cosine = min(cosine, x * rays[at + k] + y * rays[at + k + _Y] + z * rays[at + k + _Z])
    cosine = max(cosine - _HAIR, -_ONE)
    return x, y, z, cosine, math.sqrt(_ONE - cosine * cosine)


@njit(**_LOOSE)
def _choose(size, cone, table, meets, out):
    """Neighbours of the first ``size`` in ``table`` whose shadow the cone meets."""
    x, y, z, cosine, sine = cone
    if cosine <= _ZERO:  # so wide that half angles may add up to more than a straight angle
        for k in range(size):
            out[k] = k
        return size
    for k in range(np.uint64(size)):
        dot = x * table[0, k] + y * table[1, k] + z * table[2, k]
        meets[k] = dot + _HAIR >= table[3, k] * cosine - table[4, k] * sine
    chosen = np.uint64(0)
    for k in range(np.uint64(size)):
        out[chosen] = k
        chosen += np.uint64(meets[k])
    return np.int64(chosen)


@njit(inline="always", **_LOOSE)
def _test(number, table, slack, rays, at, old, new):
    """Test the sixteen rays from ``at`` on against one neighbour; see :func:`_meet`."""
    p = np.uint64(8) * np.uint64(number)
    qx, qy, qz, square = table[p], table[p + _U1], table[p + _U2], table[p + _U3]
    name = np.float32(number)
    for k in range(np.uint64(BLOCK)):
        m = at + k
        dx, dy, dz = rays[m], rays[m + _Y], rays[m + _Z]
        ax, ay, az = qx - rays[m + _PX], qy - rays[m + _PY], qz - rays[m + _PZ]
        b = ax * dx + ay * dy + az * dz
        # From the distance across, not from squares of distances: that would cost digits.
        ax, ay, az = ax - b * dx, ay - b * dy, az - b * dz
        root = square - (ax * ax + ay * ay + az * az)
        t = b - math.sqrt(max(root, _ZERO))
        t = t if (root > _ZERO) & (b > -slack) else _INF
        first, second, graze, who = old[k], old[k + _Y], old[k + _Z], old[k + _PX]
        new[k] = min(first, t)
        new[k + _Y] = min(second, max(first, t))
        new[k + _Z] = root if t < first else graze
        new[k + _PX] = name if t < first else who


@njit(**_LOOSE)
def _meet(list_, size, table, widened, slack, rays, base, state, spare):
    """First neighbour met by each of the sixteen rays from ``base`` on; whether one is in doubt.

    ``state`` gets four numbers of each ray: distances of the first and of the second one, how far
    inside its rim the first one is met, and its number. It goes to and fro between two arrays: in
    place, only what changes would be stored, and to wait for such stores takes longer than a test.
    """
    for k in range(np.uint64(BLOCK)):
        state[k] = _INF
        state[k + _Y] = _INF
        state[k + _Z] = _ONE
        state[k + _PX] = -_ONE
    at = np.uint64(6 * base)
    far = _INF
    list_[size] = MOST  # met by none
    for c in range(np.uint64(0), np.uint64(size), np.uint64(2)):
        if table[np.uint64(8) * np.uint64(list_[c]) + _U4] >= far:
            break
        _test(list_[c], table, slack, rays, at, state, spare)
        _test(list_[c + _U1], table, slack, rays, at, spare, state)
        # Looking for the furthest costs more than a test: not after each one.
        if (c & _U2) == _U2:
            far = state[0]
            for k in range(np.uint64(BLOCK)):
                far = max(far, state[k])
    doubts = 0
    for k in range(np.uint64(BLOCK)):
        doubt = (state[k + _Y] < state[k] + slack) | (state[k + _Z] < widened + widened)
        doubts += doubt | (state[k] < slack)
    return doubts > 0


@njit(**_OPTIONS)
def _met_exactly(list_, size, table, radius, rays, k):
    """First of some neighbours met by a ray, in double precision: number or -1, distance [m]."""
    dx, dy, dz = rays[0, k], rays[1, k], rays[2, k]
    px, py, pz = rays[3, k] * radius, rays[4, k] * radius, rays[5, k] * radius
    nearest, who = np.inf, np.int32(-1)
    for c in range(size):
        p = list_[c]
        ax, ay, az = table[0, p] - px, table[1, p] - py, table[2, p] - pz
        b = ax * dx + ay * dy + az * dz
        root = b * b - (ax * ax + ay * ay + az * az) + table[3, p]
        if b > 0.0 and root > 0.0:
            t = b - math.sqrt(root)
            if t < nearest:
                nearest, who = t, p
    return who, nearest


@njit(**_OPTIONS)
def distance_of(p, around, radius, rays, k):
    """Distance of ray ``k`` to neighbour ``p`` that it meets, in double precision [m]."""
    table = around.exact
    ax = table[0, p] - rays[3, k] * radius
    ay = table[1, p] - rays[4, k] * radius
    az = table[2, p] - rays[5, k] * radius
    b = ax * rays[0, k] + ay * rays[1, k] + az * rays[2, k]
    return b - math.sqrt(max(b * b - (ax * ax + ay * ay + az * az) + table[3, p], 0.0))


@njit(**_OPTIONS)
def first_neighbours(n, found, around, raw, order, rays, room, distance, index):
    """First neighbour of each of ``n`` rays sorted by direction, or -1, and distance.

    ``rays`` holds the columns ``order`` of ``raw`` in blocks, see :func:`in_blocks`: directions and
    places on the unit sphere. The other arrays need room for whole blocks, too. Distances are in
    radii of the emitter, and too small by less than ``around.margins[1]``; inf for none.
    """
    table, cones, exact = around.table, around.cones, around.exact
    pool, list_, meets = room.pool, room.list, room.meets
    picked, number, state, spare = room.picked, room.number, room.state, room.spare
    widened, slack = np.float32(around.margins[0]), np.float32(around.margins[1])
    radius = around.margins[2]
    for group in range(0, n, GROUP):
        end = min(group + GROUP, n)
        size = _choose(found, _cone(rays, group, end), cones, meets, picked)
        for c in range(size):
            p = picked[c]
            number[c] = p
            for row in range(5):
                pool[row, c] = cones[row, p]
        for base in range(group, end, BLOCK):
            chosen = _choose(size, _cone(rays, base, base + BLOCK), pool, meets, list_)
            for c in range(chosen):
                list_[c] = number[list_[c]]
            doubts = _meet(list_, chosen, table, widened, slack, rays, base, state, spare)
            for k in range(BLOCK):
                distance[base + k] = state[k]
                index[base + k] = np.int32(state[k + 3 * BLOCK])
            if not doubts:
                continue
            for k in range(min(BLOCK, n - base)):
                best = state[k]
                if best < _INF and (
                    state[k + BLOCK] < best + slack
                    or state[k + 2 * BLOCK] < widened + widened
                    or best < slack
                ):
                    p, t = _met_exactly(list_, chosen, exact, radius, raw, order[base + k])
                    distance[base + k] = t / radius
                    index[base + k] = p
