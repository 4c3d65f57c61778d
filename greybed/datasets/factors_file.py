"""View factors in HDF5, version 3: sparse rows with errors, walls, hash of the packing."""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from greybed._version import __version__
from greybed.core.errors import GreybedError, InputError
from greybed.core.files import atomic_path
from greybed.core.packing import Packing
from greybed.core.readers.opening import listed, mapped, shown
from greybed.core.records import record
from greybed.core.walls import Cylinder, Plane, Wall
from greybed.core.writers.hdf5_stream import written_hdf5
from greybed.raytrace import ViewFactors

FORMAT = "greybed-view-factors"
VERSION = 3
# Entries of one HDF5 chunk, half a MiB; and of one write, a whole number of chunks.
CHUNK = 2**16
SLAB = 32 * CHUNK

Block = Mapping[str, NDArray[Any]]


# Where arrays with an entry for each factor stand, and those with a row for each sphere.
ENTRY_ARRAYS = {"factors/data": "data", "factors/indices": "indices", "stderr/data": "stderr"}
ROW_ARRAYS = {
    "walls/stderr": "wall_stderr",
    "escaped": "escaped",
    "escaped_stderr": "escaped_stderr",
    "environment": "environment",
    "environment_stderr": "environment_stderr",
    "cost": "cost",
    "buried": "buried",
    "areas": "areas",
}
SPHERE_ARRAYS = (
    "escaped", "escaped_stderr", "environment", "environment_stderr", "buried", "areas",
)  # fmt: skip
SQUARE_METRES = ("areas", "spread", "spread_stderr")
ROW_NAMES = ("wall_factors", *ROW_ARRAYS.values())


@dataclass(frozen=True, eq=False)
class StoredFactors:
    """What a view-factor file holds.

    Attributes
    ----------
    result : ViewFactors
        The factors; ``seconds`` is NaN, for the file states nothing of the machine.
    packing_hash : str
        :func:`packing_hash` of the packing they were traced from.
    wall_names : tuple of str
        Names of the walls, in the order of ``result.wall_factors``.
    max_distance : float
        Distance at which rays ended [m].
    greybed : str
        Version that wrote the file.
    """

    result: ViewFactors
    packing_hash: str
    wall_names: tuple[str, ...]
    max_distance: float
    greybed: str

    def check(self, packing: Packing) -> None:
        """Refuse a packing other than the one that was traced.

        Raises
        ------
        InputError
            If the hashes differ.
        """
        if packing_hash(packing) != self.packing_hash:
            raise InputError(
                f"{packing.source}: these view factors belong to another packing (other spheres, "
                "box or walls); trace this one with greybed trace."
            )


def packing_hash(packing: Packing) -> str:
    """SHA-256 of everything that view factors depend on, not of names or files."""
    walls = [_shape(w) for w in packing.walls]
    box = None if packing.box is None else packing.box.tolist()
    digest = hashlib.sha256(json.dumps([len(packing), box, packing.periodic, walls]).encode())
    for array in (packing.centres, packing.radii):
        digest.update(np.ascontiguousarray(array, dtype="<f8").tobytes())
    return digest.hexdigest()


def _shape(wall: Wall) -> object:
    """What a wall is to rays, whatever its name."""
    # These two as they have always been written, so that older files keep their packing.
    if isinstance(wall, Plane):
        return ("plane", *wall.point, *wall.normal)
    if isinstance(wall, Cylinder) and wall.length is None:
        return ("cylinder", *wall.point, *wall.axis, float(wall.radius))
    said = ("name", "dropped", "watertight", "winding_consistent")
    return {part: value for part, value in record(wall).items() if part not in said}


def write_factors(
    path: str | os.PathLike[str],
    packing: Packing,
    result: ViewFactors,
    *,
    max_distance: float = math.inf,
) -> Path:
    """Write view factors; equal results give equal bytes, for no time or machine is stored.

    Parameters
    ----------
    path : path
        File to write, whole or not at all.
    packing : Packing
        What was traced.
    result : ViewFactors
        As :func:`greybed.raytrace.view_factors` returned it.
    max_distance : float
        As it was traced with [m].

    Raises
    ------
    InputError
        If the packing and the result differ in size.
    OutputError
        If the file cannot be written.
    """
    n, shape = len(packing), result.wall_factors.shape
    if result.factors.shape != (n, n) or shape != (n, packing.n_walls):
        raise InputError(
            f"{path}: factors of shape {result.factors.shape} and walls {shape} do not belong to "
            f"{n} spheres and {packing.n_walls} walls; give the packing that was traced."
        )
    return write_blocks(
        path, packing, [block_of(result, 0, n)], rays=result.rays, seed=result.seed,
        max_distance=max_distance, reciprocal=result.reciprocal,
    )  # fmt: skip


