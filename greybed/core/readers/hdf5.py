"""The project's own HDF5 packings, version 1: lossless, with box, periodicity and walls."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from greybed.core.errors import GreybedError, InputError
from greybed.core.packing import Array, Packing
from greybed.core.readers.assembling import Options, assemble
from greybed.core.readers.opening import listed, shown
from greybed.core.records import wall_of
from greybed.core.units import to_si
from greybed.core.walls import Wall

FORMAT = "greybed-packing"
VERSION = 1
# Compression shrinks numbers a thousandfold at most; a larger claim is a damaged or hostile file.
_MOST_COMPRESSED = 1100


def _text(owner: Any, name: str, default: str = "") -> str:
    """Text attribute of a file or dataset, whichever of HDF5's kinds of text it is."""
    value = owner.attrs.get(name, default)
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


def _walls(path: Path, root: Any) -> tuple[Wall, ...]:
    try:
        walls: list[Wall] = []
        for k, parts in enumerate(json.loads(_text(root, "walls", "[]"))):

            def arrays(k: int = k) -> tuple[Any, Any]:
                return (
                    _dataset(path, root, f"wall_{k}_vertices", (None, 3)),
                    _stored(path, root, f"wall_{k}_faces", (None, 3))[()],
                )

            walls.append(wall_of(parts, arrays))
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        if str(error).startswith(f"{path}: "):  # of a mesh's datasets
            raise
        raise InputError(
            f"{path}: attribute walls cannot be read ({shown(str(error), 80)}); write the file "
            "again with greybed."
        ) from None
    return tuple(walls)


def _stored(path: Path, root: Any, name: str, shape: tuple[int | None, ...]) -> Any:
    """One dataset, not read yet, with every check before the memory is taken."""
    import h5py

    if name not in root:
        raise InputError(
            f"{path}: no dataset {name!r}; the file has: {listed(list(root))}; write it again "
            "with greybed."
        )
    item = root[name]
    # A link may lead to any other file of this machine.
    own = isinstance(root.get(name, getlink=True), h5py.HardLink)
    if not (own and isinstance(item, h5py.Dataset)) or item.external or item.is_virtual:
        raise InputError(f"{path}: {name!r} is not a dataset of this file; write it again.")
    fits = len(item.shape) == len(shape) and all(
        want in (None, have) for want, have in zip(shape, item.shape, strict=True)
    )
    if not fits or item.dtype.kind not in "fiu":
        wanted = ", ".join("n" if want is None else str(want) for want in shape)
        raise InputError(
            f"{path}: dataset {name!r} has shape {item.shape} of {item.dtype}; it must hold "
            f"numbers of shape ({wanted}): write it again with greybed."
        )
    stored = item.id.get_storage_size()
    if item.nbytes > _MOST_COMPRESSED * stored:
        raise InputError(
            f"{path}: dataset {name!r} states shape {item.shape} but stores {stored} bytes; the "
            "file was cut or damaged: write it again."
        )
    return item


def _dataset(path: Path, root: Any, name: str, shape: tuple[int | None, ...]) -> Array:
    """Read one dataset of lengths [m]."""
    item = _stored(path, root, name, shape)
    if "units" not in item.attrs:
        raise InputError(f"{path}: dataset {name!r} has no attribute units; set it to 'm'.")
    return to_si(item[()], _text(item, "units"), "length", f"{path}: dataset {name!r}")


def read(path: Path, options: Options) -> Packing:
    """Read an HDF5 packing.

    Parameters
    ----------
    path : Path
        File with root attributes ``format = "greybed-packing"`` and ``version = 1``.
    options : Options
        Walls, box and periodicity that replace those of the file.

    Returns
    -------
    packing : Packing
        As it was written, to the last digit.

    Raises
    ------
    InputError
        If the file is damaged, lacks a dataset or holds a wrong unit.
    """
    import h5py

    try:
        with h5py.File(path, "r") as root:
            return _read(path, root, options)
    except GreybedError:
        raise
    except Exception as error:  # what h5py raises for a damaged file is not documented
        raise InputError(
            f"{path}: the HDF5 content is cut or damaged ({shown(str(error), 80)}); write the "
            "file again."
        ) from None


def _read(path: Path, root: Any, options: Options) -> Packing:
    kind, version = _text(root, "format", "missing"), root.attrs.get("version")
    if kind != FORMAT:
        raise InputError(
            f"{path}: root attribute format = {shown(kind)} is not {FORMAT!r}; this HDF5 "
            f"file is no packing of greybed (it has: {listed(list(root))}): convert it to CSV."
        )
    if version != VERSION:
        raise InputError(
            f"{path}: version = {shown(str(version))} of {FORMAT} is not {VERSION}, the one that "
            "this greybed reads; install a newer greybed, or write the file again."
        )
    centres = _dataset(path, root, "centres", (None, 3))
    radii = _dataset(path, root, "radii", (None,))
    if not len(centres) == len(radii) > 0:
        raise InputError(
            f"{path}: {len(centres)} centres and {len(radii)} radii; a packing needs as many of "
            "both, and at least 1: write the file again."
        )
    box = _dataset(path, root, "box", (2, 3)) if "box" in root else None
    p = np.ravel(root.attrs.get("periodic", [False] * 3))
    if p.shape != (3,) or p.dtype.kind not in "biu":
        raise InputError(f"{path}: attribute periodic = {shown(str(p))} is not three booleans.")
    return assemble(
        path,
        centres,
        radii,
        lambda row: f"{path}: row {row + 1}",
        options,
        box=box,
        periodic=(bool(p[0]), bool(p[1]), bool(p[2])),
        walls=_walls(path, root),
    )
