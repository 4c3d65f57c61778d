"""Compiled neighbour search: sorting by place, lists of near pairs, histories carried over."""

import math

import numpy as np

from greybed.core.jit import njit

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}


@njit(**_OPTIONS)
def _spread(number):
    """The low 10 bits of a number, two zeros between them."""
    number &= 0x3FF
    number = (number | (number << 16)) & 0x30000FF
    number = (number | (number << 8)) & 0x300F00F
    number = (number | (number << 4)) & 0x30C30C3
    return (number | (number << 2)) & 0x9249249


@njit(**_OPTIONS)
def cells_of(place, low, inverse, shape, cell):
    """Cell number of each particle; those outside the grid count to its outermost cells."""
    for i in range(place.shape[0]):
        x = min(max(np.int64((place[i, 0] - low[0]) * inverse[0]), 0), shape[0] - 1)
        y = min(max(np.int64((place[i, 1] - low[1]) * inverse[1]), 0), shape[1] - 1)
        z = min(max(np.int64((place[i, 2] - low[2]) * inverse[2]), 0), shape[2] - 1)
        cell[i] = (x * shape[1] + y) * shape[2] + z


@njit(**_OPTIONS)
def morton_keys(cell, shape, key):
    """Numbers of the cells along Morton's curve: what is near in space is near in memory."""
    for i in range(cell.size):
        z = cell[i] % shape[2]
        y = cell[i] // shape[2] % shape[1]
        x = cell[i] // (shape[2] * shape[1])
        key[i] = (_spread(x) << 2) | (_spread(y) << 1) | _spread(z)
        # Beds wider than 1024 cells repeat the curve.
        key[i] |= ((x >> 10) * 1009 + (y >> 10) * 31 + (z >> 10)) << 30


@njit(**_OPTIONS)
def fill_cells(cell, start, member):
    """Particles of each cell, in growing order: ``member[start[c] : start[c + 1]]``."""
    start[:] = 0
    for i in range(cell.size):
        start[cell[i] + 1] += 1
    for c in range(start.size - 1):
        start[c + 1] += start[c]
    at = start[:-1].copy()
    for i in range(cell.size):
        member[at[cell[i]]] = i
        at[cell[i]] += 1


@njit(**_OPTIONS)
def wrap(place, low, edge, periodic):
    """Particles moved back into the box along periodic axes."""
    for i in range(place.shape[0]):
        for axis in range(3):
            if periodic[axis]:
                place[i, axis] -= edge[axis] * math.floor((place[i, axis] - low[axis]) / edge[axis])


@njit(**_OPTIONS)
def list_pairs(
    begin, end, place, body, cell, start, member, shape, periodic, edge, skin, first, partner, shift
):  # fmt: skip
    """Pairs whose surfaces are nearer than ``skin``, each once, by the lower particle.

    Of the lower particles ``begin`` to ``end - 1``. Spheres of one body, those with the same number
    of at least 0, are no pair. Fills ``first[begin:end]``, which begins with 0, ``partner`` and the
    image codes ``shift`` (13 is none). Returns their number, or minus the number needed where the
    arrays are too short.
    """
    count = 0
    for i in range(begin, end):
        first[i] = count
        c = cell[i]
        cz = c % shape[2]
        cy = c // shape[2] % shape[1]
        cx = c // (shape[2] * shape[1])
        x, y, z, r = place[i, 0], place[i, 1], place[i, 2], place[i, 3]
        for ax in range(cx - 1, cx + 2):
            bx, mx = ax, 0
            if ax < 0 or ax >= shape[0]:
                if not periodic[0]:
                    continue
                mx = -1 if ax < 0 else 1
                bx = ax - mx * shape[0]
            for ay in range(cy - 1, cy + 2):
                by, my = ay, 0
                if ay < 0 or ay >= shape[1]:
                    if not periodic[1]:
                        continue
                    my = -1 if ay < 0 else 1
                    by = ay - my * shape[1]
                row = (bx * shape[1] + by) * shape[2]
                # Cells along z are beside each other: one stretch of members, and what lies across
                # a periodic face.
                for part in range(3):
                    mz = part - 1
                    if mz == 0:
                        low, high = max(cz - 1, 0), min(cz + 1, shape[2] - 1)
                    elif periodic[2] and mz < 0 and cz == 0:
                        low = high = shape[2] - 1
                    elif periodic[2] and mz > 0 and cz == shape[2] - 1:
                        low = high = 0
                    else:
                        continue
                    for m in range(start[row + low], start[row + high + 1]):
                        j = member[m]
                        if j <= i:
                            continue
                        dx = place[j, 0] + mx * edge[0] - x
                        dy = place[j, 1] + my * edge[1] - y
                        dz = place[j, 2] + mz * edge[2] - z
                        reach = r + place[j, 3] + skin
                        if dx * dx + dy * dy + dz * dz < reach * reach:
                            if body[i] >= 0 and body[j] == body[i]:
                                continue
                            if count < partner.size:
                                partner[count] = j
                                shift[count] = (mx + 1) * 9 + (my + 1) * 3 + mz + 1
                            count += 1
    return count if count <= partner.size else -count


@njit(**_OPTIONS)
def carry_over(
    begin,
    end,
    order,
    first,
    partner,
    old_first,
    old_partner,
    old_touch,
    old_history,
    touch,
    history,
):
    """Histories of the new pairs from the old ones; ``order[new] = old`` number of a particle.

    Of the pairs that particles ``begin`` to ``end - 1`` own.
    """
    for i in range(begin, end):
        a = order[i]
        for k in range(first[i], first[i + 1]):
            touch[k] = 0
            for column in range(history.shape[1]):
                history[k, column] = 0.0
            b = order[partner[k]]
            low, high = min(a, b), max(a, b)
            # The same pair from the other side points the other way; overlaps have no side.
            sign = 1.0 if low == a else -1.0
            for m in range(old_first[low], old_first[low + 1]):
                if old_partner[m] == high and old_touch[m]:
                    touch[k] = old_touch[m]
                    for column in range(history.shape[1]):
                        turned = sign if column < 6 else 1.0
                        history[k, column] = turned * old_history[m, column]


@njit(**_OPTIONS)
def list_crossings(block, first, partner, slot, into, slots):
    """Pairs that reach into another block: a slot each for the force on the far particle.

    ``into`` (n + 1) and ``slots`` list the slots of each particle in growing order. Returns their
    number.
    """
    n = first.size - 1
    count = 0
    into[:] = 0
    for b in range(block.size - 1):
        for i in range(block[b], block[b + 1]):
            for k in range(first[i], first[i + 1]):
                slot[k] = -1
                if partner[k] >= block[b + 1]:
                    slot[k] = count
                    into[partner[k] + 1] += 1
                    count += 1
    for i in range(n):
        into[i + 1] += into[i]
    at = into[:-1].copy()
    for i in range(n):
        for k in range(first[i], first[i + 1]):
            if slot[k] >= 0:
                j = partner[k]
                slots[at[j]] = slot[k]
                at[j] += 1
    return count
