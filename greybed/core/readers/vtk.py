"""Legacy VTK files, ASCII and binary: points as centres, radii from the point data."""

from __future__ import annotations

import warnings
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from greybed.core.errors import InputError
from greybed.core.packing import Array, Packing
from greybed.core.readers.assembling import Options, assemble
from greybed.core.readers.opening import Cursor, listed, shown
from greybed.core.readers.rows import NUMBER
from greybed.core.units import to_si

# VTK type -> big-endian NumPy type, as binary files hold them
_TYPES = {
    "unsigned_char": ">u1",
    "char": ">i1",
    "unsigned_short": ">u2",
    "short": ">i2",
    "unsigned_int": ">u4",
    "int": ">i4",
    "unsigned_long": ">u8",
    "long": ">i8",
    "vtkidtype": ">i4",
    "vtktypeint64": ">i8",
    "vtktypeuint64": ">u8",
    "float": ">f4",
    "double": ">f8",
}
_CELLS = {"VERTICES", "LINES", "POLYGONS", "TRIANGLE_STRIPS", "CELLS"}
_VECTORS = {"VECTORS": 3, "NORMALS": 3, "TENSORS": 9, "TENSORS6": 6}
_WANTED = ("radius", "diameter", "id")


class _Scan:
    """One pass over a legacy VTK file, keeping the points and the point data of use."""

    def __init__(self, path: Path, data: bytes) -> None:
        self.path = path
        self.data = data
        self.cursor = Cursor(path, data)
        self.ascii = True
        self.points: NDArray[np.float64] | None = None
        self.points_at = 0
        self.arrays: dict[str, NDArray[np.float64]] = {}
        self.names: list[str] = []
        self.at_points = False

    @cached_property
    def tokens(self) -> NDArray[np.int64]:
        """Byte at which each token of an ASCII file starts."""
        filled = np.frombuffer(self.data, dtype=np.uint8) > 32
        return np.flatnonzero(filled & np.concatenate(([True], ~filled[:-1])))

    def _fail(self, what: str) -> InputError:
        return InputError(f"{self.cursor.here}: {what}")

    def integer(self, words: list[str], index: int, what: str) -> int:
        """Word ``index`` as a count, refused where it is none."""
        word = words[index] if index < len(words) else ""
        if not (word.isascii() and word.isdigit() and len(word) < 16):
            raise self._fail(f"{what} = {shown(word)} is not a count; write the file again.")
        return int(word)

    def values(self, count: int, kind: str, what: str, *, keep: bool = False) -> Array | None:
        """Step over ``count`` numbers of a VTK type; parse them only where ``keep``."""
        code = _TYPES.get(kind.lower())
        if code is None:
            raise self._fail(
                f"{what} has type {shown(kind)}, which greybed does not read; write it as float "
                "or double."
            )
        if not self.ascii:
            start, size = self.cursor.position, count * np.dtype(code).itemsize
            if start + size > len(self.data):
                raise self._fail(
                    f"{what} states {count} numbers ({size} bytes) but {len(self.data) - start} "
                    "bytes follow; the file was cut: write it again."
                )
            self.cursor.position = start + size
            if not keep:
                return None
            with np.errstate(invalid="ignore"):  # a signalling NaN is refused later, with its row
                return np.frombuffer(self.data, code, count, start).astype(np.float64)
        first = int(np.searchsorted(self.tokens, self.cursor.position))
        if first + count > len(self.tokens):
            raise self._fail(
                f"{what} states {count} numbers but {len(self.tokens) - first} follow; the file "
                "was cut: write it again."
            )
        start = int(self.tokens[first]) if count else self.cursor.position
        end = int(self.tokens[first + count]) if first + count < len(self.tokens) else None
        text = self.data[start:end]
        self.cursor.position = start + len(text.rstrip()) if count else start
        return self._parsed(text, start, count, what) if keep else None

    def _parsed(self, text: bytes, start: int, count: int, what: str) -> Array:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                numbers = np.fromstring(text.decode("ascii"), dtype=np.float64, sep=" ")
            except (ValueError, DeprecationWarning):
                numbers = np.empty(0)
        if len(numbers) == count:
            return numbers
        for at in self.tokens[np.searchsorted(self.tokens, start) :]:
            token = self.data[at : at + 64].split(maxsplit=1)[0]
            if not NUMBER.fullmatch(token.decode("ascii", "replace")):
                raise InputError(
                    f"{self.path}: line {self.cursor.line_number(int(at))}: {shown(token)} in "
                    f"{what} is not a number; mend it, or write the file again if it was cut."
                )
        raise self._fail(f"{what} cannot be parsed; write the file again.")

    def run(self) -> None:
        """Read the header, then section after section."""
        cursor = self.cursor
        cursor.line(blanks=True)
        cursor.line(blanks=True)  # the title, any text
        encoding = (cursor.line() or "").upper()
        if encoding not in ("ASCII", "BINARY"):
            raise self._fail(f"{shown(encoding)} is neither ASCII nor BINARY; write it again.")
        self.ascii = encoding == "ASCII"
        words = (cursor.line() or "").upper().split()
        if words not in (["DATASET", "POLYDATA"], ["DATASET", "UNSTRUCTURED_GRID"]):
            raise self._fail(
                f"{shown(' '.join(words))} cannot hold a packing; write the centres as the points "
                "of POLYDATA or UNSTRUCTURED_GRID."
            )
        while (line := cursor.line()) is not None:
            self._section(line.split())

    def _section(self, words: list[str]) -> None:
        key = words[0].upper()
        if key == "POINTS":
            count = self.integer(words, 1, "number of points")
            self.points_at = self.cursor.position
            kind = words[2] if len(words) > 2 else ""
            numbers = self.values(3 * count, kind, "POINTS", keep=True)
            self.points = None if numbers is None else numbers.reshape(-1, 3)
        elif key in _CELLS:
            self._cells(words)
        elif key == "CELL_TYPES":
            self.values(self.integer(words, 1, "number of cell types"), "int", key)
        elif key in ("POINT_DATA", "CELL_DATA"):
            self.at_points = key == "POINT_DATA"
            count = self.integer(words, 1, "number of tuples")
            if self.at_points and (self.points is None or count != len(self.points)):
                have = 0 if self.points is None else len(self.points)
                raise self._fail(f"POINT_DATA {count} does not match {have} POINTS; mend either.")
            self.tuples = count
        elif key == "FIELD":
            self._field(self.integer(words, 2, "number of arrays"))
        elif key == "METADATA":
            while self.cursor.line(blanks=True):
                pass
        else:
            self._attribute(key, words)

    def _cells(self, words: list[str]) -> None:
        a, b = self.integer(words, 1, "number of cells"), self.integer(words, 2, "size of cells")
        before = self.cursor.position
        following = (self.cursor.line() or "").split()
        if following[:1] == ["OFFSETS"]:  # since file version 5.1
            self.values(a, following[-1], "OFFSETS")
            following = (self.cursor.line() or "").split()
            self.values(b, following[-1] if following else "", "CONNECTIVITY")
        else:
            self.cursor.position = before
            self.values(b, "int", words[0])

    def _keep(self, name: str, components: int, count: int, kind: str) -> None:
        self.names.append(name)
        known = name.lower()
        keep = self.at_points and known in _WANTED and components == 1
        numbers = self.values(components * count, kind, f"array {shown(name)}", keep=keep)
        if numbers is not None and known not in self.arrays:
            self.arrays[known] = numbers

    def _field(self, n_arrays: int) -> None:
        for _ in range(n_arrays):
            words = (self.cursor.line() or "").split()
            while words[:1] == ["METADATA"]:
                while self.cursor.line(blanks=True):
                    pass
                words = (self.cursor.line() or "").split()
            components = self.integer(words, 1, "number of components")
            count = self.integer(words, 2, "number of tuples")
            if self.at_points and self.points is not None and count != len(self.points):
                raise self._fail(
                    f"array {shown(words[0])} has {count} tuples for {len(self.points)} points; "
                    "write the file again."
                )
            self._keep(words[0], components, count, words[3] if len(words) > 3 else "")

    def _attribute(self, key: str, words: list[str]) -> None:
        """One attribute of POINT_DATA or CELL_DATA."""
        count = getattr(self, "tuples", None)
        name = words[1] if len(words) > 1 else ""
        if count is None:
            raise self._fail(f"{shown(words[0])} is no section of legacy VTK; write it again.")
        if key == "SCALARS":
            components = self.integer(words, 3, "number of components") if len(words) > 3 else 1
            before = self.cursor.position
            if not (self.cursor.line() or "").upper().startswith("LOOKUP_TABLE"):
                self.cursor.position = before
            self._keep(name, components, count, words[2] if len(words) > 2 else "")
        elif key in _VECTORS:
            self._keep(name, _VECTORS[key], count, words[2] if len(words) > 2 else "")
        elif key in ("GLOBAL_IDS", "PEDIGREE_IDS"):
            self._keep(name, 1, count, words[2] if len(words) > 2 else "")
        elif key == "TEXTURE_COORDINATES":
            components = self.integer(words, 2, "number of components")
            self._keep(name, components, count, words[3] if len(words) > 3 else "")
        elif key in ("COLOR_SCALARS", "LOOKUP_TABLE"):
            size = self.integer(words, 2, "size")
            size = 4 * size if key == "LOOKUP_TABLE" else size * count
            self.values(size, "unsigned_char", f"{key} {shown(name)}")
        else:
            raise self._fail(
                f"{shown(words[0])} is no section of legacy VTK; the number of values before it "
                "is wrong, or the file damaged: write it again."
            )


