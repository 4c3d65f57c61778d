"""Follow light paths of many emitters in parallel, with the same bits on any number of threads."""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.core import InputError, Packing
from greybed.core.processors import available_threads
from greybed.core.progress import progress
from greybed.raytrace import _paths
from greybed.raytrace.arguments import sphere_numbers, whole_number
from greybed.raytrace.scene import Scene

Array = NDArray[np.float64]

# One task's rays: a fixed number, so that sums are made in the same order on any machine.
RAYS_PER_TASK = 16_384
MOST_RAYS = 10**12
MOST_THREADS = 1024
FIRST_TABLE = 1024


@dataclass(frozen=True, eq=False)
class Followed:
    """Sums over the rays of each emitter, sorted by emitter, then key.

    Attributes
    ----------
    emitter, key : (m,) int64
        Emitter, and sphere (with coded image where kept), -1 - k for wall k, or ``ESCAPED``.
    total, square : (m, sets)
        Sums over rays of what each left there, and of its square [-].
    moments : (n, 2, sets, 4)
        See :func:`greybed.raytrace._paths.follow` [m2, m4]; NaN where not traced.
    buried : (n,)
        Fraction of each emitter's surface inside spheres or walls [-]; NaN where not traced.
    cut : int
        Paths cut short.
    hits : int
        Surfaces met, all paths together.
    rays, seed : int
        Rays of each emitter, seed.
    seconds : float
        Wall time [s].
    """

    emitter: NDArray[np.int64]
    key: NDArray[np.int64]
    total: Array
    square: Array
    moments: Array
    buried: Array
    cut: int
    hits: int
    rays: int
    seed: int
    seconds: float


def follow_rays(
    packing: Packing,
    emissivity: Array,
    wall_emissivity: Array,
    *,
    specular: Array,
    wall_specular: Array,
    rays: int,
    seed: int,
    threads: int | None = None,
    emitters: ArrayLike | None = None,
    free: tuple[Array, Array] | None = None,
    max_distance: float = np.inf,
    images: bool = False,
    show_progress: bool = False,
    scene: Scene | None = None,
) -> Followed:
    """Follow ``rays`` paths from each emitter, or those of ``free`` (origins, directions).

    Parameters are those of :func:`greybed.raytrace.exchange_factors`, spread over spheres and
    walls: ``emissivity`` (sets, n), ``wall_emissivity`` (sets, n_walls), shares (n,), (n_walls,).

    Raises
    ------
    InputError
        For numbers out of range or a sphere wholly inside others.
    """
    rays = whole_number(rays, "rays", 1, MOST_RAYS)
    seed = whole_number(seed, "seed", 0)
    workers = available_threads()
    if threads is not None:
        workers = whole_number(threads, "threads", 1, MOST_THREADS)
    if not max_distance > 0.0:
        raise InputError(f"max_distance = {max_distance:g} [m] must be above 0.")
    n = len(packing) if free is None else 1
    who = np.arange(n) if emitters is None else np.unique(sphere_numbers(emitters))
    if who[0] < 0 or who[-1] >= n:
        raise InputError(f"emitters must lie in 0 ... {n - 1}; got {who[0]} ... {who[-1]}.")
    begin = time.perf_counter()
    tables = (Scene.of(packing) if scene is None else scene).tables
    origins, directions = (np.empty((0, 3)), np.empty((0, 3))) if free is None else free
    optics = (
        np.ascontiguousarray(emissivity.T), specular,
        np.ascontiguousarray(wall_emissivity.T), wall_specular,
    )  # fmt: skip
    normals = _paths.normal_tables(packing.walls, wall_emissivity.min(axis=0) < 1.0)
    tasks = [
        (int(i), first, min(first + RAYS_PER_TASK, rays))
        for i in who
        for first in range(0, rays, RAYS_PER_TASK)
    ]

    def work(task: tuple[int, int, int]) -> tuple[NDArray[np.int64], Array, Array, Array, Array]:
        size = FIRST_TABLE
        while True:
            used, *found = _table(size, len(emissivity))
            keys, stamp, total, square, slots, moments, extra = found
            used = _paths.follow(
                *task, seed, tables.centres, tables.radii, tables.exposed, origins, directions,
                images, tables.grid, tables.walls, normals, max_distance, *optics,
                keys, stamp, np.empty_like(total), total, square, slots, moments, extra,
            )  # fmt: skip
            if used == _paths.BURIED:
                raise InputError(
                    f"{packing.source}: sphere {task[0]} lies wholly inside other spheres or walls "
                    f"(no exposed surface in {_paths.MAX_ATTEMPTS} attempts); remove it or its "
                    "duplicate."
                )
            if used != _paths.FULL:
                break
            size *= 2
        place = slots[:used][np.argsort(keys[slots[:used]])]
        return keys[place], total[place], square[place], moments, extra

    parts = []
    with (
        ThreadPoolExecutor(workers) as pool,
        progress(len(who) * rays, "following rays", show=show_progress) as advance,
    ):
        try:
            for task, part in zip(tasks, pool.map(work, tasks), strict=True):
                parts.append(part)
                advance(task[2] - task[1])
        except BaseException:  # Ctrl-C must not wait for the tasks that have not begun
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    source = np.array([task[0] for task in tasks])
    emitter, key, total, square = _merge(
        np.repeat(source, [len(part[0]) for part in parts]),
        *(np.concatenate([part[k] for part in parts]) for k in range(3)),
    )
    moments = np.full((n, 2, len(emissivity), 4), np.nan)
    moments[who] = 0.0
    np.add.at(moments, source, np.stack([part[3] for part in parts]))
    extra = np.zeros((n, 3))
    np.add.at(extra, source, np.stack([part[4] for part in parts]))
    buried = np.full(n, np.nan)
    buried[who] = extra[who, 0] / (extra[who, 0] + rays)
    _, cut, hits = extra.sum(axis=0).astype(np.int64).tolist()
    seconds = time.perf_counter() - begin
    return Followed(
        emitter, key, total, square, moments, buried, cut, hits, rays, seed, seconds
    )  # fmt: skip


def _table(size: int, sets: int) -> tuple[int, *tuple[NDArray, ...]]:
    """Empty table of ``size`` slots, moments and counters for :func:`_paths.follow`."""
    return (
        0,
        np.empty(size, np.int64), np.full(size, -1, np.int64), np.empty((size, sets)),
        np.empty((size, sets)), np.empty(size, np.int64), np.zeros((2, sets, 4)), np.zeros(3),
    )  # fmt: skip


def _merge(
    emitter: NDArray[np.int64], key: NDArray[np.int64], total: Array, square: Array
) -> tuple[NDArray[np.int64], NDArray[np.int64], Array, Array]:
    """Sum equal (emitter, key), sorted; tasks add in their order."""
    order = np.lexsort((key, emitter))  # stable
    emitter, key = emitter[order], key[order]
    new = np.ones(len(key), dtype=bool)
    new[1:] = (np.diff(emitter) != 0) | (np.diff(key) != 0)
    begin = np.flatnonzero(new)
    return (
        emitter[begin],
        key[begin],
        np.add.reduceat(total[order], begin, axis=0),
        np.add.reduceat(square[order], begin, axis=0),
    )
