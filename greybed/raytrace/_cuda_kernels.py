"""Compiled for CUDA devices: one thread a ray. Imported only where a device is asked for."""

import numpy as np
from numba import cuda

from greybed.raytrace._single import Room, last_up_to, meet


# Numba compiles the functions of the processor that are called here once more, for the device: so
# rays, walls and the march are written once.
@cuda.jit
def meet_all(
    tasks, begin, offsets, seed, quasi, points, images, bed, limit, met, rejected
):  # fmt: skip
    """Key of what each ray of some tasks meets; rejected starts, added up by task.

    Rays of task k are ``begin[k]`` to ``begin[k + 1]``, in the order of its replicates.
    """
    place = cuda.grid(1)
    n_tasks = tasks.shape[0]
    if place >= begin[n_tasks]:
        return
    task = last_up_to(place, begin, 0, n_tasks)
    sphere, first, last = tasks[task, 0], tasks[task, 1], tasks[task, 2]
    number = offsets[first] + place - begin[task]
    replicate = last_up_to(number, offsets, first, last)
    room = Room(
        cuda.local.array((6, 1), np.float64),
        cuda.local.array(4, np.uint32),
        cuda.local.array(1, np.float64),
        cuda.local.array(1, np.float64),
        cuda.local.array(1, np.int64),
        cuda.local.array(1, np.int64),
    )
    met[place], lost = meet(
        sphere, number, replicate, offsets, seed, quasi, points, images, bed, limit, room
    )
    if lost != 0:
        cuda.atomic.add(rejected, task, lost)