def block_of(result: ViewFactors, first: int, last: int) -> dict[str, NDArray[Any]]:
    """Rows ``first`` to ``last - 1`` of a result, in the arrays that :func:`write_blocks` takes."""
    rows = slice(first, last)
    entries = slice(*result.factors.indptr[[first, last]])
    lengths = np.diff(result.factors.indptr)[rows]
    data = result.factors.data[entries]
    own = np.repeat(np.arange(last - first), lengths)
    return {
        "data": data,
        "stderr": result.stderr.data[entries],
        "indices": result.factors.indices[entries].astype(np.int32),
        "lengths": lengths.astype(np.int64),
        "sums": np.bincount(own, data, last - first),
        **{name: getattr(result, name)[rows] for name in ROW_NAMES},
    }


def write_blocks(
    path: str | os.PathLike[str],
    packing: Packing,
    blocks: Sequence[Block],
    *,
    rays: int,
    seed: int,
    max_distance: float = math.inf,
    reciprocal: bool = False,
) -> Path:
    """Write rows that come in blocks, with one block in memory at a time.

    Parameters
    ----------
    path : path
        File to write, whole or not at all.
    packing : Packing
        What was traced.
    blocks : sequence of mappings
        Consecutive rows as :func:`block_of` gives them. Each array is looked up when it is
        written, so a mapping may read it from a file then. The cuts between blocks change no byte.
    rays, seed, max_distance, reciprocal
        See :class:`greybed.raytrace.ViewFactors` and :func:`write_factors`.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """

    def rows(name: str) -> NDArray[Any]:
        return np.concatenate([block[name] for block in blocks])

    lengths = rows("lengths")
    start = np.concatenate([[0], np.cumsum(lengths)])
    walls = rows("wall_factors")
    # Check sums, and texts of fixed length: see core/writers/hdf5.py.
    with atomic_path(path) as part, written_hdf5(part, libver=("v110", "v110")) as root:
        root.attrs["format"] = np.bytes_(FORMAT)
        root.attrs["version"] = VERSION
        root.attrs["greybed"] = np.bytes_(__version__)
        root.attrs["packing"] = np.bytes_(packing_hash(packing))
        root.attrs["rays"] = rays
        root.attrs["seed"] = seed
        root.attrs["reciprocal"] = reciprocal
        root.attrs["max_distance"] = max_distance
        root.attrs["wall_names"] = np.bytes_(json.dumps([wall.name for wall in packing.walls]))
        for name, part_of in ENTRY_ARRAYS.items():
            kind = np.int32 if part_of == "indices" else np.float64
            target = created(root, name, (int(start[-1]),), kind)
            begin = 0
            for slab in _slabs(block[part_of] for block in blocks):
                target[begin : begin + len(slab)] = slab
                begin += len(slab)
        per_row = {
            "factors/indptr": start,
            "walls/factors": walls,
            "sums/spheres": rows("sums"),
            "sums/walls": walls.sum(axis=1),
            **{place: rows(name) for place, name in ROW_ARRAYS.items()},
        }
        for name, values in per_row.items():
            created(root, name, values.shape, values.dtype)[...] = values
    return Path(path)


