"""The compiler of every kernel: Numba's, with machine code on disk that processes can share.

Numba numbers the files that it keeps of one kernel by what its index held a moment before. Two
processes that compile two sets of argument types at once then write the same file, and the index
leads every later process to machine code for other types: it computes nonsense or crashes. Names
that are never used twice leave nothing to mix up; at worst an entry of the index is lost, and
compiled once more.
"""

import uuid

from numba import njit, prange
from numba.core.caching import IndexDataCacheFile

__all__ = ["njit", "prange"]


def _unique_name(self: IndexDataCacheFile, number: int) -> str:
    stem = self._index_name.removesuffix(".nbi")
    return f"{stem}.{number}-{uuid.uuid4().hex[:12]}.nbc"


# Numba offers no way of its own: its choice of a place (a locator) does not name the files.
IndexDataCacheFile._data_name = _unique_name
