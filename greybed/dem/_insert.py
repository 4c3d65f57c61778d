"""Compiled insertion: random places for spheres that touch neither each other nor what is there."""

import numpy as np

from greybed.core.jit import njit

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}


@njit(**_OPTIONS)
def place_apart(numbers, radii, low, high, round_, taken, taken_radii, cell, placed):
    """Places for the spheres, one after the other; returns how many found one.

    ``numbers`` (attempts, 3) in [0, 1) are used up in order, ``placed`` (n, 3) is filled. Spheres
    stay inside the box, or with ``round_`` inside the upright cylinder in it.
    """
    n, m = radii.size, taken_radii.size
    shape = np.empty(3, np.int64)
    for axis in range(3):
        shape[axis] = max(1, min(np.int64((high[axis] - low[axis]) / cell) + 2, 200))
    head = np.full(shape[0] * shape[1] * shape[2], -1, np.int64)
    link = np.full(n + m, -1, np.int64)
    at = np.empty((n + m, 3))
    r = np.empty(n + m)
    largest = 0.0
    scale = np.empty(3)
    for axis in range(3):
        scale[axis] = shape[axis] / (high[axis] - low[axis] + 2.0 * cell)
    for k in range(m):
        at[k] = taken[k]
        r[k] = taken_radii[k]
        largest = max(largest, r[k])
        _enter(k, at[k], low, scale, cell, shape, head, link)
    for k in range(n):
        largest = max(largest, radii[k])
    used = 0
    middle_x, middle_y = 0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])
    across = 0.5 * min(high[0] - low[0], high[1] - low[1])
    x = np.empty(3)
    for k in range(n):
        own = radii[k]
        found = False
        while not found and used < numbers.shape[0]:
            for axis in range(3):
                span = high[axis] - low[axis] - 2.0 * own
                x[axis] = low[axis] + own + numbers[used, axis] * span
            used += 1
            if round_:
                far = (x[0] - middle_x) ** 2 + (x[1] - middle_y) ** 2
                if far > (across - own) ** 2:
                    continue
            found = _free(x, own, largest, at, r, low, scale, cell, shape, head, link)
        if not found:
            return k
        at[m + k] = x
        r[m + k] = own
        placed[k] = x
        _enter(m + k, x, low, scale, cell, shape, head, link)
    return n


@njit(**_OPTIONS)
def _cell(value, axis, low, scale, cell, shape):
    return min(max(np.int64((value - low[axis] + cell) * scale[axis]), 0), shape[axis] - 1)


@njit(**_OPTIONS)
def _enter(k, x, low, scale, cell, shape, head, link):
    i = _cell(x[0], 0, low, scale, cell, shape)
    j = _cell(x[1], 1, low, scale, cell, shape)
    l = _cell(x[2], 2, low, scale, cell, shape)  # noqa: E741
    c = (i * shape[1] + j) * shape[2] + l
    link[k] = head[c]
    head[c] = k


@njit(**_OPTIONS)
def _free(x, own, largest, at, r, low, scale, cell, shape, head, link):
    reach = own + largest
    first, last = np.empty(3, np.int64), np.empty(3, np.int64)
    for axis in range(3):
        first[axis] = _cell(x[axis] - reach, axis, low, scale, cell, shape)
        last[axis] = _cell(x[axis] + reach, axis, low, scale, cell, shape)
    for i in range(first[0], last[0] + 1):
        for j in range(first[1], last[1] + 1):
            for k in range(first[2], last[2] + 1):
                other = head[(i * shape[1] + j) * shape[2] + k]
                while other >= 0:
                    dx, dy, dz = at[other, 0] - x[0], at[other, 1] - x[1], at[other, 2] - x[2]
                    both = own + r[other]
                    if dx * dx + dy * dy + dz * dz < both * both:
                        return False
                    other = link[other]
    return True
