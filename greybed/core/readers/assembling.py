"""The last step of every reader: order by id, check with the place in the file, build."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.core.errors import InputError
from greybed.core.packing import Array, Packing, check_spheres
from greybed.core.walls import Wall

# No bed is larger; what is came from damage or a wrong unit, and would overflow later on.
LARGEST = 1e9  # [m]


@dataclass(frozen=True, kw_only=True)
class Options:
    """What a caller may say about a file beyond its content.

    Attributes
    ----------
    walls : tuple of walls
        Replace the walls that the file holds, if any are given.
    frame : int, optional
        Which frame of a dump, counted from 0, or from the end where negative; the last if None.
    unit : str, optional
        Length unit of a file that states none; metres if None.
    box : array_like, shape (3,) or (2, 3), optional
        Replaces the box of the file [m].
    periodic : three bools, optional
        Replaces the periodicity of the file.
    """

    walls: tuple[Wall, ...] = ()
    frame: int | None = None
    unit: str | None = None
    box: ArrayLike | None = None
    periodic: tuple[bool, bool, bool] | None = None


def _id_order(ids: Array, place: Callable[[int], str]) -> NDArray[np.int64]:
    bad = ~np.isfinite(ids) | (ids != np.floor(ids))
    if bad.any():
        i = int(bad.argmax())
        raise InputError(f"{place(i)}: id = {ids[i]:g} is not a whole number; mend this row.")
    order = np.argsort(ids, kind="stable")
    same = np.flatnonzero(ids[order][1:] == ids[order][:-1])
    if len(same):
        # the duplicate that comes first in the file
        k = same[order[same + 1].argmin()]
        first, second = int(order[k]), int(order[k + 1])
        raise InputError(
            f"{place(second)}: id = {ids[second]:.0f} is already taken by {place(first)}; "
            "ids must differ: remove one of the two."
        )
    return order


def _check_sizes(
    path: Path, centres: Array, radii: Array, box: Array | None, place: Callable[[int], str]
) -> None:
    advice = f"no bed is larger than {LARGEST:g} m: check the length unit and mend this row."
    for axis, column in zip("xyz", centres.T, strict=True):
        far = np.isfinite(column) & (np.abs(column) > LARGEST)
        if far.any():
            i = int(far.argmax())
            raise InputError(f"{place(i)}: {axis} = {column[i]:g} [m]; {advice}")
    large = np.isfinite(radii) & (radii > LARGEST)
    if large.any():
        i = int(large.argmax())
        raise InputError(f"{place(i)}: radius = {radii[i]:g} [m]; {advice}")
    if box is not None and (np.isfinite(box) & (np.abs(box) > LARGEST)).any():
        raise InputError(f"{path}: box bound {np.abs(box).max():g} [m]; {advice}")


def assemble(
    path: Path,
    centres: Array,
    radii: Array,
    place: Callable[[int], str],
    options: Options,
    *,
    ids: Array | None = None,
    box: Array | None = None,
    periodic: tuple[bool, bool, bool] = (False, False, False),
    walls: Sequence[Wall] = (),
) -> Packing:
    """Check what a reader found and make the packing.

    Parameters
    ----------
    path : Path
        The file.
    centres, radii : (n, 3) and (n,) arrays
        As read [m].
    place : callable
        File and line (or row) of sphere ``i`` in the order of ``centres``.
    options : Options
        What the caller said.
    ids : (n,) array, optional
        Identities [-]; the spheres are sorted by them.
    box, periodic, walls
        As the file has them; ``options`` goes first.

    Raises
    ------
    InputError
        For anything that :class:`Packing` refuses, for repeated ids, and for lengths above
        1e9 m, with the place in the file.
    """
    order = np.arange(len(radii)) if ids is None else _id_order(ids, place)
    if options.box is not None:
        box = np.array(options.box, dtype=np.float64)
        box = np.stack([np.zeros(3), box]) if box.shape == (3,) else box
    if options.periodic is not None:
        periodic = options.periodic
    _check_sizes(path, centres, radii, box, place)
    if box is None or box.shape == (2, 3):  # the packing itself refuses other shapes
        check_spheres(centres, radii, box, periodic, place)
    walls = tuple(options.walls or walls)
    return Packing(centres[order], radii[order], box, periodic, walls, source=path.name)
