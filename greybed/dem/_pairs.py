"""Compiled forces between particles: one block of particles at a time, contacts in batches."""

import math

import numpy as np

from greybed.core.jit import njit
from greybed.dem import _columns as col
from greybed.dem._batch import pair_extras, pair_geometry, solve
from greybed.dem._cohesion import attraction, bridge, neck
from greybed.dem._prefetch import prefetch

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}


@njit(**_OPTIONS)
def block_forces(
    begin, end, place, motion, load, kind, first, owner, partner, shift, touch, history, slot,
    crossing, edge, periodic, row, table, dt, normal, rolling, cohesion, limit, look, deepest,
    work,
):  # fmt: skip
    """Forces of the pairs that particles ``begin`` to ``end - 1`` own.

    Adds to ``load`` inside the block; what acts on particles of later blocks goes to ``crossing``,
    so that blocks may run at once and every sum has one order. With ``look``, ``deepest`` takes the
    deepest overlap over the smaller radius and a pair with it.
    """
    who = np.empty(col.SIZE, np.int64)
    # Once, flat: numba multiplies by strides at each access of two indices.
    flat, place, motion, pull = work.reshape(-1), place.reshape(-1), motion.reshape(-1), load
    load, springs, columns = load.reshape(-1), history.reshape(-1), history.shape[1]
    across = crossing.reshape(-1)
    if look:
        deepest[0], deepest[1] = 0.0, -1.0
    plain = not periodic and cohesion < col.JKR and cohesion != col.VAN_DER_WAALS
    k, last = np.int64(first[begin]), np.int64(first[end])
    while k < last:
        if plain:
            k, n = _next_touching(
                k, last, place, motion, load, owner, partner, touch, history, slot, crossing, flat,
                who,
            )  # fmt: skip
        else:
            k, n = _next_acting(
                k, last, place, pull, kind, owner, partner, shift, touch, history, slot, crossing,
                edge, periodic, row, table, cohesion, flat, who,
            )  # fmt: skip
        if n == 0:
            continue
        _bring_in(flat, who, n, place, motion, kind, owner, partner, springs, columns, row, table)
        pair_geometry(work, n)
        if cohesion == col.SJKR or rolling == col.EPSD:
            pair_extras(work, n)
        solve(work, n, dt, normal, rolling, cohesion, limit)
        _carry_out(
            flat, who, n, owner, partner, load, springs, columns, slot, across,
            rolling != col.NO_ROLLING,
        )  # fmt: skip
        if look:
            _look(flat, who, n, deepest)


@njit(**_OPTIONS)
def _next_touching(
    k, last, place, motion, load, owner, partner, touch, history, slot, crossing, work, who
):  # fmt: skip
    """The next batch of touching spheres: where to go on, and how many there are.

    One loop over pairs, not one for each particle: that would end at odd times, and each end is a
    guess that goes wrong.
    """
    filled = np.uint64(0)
    while k < last and filled < np.uint64(col.SIZE):
        a, b = np.uint64(4 * np.int64(owner[k])), np.uint64(4 * np.int64(partner[k]))
        dx = place[a] - place[b]
        dy = place[a + np.uint64(1)] - place[b + np.uint64(1)]
        dz = place[a + np.uint64(2)] - place[b + np.uint64(2)]
        both = place[a + np.uint64(3)] + place[b + np.uint64(3)]
        hit = dx * dx + dy * dy + dz * dz < both * both
        # The batch needs these rows soon. Those of the owner are there already.
        prefetch(motion, b + b)
        prefetch(load, b + b)
        # Written whether they touch or not: whether they do is a guess that costs more.
        who[filled] = k
        work[np.uint64(col.NX * col.SIZE) + filled] = dx
        work[np.uint64(col.NY * col.SIZE) + filled] = dy
        work[np.uint64(col.NZ * col.SIZE) + filled] = dz
        if touch[np.uint64(k)] != hit:
            _change(k, np.uint8(hit), hit, touch, history, slot, crossing)
        filled += np.uint64(hit)
        k += 1
    return k, np.int64(filled)


