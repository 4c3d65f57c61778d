"""Tracing on a CUDA device: rays there, tallies here, with the counts of the processor's tracer."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed.core import InputError
from greybed.raytrace import _rows, _single

# Rays of one launch: many times what a device works on at once, and keys of 8 bytes that a
# processor copies and counts meanwhile.
RAYS_PER_LAUNCH = 4_000_000
THREADS_PER_GROUP = 128
# Memory left alone: the device's own stack, other programs.
SPARE = 0.1

_REMEDY = "or give device='cpu'"


class Device:
    """A scene on the current CUDA device, traced by the same call as on the processor.

    Parameters
    ----------
    tables : _rows.Tables
        The scene.

    Raises
    ------
    InputError
        Without numba-cuda or a device, or where the scene does not fit into its memory.
    """

    def __init__(self, tables: _rows.Tables) -> None:
        self._cuda = _numba_cuda()
        bed = _single.Bed(
            tables.centres, tables.radii, tables.exposed, tables.clearance, tables.grid,
            tables.walls,
        )  # fmt: skip
        free = float(self._cuda.current_context().get_memory_info()[0])
        self.rays_per_launch = launch_size(_bytes(bed), free)
        self._bed = self._moved(bed)
        self._points: tuple[NDArray[np.uint32], Any] | None = None
        # One launch at a time, so that memory is bounded; threads count keys meanwhile.
        self._lock = threading.Lock()

    def trace_block(
        self,
        tasks: NDArray[np.int64],
        offsets: NDArray[np.int64],
        seed: int,
        quasi: bool,
        points: NDArray[np.uint32],
        images: bool,
        scene: _rows.Tables,
        limit: float,
        most_rays: int,
        most_replicates: int,
        out_keys: NDArray[np.int64],
        out_counts: NDArray[np.int64],
        out_squares: NDArray[np.int64],
        ends: NDArray[np.int64],
        rejected: NDArray[np.int64],
    ) -> int:
        """Do what :func:`greybed.raytrace._rows.trace_block` does; ``scene`` is here already."""
        sizes = offsets[tasks[:, 2]] - offsets[tasks[:, 1]]
        begin = np.concatenate([[0], np.cumsum(sizes)])
        with self._lock:
            met, lost = self._launch(tasks, begin, offsets, seed, quasi, points, images, limit)
        rejected[:] = np.where(lost < 0, -1, lost)
        return int(
            _single.tally_block(
                tasks, offsets, met, begin, images, most_rays, most_replicates,
                out_keys, out_counts, out_squares, ends,
            )
        )  # fmt: skip

    def _launch(
        self,
        tasks: NDArray[np.int64],
        begin: NDArray[np.int64],
        offsets: NDArray[np.int64],
        seed: int,
        quasi: bool,
        points: NDArray[np.uint32],
        images: bool,
        limit: float,
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Keys that all rays meet, and rejected starts of each task, below zero where buried."""
        from greybed.raytrace._cuda_kernels import meet_all

        if self._points is None or self._points[0] is not points:
            self._points = (points, self._cuda.to_device(points))
        met = self._cuda.device_array(int(begin[-1]), np.int64)
        lost = self._cuda.to_device(np.zeros(len(tasks), np.int64))
        groups = -(-int(begin[-1]) // THREADS_PER_GROUP)
        meet_all[groups, THREADS_PER_GROUP](
            self._cuda.to_device(np.ascontiguousarray(tasks)), self._cuda.to_device(begin),
            self._cuda.to_device(offsets), np.int64(seed), quasi, self._points[1], images,
            self._bed, np.float64(limit), met, lost,
        )  # fmt: skip
        return met.copy_to_host(), lost.copy_to_host()

    def _moved(self, value: Any) -> Any:
        """The same tuples with their arrays on the device."""
        if isinstance(value, np.ndarray):
            return self._cuda.to_device(value)
        if isinstance(value, tuple) and hasattr(value, "_fields"):
            return type(value)(*(self._moved(part) for part in value))
        return value


def launch_size(scene: int, free: float) -> int:
    """Rays of one launch on a device with ``free`` bytes, where the scene takes ``scene``.

    Raises
    ------
    InputError
        Where a launch would be too small to be worth it.
    """
    # A ray brings its key, and its task at worst six numbers.
    rays = int(min(RAYS_PER_LAUNCH, ((1.0 - SPARE) * free - scene) / 64.0))
    if rays < 100_000:
        raise InputError(
            f"device = 'cuda' has {free / 1e6:.0f} MB of free memory, and the scene takes "
            f"{scene / 1e6:.0f} MB and the rays 6 MB at least; free some, {_REMEDY}."
        )
    return rays


def _bytes(value: Any) -> int:
    """Bytes of the arrays in nested tuples."""
    if isinstance(value, np.ndarray):
        return value.nbytes
    return sum(_bytes(part) for part in value) if isinstance(value, tuple) else 0


def _numba_cuda() -> Any:
    """``numba.cuda`` of numba-cuda, where it is installed and finds a device."""
    install = "pip install 'greybed[gpu]'"
    try:
        from numba import config, cuda
    except ImportError as error:
        raise InputError(
            f"device = 'cuda' needs numba-cuda, which cannot be imported ({_one_line(error)}); "
            f"{install}, {_REMEDY}."
        ) from None
    # What numba itself still brings is no longer maintained and fails to compile the kernel.
    if cuda.implementation != "NVIDIA" and not config.ENABLE_CUDASIM:
        raise InputError(
            f"device = 'cuda' needs numba-cuda, which is not installed; {install}, {_REMEDY}."
        )
    if not cuda.is_available():
        reason = cuda.cuda_error() or "its driver answers, the compiler NVVM does not"
        raise InputError(
            f"device = 'cuda' finds no CUDA device ({_one_line(reason)}); take a machine with an "
            f"NVIDIA GPU and its driver, {_REMEDY}."
        )
    return cuda


def _one_line(reason: object) -> str:
    return " ".join(str(reason).split()).rstrip(".")
