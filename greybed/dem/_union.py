"""Compiled moments of a union of spheres: columns along z, exact in each of them."""

import math

import numpy as np

from greybed.core.jit import njit


@njit(cache=True, nogil=True, error_model="numpy")
def column_moments(centres, radii, columns):
    """Volume, first moments (3,) and second moments (3, 3) of what is inside any sphere."""
    m = radii.size
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    for k in range(m):
        for c in range(2):
            low[c] = min(low[c], centres[k, c] - radii[k])
            high[c] = max(high[c], centres[k, c] + radii[k])
    step = max(high[0] - low[0], high[1] - low[1]) / columns
    begin, end = np.empty(m), np.empty(m)
    volume, first, second = 0.0, np.zeros(3), np.zeros((3, 3))
    for a in range(math.ceil((high[0] - low[0]) / step)):
        x = low[0] + (a + 0.5) * step
        for b in range(math.ceil((high[1] - low[1]) / step)):
            y = low[1] + (b + 0.5) * step
            found = 0
            for k in range(m):
                square = radii[k] ** 2 - (x - centres[k, 0]) ** 2 - (y - centres[k, 1]) ** 2
                if square > 0.0:
                    half = math.sqrt(square)
                    begin[found], end[found] = centres[k, 2] - half, centres[k, 2] + half
                    found += 1
            order = np.argsort(begin[:found])
            at = 0
            while at < found:
                lower, upper = begin[order[at]], end[order[at]]
                at += 1
                while at < found and begin[order[at]] <= upper:
                    upper = max(upper, end[order[at]])
                    at += 1
                one = (upper - lower) * step * step
                z = 0.5 * (upper * upper - lower * lower) * step * step
                volume += one
                first[0] += one * x
                first[1] += one * y
                first[2] += z
                # Of a column with a width: its own spread across counts, too.
                second[0, 0] += one * (x * x + step * step / 12.0)
                second[1, 1] += one * (y * y + step * step / 12.0)
                second[2, 2] += (upper**3 - lower**3) / 3.0 * step * step
                second[0, 1] += one * x * y
                second[0, 2] += z * x
                second[1, 2] += z * y
    second[1, 0], second[2, 0], second[2, 1] = second[0, 1], second[0, 2], second[1, 2]
    return volume, first, second
