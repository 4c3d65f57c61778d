"""Readers of particle files: one door, ``read_packing``, that finds the format by itself."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from numpy.typing import ArrayLike

from greybed.core.errors import InputError
from greybed.core.packing import Packing
from greybed.core.readers import dump, hdf5, table, vtk
from greybed.core.readers.assembling import Options
from greybed.core.readers.mesh import read_mesh
from greybed.core.readers.opening import mapped, shown
from greybed.core.walls import Wall

__all__ = ["FORMATS", "file_format", "read_mesh", "read_packing"]

# format -> (what a message calls it, the extensions that announce it)
FORMATS = {
    "dump": ("LIGGGHTS/LAMMPS dump", (".dump", ".lammpstrj", ".liggghts", ".lammps")),
    "table": ("CSV table", (".csv", ".tsv", ".txt", ".dat")),
    "hdf5": ("greybed HDF5", (".h5", ".hdf5", ".hdf")),
    "vtk": ("legacy VTK", (".vtk",)),
}
_READ = "greybed reads LIGGGHTS/LAMMPS dumps, CSV with units, its own HDF5 and legacy VTK"
# first bytes of files that people do give, with what to do about them
_FOREIGN = (
    (b"\x1f\x8b", "gzip-compressed; unpack it first (gunzip)"),
    (b"PK\x03\x04", "a zip or spreadsheet file; unpack it, or save the sheet as CSV"),
    (b"\xff\xfe", "UTF-16 text; save it as UTF-8"),
    (b"\xfe\xff", "UTF-16 text; save it as UTF-8"),
)


def _identify(path: Path, head: bytes) -> str:
    """Format of a file from its first bytes, or from its extension where these are text."""
    if head.startswith(b"\x89HDF\r\n\x1a\n"):
        return "hdf5"
    for magic, advice in _FOREIGN:
        if head.startswith(magic):
            raise InputError(f"{path}: this is {advice}.")
    start = head.removeprefix(b"\xef\xbb\xbf").lstrip()
    if start[:5].lower() == b"<?xml" or start.startswith(b"<VTKFile"):
        raise InputError(f"{path}: this is XML, which greybed writes but does not read; {_READ}.")
    if start.lower().startswith(b"# vtk"):
        return "vtk"
    if start.startswith(b"ITEM:"):
        return "dump"
    extension = path.suffix.lower()
    named = next((kind for kind, (_, known) in FORMATS.items() if extension in known), "table")
    if b"\x00" in head:
        what = "text" if named == "table" else f"a {FORMATS[named][0]}"
        raise InputError(
            f"{path}: the first bytes {shown(head, 8)} are not those of {what}; {_READ}: "
            "check that this is the right file, and whole."
        )
    return named


def file_format(path: str | os.PathLike[str]) -> str:
    """Format of a particle file, a key of ``FORMATS``, by content first and extension second.

    Raises
    ------
    InputError
        If the file cannot be opened, is empty, or holds a format that greybed does not read.
    """
    place = Path(path)
    with mapped(place) as data:
        return _identify(place, data[:512])


def read_packing(
    path: str | os.PathLike[str],
    walls: Sequence[Wall] = (),
    *,
    frame: int | None = None,
    unit: str | None = None,
    box: ArrayLike | None = None,
    periodic: tuple[bool, bool, bool] | None = None,
) -> Packing:
    """Read a bed of spheres.

    Parameters
    ----------
    path : path
        LIGGGHTS/LAMMPS text dump, CSV with units in its header, greybed HDF5 or legacy VTK;
        ``docs/formats.md`` says what each must hold.
    walls : sequence of walls
        Walls of the bed [m]; they replace those of an HDF5 file, if any are given.
    frame : int, optional
        Frame of a dump, counted from 0, or from the end where negative; the last if left out.
    unit : str, optional
        Length unit of a dump or VTK file, such as ``mm``; metres if left out.
    box : array_like, shape (3,) or (2, 3), optional
        Edge lengths, or lower and upper corner [m]; replaces that of the file.
    periodic : three bools, optional
        Which directions repeat; replaces what the file says.

    Returns
    -------
    packing : Packing
        Checked, in metres; spheres sorted by ``id`` where the file has ids.

    Raises
    ------
    InputError
        One sentence with file, line, value, bound and remedy, for anything that cannot be used.

    Examples
    --------
    >>> from greybed.core.readers import read_packing
    >>> len(read_packing("greybed/datasets/packings/settled_mono_4k.dump"))
    4000
    """
    place = Path(path)
    options = Options(walls=tuple(walls), frame=frame, unit=unit, box=box, periodic=periodic)
    with mapped(place) as data:
        kind = _identify(place, data[:512])
        name = FORMATS[kind][0]
        if frame is not None and kind != "dump":
            raise InputError(f"{place}: a {name} has no frames; leave out frame = {frame}.")
        if unit is not None and kind in ("table", "hdf5"):
            raise InputError(
                f"{place}: a {name} states its own units; leave out the length unit {unit!r}."
            )
        if kind == "hdf5":
            return hdf5.read(place, options)
        if kind == "dump":
            return dump.read(place, data, options)
        if kind == "vtk":
            return vtk.read(place, data[:], options)
        return table.read(place, data[:], options)
