"""Compiled walls: how they move, and forces on the particles near them."""

import math

import numpy as np

from greybed.core.jit import njit
from greybed.dem import _columns as col
from greybed.dem._batch import solve
from greybed.dem._cohesion import attraction, bridge, neck
from greybed.dem._surfaces import FACE, PLANE, TRIANGLE, nearest

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}

MOST_AT_ONCE = 8


@njit(**_OPTIONS)
def move(kinds, data, wall, wall_motion, dt):
    """Surfaces moved on by one step: turned about the centre of their wall, and shifted."""
    for s in range(kinds.size):
        m = wall_motion[wall[s]]
        still = True
        for c in range(6):
            still = still and m[c] == 0.0
        if still:
            continue
        _carry(m, dt, data[s, 0:3], True)
        _carry(m, dt, data[s, 10:13], True)
        if kinds[s] == TRIANGLE:
            _carry(m, dt, data[s, 3:6], True)
            _carry(m, dt, data[s, 6:9], True)
        else:
            _carry(m, dt, data[s, 3:6], False)
    for w in range(wall_motion.shape[0]):
        for c in range(3):
            wall_motion[w, 6 + c] += dt * wall_motion[w, c]


@njit(**_OPTIONS)
def _carry(m, dt, vector, point):
    """A point, or a direction, of a moving body, by Rodrigues' formula."""
    rate = math.sqrt(m[3] * m[3] + m[4] * m[4] + m[5] * m[5])
    x, y, z = vector[0], vector[1], vector[2]
    if point:
        x, y, z = x - m[6], y - m[7], z - m[8]
    if rate > 0.0:
        ax, ay, az = m[3] / rate, m[4] / rate, m[5] / rate
        c, s = math.cos(rate * dt), math.sin(rate * dt)
        along = (ax * x + ay * y + az * z) * (1.0 - c)
        x, y, z = (
            x * c + (ay * z - az * y) * s + ax * along,
            y * c + (az * x - ax * z) * s + ay * along,
            z * c + (ax * y - ay * x) * s + az * along,
        )
    if point:
        x, y, z = x + m[6] + dt * m[0], y + m[7] + dt * m[1], z + m[8] + dt * m[2]
    vector[0], vector[1], vector[2] = x, y, z


@njit(**_OPTIONS)
def list_near(place, kinds, data, skin, first, surface):
    """Surfaces nearer than ``skin`` to each particle, as :func:`list_pairs` does for pairs."""
    count = 0
    flat = data.reshape(-1)
    for i in range(place.shape[0]):
        first[i] = count
        x, y, z, r = place[i, 0], place[i, 1], place[i, 2], place[i, 3]
        for s in range(kinds.size):
            if kinds[s] == PLANE:
                b = 13 * s
                distance = (x - flat[b]) * flat[b + 3] + (y - flat[b + 1]) * flat[b + 4]
                distance += (z - flat[b + 2]) * flat[b + 5]
                if distance < r + skin:
                    if count < surface.size:
                        surface[count] = s
                    count += 1
                continue
            # A bounding ball first, for meshes have many triangles.
            bx, by, bz = x - data[s, 10], y - data[s, 11], z - data[s, 12]
            ball = data[s, 9] + r + skin
            if bx * bx + by * by + bz * bz > ball * ball:
                continue
            distance = nearest(kinds[s], data[s], x, y, z)[0]
            if distance < r + skin:
                if count < surface.size:
                    surface[count] = s
                count += 1
    first[place.shape[0]] = count
    return count if count <= surface.size else -count


@njit(**_OPTIONS)
def carry_over_walls(
    order, first, surface, old_first, old_surface, old_touch, old_history, touch, history
):
    """Histories of particle and surface from the old list."""
    for i in range(order.size):
        a = order[i]
        for k in range(first[i], first[i + 1]):
            touch[k] = 0
            for column in range(history.shape[1]):
                history[k, column] = 0.0
            for m in range(old_first[a], old_first[a + 1]):
                if old_surface[m] == surface[k] and old_touch[m]:
                    touch[k] = old_touch[m]
                    for column in range(history.shape[1]):
                        history[k, column] = old_history[m, column]


