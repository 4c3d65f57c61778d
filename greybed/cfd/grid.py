"""The grid: equal cells in a box, velocities on their faces, pressure in their centres."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from greybed.core.errors import InputError

Array = NDArray[np.float64]
Shape = tuple[int, int, int]

AXES = "xyz"


@dataclass(frozen=True, kw_only=True)
class Grid:
    """Cells of equal size in a box; an axis of one cell that does not repeat makes it flat.

    Parameters
    ----------
    cells : three ints
        Cells along x, y and z, at least 1.
    lower, upper : three floats
        Corners [m].
    periodic : three bools
        Axes that repeat.

    Raises
    ------
    InputError
        For fewer than one cell, or corners that enclose nothing.

    Notes
    -----
    Arrays are ``[z, y, x]`` in C order, so x runs fastest: cell values have :attr:`shape`,
    velocities ``u, v, w`` the shapes of :attr:`face_shapes`. Where an axis repeats, its first and
    last face are the same one and carry the same number.
    """

    cells: Shape
    lower: tuple[float, float, float] = (0.0, 0.0, 0.0)
    upper: tuple[float, float, float]
    periodic: tuple[bool, bool, bool] = (False, False, False)

    def __post_init__(self) -> None:
        for axis, name in enumerate(AXES):
            count, low, high = self.cells[axis], self.lower[axis], self.upper[axis]
            if int(count) != count or count < 1:
                raise InputError(f"grid: {count} cells along {name} must be a whole number from 1.")
            if not (math.isfinite(low) and math.isfinite(high) and low < high):
                raise InputError(
                    f"grid: along {name} the corners {low:g} and {high:g} [m] must be finite and "
                    "grow."
                )

    @property
    def shape(self) -> Shape:
        """Of cell values, (nz, ny, nx)."""
        nx, ny, nz = self.cells
        return nz, ny, nx

    @property
    def face_shapes(self) -> tuple[Shape, Shape, Shape]:
        """Of velocities along x, y and z."""
        nx, ny, nz = self.cells
        return (nz, ny, nx + 1), (nz, ny + 1, nx), (nz + 1, ny, nx)

    @cached_property
    def spacing(self) -> tuple[float, float, float]:
        """Edges of a cell along x, y and z [m]."""
        dx, dy, dz = (
            (high - low) / count
            for low, high, count in zip(self.lower, self.upper, self.cells, strict=True)
        )
        return dx, dy, dz

    @property
    def cell_volume(self) -> float:
        """Volume of a cell [m3]."""
        return math.prod(self.spacing)

    def centres(self, axis: int) -> Array:
        """Coordinates of the cell centres along an axis [m]."""
        return self.lower[axis] + self.spacing[axis] * np.arange(
            0.5, self.cells[axis], dtype=np.float64
        )

    def faces(self, axis: int) -> Array:
        """Coordinates of the faces across an axis [m]."""
        return self.lower[axis] + self.spacing[axis] * np.arange(
            self.cells[axis] + 1, dtype=np.float64
        )
