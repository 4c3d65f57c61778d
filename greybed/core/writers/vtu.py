"""VTU for ParaView: one vertex per sphere with its radius (look at it as Point Gaussian)."""

from __future__ import annotations

from base64 import b64encode
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from greybed.core.packing import Packing

_NAMES = {"<f8": "Float64", "<i8": "Int64", "|u1": "UInt8"}


def _array(values: NDArray[Any], name: str, code: str) -> bytes:
    """One DataArray: its size in 8 bytes and its numbers, little-endian, in base64."""
    raw = np.ascontiguousarray(values, dtype=code).tobytes()
    components = values.shape[1] if values.ndim == 2 else 1
    head = (
        f"<DataArray type={quoteattr(_NAMES[code])} Name={quoteattr(name)} "
        f'NumberOfComponents="{components}" format="binary">'
    )
    content = b64encode(len(raw).to_bytes(8, "little") + raw)
    return head.encode() + content + b"</DataArray>\n"


def write(packing: Packing, path: Path, fields: dict[str, NDArray[np.float64]]) -> None:
    """Write centres as vertices, radii and fields as point data.

    Parameters
    ----------
    packing : Packing
        The bed [m]; box, periodicity and walls are not kept.
    path : Path
        Where to write.
    fields : dict of (n,) or (n, k) arrays
        Further point data, under their names.
    """
    n = len(packing)
    count = np.arange(n)
    with open(path, "wb") as stream:
        stream.write(
            b'<?xml version="1.0" encoding="UTF-8"?>\n'
            b'<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" '
            b'header_type="UInt64">\n<UnstructuredGrid>\n'
            + f'<Piece NumberOfPoints="{n}" NumberOfCells="{n}">\n'.encode()
        )
        stream.write(b"<Points>\n" + _array(packing.centres, "centres", "<f8") + b"</Points>\n")
        stream.write(b"<Cells>\n" + _array(count, "connectivity", "<i8"))
        stream.write(_array(count + 1, "offsets", "<i8"))
        vertex = np.ones(n)  # VTK_VERTEX
        stream.write(_array(vertex, "types", "|u1") + b"</Cells>\n")
        stream.write(b'<PointData Scalars="radius">\n' + _array(packing.radii, "radius", "<f8"))
        for name, values in fields.items():
            stream.write(_array(values, name, "<f8"))
        stream.write(b"</PointData>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n")
