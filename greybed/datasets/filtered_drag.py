"""Data sets of filtered drag in HDF5: rows of filtered fields, and the cases behind them."""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import asdict, dataclass, fields
from importlib.resources import files
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from greybed._version import __version__
from greybed.core.errors import InputError
from greybed.core.files import atomic_path
from greybed.core.writers.hdf5_stream import written_hdf5
from greybed.datasets.columns import whole_column

Array = NDArray[np.float64]

FORMAT = "greybed-filtered-drag"
VERSION = 1
CONVENTION = "fraction kept"

# Columns of rows: unit and numbers each.
COLUMNS: dict[str, tuple[str, int]] = {
    "solid_fraction": ("1", 1),
    "slip": ("m s-1", 3),
    "pressure_gradient": ("Pa m-1", 3),
    "drag_force": ("N m-3", 3),
    "drift_velocity": ("m s-1", 3),
    "scalar_variance": ("1", 1),
    "solids_stress": ("m2 s-2", 3),
    "gas_stress": ("m2 s-2", 3),
    "filter_size": ("m", 1),
    "filter_cells": ("1", 1),
    "case": ("1", 1),
}
WHOLE = ("filter_cells", "case")


@dataclass(frozen=True, kw_only=True)
class DragCase:
    """One run.

    Attributes
    ----------
    name, source : str
        Source: ``two-fluid`` or ``cfd-dem``.
    dimension : int
        2 or 3.
    diameter, particle_density, gas_density, gas_viscosity : float
        [m], [kg m-3], [kg m-3], [Pa s].
    gravity : float
        Magnitude [m s-2].
    gravity_axis : (float, float, float)
        Its direction.
    mean_solid_fraction, packing, restitution : float
        [-].
    cell : float
        Edge of a cell of the fine grid [m].
    box : (float, float, float)
        [m].
    law : str
        Drag law on the fine grid.
    seed : int
    start, stop : float
        Times between which it was filtered [s].
    parcels : float
        Particles in a parcel [-].
    """

    name: str
    source: str
    dimension: int
    diameter: float
    particle_density: float
    gas_density: float
    gas_viscosity: float
    gravity: float
    gravity_axis: tuple[float, float, float]
    mean_solid_fraction: float
    cell: float
    box: tuple[float, float, float]
    law: str
    packing: float
    restitution: float
    seed: int
    start: float
    stop: float
    parcels: float = 1.0


@dataclass(frozen=True, eq=False, kw_only=True)
class FilteredDrag:
    """Rows (n of them) of filtered fields; forces are those on the particles, drag kept.

    Attributes
    ----------
    solid_fraction : (n,) float
        Filtered [-].
    slip : (n, 3) float
        Gas less solids, each weighted with its phase [m s-1].
    pressure_gradient : (n, 3) float
        Filtered, with its mean in a periodic box [Pa m-1].
    drag_force : (n, 3) float
        Filtered drag on the particles in a unit volume [N m-3].
    drift_velocity : (n, 3) float
        Gas velocity weighted with the solids less that weighted with the gas [m s-1].
    scalar_variance : (n,) float
        Of the solid fraction inside a filter [-].
    solids_stress, gas_stress : (n, 3) float
        Diagonals of the sub-filter stresses over the density [m2 s-2].
    filter_size : (n,) float
        Edge of the filter [m].
    filter_cells : (n,) int
        Cells of the fine grid across a filter [-].
    case : (n,) int
        Index into ``cases``.
    cases : tuple of DragCase
    convention : str
        What a correction counts: ``fraction kept``.
    """

    solid_fraction: Array
    slip: Array
    pressure_gradient: Array
    drag_force: Array
    drift_velocity: Array
    scalar_variance: Array
    solids_stress: Array
    gas_stress: Array
    filter_size: Array
    filter_cells: NDArray[np.int64]
    case: NDArray[np.int64]
    cases: tuple[DragCase, ...]
    convention: str = CONVENTION

    @property
    def digest(self) -> str:
        """SHA-256 over rows and cases; the same before and after a file (single precision)."""
        found = hashlib.sha256(_cases_text(self.cases).encode())
        for name in COLUMNS:
            found.update(name.encode())
            found.update(_stored(name, getattr(self, name)).tobytes())
        return found.hexdigest()


def _cases_text(cases: tuple[DragCase, ...]) -> str:
    return json.dumps([asdict(case) for case in cases], sort_keys=True)


def _stored(name: str, column: NDArray[Any]) -> NDArray[Any]:
    return np.ascontiguousarray(column, dtype=np.int32 if name in WHOLE else np.float32)


def _case(table: dict[str, Any]) -> DragCase:
    known = {f.name for f in fields(DragCase)}
    found: dict[str, Any] = {
        k: tuple(v) if isinstance(v, list) else v for k, v in table.items() if k in known
    }
    return DragCase(**found)


def write_filtered_drag(path: str | os.PathLike[str], data: FilteredDrag) -> Path:
    """Write a data set, whole or not at all; numbers in single precision."""
    target = Path(path)
    with atomic_path(target) as temporary, written_hdf5(temporary) as file:
        file.attrs["format"] = FORMAT
        file.attrs["version"] = VERSION
        file.attrs["greybed"] = __version__
        file.attrs["convention"] = data.convention
        file.attrs["sha256"] = data.digest
        file.attrs["cases"] = _cases_text(data.cases)
        for name, (unit, _) in COLUMNS.items():
            column = _stored(name, getattr(data, name))
            made = file.create_dataset(name, data=column, compression="gzip", shuffle=True)
            made.attrs["unit"] = unit
    return target


def read_filtered_drag(path: str | os.PathLike[str]) -> FilteredDrag:
    """Read a data set and check its hash.

    Raises
    ------
    InputError
        If the file is missing, no data set, changed, or of another convention.
    """
    place = Path(path)
    try:
        with h5py.File(place, "r") as file:
            if file.attrs.get("format") != FORMAT or int(file.attrs.get("version", 0)) != VERSION:
                raise InputError(
                    f"{place}: not a data set of filtered drag of version {VERSION}; make one with "
                    "greybed dataset."
                )
            convention = str(file.attrs["convention"])
            if convention != CONVENTION:
                raise InputError(
                    f"{place}: its drag is counted as {convention!r} and must be {CONVENTION!r}; "
                    "convert it (kept = 1 - lost)."
                )
            columns: dict[str, Any] = {
                name: whole_column(file, name, "i" if name in WHOLE else "f").astype(
                    np.int64 if name in WHOLE else np.float64
                )
                for name in COLUMNS
            }
            listed = json.loads(str(file.attrs["cases"]))
            stored = str(file.attrs["sha256"])
            if len({len(column) for column in columns.values()}) != 1:
                raise ValueError("columns of different lengths")
            cases = tuple(_case(table) for table in listed)
    except InputError:
        raise
    except Exception as error:  # what h5py raises for a damaged file is not documented
        raise InputError(
            f"{place}: cannot read this data set ({error}); check the path, or make it again."
        ) from None
    data = FilteredDrag(**columns, cases=cases, convention=convention)
    with np.errstate(all="ignore"):  # numbers that are too large for what was written
        digest = data.digest
    if digest != stored:
        raise InputError(f"{place}: the data set was changed (its SHA-256 differs); copy it again.")
    return data


def shipped_filtered_drag() -> FilteredDrag:
    """The data set that comes with greybed, of ``examples/filtered_drag/default.toml``.

    ``docs/filtered_drag.md`` says which of its cases are finished in it.
    """
    return read_filtered_drag(str(files("greybed.datasets").joinpath("filtered_drag.h5")))
