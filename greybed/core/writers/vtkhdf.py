"""VTKHDF for ParaView: all frames of a run in one file, a vertex for each sphere with its radius.

Format 2.0, ``UnstructuredGrid`` with ``Steps`` (docs.vtk.org, VTKHDF file format). A file that is
being written is of no use after a kill, so frames wait in parts, each whole or not there.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.core.errors import InputError
from greybed.core.files import atomic_path
from greybed.core.packing import Packing
from greybed.core.writers.vtkhdf_root import steps_of, vtkhdf_file

# Rows in a chunk of the arrays, which grow by a frame at a time.
_CHUNK = 4096
_VERTEX = 1  # VTK's number of this cell


def write_part(
    path: str | os.PathLike[str], packing: Packing, fields: Mapping[str, ArrayLike], time: float
) -> Path:
    """Keep a frame until :func:`join_parts`.

    Parameters
    ----------
    path : path
        ``.npz`` file to write.
    packing : Packing
        Spheres [m].
    fields : dict of (n,) or (n, k) arrays
        Further numbers per sphere; a slash in a name becomes " per ", as HDF5 keeps it for folders.
    time : float
        Of the frame [s].

    Raises
    ------
    InputError
        If a field does not fit.
    OutputError
        If the file cannot be written.
    """
    arrays: dict[str, NDArray[np.float64]] = {"radius": packing.radii}
    for name, values in fields.items():
        array = np.asarray(values, dtype=np.float64)
        if array.ndim not in (1, 2) or len(array) != len(packing):
            raise InputError(
                f"field {name!r} has shape {array.shape}; give one row for each of the "
                f"{len(packing)} spheres."
            )
        arrays[name.replace("/", " per ")] = array
    columns = {f"field_{k}": array for k, array in enumerate(arrays.values())}
    with atomic_path(path) as part, open(part, "wb") as stream:
        np.savez(
            stream, allow_pickle=False, time=np.array(time), centres=packing.centres,
            names=np.array(list(arrays)), **columns,
        )  # fmt: skip
    return Path(path)


def join_parts(path: str | os.PathLike[str], parts: Sequence[str | os.PathLike[str]]) -> Path:
    """Write one file of all frames, whole or not at all.

    Parameters
    ----------
    path : path
        ``.vtkhdf`` file to write.
    parts : sequence of paths
        Of :func:`write_part`, in the order of time, with the same fields; one at least.

    Raises
    ------
    InputError
        If there is no part, or one has other fields than the first.
    OutputError
        If the file cannot be written.
    """
    with vtkhdf_file(path, "UnstructuredGrid", len(parts)) as root:
        counts, times = [], []
        names: list[str] | None = None
        for part in parts:
            with np.load(part, allow_pickle=False) as frame:
                own = frame["names"].tolist()
                if names is None:
                    names = own
                elif own != names:
                    raise InputError(f"{part}: fields {own} are not those of the first, {names}.")
                n = len(frame["centres"])
                _append(root, "Points", frame["centres"])
                for k, name in enumerate(own):
                    _append(root, f"PointData/{name}", frame[f"field_{k}"])
                times.append(float(frame["time"]))
            counts.append(n)
            _append(root, "Connectivity", np.arange(n))
            _append(root, "Offsets", np.arange(n + 1))
            _append(root, "Types", np.full(n, _VERTEX, np.uint8))
        for name in ("NumberOfPoints", "NumberOfCells", "NumberOfConnectivityIds"):
            root[name] = np.array(counts, dtype=np.int64)
        before = np.cumsum([0, *counts[:-1]])
        steps = steps_of(root, times)
        steps["NumberOfParts"] = np.ones(len(counts), np.int64)
        steps["PartOffsets"] = np.arange(len(counts))
        for name in ("PointOffsets", "CellOffsets", "ConnectivityIdOffsets"):
            steps[name] = before
        for name in names or ():
            steps[f"PointDataOffsets/{name}"] = before
    return Path(path)


def _append(root: Any, name: str, values: NDArray[Any]) -> None:
    """Add rows to an array of the file, which is made with the first ones."""
    if name not in root:
        root.create_dataset(
            name, data=values, maxshape=(None, *values.shape[1:]),
            chunks=(_CHUNK, *values.shape[1:]), compression="gzip", compression_opts=1,
            shuffle=True,
        )  # fmt: skip
        return
    there = len(root[name])
    root[name].resize(there + len(values), axis=0)
    root[name][there:] = values
