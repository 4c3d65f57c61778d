"""Compiled kernels of the packing generator: neighbour lists, FIRE relaxation, Monte-Carlo sweeps.

Every kernel runs on one thread, so the same start gives the same bits on any number of cores.
Lengths are in units of the caller's choice. ``x`` (n, 3) are centres in a box from 0 to
``lengths``; ``r`` (n,) are radii in falling order; ``periodic`` (3,) says which directions repeat,
the others end at plane walls; ``cylinder`` > 0 adds a cylindrical wall of that radius whose axis
runs along z through the middle of the box.
"""

import math

import numpy as np

from greybed.core.jit import njit

RUNNING, DONE, JAMMED = 0, 1, 2


@njit(cache=True, nogil=True, error_model="numpy")
def _cells(x, lengths, width):
    """Sort spheres into cells: counts per axis, cell of each sphere, first slot, members."""
    n = len(x)
    count = np.empty(3, np.int64)
    for a in range(3):
        count[a] = max(1, int(lengths[a] / width))
    cell = np.empty((n, 3), np.int64)
    first = np.zeros(count[0] * count[1] * count[2] + 1, np.int64)
    flat = np.empty(n, np.int64)
    for i in range(n):
        for a in range(3):
            # Clipping keeps a sphere that strays past a wall in the outermost cell.
            cell[i, a] = min(max(math.floor(x[i, a] / lengths[a] * count[a]), 0), count[a] - 1)
        flat[i] = (cell[i, 0] * count[1] + cell[i, 1]) * count[2] + cell[i, 2]
        first[flat[i] + 1] += 1
    for c in range(1, len(first)):
        first[c] += first[c - 1]
    slot = first[:-1].copy()
    members = np.empty(n, np.int64)
    for i in range(n):
        members[slot[flat[i]]] = i
        slot[flat[i]] += 1
    return count, first, members


@njit(cache=True, nogil=True, error_model="numpy")
def wrap(x, lengths, periodic):
    """Move centres back into the box along periodic directions, in place."""
    for i in range(len(x)):
        for a in range(3):
            if periodic[a]:
                x[i, a] -= lengths[a] * math.floor(x[i, a] / lengths[a])


@njit(cache=True, nogil=True, error_model="numpy")
def neighbour_list(x, r, lengths, periodic, skin):
    """Pairs whose surfaces are closer than ``skin``, as (start (n+1,), partner (m,)), j > i.

    Each sphere looks only for smaller ones (radii fall with the index), within its own diameter:
    small spheres never search as far as the largest diameter, so wide size distributions stay
    cheap. Centres must be wrapped.
    """
    n = len(x)
    volume = lengths[0] * lengths[1] * lengths[2]
    # Cells of the mean diameter, but never many more cells than spheres.
    width = max(2.0 * r.mean() + skin, (volume / (4.0 * n + 64.0)) ** (1.0 / 3.0))
    count, first, members = _cells(x, lengths, width)
    start = np.empty(n + 1, np.int64)
    partner = np.empty(16 * n + 64, np.int32)
    low = np.empty(3, np.int64)
    high = np.empty(3, np.int64)
    half = 0.5 * lengths
    m = 0
    for i in range(n):
        start[i] = m
        reach = 2.0 * r[i] + skin
        for a in range(3):
            scale = count[a] / lengths[a]
            low[a] = math.floor((x[i, a] - reach) * scale)
            high[a] = math.floor((x[i, a] + reach) * scale)
            if not periodic[a]:
                low[a] = min(max(low[a], 0), count[a] - 1)
                high[a] = min(max(high[a], 0), count[a] - 1)
            elif high[a] - low[a] + 1 >= count[a]:
                low[a], high[a] = 0, count[a] - 1
        for cx in range(low[0], high[0] + 1):
            for cy in range(low[1], high[1] + 1):
                row = ((cx % count[0]) * count[1] + cy % count[1]) * count[2]
                for cz in range(low[2], high[2] + 1):
                    c = row + cz % count[2]
                    for k in range(first[c], first[c + 1]):
                        j = members[k]
                        if j <= i:
                            continue
                        d2 = 0.0
                        for a in range(3):
                            d = abs(x[j, a] - x[i, a])
                            if periodic[a] and d > half[a]:
                                d = lengths[a] - d
                            d2 += d * d
                        if d2 < (r[i] + r[j] + skin) ** 2:
                            if m == len(partner):
                                grown = np.empty(2 * m, np.int32)
                                grown[:m] = partner
                                partner = grown
                            partner[m] = j
                            m += 1
    start[n] = m
    return start, partner[:m].copy()


