"""Compiled forces between particles: one block of particles at a time, contacts in batches."""

import math

import numpy as np
from numba import njit

from greybed.dem import _columns as col
from greybed.dem._batch import pair_extras, pair_geometry, room, solve
from greybed.dem._cohesion import attraction, bridge, neck

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
    filled = np.int64(0)
    count[0], count[1], count[2] = 0.0, 0.0, -1.0
    columns = history.shape[1]
    for i in range(begin, end):
        x, y, z, r = at[4 * i], at[4 * i + 1], at[4 * i + 2], at[4 * i + 3]
        for k in range(first[i], first[i + 1]):
            j = np.int64(partner[np.uint64(k)])
            dx, dy, dz = (
                x - at[np.uint64(4 * j)],
                y - at[np.uint64(4 * j + 1)],
                z - at[np.uint64(4 * j + 2)],
            )
            if periodic:
                code = np.int64(shift[np.uint64(k)])
                dx -= (code // 9 - 1) * edge[0]
                dy -= (code // 3 % 3 - 1) * edge[1]
                dz -= (code % 3 - 1) * edge[2]
            both = r + at[np.uint64(4 * j + 3)]
            square = dx * dx + dy * dy + dz * dz
            hit = square < both * both
            gap = 0.0
            if cohesion >= col.JKR and not hit and touch[k] != col.APART:
                # A neck, of solid or liquid, holds on where the surfaces no longer touch.
                gap = math.sqrt(square) - both
                if cohesion == col.JKR:
                    r_eff = r * at[4 * j + 3] / both
                    hit = gap < neck(r_eff, table, row[kind[i], kind[j]])
            # Written whether they touch or not: whether they do is a guess that costs more.
            c = np.uint64(filled)
            who[c], who[c + np.uint64(col.SIZE)], who[c + np.uint64(2 * col.SIZE)] = i, j, k
            flat[np.uint64(col.NX * col.SIZE) + c] = dx
            flat[np.uint64(col.NY * col.SIZE) + c] = dy
            flat[np.uint64(col.NZ * col.SIZE) + c] = dz
            filled += hit
            now = np.uint8(hit)
            if gap > 0.0 and cohesion == col.LIQUID:
                within = gap < table[row[kind[i], kind[j]], col.REACH]
                now = np.uint8(col.BRIDGE if within else col.APART)
            if touch[np.uint64(k)] != now:
                touch[k] = now
                if not hit:
                    for m in range(columns):
                        history[k, m] = 0.0
                    if slot[k] >= 0:
                        for m in range(6):
                            crossing[slot[k], m] = 0.0
            if (cohesion == col.VAN_DER_WAALS and not hit) or now == col.BRIDGE:
                _attract(i, j, k, dx, dy, dz, square, r, at[4 * j + 3], table,
                         row[kind[i], kind[j]], load, slot, crossing, cohesion)  # fmt: skip
            if filled == col.SIZE:
                _settle(work, who, filled, place, motion, load, kind, history, slot, crossing, row,
                        table, dt, normal, rolling, cohesion, limit, count)  # fmt: skip
                filled = np.int64(0)
    if filled:
        _settle(work, who, filled, place, motion, load, kind, history, slot, crossing, row, table,
                dt, normal, rolling, cohesion, limit, count)  # fmt: skip


@njit(**_OPTIONS)
def _attract(i, j, k, dx, dy, dz, square, ri, rj, table, p, load, slot, crossing, cohesion):
    """Attraction across a gap."""
    distance = math.sqrt(square)
    gap, r_eff = distance - ri - rj, ri * rj / (ri + rj)
    if cohesion == col.LIQUID:
        pull = bridge(gap, r_eff, table, p) / distance
    else:
        pull = attraction(gap, r_eff, table, p) / distance
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
    if cohesion == col.SJKR or rolling == col.EPSD:
        pair_extras(work, n)
    solve(work, n, dt, normal, rolling, cohesion, limit)
    _carry_out(
        work.reshape(-1), who, n, load.reshape(-1), history.reshape(-1), history.shape[1], slot,
        crossing.reshape(-1), rolling != col.NO_ROLLING,
    )  # fmt: skip
    count[0] += n
    overlap, ri, rj, deepest = work[col.OVERLAP], work[col.RI], work[col.RJ], count[1]
    for c in range(n):
        least = min(ri[c], rj[c])
        if overlap[c] > deepest * least:
            deepest = overlap[c] / least
            count[1], count[2] = deepest, who[2 * col.SIZE + c]


@njit(**_OPTIONS)
def _bring_in(work, who, n, place, motion, kind, history, columns, row, table):
    one = table.shape[0] == 1
    for c in range(n):
        i, j, k = who[c], who[c + col.SIZE], who[c + 2 * col.SIZE]
        a, b, h = np.uint64(8 * i), np.uint64(8 * j), np.uint64(columns * k)
        c = np.uint64(c)
        work[np.uint64(col.RI * col.SIZE) + c] = place[np.uint64(4 * i + 3)]
        work[np.uint64(col.RJ * col.SIZE) + c] = place[np.uint64(4 * j + 3)]
        work[np.uint64(col.UX * col.SIZE) + c] = motion[a] - motion[b]
        work[np.uint64(col.UY * col.SIZE) + c] = motion[a + np.uint64(1)] - motion[b + np.uint64(1)]
        work[np.uint64(col.UZ * col.SIZE) + c] = motion[a + np.uint64(2)] - motion[b + np.uint64(2)]
        work[np.uint64(col.IX * col.SIZE) + c] = motion[a + np.uint64(3)]
        work[np.uint64(col.IY * col.SIZE) + c] = motion[a + np.uint64(4)]
        work[np.uint64(col.IZ * col.SIZE) + c] = motion[a + np.uint64(5)]
        work[np.uint64(col.MI * col.SIZE) + c] = motion[a + np.uint64(6)]
        work[np.uint64(col.JX * col.SIZE) + c] = motion[b + np.uint64(3)]
        work[np.uint64(col.JY * col.SIZE) + c] = motion[b + np.uint64(4)]
        work[np.uint64(col.JZ * col.SIZE) + c] = motion[b + np.uint64(5)]
        work[np.uint64(col.MJ * col.SIZE) + c] = motion[b + np.uint64(6)]
        work[np.uint64(col.SX * col.SIZE) + c] = history[h]
        work[np.uint64(col.SY * col.SIZE) + c] = history[h + np.uint64(1)]
        work[np.uint64(col.SZ * col.SIZE) + c] = history[h + np.uint64(2)]
        if columns > col.TWIST:
            work[np.uint64(col.TX * col.SIZE) + c] = history[h + np.uint64(3)]
            work[np.uint64(col.TY * col.SIZE) + c] = history[h + np.uint64(4)]
            work[np.uint64(col.TZ * col.SIZE) + c] = history[h + np.uint64(5)]
        if columns > col.PLASTIC:
            work[np.uint64(col.DEEP * col.SIZE) + c] = history[h + np.uint64(6)]
        if not one:
            p = row[kind[i], kind[j]]
            for column in range(col.COLUMNS):
                work[np.uint64(column * col.SIZE) + c] = table[p, column]


@njit(**_OPTIONS)
def _carry_out(work, who, n, load, history, columns, slot, crossing, rolls):
    for c in range(n):
        i, j, k = who[c], who[c + col.SIZE], who[c + 2 * col.SIZE]
        h = np.uint64(columns * k)
        ahead = slot[np.uint64(k)]
        c = np.uint64(c)
        history[h] = work[np.uint64(col.SX * col.SIZE) + c]
        history[h + np.uint64(1)] = work[np.uint64(col.SY * col.SIZE) + c]
        history[h + np.uint64(2)] = work[np.uint64(col.SZ * col.SIZE) + c]
        if columns > col.TWIST:
            history[h + np.uint64(3)] = work[np.uint64(col.TX * col.SIZE) + c]
            history[h + np.uint64(4)] = work[np.uint64(col.TY * col.SIZE) + c]
            history[h + np.uint64(5)] = work[np.uint64(col.TZ * col.SIZE) + c]
        if columns > col.PLASTIC:
            history[h + np.uint64(6)] = work[np.uint64(col.DEEP * col.SIZE) + c]
        fx, fy, fz = (
            work[np.uint64(col.FX * col.SIZE) + c],
            work[np.uint64(col.FY * col.SIZE) + c],
            work[np.uint64(col.FZ * col.SIZE) + c],
        )
        bx, by, bz = (
            work[np.uint64(col.BX * col.SIZE) + c],
            work[np.uint64(col.BY * col.SIZE) + c],
            work[np.uint64(col.BZ * col.SIZE) + c],
        )
        tx, ty, tz = 0.0, 0.0, 0.0
        if rolls:
            tx, ty, tz = (
                work[np.uint64(col.RX * col.SIZE) + c],
                work[np.uint64(col.RY * col.SIZE) + c],
                work[np.uint64(col.RZ * col.SIZE) + c],
            )
        a, b = work[np.uint64(col.ARM_I * col.SIZE) + c], work[np.uint64(col.ARM_J * col.SIZE) + c]
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