def created(root: Any, name: str, shape: tuple[int, ...], kind: Any) -> Any:
    """An empty dataset with its unit, checked where there is something to check."""
    size = math.prod(shape)
    rows = max(1, min(shape[0], CHUNK * shape[0] // max(size, 1)))
    checked = {"chunks": (rows, *shape[1:]), "fletcher32": True} if size else {}
    dataset = root.create_dataset(name, shape, kind, **checked)
    dataset.attrs["units"] = np.bytes_("m2" if name in SQUARE_METRES else "-")
    return dataset


def _slabs(pieces: Iterator[NDArray[Any]]) -> Iterator[NDArray[Any]]:
    """The same entries in pieces of SLAB, however they come: HDF5's bytes follow the writes."""
    held: list[NDArray[Any]] = []
    count = 0
    for piece in pieces:
        held.append(piece)
        count += len(piece)
        if count >= SLAB:
            joined = np.concatenate(held)
            whole = count - count % SLAB
            for begin in range(0, whole, SLAB):
                yield joined[begin : begin + SLAB]
            held, count = [joined[whole:]], count - whole
    if count:
        yield np.concatenate(held)


def read_factors(path: str | os.PathLike[str]) -> StoredFactors:
    """Read a file of :func:`write_factors`.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    stored : StoredFactors
        The same bits as were written.

    Raises
    ------
    InputError
        If the file is missing, cut, damaged, or of another kind or version.
    """
    import h5py

    place = Path(path)
    with mapped(place):
        pass  # refuses what is missing, empty, or no regular file
    try:
        with h5py.File(place, "r") as root:
            return _read(place, root)
    except GreybedError:
        raise
    except Exception as error:  # what h5py raises for a damaged file is not documented
        raise InputError(
            f"{place}: the HDF5 content is cut or damaged ({shown(str(error), 80)}); trace the "
            "packing again with greybed trace."
        ) from None


def text_of(root: Any, name: str) -> str:
    """An attribute as text, ``missing`` where it is not there."""
    value = root.attrs.get(name, b"missing")
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


def array_of(place: Path, root: Any, name: str, shape: tuple[int, ...], kind: str) -> NDArray[Any]:
    """A dataset of this shape and kind of number, whole, or an InputError."""
    import h5py

    item = root.get(name)
    fits = isinstance(item, h5py.Dataset) and item.shape == shape and item.dtype.kind == kind
    if not fits or (item.size and item.nbytes > item.id.get_storage_size()):
        raise InputError(
            f"{place}: dataset {name!r} is missing, cut, or not of shape {shape}; trace the "
            "packing again with greybed trace."
        )
    return np.asarray(item[()])


def _read(place: Path, root: Any) -> StoredFactors:
    kind, version = text_of(root, "format"), root.attrs.get("version")
    if kind != FORMAT:
        raise InputError(
            f"{place}: root attribute format = {shown(kind)} is not {FORMAT!r}; this HDF5 file "
            f"holds no view factors (it has: {listed(list(root))}): give the view_factors.h5 of "
            "greybed trace."
        )
    if version != VERSION:
        raise InputError(
            f"{place}: version = {shown(str(version))} of {FORMAT} is not {VERSION}, the one that "
            "this greybed reads; install a newer greybed, or trace the packing again."
        )
    names = tuple(str(name) for name in json.loads(text_of(root, "wall_names")))
    n = int(root["escaped"].shape[0])
    indptr = array_of(place, root, "factors/indptr", (n + 1,), "i")
    size = int(indptr[-1])
    if indptr[0] != 0 or (np.diff(indptr) < 0).any():
        raise InputError(f"{place}: factors/indptr does not rise from 0; trace the packing again.")
    indices = array_of(place, root, "factors/indices", (size,), "i")
    if size and not (indices.min() >= 0 and indices.max() < n):
        raise InputError(
            f"{place}: factors/indices exceeds 0 ... {n - 1}; trace the packing again."
        )
    data = array_of(place, root, "factors/data", (size,), "f")
    errors = array_of(place, root, "stderr/data", (size,), "f")
    result = ViewFactors(
        factors=sparse.csr_array((data, indices, indptr), shape=(n, n)),
        stderr=sparse.csr_array((errors, indices, indptr), shape=(n, n)),
        wall_factors=array_of(place, root, "walls/factors", (n, len(names)), "f"),
        wall_stderr=array_of(place, root, "walls/stderr", (n, len(names)), "f"),
        **{name: array_of(place, root, name, (n,), "f") for name in SPHERE_ARRAYS},
        rays=int(root.attrs["rays"]),
        seed=int(root.attrs["seed"]),
        seconds=math.nan,
        cost=array_of(place, root, "cost", (n,), "i"),
        reciprocal=bool(root.attrs["reciprocal"]),
    )
    return StoredFactors(
        result,
        text_of(root, "packing"),
        names,
        float(root.attrs["max_distance"]),
        text_of(root, "greybed"),
    )