@njit(cache=True, nogil=True, error_model="numpy")
def both_sides(start, partner):
    """List of all neighbours of each sphere from the list of its smaller ones."""
    n = len(start) - 1
    first = np.zeros(n + 1, np.int64)
    for i in range(n):
        first[i + 1] += start[i + 1] - start[i]
        for k in range(start[i], start[i + 1]):
            first[partner[k] + 1] += 1
    for i in range(n):
        first[i + 1] += first[i]
    slot = first[:-1].copy()
    members = np.empty(2 * len(partner), np.int32)
    for i in range(n):
        for k in range(start[i], start[i + 1]):
            j = partner[k]
            members[slot[i]] = j
            members[slot[j]] = i
            slot[i] += 1
            slot[j] += 1
    return first, members


@njit(cache=True, nogil=True, error_model="numpy")
def _forces_into(x, r, lengths, periodic, cylinder, start, partner, force):
    """Fill ``force`` with harmonic repulsion (unit stiffness).

    Returns the deepest overlap relative to the contact distance, the sum of all depths squared,
    and the mean relative depth of the overlapping pairs.
    """
    n = len(x)
    force[:] = 0.0
    worst, squares, total, touching = 0.0, 0.0, 0.0, 0
    lx, ly, lz = lengths[0], lengths[1], lengths[2]
    px, py, pz = periodic[0], periodic[1], periodic[2]
    for i in range(n):
        xi, yi, zi, ri = x[i, 0], x[i, 1], x[i, 2], r[i]
        fx, fy, fz = 0.0, 0.0, 0.0
        for k in range(start[i], start[i + 1]):
            j = partner[k]
            contact = ri + r[j]
            # Centres were wrapped when the list was made: one image step is enough.
            dx, dy, dz = x[j, 0] - xi, x[j, 1] - yi, x[j, 2] - zi
            if px:
                if dx > 0.5 * lx:
                    dx -= lx
                elif dx < -0.5 * lx:
                    dx += lx
            if py:
                if dy > 0.5 * ly:
                    dy -= ly
                elif dy < -0.5 * ly:
                    dy += ly
            if pz:
                if dz > 0.5 * lz:
                    dz -= lz
                elif dz < -0.5 * lz:
                    dz += lz
            d2 = dx * dx + dy * dy + dz * dz
            if d2 >= contact * contact:
                continue
            d = math.sqrt(d2)
            depth = contact - d
            squares += depth * depth
            total += depth / contact
            touching += 1
            worst = max(worst, depth / contact)
            push = depth / max(d, 1e-12)
            fx -= push * dx
            fy -= push * dy
            fz -= push * dz
            force[j, 0] += push * dx
            force[j, 1] += push * dy
            force[j, 2] += push * dz
        force[i, 0] += fx
        force[i, 1] += fy
        force[i, 2] += fz
        for a in range(3):
            if periodic[a] or (cylinder > 0.0 and a < 2):
                continue
            below, above = ri - x[i, a], x[i, a] + ri - lengths[a]
            if below > 0.0:
                force[i, a] += below
                squares += below * below
                worst = max(worst, below / ri)
            if above > 0.0:
                force[i, a] -= above
                squares += above * above
                worst = max(worst, above / ri)
        if cylinder > 0.0:
            ax, ay = xi - 0.5 * lx, yi - 0.5 * ly
            distance = math.sqrt(ax * ax + ay * ay)
            depth = distance + ri - cylinder
            if depth > 0.0:
                squares += depth * depth
                worst = max(worst, depth / ri)
                force[i, 0] -= depth * ax / max(distance, 1e-12)
                force[i, 1] -= depth * ay / max(distance, 1e-12)
    return worst, squares, total / max(touching, 1)


