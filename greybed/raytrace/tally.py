"""Tallies: how many rays of each sphere end where, traced in parallel with the same bits always."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.core import InputError, Packing
from greybed.core.processors import available_threads
from greybed.core.progress import progress
from greybed.raytrace import _bundle, _kernels, _rows, _sobol
from greybed.raytrace.arguments import sphere_numbers, whole_number
from greybed.raytrace.scene import Scene

# One task's rays: small enough to stay in cache, and for one sphere's rays to spread over the
# threads.
RAYS_PER_TASK = 16_384
RAYS_PER_BLOCK = 1_000_000
# Independent scramblings of the sequence, by whose spread errors are known. A replicate grows with
# the rays, for that is where quasi-random points gain, up to what a task may hold.
REPLICATES = 16
LONGEST_REPLICATE = 16_384
SAMPLINGS = ("sobol", "random")
DEVICES = ("cpu", "cuda")
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
        the packing, ``ESCAPED``, or ``ENVIRONMENT`` for rays that the distance limit ended
        inside the bed.
    count : (m,) int64
        Rays.
    squares : (m,) int64
        Sum of the squares of the replicates' rays.
    rays : int
        Rays of each emitter.
    replicates : int
        Parts of near equal size that the rays of an emitter come in, independent of each other.
    buried : (n,) float
        Fraction of each sphere's surface inside other spheres or walls [-]; NaN if not traced.
    seconds : float
        Wall time [s].
    """

    emitter: NDArray[np.int64]
    key: NDArray[np.int64]
    count: NDArray[np.int64]
    squares: NDArray[np.int64]
    rays: int
    replicates: int
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
    sampling: str = "sobol",
    scene: Scene | None = None,
    device: str = "cpu",
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
        Rays end there [m].
    sampling : str
        ``sobol``: scrambled quasi-random rays in 16 independent replicates, or more where one
        would exceed 16,384 rays; ``random``: every ray on its own.
    scene : Scene, optional
        That of the packing, where it is built already.
    device : str
        ``cpu``, or ``cuda``: rays on a GPU, see :mod:`greybed.raytrace.cuda`.

    Raises
    ------
    InputError
        For numbers out of range, walls that do not repeat, a sphere wholly inside others, or a
        device that is not there.
    """
    rays = whole_number(rays, "rays", 1, MOST_RAYS)
    seed = whole_number(seed, "seed", 0)
    workers = available_threads()
    if threads is not None:
        workers = whole_number(threads, "threads", 1, MOST_THREADS)
    if not max_distance > 0.0:
        raise InputError(f"max_distance = {max_distance:g} [m] must be above 0.")
    if sampling not in SAMPLINGS:
        raise InputError(f"sampling = {sampling!r} is unknown; give one of {', '.join(SAMPLINGS)}.")
    if device not in DEVICES:
        raise InputError(f"device = {device!r} is unknown; give one of {', '.join(DEVICES)}.")
    n = len(packing)
    who = np.arange(n) if emitters is None else np.unique(sphere_numbers(emitters))
    if who[0] < 0 or who[-1] >= n:
        raise InputError(f"emitters must lie in 0 ... {n - 1}; got {who[0]} ... {who[-1]}.")
    begin = time.perf_counter()
    if scene is not None and scene.packing is not packing:
        raise InputError(f"{packing.source}: the scene is that of another packing; leave it out.")
    job = _Job.of(scene or Scene.of(packing), rays, seed, sampling, images, max_distance)
    if device == "cuda":
        job = job.on_device()
    blocks = list(job.blocks(who))
    emitter, key, count, square = [], [], [], []
    rejected = np.zeros(n)
    with (
        ThreadPoolExecutor(workers) as pool,
        progress(len(who) * rays, "tracing rays", show=show_progress) as advance,
    ):
        done = pool.map(job.run, blocks)
        try:
            for tasks, (keys, counts, squares, ends, lost) in zip(blocks, done, strict=True):
                emitter.append(np.repeat(tasks[:, 0], np.diff(ends, prepend=0)))
                key.append(keys)
                count.append(counts)
                square.append(squares)
                np.add.at(rejected, tasks[:, 0], lost)
                advance(job.rays_of(tasks))
        except BaseException:  # Ctrl-C must not wait for the blocks that have not begun
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    buried = np.full(n, np.nan)
    buried[who] = rejected[who] / (rejected[who] + rays)
    merged = (
        np.concatenate(emitter), np.concatenate(key), np.concatenate(count), np.concatenate(square)
    )  # fmt: skip
    if not job.whole_rows:
        merged = _merge(*merged)
    seconds = time.perf_counter() - begin
    return Tally(*merged, rays, job.replicates, buried, seconds)


@dataclass(frozen=True, eq=False)
class _Job:
    """One trace: the scene, and how the rays of an emitter are cut into replicates."""

    scene: Scene
    offsets: NDArray[np.int64]
    seed: int
    quasi: bool
    points: NDArray[np.uint32]
    images: bool
    limit: float
    trace_block: Callable[..., int]
    rays_per_block: int

    @classmethod
    def of(
        cls, scene: Scene, rays: int, seed: int, sampling: str, images: bool, limit: float
    ) -> _Job:
        replicates = min(rays, max(REPLICATES, -(-rays // LONGEST_REPLICATE)))
        # Near equal parts; of one ray more the first replicates get it.
        number = np.arange(replicates + 1)
        offsets = number * (rays // replicates) + np.minimum(number, rays % replicates)
        longest = int(np.diff(offsets).max())
        points = np.zeros((_sobol.DIMENSIONS, longest), np.uint32)
        if sampling == "sobol":
            _sobol.sequence(longest, _sobol.direction_numbers(), points)
        return cls(
            scene, offsets, seed, sampling == "sobol", points, images, limit,
            _rows.trace_block, RAYS_PER_BLOCK,
        )  # fmt: skip

    def on_device(self) -> _Job:
        """The same rays, traced by a GPU."""
        from greybed.raytrace.cuda import Device

        device = Device(self.scene.tables)
        return replace(self, trace_block=device.trace_block, rays_per_block=device.rays_per_launch)

    @property
    def replicates(self) -> int:
        return len(self.offsets) - 1

    @property
    def whole_rows(self) -> bool:
        """Whether each task is a whole row, so that tallies are in key order already."""
        return self.replicates <= self._per_task

    @property
    def _per_task(self) -> int:
        return max(1, RAYS_PER_TASK // int(self.offsets[1]))

    def rays_of(self, tasks: NDArray[np.int64]) -> int:
        """Rays of some tasks."""
        return int((self.offsets[tasks[:, 2]] - self.offsets[tasks[:, 1]]).sum())

    def blocks(self, emitters: NDArray[np.int64]) -> Iterator[NDArray[np.int64]]:
        """Tasks (sphere, first replicate, last replicate) in blocks worth handing to a thread."""
        first = np.arange(0, self.replicates, self._per_task)
        last = np.append(first[1:], self.replicates)
        rays_per_task = int((self.offsets[last] - self.offsets[first]).max())
        per_block = max(1, self.rays_per_block // rays_per_task)
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

    def run(
        self, tasks: NDArray[np.int64]
    ) -> tuple[
        NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], NDArray[np.int64],
        NDArray[np.int64],
    ]:  # fmt: skip
        """Trace one block; what does not fit into the output is traced in a second go."""
        sizes = self.offsets[tasks[:, 2]] - self.offsets[tasks[:, 1]]
        most, widest = int(sizes.max()), int((tasks[:, 2] - tasks[:, 1]).max())
        ends = np.zeros(len(tasks), np.int64)
        lost = np.zeros(len(tasks), np.int64)
        # One task fits always, and so each go does at least one.
        room = max(len(tasks) * min(most, 512), most + _bundle.MOST)
        packing = self.scene.packing
        output = np.empty((3, room), np.int64)
        parts = []
        done = 0
        while done < len(tasks):
            more = self.trace_block(
                tasks[done:], self.offsets, self.seed, self.quasi, self.points, self.images,
                self.scene.tables, self.limit, most, widest, *output, ends[done:], lost[done:],
            )  # fmt: skip
            used = int(ends[done + more - 1])
            parts.append(output[:, :used].copy())
            ends[done : done + more] += sum(part.shape[1] for part in parts[:-1])
            done += more
        if (lost < 0).any():
            i = int(tasks[(lost < 0).argmax(), 0])
            raise InputError(
                f"{packing.source}: sphere {i} lies wholly inside other spheres or walls (no "
                f"exposed surface in {_kernels.MAX_ATTEMPTS} attempts); remove it or its duplicate."
            )
        keys, counts, squares = np.concatenate(parts, axis=1)
        return keys, counts, squares, ends, lost


def _merge(
    emitter: NDArray[np.int64],
    key: NDArray[np.int64],
    count: NDArray[np.int64],
    squares: NDArray[np.int64],
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Sum the counts, and the squares, of equal (emitter, key), sorted."""
    order = np.lexsort((key, emitter))
    emitter, key, count, squares = emitter[order], key[order], count[order], squares[order]
    new = np.ones(len(key), dtype=bool)
    new[1:] = (np.diff(emitter) != 0) | (np.diff(key) != 0)
    begin = np.flatnonzero(new)
    return (
        emitter[begin],
        key[begin],
        np.add.reduceat(count, begin),
        np.add.reduceat(squares, begin),
    )