def read(path: Path, data: bytes, options: Options) -> Packing:
    """Read the points of a legacy VTK file as spheres.

    Parameters
    ----------
    path : Path
        The file, for messages.
    data : bytes
        Its content.
    options : Options
        Length unit of coordinates and radii; walls, box and periodicity, which VTK does not hold.

    Returns
    -------
    packing : Packing
        One sphere per point, radius from the point data named ``radius`` or ``diameter`` in
        upper or lower case; sorted by ``id`` where there is one.

    Raises
    ------
    InputError
        If the file cannot be read; see :func:`greybed.core.readers.read_packing`.
    """
    scan = _Scan(path, data)
    scan.run()
    centres, arrays = scan.points, scan.arrays
    if centres is None or len(centres) == 0:
        raise InputError(f"{path}: there are no POINTS; a packing needs at least 1.")
    size = next((name for name in ("radius", "diameter") if name in arrays), None)
    if size is None:
        raise InputError(
            f"{path}: no point data radius or diameter with one component; the file has: "
            f"{listed(scan.names)}; add the radius as a SCALARS array."
        )
    radii = arrays[size] if size == "radius" else 0.5 * arrays[size]
    unit, where = options.unit or "m", f"{path}: length unit"

    def place(row: int) -> str:
        if not scan.ascii:
            return f"{path}: point {row + 1}"
        first = int(np.searchsorted(scan.tokens, scan.points_at))
        line = scan.cursor.line_number(int(scan.tokens[first + 3 * row]))
        return f"{path}: point {row + 1}, line {line}"

    return assemble(
        path,
        to_si(centres, unit, "length", where),
        to_si(radii, unit, "length", where),
        place,
        options,
        ids=arrays.get("id"),
    )