@njit(cache=True, nogil=True, error_model="numpy")
def relax(x, v, r, lengths, periodic, cylinder, tolerance, still, step_limit, fire, steps):
    """Run up to ``steps`` FIRE steps on ``x`` and ``v``; ``fire`` = [time step, mixing, streak].

    Stops as DONE when no overlap exceeds ``tolerance`` of the contact distance, as JAMMED when
    the net forces have fallen below ``still`` of the contact forces while overlaps remain.
    Returns (status, deepest relative overlap, mean relative overlap).
    """
    n = len(x)
    skin = 0.3 * r.mean()
    # A large sphere has contacts in proportion to its surface: so must grow its mass.
    mass = np.maximum((r / r.mean()) ** 2, 1.0)
    force = np.empty((n, 3))
    moved = 0.0
    wrap(x, lengths, periodic)
    start, partner = neighbour_list(x, r, lengths, periodic, skin)
    worst, mean = 0.0, 0.0
    for _ in range(steps):
        worst, squares, mean = _forces_into(
            x, r, lengths, periodic, cylinder, start, partner, force
        )
        if worst <= tolerance:
            return DONE, worst, mean
        net = 0.0
        power, speed2, pull2 = 0.0, 0.0, 0.0
        for i in range(n):
            for a in range(3):
                net += force[i, a] * force[i, a]
                power += force[i, a] * v[i, a]
                speed2 += mass[i] * v[i, a] * v[i, a]
                pull2 += force[i, a] * force[i, a] / mass[i]
        if net <= still * still * squares:
            return JAMMED, worst, mean
        if power > 0.0:
            fire[2] += 1.0
            mix, turn = fire[1], fire[1] * math.sqrt(speed2 / pull2)
            if fire[2] > 5.0:
                fire[0] = min(1.1 * fire[0], step_limit)
                fire[1] *= 0.99
        else:
            mix, turn = 1.0, 0.0
            fire[0], fire[1], fire[2] = max(0.5 * fire[0], 0.02 * step_limit), 0.1, 0.0
        dt = fire[0]
        largest = 0.0
        for i in range(n):
            step2 = 0.0
            for a in range(3):
                pull = force[i, a] / mass[i]
                v[i, a] = (1.0 - mix) * v[i, a] + turn * pull + dt * pull
                step2 += v[i, a] * v[i, a]
            largest = max(largest, step2)
            for a in range(3):
                x[i, a] += dt * v[i, a]
        moved += dt * math.sqrt(largest)
        # Two spheres may have approached by twice the sum of the largest steps.
        if 2.0 * moved > skin:
            wrap(x, lengths, periodic)
            start, partner = neighbour_list(x, r, lengths, periodic, skin)
            moved = 0.0
    return RUNNING, worst, mean


@njit(cache=True, nogil=True, error_model="numpy")
def sweep(x, r, lengths, periodic, cylinder, first, members, step, uniforms):
    """One hard-sphere Monte-Carlo sweep over ``x``: a trial move of up to ``step`` per sphere.

    ``uniforms`` (n, 3) are random numbers in [0, 1). Returns the number of accepted moves.
    """
    accepted = 0
    trial = np.empty(3)
    for i in range(len(x)):
        free = True
        for a in range(3):
            trial[a] = x[i, a] + step * (2.0 * uniforms[i, a] - 1.0)
            walled = not periodic[a] and (cylinder <= 0.0 or a == 2)
            if walled and (trial[a] < r[i] or trial[a] > lengths[a] - r[i]):
                free = False
        if free and cylinder > 0.0:
            ax, ay = trial[0] - 0.5 * lengths[0], trial[1] - 0.5 * lengths[1]
            room = cylinder - r[i]
            free = ax * ax + ay * ay <= room * room
        if not free:
            continue
        for k in range(first[i], first[i + 1]):
            j = members[k]
            d2 = 0.0
            for a in range(3):
                d = abs(x[j, a] - trial[a])
                if periodic[a] and d > 0.5 * lengths[a]:
                    d = lengths[a] - d
                d2 += d * d
            if d2 < (r[i] + r[j]) ** 2:
                free = False
                break
        if free:
            accepted += 1
            for a in range(3):
                x[i, a] = trial[a]
    return accepted
