"""CSV with units in its header; numbers with the digits that reading them back exactly needs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from greybed.core.packing import Packing

_ROWS = 1 << 15


def write(packing: Packing, path: Path, fields: dict[str, NDArray[np.float64]]) -> None:
    """Write centres, radii and fields as columns.

    Parameters
    ----------
    packing : Packing
        The bed [m]; box, periodicity and walls are not kept.
    path : Path
        Where to write.
    fields : dict of (n,) or (n, k) arrays
        Further columns; of an (n, k) array, column j is called ``name_j``, before the unit.
    """
    header = [f"{name} [m]" for name in ("x", "y", "z", "radius")]
    columns = [packing.centres, packing.radii[:, None]]
    for name, values in fields.items():
        if values.ndim == 1:
            header.append(name)
        else:
            word, bracket, unit = name.partition("[")
            header += [
                f"{word.strip()}_{j}{' ' + bracket + unit if bracket else ''}"
                for j in range(values.shape[1])
            ]
        columns.append(values.reshape(len(packing), -1))
    table = np.concatenate(columns, axis=1)
    with open(path, "w", encoding="utf-8", newline="\n") as stream:
        stream.write(",".join(header) + "\n")
        for start in range(0, len(table), _ROWS):
            rows = table[start : start + _ROWS].tolist()
            stream.write("".join(",".join(map(repr, row)) + "\n" for row in rows))
