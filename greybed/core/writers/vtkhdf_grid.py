"""VTKHDF for ParaView: cell values of a regular grid over time in one file.

Format 2.0, ``ImageData`` with ``Steps`` (docs.vtk.org, VTKHDF file format). Frames wait in parts,
each whole or not there, as those of particles do.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from greybed.core.files import atomic_path
from greybed.core.writers.vtkhdf_root import steps_of, vtkhdf_file


def write_grid_part(
    path: str | os.PathLike[str], fields: Mapping[str, ArrayLike], time: float
) -> Path:
    """Keep a frame until :func:`join_grid_parts`.

    Parameters
    ----------
    path : path
        ``.npz`` file to write.
    fields : dict of arrays, shapes (nz, ny, nx) or (nz, ny, nx, 3)
        Cell values; a slash in a name becomes " per ", as HDF5 keeps it for folders.
    time : float
        Of the frame [s].

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    names = [name.replace("/", " per ") for name in fields]
    arrays = {f"field_{k}": np.asarray(a, np.float32) for k, a in enumerate(fields.values())}
    with atomic_path(path) as part, open(part, "wb") as stream:
        np.savez(stream, allow_pickle=False, time=np.array(time), names=np.array(names), **arrays)
    return Path(path)


def join_grid_parts(
    path: str | os.PathLike[str],
    parts: Sequence[str | os.PathLike[str]],
    cells: tuple[int, int, int],
    lower: tuple[float, float, float],
    spacing: tuple[float, float, float],
) -> Path:
    """Write one file of all frames, whole or not at all.

    Parameters
    ----------
    path : path
        ``.vtkhdf`` file to write.
    parts : sequence of paths
        Of :func:`write_grid_part`, in the order of time, with the same fields; one at least.
    cells : three ints
        Along x, y and z.
    lower, spacing : three floats
        Corner of the grid and edges of a cell [m].

    Raises
    ------
    InputError
        If there is no part.
    OutputError
        If the file cannot be written.
    """
    with vtkhdf_file(path, "ImageData", len(parts)) as root:
        nx, ny, nz = cells
        root.attrs["WholeExtent"] = np.array([0, nx, 0, ny, 0, nz], dtype=np.int64)
        root.attrs["Origin"] = np.array(lower)
        root.attrs["Spacing"] = np.array(spacing)
        root.attrs["Direction"] = np.eye(3).ravel()
        data, times = root.create_group("CellData"), []
        for number, part in enumerate(parts):
            with np.load(part, allow_pickle=False) as frame:
                for k, name in enumerate(frame["names"].tolist()):
                    values = frame[f"field_{k}"]
                    if name not in data:
                        data.create_dataset(
                            name, shape=(len(parts), *values.shape), dtype="f4",
                            chunks=(1, *values.shape), compression="gzip", compression_opts=1,
                            shuffle=True,
                        )  # fmt: skip
                    data[name][number] = values
                times.append(float(frame["time"]))
        steps_of(root, times)
    return Path(path)
