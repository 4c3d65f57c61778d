"""What every VTKHDF file has: its group, version and type, and the times of its frames.

Format 2.0 (docs.vtk.org, VTKHDF file format).
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from greybed.core.errors import InputError
from greybed.core.files import atomic_path
from greybed.core.writers.hdf5_stream import written_hdf5


@contextmanager
def vtkhdf_file(path: str | os.PathLike[str], kind: str, frames: int) -> Iterator[Any]:
    """Group ``VTKHDF`` of a new file of type ``kind``; it comes into place whole or not at all.

    Raises
    ------
    InputError
        If there are no frames.
    OutputError
        If the file cannot be written.
    """
    if not frames:
        raise InputError(f"{path}: there is no frame to write; give one at least.")
    with atomic_path(path) as target, written_hdf5(target, libver=("v110", "v110")) as file:
        root = file.create_group("VTKHDF")
        root.attrs["Version"] = np.array([2, 0], dtype=np.int64)
        # A text of fixed length in ASCII: readers of VTK take no other.
        root.attrs.create("Type", np.bytes_(kind))
        yield root


def steps_of(root: Any, times: Sequence[float]) -> Any:
    """Group ``Steps`` with the times of the frames [s]."""
    steps = root.create_group("Steps")
    steps.attrs["NSteps"] = len(times)
    steps["Values"] = np.array(times)
    return steps
