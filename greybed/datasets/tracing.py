"""Long traces: rows in blocks that no kill loses, on threads, processes or a scheduler."""

from __future__ import annotations

import hashlib
import json
import shutil
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from greybed._version import __version__
from greybed.core.clusters import client_of
from greybed.core.files import atomic_path, output_folder
from greybed.core.packing import Packing
from greybed.core.processes import finished, processes
from greybed.core.processors import available_threads
from greybed.core.progress import progress
from greybed.datasets.factors_file import (
    ENTRY_ARRAYS,
    ROW_NAMES,
    block_of,
    packing_hash,
    write_blocks,
)
from greybed.raytrace import ViewFactors, view_factors
from greybed.raytrace.arguments import whole_number
from greybed.raytrace.scene import Scene
from greybed.raytrace.tally import MOST_RAYS, MOST_THREADS

STATE = ".trace"
# Work between two saves: about a second, and long against what a block's arrays cost.
RAYS_PER_BLOCK = 4_000_000
# In beds of millions each block costs something for every sphere of the bed.
RAYS_PER_BLOCK_AND_SPHERE = 10
MOST_WORKERS = 1024
# What a block of view factors holds.
BLOCK_NAMES = ("lengths", "sums", *ENTRY_ARRAYS.values(), *ROW_NAMES)


@dataclass(frozen=True)
class Settings:
    """How to trace: see :func:`greybed.raytrace.view_factors`."""

    rays: int
    seed: int = 0
    max_distance: float = np.inf
    device: str = "cpu"


class Kept(Mapping[str, NDArray[Any]]):
    """Arrays of a finished block, read from its file when they are asked for."""

    def __init__(self, path: Path, names: tuple[str, ...] = BLOCK_NAMES) -> None:
        self.path = path
        self.names = names

    def __getitem__(self, name: str) -> NDArray[Any]:
        # Opened here, for numpy would leave a damaged file open.
        with open(self.path, "rb") as stream, np.load(stream, allow_pickle=False) as stored:
            return np.asarray(stored[name])

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)

    @property
    def whole(self) -> bool:
        """Whether every array is there and its check sum right."""
        try:
            return all(self[name] is not None for name in self)
        except Exception:  # absent or cut: this block is traced again, with the same bits
            return False


@dataclass(frozen=True, eq=False)
class Traced:
    """Rows of a bed in blocks, on disk until :meth:`remove`.

    Attributes
    ----------
    blocks : tuple of Kept
        Consecutive rows.
    settings : Settings
        How they were traced.
    found : int
        Spheres whose rows an earlier run had left.
    seconds : float
        Wall time of this run [s].
    """

    packing: Packing
    blocks: tuple[Kept, ...]
    settings: Settings
    found: int
    seconds: float
    folder: Path

    def write(self, path: str | Path) -> Path:
        """Write them as :func:`greybed.datasets.factors_file.write_factors` would, blockwise."""
        s = self.settings
        return write_blocks(
            path, self.packing, self.blocks, rays=s.rays, seed=s.seed, max_distance=s.max_distance
        )

    def rows(self, name: str) -> NDArray[Any]:
        """An array with a row for each sphere, of all blocks."""
        return np.concatenate([block[name] for block in self.blocks])

    def joined(self) -> ViewFactors:
        """All rows in memory, as one call of :func:`greybed.raytrace.view_factors` gives them."""
        n = len(self.packing)
        start = np.concatenate([[0], np.cumsum(self.rows("lengths"))])
        index = self.rows("indices")

        def matrix(name: str) -> sparse.csr_array:
            return sparse.csr_array((self.rows(name), index, start), shape=(n, n))

        per_row: dict[str, Any] = {name: self.rows(name) for name in ROW_NAMES}
        return ViewFactors(
            factors=matrix("data"),
            stderr=matrix("stderr"),
            rays=self.settings.rays,
            seed=self.settings.seed,
            seconds=self.seconds,
            **per_row,
        )

    def remove(self) -> None:
        """Forget the blocks, once the results are written."""
        shutil.rmtree(self.folder, ignore_errors=True)


