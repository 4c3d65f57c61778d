"""Compiled contacts of particles with walls, for the heat that goes through them."""

import numpy as np

from greybed.core.jit import njit
from greybed.dem import _columns as col
from greybed.dem._surfaces import nearest

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}


@njit(**_OPTIONS)
def wall_contacts(place, first, surface, touch, kinds, data, wall):
    """Particle, wall and overlap [m] of each contact with a surface."""
    count = 0
    for k in range(surface.size):
        count += touch[k] == col.TOUCH
    who, what = np.empty(count, np.int64), np.empty(count, np.int64)
    deep = np.empty(count)
    at = 0
    for i in range(first.size - 1):
        for k in range(first[i], first[i + 1]):
            if touch[k] != col.TOUCH:
                continue
            s = surface[k]
            distance, _, _, _, _ = nearest(kinds[s], data[s], place[i, 0], place[i, 1], place[i, 2])
            who[at], what[at], deep[at] = i, wall[s], place[i, 3] - distance
            at += 1
    return who, what, deep
