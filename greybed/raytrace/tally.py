"""Tallies: how many rays of each sphere end where, traced in parallel with the same bits always."""

from __future__ import annotations

import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.core import InputError, Packing
from greybed.core.processors import available_threads
from greybed.core.progress import progress
from greybed.raytrace import _kernels
from greybed.raytrace.scene import Scene

# One task's rays: small enough for its table to stay in cache, and for one sphere's rays to
# spread over the threads.
RAYS_PER_TASK = 65_536
RAYS_PER_BLOCK = 1_000_000
# A standard error of 5e-7, and a day's work per emitter; beyond, the list of tasks alone would
# fill the memory.
MOST_RAYS = 10**12
MOST_THREADS = 1024


@dataclass(frozen=True, eq=False)
class Tally:
    """Ray counts in coordinate form, sorted by emitter, then key.

    Attributes
    ----------
    emitter : (m,) int64
        Emitting sphere.
    key : (m,) int64
        Sphere (with its coded image above bit 32 where images were kept), -1 - k for wall k of
        the packing, or ``ESCAPED``.
    count : (m,) int64
        Rays.
    rays : int
        Rays of each emitter.
    buried : (n,) float
        Fraction of each sphere's surface inside other spheres or walls [-]; NaN if not traced.
    seconds : float
        Wall time [s].
    """

    emitter: NDArray[np.int64]
    key: NDArray[np.int64]
    count: NDArray[np.int64]
    rays: int
    buried: NDArray[np.float64]
    seconds: float


def image_keys(sphere: NDArray[np.int64], image: NDArray[np.int64]) -> NDArray[np.int64]:
    """Keys (m,) of spheres (m,) seen in periodic images (m, 3), as a tally with images has them."""
    c = image.astype(np.int64) + _kernels.IMAGE_SPAN // 2
    return sphere + (
        ((c[:, 0] * _kernels.IMAGE_SPAN + c[:, 1]) * _kernels.IMAGE_SPAN + c[:, 2]) << 32
    )


