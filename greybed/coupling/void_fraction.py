"""Solid fraction of the cells of a grid: exact volumes of spheres, and smoothing of fields."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from greybed.cfd.grid import Grid
from greybed.core.errors import InputError
from greybed.coupling import _overlap, _smoothing

Array = NDArray[np.float64]

METHODS = ("exact", "centre")
# Implicit steps of a smoothing: their kernel is a Gaussian but for its fourth moment.
_STEPS = 3


class Overlaps:
    r"""Which cells spheres lie in, with how much of their volume.

    Parameters
    ----------
    grid : Grid
        Cells.
    place : ndarray, shape (n, 4)
        Centres, which lie in the grid along axes that do not repeat, and radii [m].
    method : str
        ``exact``: each cell gets the volume that lies in it, in closed form: caps, and parts
        beyond two and three planes at right angles (for general cells: Strobl, Formella &
        Poeschel, J. Comput. Phys. 311 (2016) 158). ``centre``: all of it where the centre is.
        What reaches across a rim counts in the cell there, so that the volumes of a sphere add up
        to its own, to round-off.

    Attributes
    ----------
    first, cell, volume : ndarray, shapes (n + 1,), (m,), (m,)
        Rows of each sphere: flat numbers of cells, and volumes [m3].

    Raises
    ------
    InputError
        If a centre lies outside, or the method is not known.
    """

    def __init__(self, grid: Grid, place: Array, *, method: str = "exact") -> None:
        if method not in METHODS:
            raise InputError(f"method = {method!r} is not known; known are {', '.join(METHODS)}.")
        place = np.ascontiguousarray(place)
        n = len(place)
        shape = (np.array(grid.lower, dtype=np.float64), np.array(grid.spacing),
                 np.array(grid.cells), np.array(grid.periodic))  # fmt: skip
        self.grid = grid
        self.first = np.empty(n + 1, np.int64)
        # Cells that the largest sphere may reach along each axis.
        largest = float(place[:, 3].max(initial=0.0))
        across = [int(2.0 * largest / h) + 2 for h in grid.spacing]
        most, entries = max(across), n if method == "centre" else n * math.prod(across)
        cell, volume = np.empty(entries, np.int64), np.empty(entries)
        self._solids = np.zeros(grid.shape)
        found = (self.first, cell, volume, self._solids.reshape(-1))
        if method == "centre":
            used = _overlap.centre_cells(place, *shape, *found)
        else:
            used = _overlap.overlaps(place, *shape, most, *found)
        if used < 0:
            at = ", ".join(f"{c:.4g}" for c in place[-1 - used, :3])
            raise InputError(
                f"a particle at ({at}) [m] lies outside the gas's grid, {grid.lower} to "
                f"{grid.upper}; make the grid larger or keep the particles in with walls."
            )
        self.cell, self.volume = cell[:used], volume[:used]

    @cached_property
    def _whole(self) -> Array:
        whole: Array = np.add.reduceat(self.volume, self.first[:-1])
        return whole

    def solids(self) -> Array:
        """Volumes in the cells, shape (nz, ny, nx) [m3]."""
        return self._solids.copy()

    def integral(self, fields: Array) -> Array:
        """Integrals over each sphere of fields (nz, ny, nx, k), constant in cells; (n, k) [m3]."""
        fields = np.ascontiguousarray(fields)
        out = np.empty((len(self.first) - 1, fields.shape[-1]))
        flat = fields.reshape(-1, fields.shape[-1])
        _overlap.collect(self.first, self.cell, self.volume, flat, out)
        return out

    def mean(self, fields: Array) -> Array:
        """Means over each sphere of fields (nz, ny, nx, k), shape (n, k)."""
        return self.integral(fields) / self._whole[:, None]

    def share_out(self, values: Array) -> Array:
        """Values of spheres (n, k) shared out to cells by volume, (nz, ny, nx, k).

        It is the transpose of :meth:`mean`: sums stay, and products with fields.
        """
        per_volume = values / self._whole[:, None]
        out = np.zeros((int(np.prod(self.grid.shape)), values.shape[1]))
        _overlap.spread(self.first, self.cell, self.volume, per_volume, out)
        return out.reshape(*self.grid.shape, values.shape[1])


def solid_fraction(grid: Grid, centres: Array, radii: Array, *, method: str = "exact") -> Array:
    """Solid fraction of the cells, shape (nz, ny, nx) [-], from spheres.

    Parameters
    ----------
    grid, method
        As of :class:`Overlaps`.
    centres, radii : ndarray, shapes (n, 3), (n,)
        Spheres [m].

    Raises
    ------
    InputError
        If a centre lies outside, or the method is not known.
    """
    place = np.empty((len(centres), 4))
    place[:, :3], place[:, 3] = centres, radii
    return Overlaps(grid, place, method=method).solids() / grid.cell_volume


class Smoother:
    r"""Conserving smoothing of fields on a grid, the same whatever the cells.

    A field is spread as by a box of the given width: by a Gaussian whose variance along each axis
    is :math:`(w^2 - h^2) / 12`, what a box of width w has and a cell of width h lacks. It is three
    implicit steps of diffusion along each axis in turn, without a limit for the ratio of width and
    cell (Sun & Xiao, Int. J. Multiphase Flow 77 (2015) 142 diffuse explicitly). Nothing crosses
    walls; sums and constants are kept, and no value leaves the range of the field.

    Parameters
    ----------
    grid : Grid
        Cells.
    width : float
        Width, at least 0; where it is below that of the cells nothing is done [m].

    Raises
    ------
    InputError
        If it is negative or not finite.
    """

    def __init__(self, grid: Grid, width: float) -> None:
        if not (math.isfinite(width) and width >= 0.0):
            raise InputError(f"smoothing: width = {width:g} [m] must be finite and at least 0.")
        self.grid, self.width = grid, width
        self._axes: list[tuple[int, float, bool, Array, Array, Array, Array]] = []
        for axis, h in enumerate(grid.spacing):
            share = (width**2 - h**2) / (24.0 * _STEPS * h**2)
            n, ring = grid.cells[axis], grid.periodic[axis]
            if share > 0.0 and n > 1:
                cells = _smoothing.factors(n, share, ring)
                # A ring has as many faces as cells; else there is one more.
                faces = cells if ring else _smoothing.factors(n + 1, share, False)
                self._axes.append((axis, share, ring, *cells, *faces))

    @property
    def idle(self) -> bool:
        """Whether nothing is done."""
        return not self._axes

    def cells(self, field: Array) -> Array:
        """A smoothed copy of cell values, shape (nz, ny, nx)."""
        return self._smooth(np.array(field, dtype=np.float64, order="C"), -1)

    def faces(self, field: Array, axis: int) -> Array:
        """The same of values on the faces across an axis (0 is x).

        It is its own transpose, so that what is read with it can be given back with it.
        """
        if self.idle:
            return np.array(field)
        if not self.grid.periodic[axis]:
            return self._smooth(np.array(field, dtype=np.float64, order="C"), axis)
        along = 2 - axis
        one = np.delete(field, -1, axis=along)
        one = self._smooth(np.ascontiguousarray(one), axis)
        return np.concatenate([one, one.take([0], axis=along)], axis=along)

    def _smooth(self, field: Array, across: int) -> Array:
        nz, ny, nx = field.shape
        views = (field.reshape(nz * ny, nx, 1), field.reshape(nz, ny, nx), field.reshape(1, nz, -1))
        for axis, share, ring, pivot, turn, face_pivot, face_turn in self._axes:
            own = (face_pivot, face_turn) if axis == across else (pivot, turn)
            for _ in range(_STEPS):
                _smoothing.diffuse(views[axis], share, *own, ring)
        return field
