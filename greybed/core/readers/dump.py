"""LIGGGHTS and LAMMPS text dumps: one frame, any column order, box and periodicity."""

from __future__ import annotations

import mmap
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from greybed.core.errors import InputError
from greybed.core.packing import Array, Packing
from greybed.core.readers.assembling import Options, assemble
from greybed.core.readers.opening import Cursor, listed, shown
from greybed.core.readers.rows import NUMBER, n_rows, parse_rows, trimmed
from greybed.core.units import to_si

_STEP = b"ITEM: TIMESTEP"
# Which coordinates, in order of preference: as they are, unwrapped, scaled, scaled and unwrapped.
_SUFFIXES = ("", "u", "s", "su")
# What "ITEM: UNITS" may name, with its length unit; lj has none.
_STYLES = {
    "si": "m",
    "cgs": "cm",
    "micro": "um",
    "nano": "nm",
    "real": "angstrom",
    "metal": "angstrom",
}


@dataclass
class _Frame:
    """Header of one frame, in the units of the file, and where its parts start."""

    count: int = -1
    count_at: int = 0
    columns: list[str] = field(default_factory=list)
    columns_at: int = 0
    body_at: int = 0
    box: Array | None = None
    periodic: tuple[bool, bool, bool] = (False, False, False)


def _find(data: mmap.mmap, position: int) -> int:
    """First frame at or after ``position``, -1 if there is none."""
    at = data.find(_STEP, position)
    while at > 0 and data[at - 1 : at] != b"\n":
        at = data.find(_STEP, at + 1)
    return at


def _find_back(data: mmap.mmap, end: int) -> int:
    """Last frame that starts before ``end``, -1 if there is none."""
    at = data.rfind(_STEP, 0, end)
    while at > 0 and data[at - 1 : at] != b"\n":
        at = data.rfind(_STEP, 0, at)
    return at


def _frame_start(path: Path, data: mmap.mmap, frame: int) -> int:
    at = -1
    if frame >= 0:
        for _ in range(frame + 1):
            at = _find(data, at + 1)
            if at < 0:
                break
    else:
        at = len(data)
        for _ in range(-frame):
            at = _find_back(data, at) if at > 0 else -1
            if at < 0:
                break
    if at >= 0:
        return at
    total, last = 0, _find(data, 0)
    while last >= 0:
        total, last = total + 1, _find(data, last + 1)
    if total == 0:
        raise InputError(
            f"{path}: no line 'ITEM: TIMESTEP' was found; give a text dump written by LIGGGHTS "
            "or LAMMPS (dump custom), or name the file .csv, .h5 or .vtk if it is one."
        )
    raise InputError(
        f"{path}: frame = {frame} does not exist; the file has {total} "
        f"({f'0 to {total - 1}, or -{total} to -1' if total > 1 else 'only 0'})."
    )


def _whole_number(cursor: Cursor, what: str) -> int:
    text = cursor.line() or ""
    if not (text.isascii() and text.removeprefix("-").isdigit() and len(text) < 19):
        raise InputError(
            f"{cursor.here}: {what} = {shown(text)} is not a whole number; write the dump again."
        )
    return int(text)


def _read_box(cursor: Cursor, frame: _Frame, flags: list[str]) -> None:
    if {"xy", "xz", "yz", "abc"} & set(flags):
        raise InputError(
            f"{cursor.here}: the box is triclinic (tilt factors xy xz yz), which greybed does not "
            "read; dump from an orthogonal box."
        )
    if len(flags) >= 3:  # files of old versions have none
        frame.periodic = (flags[0] == "pp", flags[1] == "pp", flags[2] == "pp")
    bounds = []
    for axis in "xyz":
        words = (cursor.line() or "").split()
        if len(words) != 2 or not all(map(NUMBER.fullmatch, words)):
            raise InputError(
                f"{cursor.here}: {axis} bounds = {shown(' '.join(words))} are not two numbers, "
                "lower and upper; write the dump again."
            )
        low, high = map(float, words)
        if not (np.isfinite(low) and np.isfinite(high) and low < high):
            raise InputError(
                f"{cursor.here}: {axis} bounds [{low:g}, {high:g}] are empty or not finite; "
                "the upper bound must exceed the lower: mend this line."
            )
        bounds.append((low, high))
    frame.box = np.array(bounds).T.copy()


def _read_header(cursor: Cursor) -> _Frame:
    frame = _Frame()
    cursor.line()  # ITEM: TIMESTEP
    while (line := cursor.line()) is not None:
        if line.startswith("ITEM: TIMESTEP"):
            raise InputError(
                f"{cursor.here}: a second frame starts before 'ITEM: ATOMS' of the first; the "
                "file is damaged: write it again, or choose another frame."
            )
        if line.startswith("ITEM: NUMBER OF ATOMS"):
            frame.count = _whole_number(cursor, "number of atoms")
            frame.count_at = cursor.start
            if frame.count < 1:
                raise InputError(
                    f"{cursor.here}: number of atoms = {frame.count}; a packing needs at least 1: "
                    "choose another frame."
                )
        elif line.startswith("ITEM: BOX BOUNDS"):
            _read_box(cursor, frame, line.split()[3:])
        elif line.startswith("ITEM: ATOMS"):
            if frame.count < 0:
                raise InputError(
                    f"{cursor.here}: 'ITEM: NUMBER OF ATOMS' is missing before this line; "
                    "write the dump again."
                )
            frame.columns = line.split()[2:]
            frame.columns_at, frame.body_at = cursor.start, cursor.position
            return frame
    raise InputError(
        f"{cursor.path}: the frame ends in line {max(1, cursor.line_number() - 1)}, before "
        "'ITEM: ATOMS'; the file was cut: write it again, or choose an earlier frame."
    )