def split_keys(key: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Spheres (m,) and periodic images (m, 3) of such keys: the inverse of :func:`image_keys`."""
    span, code = _kernels.IMAGE_SPAN, key >> 32
    image = np.stack([code // span**2, code // span % span, code % span], axis=1) - span // 2
    return key & 0xFFFFFFFF, image


def trace(
    packing: Packing,
    *,
    rays: int,
    seed: int = 0,
    threads: int | None = None,
    emitters: ArrayLike | None = None,
    images: bool = False,
    max_distance: float = np.inf,
    show_progress: bool = False,
) -> Tally:
    """Trace ``rays`` cosine-law rays from each emitter to the first sphere or wall.

    Parameters
    ----------
    packing : Packing
        Spheres, walls, periodicity.
    rays : int
        Rays per emitter, 1 or more [-].
    seed : int
        Seed of the random streams, 0 to 2^63 - 1.
    threads : int, optional
        Threads; all available ones by default. Does not change the result.
    emitters : int array, optional
        Spheres to trace from; all by default.
    images : bool
        Keep apart the periodic images of a target.
    max_distance : float
        Rays that meet nothing within it count as escaped [m].

    Raises
    ------
    InputError
        For numbers out of range, walls that do not repeat, or a sphere wholly inside others.
    """
    rays = _whole(rays, "rays", 1, MOST_RAYS)
    seed = _whole(seed, "seed", 0)
    workers = available_threads()
    if threads is not None:
        workers = _whole(threads, "threads", 1, MOST_THREADS)
    if not max_distance > 0.0:
        raise InputError(f"max_distance = {max_distance:g} [m] must be above 0.")
    n = len(packing)
    who = np.arange(n) if emitters is None else np.unique(_numbers(emitters))
    if who[0] < 0 or who[-1] >= n:
        raise InputError(f"emitters must lie in 0 ... {n - 1}; got {who[0]} ... {who[-1]}.")
    begin = time.perf_counter()
    scene = Scene.of(packing)
    blocks = list(_blocks(who, rays))
    emitter, key, count = [], [], []
    rejected = np.zeros(n)
    with (
        ThreadPoolExecutor(workers) as pool,
        progress(len(who) * rays, "tracing rays", show=show_progress) as advance,
    ):
        done = pool.map(
            lambda tasks: _trace_tasks(scene, tasks, seed, images, max_distance), blocks
        )
        try:
            for tasks, (keys, counts, ends, lost) in zip(blocks, done, strict=True):
                emitter.append(np.repeat(tasks[:, 0], np.diff(ends, prepend=0)))
                key.append(keys)
                count.append(counts)
                np.add.at(rejected, tasks[:, 0], lost)
                advance(int((tasks[:, 2] - tasks[:, 1]).sum()))
        except BaseException:  # Ctrl-C must not wait for the blocks that have not begun
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    buried = np.full(n, np.nan)
    buried[who] = rejected[who] / (rejected[who] + rays)
    merged = _merge(np.concatenate(emitter), np.concatenate(key), np.concatenate(count))
    return Tally(*merged, rays, buried, time.perf_counter() - begin)


def _whole(value: int, name: str, least: int, most: int = 2**63 - 1) -> int:
    if not least <= value <= most or value != int(value):
        raise InputError(
            f"{name} = {value!r} must be a whole number of at least {least} and at most {most}; "
            "mend it."
        )
    return int(value)


def _numbers(emitters: ArrayLike) -> NDArray[np.int64]:
    given = np.asarray(emitters)
    if given.size == 0:
        raise InputError("emitters is empty; leave it out to trace from all spheres.")
    if given.dtype.kind not in "iu":  # a mask would silently mean the spheres 0 and 1
        raise InputError(
            f"emitters of type {given.dtype} must be sphere numbers; for a mask give "
            "np.flatnonzero(mask)."
        )
    return given.astype(np.int64)


def _blocks(emitters: NDArray[np.int64], rays: int) -> Iterator[NDArray[np.int64]]:
    """Tasks (sphere, first ray, last ray) in blocks worth handing to a thread."""
    first = np.arange(0, rays, RAYS_PER_TASK)
    last = np.minimum(first + RAYS_PER_TASK, rays)
    per_block = max(1, RAYS_PER_BLOCK // min(rays, RAYS_PER_TASK))
    tasks = np.stack(
        [
            np.repeat(emitters, len(first)),
            np.tile(first, len(emitters)),
            np.tile(last, len(emitters)),
        ],
        axis=1,
    )
    for begin in range(0, len(tasks), per_block):
        yield tasks[begin : begin + per_block]


def _trace_tasks(
    scene: Scene, tasks: NDArray[np.int64], seed: int, images: bool, limit: float
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Trace one block, with more room for output whenever it runs full."""
    most = int((tasks[:, 2] - tasks[:, 1]).max())
    size = 1 << max(4, (2 * most - 1).bit_length())
    table = np.empty(size, np.int64), np.empty(size, np.int64), np.empty(size, np.int64)
    ends = np.zeros(len(tasks), np.int64)
    lost = np.zeros(len(tasks), np.int64)
    room = len(tasks) * min(most, 512)
    packing = scene.packing
    while True:
        keys, counts = np.empty(room, np.int64), np.empty(room, np.int64)
        done = _kernels.trace_block(
            tasks, seed, packing.centres, packing.radii, scene.exposed, images, scene.grid,
            scene.walls, limit, *table, keys, counts, ends, lost,
        )  # fmt: skip
        if done == len(tasks):
            break
        room *= 2
    if (lost < 0).any():
        i = int(tasks[(lost < 0).argmax(), 0])
        raise InputError(
            f"{packing.source}: sphere {i} lies wholly inside other spheres or walls (no exposed "
            f"surface in {_kernels.MAX_ATTEMPTS} attempts); remove it or its duplicate."
        )
    keys, counts = keys[: ends[-1]].copy(), counts[: ends[-1]].copy()
    return keys, counts, ends, lost


def _merge(
    emitter: NDArray[np.int64], key: NDArray[np.int64], count: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Sum the counts of equal (emitter, key), sorted."""
    if (np.diff(emitter, prepend=-1)[np.diff(key, prepend=key[0]) <= 0] > 0).all():
        return emitter, key, count  # one task per sphere: each task's tallies are in key order
    order = np.lexsort((key, emitter))
    emitter, key, count = emitter[order], key[order], count[order]
    new = np.ones(len(key), dtype=bool)
    new[1:] = (np.diff(emitter) != 0) | (np.diff(key) != 0)
    begin = np.flatnonzero(new)
    return emitter[begin], key[begin], np.add.reduceat(count, begin)