@njit(**_OPTIONS)
def _next_acting(
    k, last, place, load, kind, owner, partner, shift, touch, history, slot, crossing, edge,
    periodic, row, table, cohesion, work, who,
):  # fmt: skip
    """The same across periodic faces, and with attraction across gaps, which it sees to itself."""
    filled = np.uint64(0)
    while k < last and filled < np.uint64(col.SIZE):
        i, j = np.int64(owner[k]), np.int64(partner[k])
        a, b = np.uint64(4 * i), np.uint64(4 * j)
        dx = place[a] - place[b]
        dy = place[a + np.uint64(1)] - place[b + np.uint64(1)]
        dz = place[a + np.uint64(2)] - place[b + np.uint64(2)]
        if periodic:
            code = np.int64(shift[k])
            dx -= (code // 9 - 1) * edge[0]
            dy -= (code // 3 % 3 - 1) * edge[1]
            dz -= (code % 3 - 1) * edge[2]
        ri, rj = place[a + np.uint64(3)], place[b + np.uint64(3)]
        both = ri + rj
        square = dx * dx + dy * dy + dz * dz
        hit = square < both * both
        gap = 0.0
        if cohesion >= col.JKR and not hit and touch[k] != col.APART:
            # A neck, of solid or liquid, holds on where the surfaces no longer touch.
            gap = math.sqrt(square) - both
            if cohesion == col.JKR:
                hit = gap < neck(ri * rj / both, table, row[kind[i], kind[j]])
        who[filled] = k
        work[np.uint64(col.NX * col.SIZE) + filled] = dx
        work[np.uint64(col.NY * col.SIZE) + filled] = dy
        work[np.uint64(col.NZ * col.SIZE) + filled] = dz
        filled += np.uint64(hit)
        now = np.uint8(hit)
        if gap > 0.0 and cohesion == col.LIQUID:
            within = gap < table[row[kind[i], kind[j]], col.REACH]
            now = np.uint8(col.BRIDGE if within else col.APART)
        if touch[k] != now:
            _change(k, now, hit, touch, history, slot, crossing)
        if (cohesion == col.VAN_DER_WAALS and not hit) or now == col.BRIDGE:
            _attract(i, j, k, dx, dy, dz, square, ri, rj, table, row[kind[i], kind[j]],
                     load, slot, crossing, cohesion)  # fmt: skip
        k += 1
    return k, np.int64(filled)


@njit(**_OPTIONS)
def _change(k, now, hit, touch, history, slot, crossing):
    """A contact that begins, or ends and is forgotten."""
    touch[k] = now
    if not hit:
        for m in range(history.shape[1]):
            history[k, m] = 0.0
        if slot[k] >= 0:
            for m in range(6):
                crossing[slot[k], m] = 0.0


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
def _look(work, who, n, deepest):
    """The deepest overlap so far, and whose it is."""
    for c in range(n):
        least = min(work[col.RI * col.SIZE + c], work[col.RJ * col.SIZE + c])
        overlap = work[col.OVERLAP * col.SIZE + c]
        if overlap > deepest[0] * least:
            deepest[0], deepest[1] = overlap / least, who[c]


@njit(**_OPTIONS)
def _bring_in(work, who, n, place, motion, kind, owner, partner, history, columns, row, table):
    one = table.shape[0] == 1
    for c in range(n):
        k = np.uint64(who[c])
        i, j = np.int64(owner[k]), np.int64(partner[k])
        a, b, h = np.uint64(8 * i), np.uint64(8 * j), np.uint64(columns) * k
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
def _carry_out(work, who, n, owner, partner, load, history, columns, slot, crossing, rolls):
    for c in range(n):
        k = np.uint64(who[c])
        i, j = np.int64(owner[k]), np.int64(partner[k])
        h = np.uint64(columns) * k
        ahead = slot[k]
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
