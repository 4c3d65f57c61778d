"""Columns of HDF5 files that may be damaged: read only where the file has them whole."""

from __future__ import annotations

from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

# Deflate packs no better: what states more than this was never written.
MOST_PACKED = 1100


def whole_column(group: Any, name: str, kind: str) -> NDArray[Any]:
    """A column of numbers, or a ValueError.

    A file may state any number of rows without having them: reading would fill the memory with
    zeros.

    Parameters
    ----------
    group : h5py group
        Where it is.
    name : str
        The dataset in it.
    kind : str
        ``f`` or ``i``, of the numbers.
    """
    item = group.get(name)
    if not isinstance(item, h5py.Dataset) or not item.ndim or item.dtype.kind != kind:
        raise ValueError(f"column {name!r} is missing or of another kind")
    if item.external or (item.size and item.nbytes > MOST_PACKED * item.id.get_storage_size()):
        raise ValueError(f"column {name!r} states {item.size} numbers that the file does not hold")
    return np.asarray(item[()])
