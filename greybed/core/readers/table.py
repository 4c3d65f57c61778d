"""CSV tables with units in the header: ``x [mm], y [mm], z [mm], radius [mm]`` in any order."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from greybed.core.errors import InputError
from greybed.core.packing import Packing
from greybed.core.readers.assembling import Options, assemble
from greybed.core.readers.opening import listed
from greybed.core.readers.rows import NUMBER, parse_rows, split_cells, trimmed
from greybed.core.units import to_si

_CELL = re.compile(r"\s*(?P<name>[^\[\](]*?)\s*(?:[\[(](?P<unit>[^\])]*)[\])])?\s*")
_EXAMPLE = "such as 'x [mm], y [mm], z [mm], radius [mm]'"
_LONGEST_HEADER = 100_000


def _header(path: Path, data: bytes) -> tuple[int, str, str, list[str]]:
    """Line number, delimiter and cells of the header line, after the byte where rows start.

    A line that starts with ``#`` is a comment, unless it holds a column x: NumPy's savetxt
    writes headers that way.
    """
    position = 3 if data.startswith(b"\xef\xbb\xbf") else 0
    number = 0
    while position < len(data):
        number += 1
        end = data.find(b"\n", position)
        end = len(data) if end < 0 else end
        line = data[position : min(end, position + _LONGEST_HEADER)].decode("utf-8", "replace")
        position = end + 1
        comment = line.lstrip().startswith("#")
        line = line.strip().lstrip("#").strip()
        delimiter = next((mark for mark in ",;\t" if mark in line), ",")
        cells = split_cells(line, delimiter)
        if line and not (comment and not any(_split(cell)[0] == "x" for cell in cells)):
            return position, f"{path}: line {number}", delimiter, cells
    raise InputError(
        f"{path}: there is no header line in {number} lines; begin with one, {_EXAMPLE}."
    )


def _split(cell: str) -> tuple[str, str | None]:
    """Name in lower case, and unit where one is given."""
    match = _CELL.fullmatch(cell)
    if match is None:
        return cell.strip().lower(), None
    return match["name"].lower(), match["unit"]


def _choose(place: str, cells: list[str]) -> tuple[dict[str, int], dict[str, str]]:
    """Index and unit of each column to parse."""
    if all(map(NUMBER.fullmatch, cells)):
        raise InputError(
            f"{place}: the first line holds numbers instead of column names; put a header with "
            f"units above it, {_EXAMPLE}."
        )
    names = [_split(cell)[0] for cell in cells]
    wanted: dict[str, int] = {}
    units: dict[str, str] = {}
    for options in (("x",), ("y",), ("z",), ("radius", "diameter")):
        name = next((option for option in options if option in names), None)
        if name is None:
            raise InputError(
                f"{place}: no column {' or '.join(options)}; the file has: {listed(names)}; "
                f"name the columns in a header with units, {_EXAMPLE}."
            )
        if names.count(name) > 1:
            raise InputError(f"{place}: column {name} appears twice; write each column once.")
        wanted[name] = names.index(name)
        unit = _split(cells[wanted[name]])[1]
        if unit is None or not unit.strip():
            raise InputError(
                f"{place}: column {name} has no unit; write it in brackets, such as '{name} [mm]'."
            )
        units[name] = unit
    if names.count("id") == 1:
        wanted["id"] = names.index("id")
    return wanted, units


def read(path: Path, data: bytes, options: Options) -> Packing:
    """Read a CSV table.

    Parameters
    ----------
    path : Path
        The file, for messages.
    data : bytes
        Its content: UTF-8, cells parted by comma, semicolon or tab, decimal points.
    options : Options
        Walls, box and periodicity, which a table does not hold.

    Returns
    -------
    packing : Packing
        Spheres in metres, in the order of the rows, or by ``id`` where there is such a column.

    Raises
    ------
    InputError
        If the table cannot be read; see :func:`greybed.core.readers.read_packing`.
    """
    start, place, delimiter, cells = _header(path, data)
    wanted, units = _choose(place, cells)
    first = data.count(b"\n", 0, start) + 1
    body = trimmed(data[start:])
    if not body:
        raise InputError(f"{place}: no rows follow the header; a packing needs at least 1 sphere.")
    columns = parse_rows(path, body, lambda row: first + row, len(cells), wanted, delimiter)
    metres = {
        name: to_si(columns[name], unit, "length", f"{place}: column {name}")
        for name, unit in units.items()
    }
    return assemble(
        path,
        np.stack([metres[axis] for axis in "xyz"], axis=1),
        metres["radius"] if "radius" in metres else 0.5 * metres["diameter"],
        lambda row: f"{path}: line {first + row}",
        options,
        ids=columns.get("id"),
    )
