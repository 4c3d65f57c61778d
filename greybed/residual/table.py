"""Measured tables: CSV with ``name [unit]`` in the header; words become labels, numbers SI."""

from __future__ import annotations

import csv
import io
import os
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from greybed.core.errors import InputError
from greybed.core.units import to_base, to_si
from greybed.residual.columns import DIMENSIONS
from greybed.residual.study import Table

_CELL = re.compile(r"\s*(?P<name>[^\[\](]*?)\s*(?:[\[(](?P<unit>[^\])]*)[\])])?\s*")
_EXAMPLE = "such as 'diameter [mm], velocity [m/s], operator'"
FEWEST = 5
LARGEST = 50_000_000  # bytes; a table of measurements is far smaller


def read_table(
    path: str | os.PathLike[str],
    response: str,
    words: Sequence[str] = (),
    counters: Sequence[str] = (),
) -> Table:
    """Read a measured table.

    Parameters
    ----------
    path : path
        CSV (comma, semicolon or tab), UTF-8, a header ``name [unit]``, ``#`` comments.
    response : str
        Column that must be there.
    words : sequence of str
        Columns that are labels even if their cells are numbers.
    counters : sequence of str
        Columns that need no unit whatever they are called, such as the repeat.

    Returns
    -------
    table : Table
        Numbers in base SI; a column is numeric if all of its cells are numbers.

    Raises
    ------
    InputError
        With line, column, value and remedy.
    """
    path = Path(path)
    lines = _lines(path)
    number, cells, delimiter = _header(path, lines)
    names = [_split(cell) for cell in cells]
    _check_names(path, number, [n for n, _ in names], [response, *words, *counters])
    rows: list[list[str]] = []
    numbers: list[int] = []
    reader = csv.reader(
        io.StringIO("\n".join(lines[number:])), delimiter=delimiter, skipinitialspace=True
    )
    for row in reader:
        line = number + reader.line_num
        if not row or not any(cell.strip() for cell in row) or row[0].lstrip().startswith("#"):
            continue
        if len(row) != len(names):
            raise InputError(
                f"{path}: line {line}: {len(row)} cells where the header has {len(names)}; the "
                "line is cut off or a delimiter is missing; mend it."
            )
        rows.append([cell.strip() for cell in row])
        numbers.append(line)
    if len(rows) < FEWEST:
        raise InputError(
            f"{path}: {len(rows)} rows follow the header; a diagnosis needs at least {FEWEST}."
        )
    columns, units, labels = {}, {}, {}
    for k, (name, unit) in enumerate(names):
        text = [row[k] for row in rows]
        if name in words or (name != response and not any(map(_number, text))):
            labels[name] = _words(path, name, text, numbers)
            continue
        values = _values(path, name, text, numbers)
        columns[name], units[name] = _convert(path, number, name, unit, values, counters)
    return Table(
        columns=columns,
        units=units,
        labels=labels,
        rows=np.array(numbers, dtype=np.int64),
        file=path,
    )


def _lines(path: Path) -> list[str]:
    try:
        if path.stat().st_size > LARGEST:
            raise InputError(
                f"{path}: {path.stat().st_size} bytes are more than the {LARGEST} of a table of "
                "measurements; check the path."
            )
        data = path.read_bytes()
    except OSError as error:
        reason = error.strerror or error
        raise InputError(f"{path}: cannot read this table ({reason}); check the path.") from None
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path}: byte {error.start} is not UTF-8 text; save the table as CSV in UTF-8."
        ) from None
    if "\x00" in text:
        raise InputError(f"{path}: holds zero bytes, so it is not a CSV table; save it as CSV.")
    return text.splitlines()


def _header(path: Path, lines: list[str]) -> tuple[int, list[str], str]:
    """Line number, cells and delimiter of the first line that is no comment."""
    for k, line in enumerate(lines):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        delimiter = next((mark for mark in ",;\t" if mark in line), ",")
        cells = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))
        if all(map(_number, cells)):
            raise InputError(
                f"{path}: line {k + 1}: the first line holds numbers instead of column names; put "
                f"a header above it, {_EXAMPLE}."
            )
        return k + 1, cells, delimiter
    raise InputError(f"{path}: is empty; begin with a header, {_EXAMPLE}.")


def _split(cell: str) -> tuple[str, str]:
    match = _CELL.fullmatch(cell)
    if match is None:
        return cell.strip(), ""
    return match["name"], (match["unit"] or "").strip()


def _check_names(path: Path, line: int, names: list[str], wanted: list[str]) -> None:
    for k, name in enumerate(names):
        if not name:
            raise InputError(f"{path}: line {line}: column {k + 1} has no name; give it one.")
        if names.index(name) != k:
            raise InputError(f"{path}: line {line}: column {name} appears twice; keep one.")
    for name in wanted:
        if name not in names:
            raise InputError(
                f"{path}: line {line}: no column {name}; the file has {', '.join(names)}; name it "
                "as the study does, or mend the study."
            )


def _number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _words(path: Path, name: str, text: list[str], lines: list[int]) -> tuple[str, ...]:
    for word, line in zip(text, lines, strict=True):
        if not word:
            raise InputError(
                f"{path}: line {line}: column {name} is empty; write the label, or 'unknown'."
            )
    return tuple(text)


def _values(path: Path, name: str, text: list[str], lines: list[int]) -> list[float]:
    values = []
    for cell, line in zip(text, lines, strict=True):
        place = f"{path}: line {line}: column {name}"
        if not cell:
            raise InputError(f"{place} is empty; measure it, or remove the row.")
        if not _number(cell):
            raise InputError(f"{place} = {cell[:40]!r} is not a number; mend or remove the row.")
        value = float(cell)
        if not np.isfinite(value):
            raise InputError(f"{place} = {cell} must be finite; mend or remove the row.")
        values.append(value)
    return values


def _convert(
    path: Path, line: int, name: str, unit: str, values: list[float], counters: Sequence[str]
) -> tuple[np.ndarray, str]:
    place = f"{path}: line {line}: column {name}"
    if name in DIMENSIONS and name not in counters:
        from greybed.core.units import DIMENSIONS as KNOWN

        dimension = DIMENSIONS[name]
        if dimension == "dimensionless" and unit in ("", "-", "1"):
            return np.array(values), ""
        return to_si(values, unit, dimension, place), _plain(KNOWN[dimension][0])
    return to_base(values, unit, place)


def _plain(unit: str) -> str:
    return unit.replace("**", "")
