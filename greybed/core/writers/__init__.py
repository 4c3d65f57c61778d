"""Writers of packings: one door, ``write_packing``, that goes by the extension."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.core.errors import InputError
from greybed.core.files import atomic_path
from greybed.core.packing import Packing
from greybed.core.writers import csv, hdf5, mesh, vtu

__all__ = ["keeps_surroundings", "write_packing"]

Fields = dict[str, NDArray[np.float64]]

# extension -> (writer, whether it takes fields, whether it keeps box, periodicity and walls)
_WRITERS: dict[str, tuple[Callable[[Packing, Path, Fields], None], bool, bool]] = {
    ".csv": (csv.write, True, False),
    ".h5": (hdf5.write, False, True),
    ".hdf5": (hdf5.write, False, True),
    ".vtu": (vtu.write, True, False),
    ".glb": (mesh.write, False, False),
    ".ply": (mesh.write, False, False),
    ".stl": (mesh.write, False, False),
}


def _writer(path: Path) -> tuple[Callable[[Packing, Path, Fields], None], bool, bool]:
    try:
        return _WRITERS[path.suffix.lower()]
    except KeyError:
        raise InputError(
            f"{path}: no writer for the extension {path.suffix!r}; choose one of "
            f"{', '.join(_WRITERS)}."
        ) from None


def keeps_surroundings(path: str | os.PathLike[str]) -> bool:
    """Whether the format of ``path`` keeps box, periodicity and walls.

    Raises
    ------
    InputError
        If no format has this extension.
    """
    return _writer(Path(path))[2]


def write_packing(
    packing: Packing,
    path: str | os.PathLike[str],
    fields: Mapping[str, ArrayLike] | None = None,
) -> Path:
    """Write a bed of spheres, whole or not at all.

    Parameters
    ----------
    packing : Packing
        The bed [m].
    path : path
        ``.csv`` (units in the header), ``.h5`` (lossless, with box and walls), ``.vtu``
        (ParaView), or ``.glb``, ``.ply``, ``.stl`` (a mesh to look at, 20,000 spheres at most).
    fields : dict of (n,) or (n, k) arrays, optional
        Further numbers per sphere for ``.csv`` and ``.vtu``, under names that carry their unit,
        such as ``temperature [K]``.

    Returns
    -------
    path : Path
        The file written.

    Raises
    ------
    InputError
        If the extension is unknown, a field does not fit, or a mesh would be too large.
    OutputError
        If the file cannot be written.

    Examples
    --------
    >>> write_packing(packing, "bed.vtu", {"temperature [K]": temperatures})  # doctest: +SKIP
    """
    target = Path(path)
    write, takes_fields, _ = _writer(target)
    extra: Fields = {}
    for name, values in (fields or {}).items():
        if not takes_fields:
            raise InputError(
                f"{target}: {target.suffix} holds no fields (got {name!r}); write .csv or .vtu."
            )
        array = np.asarray(values, dtype=np.float64)
        if array.ndim not in (1, 2) or len(array) != len(packing) or array.size == 0:
            raise InputError(
                f"field {name!r} has shape {array.shape}; give one row for each of the "
                f"{len(packing)} spheres."
            )
        if not name.isprintable() or not name.strip() or set(name) & set(',;"'):
            raise InputError(
                f"field name {name!r} cannot stand in a file; use printable characters without "
                "commas, semicolons and quotation marks."
            )
        plain = name.split("[")[0].strip().lower()
        if plain in ("x", "y", "z", "radius", "diameter", "id"):
            raise InputError(f"field {name!r} takes a name of the packing itself; rename it.")
        extra[name] = array
    with atomic_path(target) as temporary:
        write(packing, temporary, extra)
    return target
