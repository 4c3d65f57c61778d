"""Crystal packings of equal spheres: simple cubic, body-centred and face-centred cubic."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from greybed.core.errors import InputError
from greybed.core.packing import Packing

# Basis of the cubic cell, in cell edges, and the edge at which spheres touch, in radii.
_BASIS = {
    "sc": [(0.0, 0.0, 0.0)],
    "bcc": [(0.0, 0.0, 0.0), (0.5, 0.5, 0.5)],
    "fcc": [(0.0, 0.0, 0.0), (0.0, 0.5, 0.5), (0.5, 0.0, 0.5), (0.5, 0.5, 0.0)],
}
_TOUCHING_EDGE = {"sc": 2.0, "bcc": 4.0 / math.sqrt(3.0), "fcc": 2.0 * math.sqrt(2.0)}

# A hair above touching, so that the rounding of coordinates never makes an overlap.
_HAIR = 1e-13


def lattice(
    kind: Literal["sc", "bcc", "fcc"],
    cells: int | tuple[int, int, int],
    radius: float,
    solid_fraction: float | None = None,
    *,
    periodic: bool = True,
) -> Packing:
    """Equal spheres on a cubic lattice.

    Parameters
    ----------
    kind : "sc", "bcc" or "fcc"
        Lattice with 1, 2 or 4 spheres in each cubic cell.
    cells : int or three ints
        Number of cells along x, y and z, at least 1 [-]. Consumers that look at nearest images
        only want edges of two diameters: at least 2 cells.
    radius : float
        Sphere radius, above zero [m].
    solid_fraction : float, optional
        Sphere volume over cell volume, above 0 and up to the touching one (sc 0.5236,
        bcc 0.6802, fcc 0.7405) [-]. Spheres touch where it is not given.
    periodic : bool
        Repeat in all directions; otherwise the spheres stand free, without box.

    Raises
    ------
    InputError
        If the kind is unknown, ``cells`` is below 1, or the fraction exceeds the touching one.

    Examples
    --------
    >>> round(lattice("fcc", 3, 1.5e-3).solid_fraction, 6)
    0.74048
    """
    if kind not in _BASIS:
        raise InputError(f"lattice {kind!r} is unknown; choose one of: {', '.join(_BASIS)}.")
    counts = (cells, cells, cells) if isinstance(cells, int) else tuple(cells)
    if len(counts) != 3 or min(counts) < 1:
        raise InputError(f"cells = {cells} [-] must be one or three integers of at least 1.")
    if not (math.isfinite(radius) and radius > 0.0):
        raise InputError(f"radius = {radius:g} [m] must be finite and above 0; mend it.")
    basis = np.array(_BASIS[kind])
    solid = len(basis) * 4.0 / 3.0 * math.pi * radius**3
    edge = _TOUCHING_EDGE[kind] * radius * (1.0 + _HAIR)
    if solid_fraction is not None:
        touching = solid / edge**3
        # Ten hairs of slack let the touching fraction itself, rounded, be asked for.
        if not 0.0 < solid_fraction <= touching * (1.0 + 10.0 * _HAIR):
            raise InputError(
                f"solid fraction = {solid_fraction:g} [-] is outside (0, {touching:.4f}], the "
                f"range of the {kind} lattice; lower it or leave it out for touching spheres."
            )
        edge = max(edge, float(np.cbrt(solid / solid_fraction)))
    corners = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1)
    centres = (corners.reshape(-1, 1, 3) + basis).reshape(-1, 3) * edge
    source = f"{kind} lattice"
    if not periodic:
        return Packing(centres, radius, source=source)
    return Packing(centres, radius, np.array(counts) * edge, (True, True, True), source=source)