def trace_in_blocks(
    packing: Packing,
    folder: str | Path,
    settings: Settings,
    *,
    threads: int | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    show_progress: bool = False,
) -> Traced:
    """Trace a bed of any size; what is finished stays in ``folder`` and is not traced again.

    Parameters
    ----------
    packing : Packing
        Spheres and walls.
    folder : path
        Existing folder; blocks go to ``.trace`` in it. Those of other settings are removed.
    settings : Settings
        Rays, seed, distance limit. Together with the packing they decide every bit.
    threads : int, optional
        Threads in all; all available ones by default.
    workers : int, optional
        Processes that share the threads; by default none but this one.
    scheduler : str, optional
        ``local``, the address of a ``dask.distributed`` scheduler whose workers trace, or a TOML
        file of Slurm jobs: see :func:`greybed.core.clusters.client_of`.
    show_progress : bool
        Draw a progress bar on standard error.

    Returns
    -------
    Traced

    Raises
    ------
    InputError
        For numbers out of range, or a scheduler that does not answer.
    OutputError
        If a worker was killed or the folder cannot be written.
    """
    n = len(packing)
    # Before any work, and here rather than on the workers.
    rays = whole_number(settings.rays, "rays", 1, MOST_RAYS)
    whole_number(settings.seed, "seed", 0)
    count = 0 if workers is None else whole_number(workers, "workers", 1, MOST_WORKERS)
    if threads is not None:
        whole_number(threads, "threads", 1, MOST_THREADS)
    size = min(max(max(RAYS_PER_BLOCK, RAYS_PER_BLOCK_AND_SPHERE * n) // rays, 1), n)
    key = json.dumps([__version__, packing_hash(packing), list(vars(settings).values()), size])
    root = Path(folder) / STATE
    kept = state_folder(root, hashlib.sha256(key.encode()).hexdigest()[:32])
    spans = [(first, min(first + size, n)) for first in range(0, n, size)]
    blocks = [Kept(kept / f"{first}-{last}.npz") for first, last in spans]
    todo = [span for span, block in zip(spans, blocks, strict=True) if not block.whole]
    found = n - sum(last - first for first, last in todo)
    with progress(n * rays, "tracing rays", show=show_progress) as advance:
        advance(found * rays)
        begin = time.perf_counter()
        with _tracers(packing, settings, threads, count, scheduler) as results:
            for (first, last), arrays in results(todo):
                keep(kept / f"{first}-{last}.npz", arrays)
                advance((last - first) * rays)
    return Traced(packing, tuple(blocks), settings, found, time.perf_counter() - begin, root)


def keep(path: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write the arrays of a finished block, whole or not at all."""
    with atomic_path(path) as part, open(part, "wb") as stream:
        np.savez(stream, allow_pickle=False, **arrays)


def state_folder(root: Path, key: str) -> Path:
    """The folder of a run's blocks; what other settings have left is of no use to it."""
    for other in root.glob("*"):
        if other.name != key:
            shutil.rmtree(other) if other.is_dir() else other.unlink()
    return output_folder(root / key)


Span = tuple[int, int]
Results = Callable[[Iterable[Span]], Iterator[tuple[Span, dict[str, NDArray[Any]]]]]


@contextmanager
def _tracers(
    packing: Packing, settings: Settings, threads: int | None, workers: int, scheduler: str | None
) -> Iterator[Results]:
    """Whoever traces: this process, others beside it, or those of a scheduler."""
    share = max(1, (threads or available_threads()) // max(workers, 1))
    if scheduler is not None:
        with client_of(scheduler, workers or None) as client:
            there = client.scatter(packing, broadcast=True)
            seats = sum(client.nthreads().values())
            jobs = client.get_executor(pure=False)
            # One thread a job: the scheduler counts on it.
            yield lambda spans: (
                (job[2:], arrays)
                for job, arrays in finished(
                    jobs, _rows, ((there, (settings, 1), *span) for span in spans), 2 * seats
                )
            )
    elif workers:
        with processes(workers, _hold, (packing, settings, share)) as pool:
            yield lambda spans: finished(pool, _held_rows, spans, workers + 1)
    else:
        yield lambda spans: ((span, _rows(packing, (settings, threads), *span)) for span in spans)


_scene: Scene | None = None
_lock = threading.Lock()
_held: tuple[Packing, Settings, int] | None = None


def _hold(packing: Packing, settings: Settings, threads: int) -> None:
    """Keep what all jobs of this process share."""
    global _held
    _held = (packing, settings, threads)


def _held_rows(first: int, last: int) -> dict[str, NDArray[Any]]:
    assert _held is not None
    packing, settings, threads = _held
    return _rows(packing, (settings, threads), first, last)


def _rows(
    packing: Packing, how: tuple[Settings, int | None], first: int, last: int
) -> dict[str, NDArray[Any]]:
    """Rows ``first`` to ``last - 1``, traced."""
    global _scene
    settings, threads = how
    with _lock:
        if _scene is None or _scene.packing is not packing:
            _scene = None  # the old one goes before the new one comes
            _scene = Scene.of(packing)
        scene = _scene
    result = view_factors(
        packing,
        rays=settings.rays,
        seed=settings.seed,
        max_distance=settings.max_distance,
        threads=threads,
        emitters=np.arange(first, last),
        device=settings.device,
        scene=scene,
    )
    return block_of(result, first, last)