@njit(**_OPTIONS)
def wall_forces(
    begin, end, place, motion, load, kind, first, surface, touch, history,
    kinds, data, wall, wall_motion, wall_kind, on_wall, row, table, dt,
    normal, rolling, cohesion, limit, work,
):  # fmt: skip
    """Forces of surfaces on particles ``begin`` to ``end - 1``; ``on_wall`` collects the sums.

    A wall is one surface or a mesh of them. Where a particle touches several triangles of a mesh,
    faces count first; a rim counts where it is not part of such a face and not met before.
    """
    who = np.empty(3 * col.SIZE, np.int64)
    one = table.shape[0] == 1
    # Flat: a slice of a row counts references, which takes longer than a plane's distance, and
    # numba multiplies by strides at each access of two indices.
    flat, moves, rows = data.reshape(-1), wall_motion.reshape(-1), work.reshape(-1)
    at, motions, springs = place.reshape(-1), motion.reshape(-1), history.reshape(-1)
    columns = history.shape[1]
    filled = np.int64(0)
    seen = np.empty((MOST_AT_ONCE, 7))
    met = np.empty(MOST_AT_ONCE, np.int64)
    for i in range(begin, end):
        if first[i] == first[i + 1]:
            continue
        q, v = np.uint64(4 * i), np.uint64(8 * i)
        x, y, z, r = at[q], at[q + np.uint64(1)], at[q + np.uint64(2)], at[q + np.uint64(3)]
        mass = motions[v + np.uint64(6)]
        number, turns = 0, 1
        for turn in range(2):
            if turn == turns:
                break
            for k in range(first[i], first[i + 1]):
                s = surface[k]
                if kinds[s] == PLANE:
                    if turn == 1:
                        continue
                    b = 13 * s
                    nx, ny, nz, where = flat[b + 3], flat[b + 4], flat[b + 5], FACE
                    distance = (x - flat[b]) * nx + (y - flat[b + 1]) * ny
                    distance += (z - flat[b + 2]) * nz
                else:
                    turns = 2
                    distance, nx, ny, nz, where = nearest(kinds[s], data[s], x, y, z)
                if (where == FACE) != (turn == 0):
                    continue
                w = wall[s]
                p = row[kind[i], wall_kind[w]]
                overlap = r - distance
                least, now = 0.0, col.APART
                if cohesion == col.JKR and touch[k] == col.TOUCH:
                    least = -neck(r, table, p)
                if overlap <= least:
                    if cohesion == col.LIQUID and touch[k] and -overlap < table[p, col.REACH]:
                        now = col.BRIDGE
                    if touch[k] != now:
                        touch[k] = now
                        forget(history, k)
                    if cohesion == col.VAN_DER_WAALS or now == col.BRIDGE:
                        if now == col.BRIDGE:
                            pull = bridge(-overlap, r, table, p)
                        else:
                            pull = attraction(-overlap, r, table, p)
                        load[i, 0] -= pull * nx
                        load[i, 1] -= pull * ny
                        load[i, 2] -= pull * nz
                        on_wall[w, 0] += pull * nx
                        on_wall[w, 1] += pull * ny
                        on_wall[w, 2] += pull * nz
                    continue
                qx, qy, qz = x - distance * nx, y - distance * ny, z - distance * nz
                if turn == 1 and _part_of(seen, met, number, wall, s, qx, qy, qz, r):
                    if touch[k]:
                        touch[k] = 0
                        forget(history, k)
                    continue
                if touch[k] != col.TOUCH:
                    _take_over(first[i], first[i + 1], k, surface, wall, kinds, data,
                               x, y, z, r, touch, history)  # fmt: skip
                touch[k] = 1
                if number < MOST_AT_ONCE:
                    met[number] = s
                    seen[number, 0], seen[number, 1], seen[number, 2] = qx, qy, qz
                    seen[number, 3], seen[number, 4], seen[number, 5] = nx, ny, nz
                    seen[number, 6] = where
                    number += 1
                m = 9 * w
                c = np.uint64(filled)
                who[c], who[c + np.uint64(col.SIZE)] = i, w
                who[c + np.uint64(2 * col.SIZE)] = k
                rows[np.uint64(col.NX * col.SIZE) + c] = nx
                rows[np.uint64(col.NY * col.SIZE) + c] = ny
                rows[np.uint64(col.NZ * col.SIZE) + c] = nz
                rows[np.uint64(col.OVERLAP * col.SIZE) + c] = overlap
                # Velocity relative to the wall at the contact.
                lx, ly, lz = qx - moves[m + 6], qy - moves[m + 7], qz - moves[m + 8]
                wx, wy, wz = moves[m + 3], moves[m + 4], moves[m + 5]
                ux = motions[v] - (moves[m] + wy * lz - wz * ly)
                uy = motions[v + np.uint64(1)] - (moves[m + 1] + wz * lx - wx * lz)
                uz = motions[v + np.uint64(2)] - (moves[m + 2] + wx * ly - wy * lx)
                rows[np.uint64(col.UX * col.SIZE) + c] = ux
                rows[np.uint64(col.UY * col.SIZE) + c] = uy
                rows[np.uint64(col.UZ * col.SIZE) + c] = uz
                rows[np.uint64(col.IX * col.SIZE) + c] = motions[v + np.uint64(3)]
                rows[np.uint64(col.IY * col.SIZE) + c] = motions[v + np.uint64(4)]
                rows[np.uint64(col.IZ * col.SIZE) + c] = motions[v + np.uint64(5)]
                rows[np.uint64(col.JX * col.SIZE) + c] = wx
                rows[np.uint64(col.JY * col.SIZE) + c] = wy
                rows[np.uint64(col.JZ * col.SIZE) + c] = wz
                rows[np.uint64(col.R_EFF * col.SIZE) + c] = r
                rows[np.uint64(col.M_EFF * col.SIZE) + c] = mass
                rows[np.uint64(col.INERTIA * col.SIZE) + c] = mass * r * r
                rows[np.uint64(col.ARM_I * col.SIZE) + c] = r - 0.5 * overlap
                rows[np.uint64(col.ARM_J * col.SIZE) + c] = 0.0
                rows[np.uint64(col.AREA * col.SIZE) + c] = math.pi * (r * r - distance * distance)
                for column in range(columns):
                    rows[(col.SX + column) * col.SIZE + filled] = springs[columns * k + column]
                if not one:
                    for column in range(col.COLUMNS):
                        rows[column * col.SIZE + filled] = table[p, column]
                filled += 1
                if filled == col.SIZE:
                    solve(work, filled, dt, normal, rolling, cohesion, limit)
                    _carry_out(rows, who, filled, at, load.reshape(-1), springs, columns, moves,
                               rolling, on_wall)  # fmt: skip
                    filled = np.int64(0)
    if filled:
        solve(work, filled, dt, normal, rolling, cohesion, limit)
        _carry_out(rows, who, filled, at, load.reshape(-1), springs, columns, moves, rolling,
                   on_wall)  # fmt: skip