def _unit_of(path: Path, data: mmap.mmap, unit: str | None) -> str:
    """Length unit: what the caller said, or 'ITEM: UNITS' of newer LAMMPS files, or metres."""
    if unit is not None:
        return unit
    cursor = Cursor(path, data)
    if cursor.line() != "ITEM: UNITS":
        return "m"
    style = cursor.line() or ""
    if style not in _STYLES:
        raise InputError(
            f"{cursor.here}: units style {shown(style)} has no fixed length unit; state it with "
            "unit= (--length-unit), such as mm."
        )
    return _STYLES[style]


def _choose(columns: list[str], place: Callable[[], str]) -> tuple[dict[str, int], str]:
    """Columns to parse and the suffix of the coordinates: '', 'u', 's' or 'su'."""
    twice = next((name for name in columns if columns.count(name) > 1), None)
    if twice is not None:
        raise InputError(f"{place()}: column {shown(twice)} appears twice; write each column once.")
    complete = [s for s in _SUFFIXES if all(axis + s in columns for axis in "xyz")]
    if not complete:
        lacking = [a for a in "xyz" if not any(a + s in columns for s in _SUFFIXES)]
        raise InputError(
            f"{place()}: no column {' '.join(lacking) or 'x y z of one kind'} (x y z, xu yu zu, "
            f"xs ys zs or xsu ysu zsu); the file has: {listed(columns)}; add it to the dump "
            "command."
        )
    size = next((name for name in ("radius", "diameter") if name in columns), None)
    if size is None:
        raise InputError(
            f"{place()}: no column radius or diameter; the file has: {listed(columns)}; add "
            "radius to the dump command."
        )
    wanted = {axis: columns.index(axis + complete[0]) for axis in "xyz"}
    wanted[size] = columns.index(size)
    if "id" in columns:
        wanted["id"] = columns.index("id")
    return wanted, complete[0]


def read(path: Path, data: mmap.mmap, options: Options) -> Packing:
    """Read one frame of a text dump.

    Parameters
    ----------
    path : Path
        The file, for messages.
    data : mmap
        Its bytes; only the chosen frame is parsed, so long trajectories cost little.
    options : Options
        Frame, length unit, walls.

    Returns
    -------
    packing : Packing
        Coordinates from x, xu, xs or xsu (the first that is there for all three axes), radii from
        ``radius`` or ``diameter``; directions flagged ``pp`` are periodic.

    Raises
    ------
    InputError
        If the frame cannot be read; see :func:`greybed.core.readers.read_packing`.
    """
    unit = _unit_of(path, data, options.unit)
    start = _frame_start(path, data, -1 if options.frame is None else options.frame)
    cursor = Cursor(path, data, start)
    frame = _read_header(cursor)

    def line_of(position: int) -> int:
        return cursor.line_number(position)

    def header() -> str:
        return f"{path}: line {line_of(frame.columns_at)}"

    wanted, suffix = _choose(frame.columns, header)
    end = data.find(b"\nITEM:", frame.body_at - 1)
    body = trimmed(data[frame.body_at : len(data) if end < 0 else end + 1])
    rows = n_rows(body)
    if rows != frame.count:
        first = line_of(frame.body_at)
        problem = (
            f"only {rows} rows follow, to line {first + rows - 1}; the file was cut: write it "
            "again, or read an earlier frame if it has one (frame = -2)"
            if rows < frame.count
            else f"{rows} rows follow from line {first} on; mend the number or the rows"
        )
        raise InputError(
            f"{path}: line {line_of(frame.count_at)}: {frame.count} atoms are stated but {problem}."
        )
    table = parse_rows(
        path, body, lambda row: line_of(frame.body_at) + row, len(frame.columns), wanted
    )
    centres = np.stack([table[axis] for axis in "xyz"], axis=1)
    box = frame.box
    if "s" in suffix:
        if box is None:
            raise InputError(
                f"{header()}: scaled coordinates (x{suffix}) need 'ITEM: BOX BOUNDS', which is "
                "missing; dump x y z instead."
            )
        with np.errstate(over="ignore", invalid="ignore"):
            centres = box[0] + centres * (box[1] - box[0])
    radii = table["radius"] if "radius" in table else 0.5 * table["diameter"]
    where = f"{path}: length unit"
    return assemble(
        path,
        to_si(centres, unit, "length", where),
        to_si(radii, unit, "length", where),
        lambda row: f"{path}: line {line_of(frame.body_at) + row}",
        options,
        ids=table.get("id"),
        box=None if box is None else to_si(box, unit, "length", where),
        periodic=frame.periodic,
    )
