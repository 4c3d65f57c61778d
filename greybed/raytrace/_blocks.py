"""Compiled blocks: sixteen rays at a time against the neighbours in their cone.

Which neighbour a ray meets first is found in single precision, which runs twice as many rays at
once and halves the memory. The spheres are widened by more than the rounding, so that no hit is
lost; where the first one then stands out by more than the rounding, it is the first one in double
precision too. A ray in doubt, one of some hundred, is traced again in double precision.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from greybed.raytrace._bundle import MOST

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}
# Where the rounding is covered by a margin, the order of the sums is free.
_LOOSE = {**_OPTIONS, "fastmath": {"reassoc", "contract", "nsz", "arcp"}}

BLOCK = 16  # rays that share a list of neighbours
GROUP = 256  # rays whose blocks choose from one first selection
# Cosines come out wrong by less than this in single precision.
_HAIR = np.float32(2e-6)
_ZERO, _ONE, _INF = np.float32(0.0), np.float32(1.0), np.float32(np.inf)


class Room(NamedTuple):
    """Scratch of :func:`first_neighbours`."""

    pool: np.ndarray  # (5, MOST) float32: cones of the neighbours that a group may meet
    picked: np.ndarray  # (MOST,) int32
    number: np.ndarray  # (MOST,) int32: which they are
    list: np.ndarray  # (MOST,) int32: neighbours that a block may meet
    meets: np.ndarray  # (MOST,) int32
    best: np.ndarray  # (BLOCK,) float32: first distance
    second: np.ndarray  # (BLOCK,) float32: second distance
    graze: np.ndarray  # (BLOCK,) float32: how far inside the rim the first one is met
    who: np.ndarray  # (BLOCK,) int32: the first one


@njit(**_OPTIONS)
def room_for_blocks():
    """Empty room, made once a block of work."""
    return Room(
        np.empty((5, MOST), np.float32),
        np.empty(MOST, np.int32),
        np.empty(MOST, np.int32),
        np.empty(MOST, np.int32),
        np.empty(MOST, np.int32),
        np.empty(BLOCK, np.float32),
        np.empty(BLOCK, np.float32),
        np.empty(BLOCK, np.float32),
        np.empty(BLOCK, np.int32),
    )


@njit(**_LOOSE)
def _cone(rays, first, count):
    """Unit axis of some directions, cosine and sine of the angle that holds them all."""
    x, y, z = _ZERO, _ZERO, _ZERO
    begin = np.uint64(first)
    for k in range(np.uint64(count)):
        x += rays[0, begin + k]
        y += rays[1, begin + k]
        z += rays[2, begin + k]
    length = math.sqrt(x * x + y * y + z * z)
    if length < 1e-3:  # directions all round: no cone
        return _ZERO, _ZERO, _ONE, -_ONE, _ZERO
    scale = _ONE / length
    x, y, z = x * scale, y * scale, z * scale
    cosine = _ONE
    for k in range(np.uint64(count)):
        dot = x * rays[0, begin + k] + y * rays[1, begin + k] + z * rays[2, begin + k]
        cosine = dot if dot < cosine else cosine
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


@njit(**_LOOSE)
def _meet(list_, size, table, slack, rays, base, best, second, graze, who):
    """First neighbour met by each of the sixteen rays from ``base`` on, and by how much."""
    for k in range(BLOCK):
        best[k] = _INF
        second[k] = _INF
        graze[k] = _ZERO
        who[k] = -1
    first = np.uint64(base)
    far = _INF
    for c in range(np.uint64(size)):
        p = np.uint64(list_[c])
        if table[4, p] >= far:
            break
        qx, qy, qz, square = table[0, p], table[1, p], table[2, p], table[3, p]
        number = np.int32(p)
        for k in range(BLOCK):
            m = first + np.uint64(k)
            dx, dy, dz = rays[0, m], rays[1, m], rays[2, m]
            ax, ay, az = qx - rays[3, m], qy - rays[4, m], qz - rays[5, m]
            b = ax * dx + ay * dy + az * dz
            # From the distance across, not from squares of distances: that would cost digits.
            ax, ay, az = ax - b * dx, ay - b * dy, az - b * dz
            root = square - (ax * ax + ay * ay + az * az)
            t = b - math.sqrt(max(root, _ZERO))
            t = t if (root > _ZERO) & (b > -slack) else _INF
            nearer = t < best[k]
            behind = best[k] if nearer else t
            second[k] = behind if behind < second[k] else second[k]
            graze[k] = root if nearer else graze[k]
            who[k] = number if nearer else who[k]
            best[k] = t if nearer else best[k]
        # Looking for the furthest costs more than a test: not after each one.
        if (c & np.uint64(3)) == np.uint64(3):
            far = _ZERO
            for k in range(BLOCK):
                far = best[k] if best[k] > far else far


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

    ``rays`` (6, m) float32 holds directions and places on the unit sphere, with room for BLOCK
    more after the last one; ray k is ``raw[:, order[k]]`` in double precision. Distances are in
    radii of the emitter, and too small by less than ``around.margins[1]``; inf for none.
    """
    # Fill the last block with copies, so that none runs short.
    for k in range(n, -(-n // BLOCK) * BLOCK):
        for row in range(6):
            rays[row, k] = rays[row, n - 1]
    table, cones, exact = around.table, around.cones, around.exact
    pool, list_, meets = room.pool, room.list, room.meets
    picked, number = room.picked, room.number
    best, second, graze, who = room.best, room.second, room.graze, room.who
    widened, slack = np.float32(around.margins[0]), np.float32(around.margins[1])
    radius = around.margins[2]
    for group in range(0, n, GROUP):
        end = min(group + GROUP, n)
        size = _choose(found, _cone(rays, group, end - group), cones, meets, picked)
        for c in range(size):
            p = picked[c]
            number[c] = p
            for row in range(5):
                pool[row, c] = cones[row, p]
        for base in range(group, end, BLOCK):
            chosen = _choose(size, _cone(rays, base, BLOCK), pool, meets, list_)
            for c in range(chosen):
                list_[c] = number[list_[c]]
            _meet(list_, chosen, table, slack, rays, base, best, second, graze, who)
            for k in range(min(BLOCK, n - base)):
                distance[base + k] = best[k]
                index[base + k] = who[k]
                if best[k] < _INF and (
                    second[k] < best[k] + slack or graze[k] < 2 * widened or best[k] < slack
                ):
                    p, t = _met_exactly(list_, chosen, exact, radius, raw, order[base + k])
                    distance[base + k] = t / radius
                    index[base + k] = p