@njit(**_OPTIONS)
def _carry_out(work, who, n, place, load, history, columns, wall_motion, rolling, on_wall):
    """Forces of a batch, on particles and walls."""
    for c in range(n):
        i, w, k = who[c], who[c + col.SIZE], who[c + 2 * col.SIZE]
        for column in range(columns):
            history[columns * k + column] = work[(col.SX + column) * col.SIZE + c]
        p, m, v, c = np.uint64(4 * i), np.uint64(8 * i), np.uint64(9 * w), np.uint64(c)
        fx = work[np.uint64(col.FX * col.SIZE) + c]
        fy = work[np.uint64(col.FY * col.SIZE) + c]
        fz = work[np.uint64(col.FZ * col.SIZE) + c]
        tx, ty, tz = 0.0, 0.0, 0.0
        if rolling != col.NO_ROLLING:
            tx = work[np.uint64(col.RX * col.SIZE) + c]
            ty = work[np.uint64(col.RY * col.SIZE) + c]
            tz = work[np.uint64(col.RZ * col.SIZE) + c]
        arm = work[np.uint64(col.ARM_I * col.SIZE) + c]
        load[m] += fx
        load[m + np.uint64(1)] += fy
        load[m + np.uint64(2)] += fz
        load[m + np.uint64(3)] -= arm * work[np.uint64(col.BX * col.SIZE) + c] + tx
        load[m + np.uint64(4)] -= arm * work[np.uint64(col.BY * col.SIZE) + c] + ty
        load[m + np.uint64(5)] -= arm * work[np.uint64(col.BZ * col.SIZE) + c] + tz
        away = place[p + np.uint64(3)] - work[np.uint64(col.OVERLAP * col.SIZE) + c]
        lx = place[p] - away * work[np.uint64(col.NX * col.SIZE) + c]
        ly = place[p + np.uint64(1)] - away * work[np.uint64(col.NY * col.SIZE) + c]
        lz = place[p + np.uint64(2)] - away * work[np.uint64(col.NZ * col.SIZE) + c]
        lx -= wall_motion[v + np.uint64(6)]
        ly -= wall_motion[v + np.uint64(7)]
        lz -= wall_motion[v + np.uint64(8)]
        on_wall[w, 0] -= fx
        on_wall[w, 1] -= fy
        on_wall[w, 2] -= fz
        on_wall[w, 3] += lz * fy - ly * fz + tx
        on_wall[w, 4] += lx * fz - lz * fx + ty
        on_wall[w, 5] += ly * fx - lx * fy + tz


@njit(**_OPTIONS)
def forget(history, k):
    """Springs of a contact that has ended."""
    for column in range(history.shape[1]):
        history[k, column] = 0.0


@njit(**_OPTIONS)
def _part_of(seen, met, number, wall, s, qx, qy, qz, r):
    """Whether a point on a rim belongs to a surface of the same wall that counted already."""
    for m in range(number):
        if wall[met[m]] != wall[s]:
            continue
        dx, dy, dz = qx - seen[m, 0], qy - seen[m, 1], qz - seen[m, 2]
        if seen[m, 6] == FACE:
            if abs(dx * seen[m, 3] + dy * seen[m, 4] + dz * seen[m, 5]) < 1e-6 * r:
                return True
        elif dx * dx + dy * dy + dz * dz < 1e-12 * r * r:
            return True
    return False


@njit(**_OPTIONS)
def _take_over(low, high, k, surface, wall, kinds, data, x, y, z, r, touch, history):
    """Springs that a particle brings from the triangle it has just left, within one mesh."""
    if kinds[surface[k]] != TRIANGLE:
        return
    for m in range(low, high):
        if m == k or not touch[m] or wall[surface[m]] != wall[surface[k]]:
            continue
        distance, _, _, _, where = nearest(kinds[surface[m]], data[surface[m]], x, y, z)
        if where == FACE and distance < r:
            continue  # still in contact of its own
        for column in range(history.shape[1]):
            history[k, column] = history[m, column]
        touch[m] = 0
        forget(history, m)
        return
