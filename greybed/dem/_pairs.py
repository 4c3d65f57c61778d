"""Compiled forces between particles: one block of particles at a time, contacts in batches."""

import math

import numpy as np
from numba import njit

from greybed.dem._batch import (
    ARM_I, ARM_J, BX, BY, BZ, COLUMNS, DEEP, EPSD, FX, FY, FZ, IX, IY, IZ, JX, JY, JZ, MI, MJ,
    NO_ROLLING, NX, NY, NZ, OVERLAP, PLASTIC, RI, RJ, RX, RY, RZ, SIZE, SJKR, SX, SY, SZ, TWIST,
    TX, TY, TZ, UX, UY, UZ, VAN_DER_WAALS, attraction, pair_extras, pair_geometry, room, solve,
)  # fmt: skip

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}


@njit(**_OPTIONS)
def block_forces(
    begin, end, place, motion, load, kind, first, partner, shift, touch, history, slot, crossing,
    edge, periodic, row, table, dt, normal, rolling, cohesion, limit, count,
):  # fmt: skip
    """Forces of the pairs that particles ``begin`` to ``end - 1`` own.

    Adds to ``load`` inside the block; what acts on particles of later blocks goes to ``crossing``,
    so that blocks may run at once and every sum has one order. ``count[0]`` adds up contacts,
    ``count[1]`` is the deepest overlap over the smaller radius, ``count[2]`` a pair with it.
    """
    work, who = room(table)
    # Flat: a row's begin is then a constant, while numba multiplies by strides at each access.
    flat, at = work.reshape(-1), place.reshape(-1)
    filled = 0
    count[0], count[1], count[2] = 0.0, 0.0, -1.0
    columns = history.shape[1]
    for i in range(begin, end):
        x, y, z, r = at[4 * i], at[4 * i + 1], at[4 * i + 2], at[4 * i + 3]
        for k in range(first[i], first[i + 1]):
            j = np.int64(partner[np.uint64(k)])
            dx, dy, dz = x - at[np.uint64(4 * j)], y - at[np.uint64(4 * j + 1)], z - at[np.uint64(4 * j + 2)]
            if periodic:
                code = np.int64(shift[np.uint64(k)])
                dx -= (code // 9 - 1) * edge[0]
                dy -= (code // 3 % 3 - 1) * edge[1]
                dz -= (code % 3 - 1) * edge[2]
            both = r + at[np.uint64(4 * j + 3)]
            square = dx * dx + dy * dy + dz * dz
            hit = square < both * both
            # Written whether they touch or not: whether they do is a guess that costs more.
            c = np.uint64(filled)
            who[c], who[c + np.uint64(SIZE)], who[c + np.uint64(2 * SIZE)] = i, j, k
            flat[np.uint64(NX * SIZE) + c] = dx
            flat[np.uint64(NY * SIZE) + c] = dy
            flat[np.uint64(NZ * SIZE) + c] = dz
            filled += hit
            if touch[np.uint64(k)] != hit:
                touch[k] = hit
                if not hit:
                    for m in range(columns):
                        history[k, m] = 0.0
                    if slot[k] >= 0:
                        for m in range(6):
                            crossing[slot[k], m] = 0.0
            if cohesion == VAN_DER_WAALS and not hit:
                _attract(i, j, k, dx, dy, dz, square, r, at[4 * j + 3], table,
                         row[kind[i], kind[j]], load, slot, crossing)  # fmt: skip
            if filled == SIZE:
                _settle(work, who, filled, place, motion, load, kind, history, slot, crossing, row,
                        table, dt, normal, rolling, cohesion, limit, count)  # fmt: skip
                filled = 0
    if filled:
        _settle(work, who, filled, place, motion, load, kind, history, slot, crossing, row, table,
                dt, normal, rolling, cohesion, limit, count)  # fmt: skip


@njit(**_OPTIONS)
def _attract(i, j, k, dx, dy, dz, square, ri, rj, table, p, load, slot, crossing):
    """Attraction across a gap."""
    distance = math.sqrt(square)
    pull = attraction(distance - ri - rj, ri * rj / (ri + rj), table, p) / distance
    fx, fy, fz = pull * dx, pull * dy, pull * dz
    load[i, 0] -= fx
    load[i, 1] -= fy
    load[i, 2] -= fz
    if slot[k] >= 0:
        crossing[slot[k], 0], crossing[slot[k], 1], crossing[slot[k], 2] = fx, fy, fz
    else:
        load[j, 0] += fx
        load[j, 1] += fy
        load[j, 2] += fz


@njit(**_OPTIONS)
def _settle(
    work, who, n, place, motion, load, kind, history, slot, crossing, row, table, dt,
    normal, rolling, cohesion, limit, count,
):  # fmt: skip
    """Forces of a batch: what the laws need is brought in, and what they say carried out."""
    _bring_in(
        work.reshape(-1), who, n, place.reshape(-1), motion.reshape(-1), kind,
        history.reshape(-1), history.shape[1], row, table,
    )  # fmt: skip
    pair_geometry(work, n)
    if cohesion == SJKR or rolling == EPSD:
        pair_extras(work, n)
    solve(work, n, dt, normal, rolling, cohesion, limit)
    _carry_out(
        work.reshape(-1), who, n, load.reshape(-1), history.reshape(-1), history.shape[1], slot,
        crossing.reshape(-1), rolling != NO_ROLLING,
    )  # fmt: skip
    count[0] += n
    for c in range(n):
        deep = work[OVERLAP, c] / min(work[RI, c], work[RJ, c])
        if deep > count[1]:
            count[1], count[2] = deep, who[2 * SIZE + c]


@njit(**_OPTIONS)
def _bring_in(work, who, n, place, motion, kind, history, columns, row, table):
    one = table.shape[0] == 1
    for c in range(n):
        i, j, k = who[c], who[c + SIZE], who[c + 2 * SIZE]
        a, b, h = np.uint64(8 * i), np.uint64(8 * j), np.uint64(columns * k)
        c = np.uint64(c)
        work[np.uint64(RI * SIZE) + c] = place[np.uint64(4 * i + 3)]
        work[np.uint64(RJ * SIZE) + c] = place[np.uint64(4 * j + 3)]
        work[np.uint64(UX * SIZE) + c] = motion[a] - motion[b]
        work[np.uint64(UY * SIZE) + c] = motion[a + np.uint64(1)] - motion[b + np.uint64(1)]
        work[np.uint64(UZ * SIZE) + c] = motion[a + np.uint64(2)] - motion[b + np.uint64(2)]
        work[np.uint64(IX * SIZE) + c] = motion[a + np.uint64(3)]
        work[np.uint64(IY * SIZE) + c] = motion[a + np.uint64(4)]
        work[np.uint64(IZ * SIZE) + c] = motion[a + np.uint64(5)]
        work[np.uint64(MI * SIZE) + c] = motion[a + np.uint64(6)]
        work[np.uint64(JX * SIZE) + c] = motion[b + np.uint64(3)]
        work[np.uint64(JY * SIZE) + c] = motion[b + np.uint64(4)]
        work[np.uint64(JZ * SIZE) + c] = motion[b + np.uint64(5)]
        work[np.uint64(MJ * SIZE) + c] = motion[b + np.uint64(6)]
        work[np.uint64(SX * SIZE) + c] = history[h]
        work[np.uint64(SY * SIZE) + c] = history[h + np.uint64(1)]
        work[np.uint64(SZ * SIZE) + c] = history[h + np.uint64(2)]
        if columns > TWIST:
            work[np.uint64(TX * SIZE) + c] = history[h + np.uint64(3)]
            work[np.uint64(TY * SIZE) + c] = history[h + np.uint64(4)]
            work[np.uint64(TZ * SIZE) + c] = history[h + np.uint64(5)]
        if columns > PLASTIC:
            work[np.uint64(DEEP * SIZE) + c] = history[h + np.uint64(6)]
        if not one:
            p = row[kind[i], kind[j]]
            for column in range(COLUMNS):
                work[np.uint64(column * SIZE) + c] = table[p, column]


@njit(**_OPTIONS)
def _carry_out(work, who, n, load, history, columns, slot, crossing, rolls):
    for c in range(n):
        i, j, k = who[c], who[c + SIZE], who[c + 2 * SIZE]
        h = np.uint64(columns * k)
        ahead = slot[np.uint64(k)]
        c = np.uint64(c)
        history[h] = work[np.uint64(SX * SIZE) + c]
        history[h + np.uint64(1)] = work[np.uint64(SY * SIZE) + c]
        history[h + np.uint64(2)] = work[np.uint64(SZ * SIZE) + c]
        if columns > TWIST:
            history[h + np.uint64(3)] = work[np.uint64(TX * SIZE) + c]
            history[h + np.uint64(4)] = work[np.uint64(TY * SIZE) + c]
            history[h + np.uint64(5)] = work[np.uint64(TZ * SIZE) + c]
        if columns > PLASTIC:
            history[h + np.uint64(6)] = work[np.uint64(DEEP * SIZE) + c]
        fx, fy, fz = (
            work[np.uint64(FX * SIZE) + c],
            work[np.uint64(FY * SIZE) + c],
            work[np.uint64(FZ * SIZE) + c],
        )
        bx, by, bz = (
            work[np.uint64(BX * SIZE) + c],
            work[np.uint64(BY * SIZE) + c],
            work[np.uint64(BZ * SIZE) + c],
        )
        tx, ty, tz = 0.0, 0.0, 0.0
        if rolls:
            tx, ty, tz = (
                work[np.uint64(RX * SIZE) + c],
                work[np.uint64(RY * SIZE) + c],
                work[np.uint64(RZ * SIZE) + c],
            )
        a, b = work[np.uint64(ARM_I * SIZE) + c], work[np.uint64(ARM_J * SIZE) + c]
        m = np.uint64(8 * i)
        load[m] += fx
        load[m + np.uint64(1)] += fy
        load[m + np.uint64(2)] += fz
        load[m + np.uint64(3)] -= a * bx + tx
        load[m + np.uint64(4)] -= a * by + ty
        load[m + np.uint64(5)] -= a * bz + tz
        if ahead < 0:
            m = np.uint64(8 * j)
            load[m] -= fx
            load[m + np.uint64(1)] -= fy
            load[m + np.uint64(2)] -= fz
            load[m + np.uint64(3)] += tx - b * bx
            load[m + np.uint64(4)] += ty - b * by
            load[m + np.uint64(5)] += tz - b * bz
        else:
            m = np.uint64(6 * ahead)
            crossing[m] = -fx
            crossing[m + np.uint64(1)] = -fy
            crossing[m + np.uint64(2)] = -fz
            crossing[m + np.uint64(3)] = tx - b * bx
            crossing[m + np.uint64(4)] = ty - b * by
            crossing[m + np.uint64(5)] = tz - b * bz
