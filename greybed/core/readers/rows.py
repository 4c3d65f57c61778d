"""Rows of numbers in text, parsed by NumPy; what cannot be parsed is named by file and line."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from greybed.core.errors import InputError
from greybed.core.readers.opening import shown

NUMBER = re.compile(
    r"\s*[+-]?(?:(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|nan|inf|infinity)\s*", re.I | re.A
)


def trimmed(body: bytes) -> bytes:
    """``body`` without the blank lines at its end."""
    return body.rstrip(b" \r\n")


def n_rows(body: bytes) -> int:
    """Number of lines in a trimmed body [-]."""
    return body.count(b"\n") + 1 if body else 0


def split_cells(line: str, delimiter: str | None) -> list[str]:
    """Cells of one line, at ``delimiter`` (with CSV quoting) or at white space."""
    if delimiter is None:
        return line.split()
    try:
        return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    except csv.Error:
        return line.split(delimiter)


def _cells_per_row(buffer: NDArray[np.uint8], delimiter: str | None) -> NDArray[np.int64]:
    """Count the cells of every line at once, shape (rows,)."""
    ends = np.append(np.flatnonzero(buffer == 10), len(buffer))
    if delimiter is None:
        filled = buffer > 32
        marks = np.flatnonzero(filled & np.concatenate(([True], ~filled[:-1])))
        extra = 0
    else:
        is_mark = buffer == ord(delimiter)
        quotes = buffer == ord('"')
        if quotes.any():
            is_mark &= np.cumsum(quotes, dtype=np.uint8) % 2 == 0
        marks = np.flatnonzero(is_mark)
        extra = 1
    return np.diff(np.searchsorted(marks, ends), prepend=0) + extra


def parse_rows(
    path: Path,
    body: bytes,
    line_of: Callable[[int], int],
    n_columns: int,
    wanted: dict[str, int],
    delimiter: str | None = None,
) -> dict[str, NDArray[np.float64]]:
    """Parse some columns of a block of text.

    Parameters
    ----------
    path : Path
        The file, for messages.
    body : bytes
        Trimmed block, one row a line, at least one row.
    line_of : callable
        Line number in the file, from 1, of a row, from 0.
    n_columns : int
        How many cells every row must have [-].
    wanted : dict
        Name and index of each column to parse; other columns may hold anything.
    delimiter : str, optional
        One character; white space where left out.

    Returns
    -------
    columns : dict of (rows,) arrays
        The numbers as they stand in the file, in its own units.

    Raises
    ------
    InputError
        For bytes that are not text, rows with too few or too many cells, and cells that are
        not numbers.
    """
    buffer = np.frombuffer(body, dtype=np.uint8)
    strange = (buffer < 32) & (buffer != 9) & (buffer != 10) & (buffer != 13)
    if delimiter is None:
        strange |= buffer > 126
    if strange.any():
        at = int(strange.argmax())
        row = body.count(b"\n", 0, at)
        raise InputError(
            f"{path}: line {line_of(row)}: byte 0x{buffer[at]:02x} is not "
            "text; the file is damaged or of another format: write it again."
        )
    if delimiter is not None and b'"' in body:
        for row, line in enumerate(body.split(b"\n")):
            if line.count(b'"') % 2:
                raise InputError(
                    f"{path}: line {line_of(row)}: a quotation mark is not closed in its line; "
                    "close or remove it."
                )
    counts = _cells_per_row(buffer, delimiter)
    ragged = counts != n_columns
    if ragged.any():
        row = int(ragged.argmax())
        raise InputError(
            f"{path}: line {line_of(row)}: {counts[row]} values where the header names "
            f"{n_columns} columns; mend this row, or write the file again if it was cut."
        )
    try:
        text = body.decode("utf-8")
    except UnicodeDecodeError as error:
        row = body.count(b"\n", 0, error.start)
        raise InputError(
            f"{path}: line {line_of(row)}: byte 0x{body[error.start]:02x} is not UTF-8 text; "
            "save the file as UTF-8."
        ) from None
    try:
        table = np.loadtxt(
            io.StringIO(text),
            delimiter=delimiter,
            comments=None,
            quotechar=None if delimiter is None else '"',
            usecols=list(wanted.values()),
            ndmin=2,
        )
    except ValueError as error:
        raise _first_fault(path, text, line_of, wanted, delimiter, error) from None
    if len(table) != len(counts):
        raise InputError(
            f"{path}: {len(counts)} lines hold {len(table)} rows from line {line_of(0)} on; "
            "a quotation mark or a line end is out of place: write the file again."
        )
    return {name: table[:, i] for i, name in enumerate(wanted)}


def _first_fault(
    path: Path,
    text: str,
    line_of: Callable[[int], int],
    wanted: dict[str, int],
    delimiter: str | None,
    error: ValueError,
) -> InputError:
    """Find the cell that NumPy could not take; slow, and only walked once something failed."""
    for row, line in enumerate(text.split("\n")):
        cells = split_cells(line, delimiter)
        for name, column in wanted.items():
            cell = cells[column] if column < len(cells) else ""
            if not NUMBER.fullmatch(cell):
                return InputError(
                    f"{path}: line {line_of(row)}: {name} = {shown(cell)} is not a number; "
                    "mend or remove this row."
                )
    return InputError(
        f"{path}: rows from line {line_of(0)} on cannot be parsed ({shown(str(error), 80)}); "
        "write the file again."
    )
