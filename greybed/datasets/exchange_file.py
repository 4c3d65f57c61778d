"""Exchange factors in HDF5: one group for each set of emissivities, sparse rows with errors."""

from __future__ import annotations

import json
import math
import os
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
from greybed.core.writers.hdf5_stream import written_hdf5
from greybed.datasets.factors_file import array_of, created, packing_hash, text_of
from greybed.raytrace import ExchangeFactors, ExchangeRows, PatchExchange

FORMAT = "greybed-exchange-factors"
VERSION = 1
AGAIN = "trace the packing again with greybed trace --emissivity"

# Arrays of a set with a row for each sphere, and of its walls' own rows.
ROWS = (
    "wall_factors", "wall_stderr", "escaped", "escaped_stderr", "emissivity", "areas", "buried",
    "spread", "spread_stderr",
)  # fmt: skip
WALLS = (
    "wall_factors", "wall_stderr", "escaped", "escaped_stderr", "emissivity", "areas", "buried",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class StoredExchange:
    """What a file of exchange factors holds.

    Attributes
    ----------
    results : ExchangeFactors
        The sets; ``seconds`` is NaN, and images are not kept apart.
    packing_hash : str
        :func:`greybed.datasets.factors_file.packing_hash` of the packing that was traced.
    wall_names : tuple of str
        In the order of the walls.
    max_distance : float
        Of each flight [m].
    greybed : str
        Version that wrote the file.
    """

    results: ExchangeFactors
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
                f"{packing.source}: these exchange factors belong to another packing (other "
                f"spheres, box or walls); {AGAIN}."
            )


def write_exchange(
    path: str | os.PathLike[str],
    packing: Packing,
    results: ExchangeFactors,
    *,
    max_distance: float = math.inf,
) -> Path:
    """Write exchange factors; equal results give equal bytes.

    Parameters
    ----------
    path : path
        File to write, whole or not at all.
    packing : Packing
        What was traced.
    results : ExchangeFactors
        As :func:`greybed.raytrace.exchange_factors` returned them; ``pairs`` are not written.
    max_distance : float
        As they were traced with [m].

    Raises
    ------
    InputError
        If the packing and the results differ in size.
    OutputError
        If the file cannot be written.
    """

    n = len(packing)
    shape = results[0].wall_factors.shape
    if shape != (n, packing.n_walls):
        raise InputError(
            f"{path}: exchange factors of {shape[0]} spheres and {shape[1]} walls do not belong to "
            f"{n} spheres and {packing.n_walls} walls; give the packing that was traced."
        )
    with atomic_path(path) as part, written_hdf5(part, libver=("v110", "v110")) as root:
        root.attrs["format"] = np.bytes_(FORMAT)
        root.attrs["version"] = VERSION
        root.attrs["greybed"] = np.bytes_(__version__)
        root.attrs["packing"] = np.bytes_(packing_hash(packing))
        root.attrs["rays"] = results[0].rays
        root.attrs["seed"] = results[0].seed
        root.attrs["sets"] = len(results)
        root.attrs["max_distance"] = max_distance
        root.attrs["wall_names"] = np.bytes_(json.dumps([wall.name for wall in packing.walls]))
        for k, rows in enumerate(results):
            group = root.create_group(f"set_{k}")
            group.attrs["cut"] = rows.cut
            _matrices(group, rows.factors, rows.stderr)
            for name in ROWS:
                _put(group, name, getattr(rows, name))
            _put(group, "wall_emissivity", rows.wall_emissivity)
            if rows.patches is not None:
                own = group.create_group("patches")
                own.attrs["rays"] = rows.patches.rays
                _matrices(own, rows.patches.factors, rows.patches.stderr)
                for name in WALLS:
                    _put(own, name, getattr(rows.patches, name))
    return Path(path)


def _put(group: Any, name: str, values: NDArray[Any]) -> None:
    created(group, name, values.shape, values.dtype)[...] = values


def _matrices(group: Any, factors: sparse.csr_array, stderr: sparse.csr_array) -> None:
    _put(group, "factors/indptr", factors.indptr.astype(np.int64))
    _put(group, "factors/indices", factors.indices.astype(np.int32))
    _put(group, "factors/data", factors.data)
    _put(group, "stderr/data", stderr.data)


def read_exchange(path: str | os.PathLike[str]) -> StoredExchange:
    """Read a file of :func:`write_exchange`: the same bits as were written.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    stored : StoredExchange

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
            f"{place}: the HDF5 content is cut or damaged ({shown(str(error), 80)}); {AGAIN}."
        ) from None


def _read(place: Path, root: Any) -> StoredExchange:
    kind, version = text_of(root, "format"), root.attrs.get("version")
    if kind != FORMAT or version != VERSION:
        raise InputError(
            f"{place}: format {shown(kind)}, version {shown(str(version))} is not {FORMAT!r}, "
            f"version {VERSION} (it has: {listed(list(root))}); {AGAIN}."
        )
    names = tuple(str(name) for name in json.loads(text_of(root, "wall_names")))
    rays, seed = int(root.attrs["rays"]), int(root.attrs["seed"])
    sets = tuple(
        _set(place, root[f"set_{k}"], len(names), rays, seed)
        for k in range(int(root.attrs["sets"]))
    )
    return StoredExchange(
        ExchangeFactors(sets),
        text_of(root, "packing"),
        names,
        float(root.attrs["max_distance"]),
        text_of(root, "greybed"),
    )


def _set(place: Path, group: Any, walls: int, rays: int, seed: int) -> ExchangeRows:
    n = int(group["escaped"].shape[0])
    shapes = {"wall_factors": (n, walls), "wall_stderr": (n, walls)}
    shapes |= {"spread": (n, 4), "spread_stderr": (n, 4)}
    factors, stderr = _sparse(place, group, (n, n))
    arrays: dict[str, Any] = {
        name: array_of(place, group, name, shapes.get(name, (n,)), "f") for name in ROWS
    }
    patches = None
    if "patches" in group:
        own = group["patches"]
        square = {"wall_factors": (walls, walls), "wall_stderr": (walls, walls)}
        to_spheres, error = _sparse(place, own, (walls, n))
        parts: dict[str, Any] = {
            name: array_of(place, own, name, square.get(name, (walls,)), "f") for name in WALLS
        }
        patches = PatchExchange(
            factors=to_spheres, stderr=error, rays=int(own.attrs["rays"]), **parts
        )
    return ExchangeRows(
        factors=factors,
        stderr=stderr,
        wall_emissivity=array_of(place, group, "wall_emissivity", (walls,), "f"),
        pairs=None,
        patches=patches,
        cut=float(group.attrs["cut"]),
        rays=rays,
        seed=seed,
        seconds=math.nan,
        **arrays,
    )


def _sparse(
    place: Path, group: Any, shape: tuple[int, int]
) -> tuple[sparse.csr_array, sparse.csr_array]:
    indptr = array_of(place, group, "factors/indptr", (shape[0] + 1,), "i")
    size = int(indptr[-1])
    indices = array_of(place, group, "factors/indices", (size,), "i")
    rising = indptr[0] == 0 and (np.diff(indptr) >= 0).all()
    if not rising or (size and not (indices.min() >= 0 and indices.max() < shape[1])):
        raise InputError(f"{place}: {group.name}/factors has rows that do not fit; {AGAIN}.")
    data = array_of(place, group, "factors/data", (size,), "f")
    error = array_of(place, group, "stderr/data", (size,), "f")
    return (
        sparse.csr_array((data, indices, indptr), shape=shape),
        sparse.csr_array((error, indices, indptr), shape=shape),
    )
