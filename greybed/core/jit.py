"""The compiler of every kernel: Numba's, with machine code on disk that processes can share.

Numba numbers the files that it keeps of one kernel by what its index held a moment before. Two
processes that compile two sets of argument types at once then write the same file, and the index
leads every later process to machine code for other types: it computes nonsense or crashes. Names
that are never used twice leave nothing to mix up; at worst an entry of the index is lost, and
compiled once more.

With ``NUMBA_DISABLE_JIT=1`` kernels are plain Python, for a debugger or to see which lines a test
reaches.
"""

import uuid
from typing import Any

import numba
import numpy as np
from numba import config, prange
from numba.core.caching import IndexDataCacheFile

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


# Numba offers no way of its own: its choice of a place (a locator) does not name the files.
IndexDataCacheFile._data_name = _unique_name
