"""Compiled single rays: what ray k of a sphere meets, for devices with a thread for every ray."""

from typing import NamedTuple

import numpy as np

from greybed.core.jit import njit
from greybed.raytrace._grid import Grid
from greybed.raytrace._kernels import ESCAPED, redraw
from greybed.raytrace._rows import at_limit, march_on, slot_for, store
from greybed.raytrace._scratch import room_for_tasks
from greybed.raytrace._sobol import sphere_rays
from greybed.raytrace._streams import GOLDEN, draw, mix, replicate_seeds, stream_of
from greybed.raytrace._walls import Walls, walls_ahead

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}

# Stands for the rejected starts of a sphere that is wholly buried: more than any task can have.
BURIED = -(2**40)


class Bed(NamedTuple):
    """Of :class:`greybed.raytrace._rows.Tables`, under the same names, what a single ray needs."""

    centres: np.ndarray  # (n, 3) [m]
    radii: np.ndarray  # (n,) [m]
    exposed: np.ndarray  # (n,) bool
    clearance: np.ndarray  # (n,) [m]
    grid: Grid
    walls: Walls


class Room(NamedTuple):
    """Scratch of one ray: the arrays that the functions for many rays take, one ray long."""

    ray: np.ndarray  # (6, 1): direction, place relative to the centre [m]
    seeds: np.ndarray  # (4,) uint32
    ahead: np.ndarray  # (1,) [m]
    bound: np.ndarray  # (1,) [m]
    wall: np.ndarray  # (1,) int64
    key: np.ndarray  # (1,) int64


@njit(**_OPTIONS)
def last_up_to(value, numbers, low, high):
    """Largest k from ``low`` to ``high`` - 1 whose number, in growing order, is no more than it."""
    while high - low > 1:
        middle = (low + high) // 2
        if numbers[middle] <= value:
            low = middle
        else:
            high = middle
    return low


@njit(**_OPTIONS)
def meet(sphere, number, replicate, offsets, seed, quasi, points, images, bed, limit, room):
    """Key of what ray ``number`` of a sphere meets, and its rejected starts or ``BURIED``.

    The ray that :func:`greybed.raytrace._rows.trace_sphere` gives this number, but traced through
    the cells from its start on.
    """
    ray, radius = room.ray, bed.radii[sphere]
    stream = stream_of(sphere, seed)
    if quasi:
        replicate_seeds(stream, replicate, room.seeds)
        k = number - offsets[replicate]
        sphere_rays(points[:, k : k + 1], 1, room.seeds, ray, 0)
    else:
        draw(mix(stream + np.uint64(number) * GOLDEN), ray, 0)
    rejected = 0
    if not bed.exposed[sphere]:
        rejected = redraw(stream, number, sphere, radius, bed, ray, 0)
        if rejected < 0:
            return np.int64(ESCAPED), np.int64(BURIED)
    for row in range(3, 6):
        ray[row, 0] *= radius
    room.ahead[0], room.bound[0], room.wall[0] = 0.0, limit, -1
    centre = bed.centres[sphere]
    if bed.clearance[sphere] < np.inf:
        walls_ahead(1, ray, centre, bed.walls, room.bound, room.wall)
    frame, start, items, owner, image = bed.grid
    march_on(
        1, ray, room.ahead, room.bound, centre, images, frame, start, items, owner,
        image, room.key,
    )  # fmt: skip
    key = room.key[0]
    if key == ESCAPED and room.wall[0] >= 0:
        key = np.int64(-1 - room.wall[0])
    elif key == ESCAPED and limit < np.inf:
        key = at_limit(ray, 0, centre, limit, bed.clearance[sphere], frame, bed.walls)
    return key, np.int64(rejected)


@njit(**_OPTIONS)
def tally_block(
    tasks, offsets, met, begin, images, most_rays, most_replicates,
    out_keys, out_counts, out_squares, ends,
):  # fmt: skip
    """Tallies of tasks whose rays met the keys ``met``, those of task k from ``begin[k]`` on.

    Stores what :func:`greybed.raytrace._rows.trace_block` does, and returns as it does.
    """
    work = room_for_tasks(most_rays, most_replicates)
    keys, slots, counts, places = work.keys, work.slots, work.counts, work.places
    mask = keys.size - 1
    filled = 0
    for k in range(tasks.shape[0]):
        first, last = tasks[k, 1], tasks[k, 2]
        used, at = 0, begin[k]
        for r in range(first, last):
            for _ in range(offsets[r], offsets[r + 1]):
                slot, place = slot_for(met[at], keys, slots, used, mask)
                at += 1
                if slot == used:
                    places[used] = place
                    for q in range(last - first):
                        counts[used, q] = 0
                    used += 1
                counts[slot, r - first] += 1
        filled = store(used, last - first, images, work, filled, out_keys, out_counts, out_squares)
        if filled < 0:
            return k
        ends[k] = filled
    return tasks.shape[0]
