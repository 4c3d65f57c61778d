"""The compiler of every kernel: Numba's, with machine code on disk that processes can share.

Numba numbers the files that it keeps of one kernel by what its index held a moment before. Two
processes that compile two sets of argument types at once then write the same file, and the index
leads every later process to machine code for other types: it computes nonsense or crashes. Names
that are never used twice leave nothing to mix up; at worst an entry of the index is lost, and
compiled once more. Two processes that need the same machine code at once would both compile it;
here the second waits for the first and takes what it has kept.

With ``NUMBA_DISABLE_JIT=1`` kernels are plain Python, for a debugger or to see which lines a test
reaches.
"""

from __future__ import annotations

import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numba import config, prange
from numba.core import sigutils
from numba.core.caching import IndexDataCacheFile
from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import Dispatcher

try:
    import fcntl
except ImportError:  # Windows: each process compiles for itself
    fcntl = None  # type: ignore[assignment]

__all__ = ["njit", "prange"]


def _plain(function: Any = None, **options: Any) -> Any:
    """Leave a kernel as it is, but silent about what compiled code does not speak of.

    Random streams wrap their integers around, and what an array holds may be divided by 0.
    """
    if function is None:
        return _plain
    kernel: Any = np.errstate(all="ignore")(function)
    kernel.py_func = function
    return kernel


njit: Any = _plain if config.DISABLE_JIT else numba.njit


def _unique_name(self: IndexDataCacheFile, number: int) -> str:
    stem = self._index_name.removesuffix(".nbi")
    return f"{stem}.{number}-{uuid.uuid4().hex[:12]}.nbc"


_compile = Dispatcher.compile
_held: set[Path] = set()


@contextmanager
def _alone(dispatcher: Dispatcher) -> Iterator[None]:
    """Keep other processes from compiling this kernel; the system ends the lock with the process.

    Locks are taken in the order of calls, callers first, which has no circles.
    """
    cache = dispatcher._cache  # type: ignore[attr-defined]
    folder = getattr(cache, "cache_path", None)
    if fcntl is None or folder is None:  # a kernel that is not kept
        yield
        return
    lock = Path(folder) / f"{cache._impl.filename_base}.lock"
    # Other threads of this process wait here, so that a lock on disk is asked for once.
    with global_compiler_lock:
        if lock in _held:
            yield
            return
        try:
            cache._impl.locator.ensure_cache_path()
            stream = open(lock, "a")  # noqa: SIM115
        except OSError:  # nothing can be written there, so nothing will be kept
            yield
            return
        with stream:
            with suppress(OSError):  # a file system without locks
                fcntl.flock(stream, fcntl.LOCK_EX)
            _held.add(lock)
            try:
                yield
            finally:
                _held.discard(lock)


def _compile_once(self: Dispatcher, sig: Any) -> Any:
    if tuple(sigutils.normalize_signature(sig)[0]) in self.overloads:
        return _compile(self, sig)
    with _alone(self):
        return _compile(self, sig)


# Numba offers no way of its own: its choice of a place (a locator) neither names the files nor
# stands between the search for machine code and the compiler.
IndexDataCacheFile._data_name = _unique_name
Dispatcher.compile = _compile_once  # type: ignore[method-assign]
