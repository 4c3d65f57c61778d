"""Values from faces to particles and back, with the same weights."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from greybed.cfd.grid import Grid
from greybed.coupling import _exchange
from greybed.coupling.gas import Faces
from greybed.coupling.void_fraction import Smoother

Array = NDArray[np.float64]


class Transfer:
    """Linear interpolation from smoothed faces to particles, and its transpose.

    Parameters
    ----------
    grid : Grid
        Cells.
    smoother : Smoother
        What smooths fields before they are read, and what is given after it.
    """

    def __init__(self, grid: Grid, smoother: Smoother) -> None:
        self.grid, self.smoother = grid, smoother
        self._shape = (
            np.array(grid.lower, dtype=np.float64), np.array(grid.spacing), np.array(grid.cells),
            np.array(grid.periodic),
        )  # fmt: skip

    def read(self, velocity: Faces, place: Array) -> Array:
        """Values of faces at particles (n, 4), (n, 3)."""
        out = np.empty((len(place), 3))
        for axis, field in enumerate(velocity):
            values = np.empty(len(place))
            smooth = np.ascontiguousarray(self.smoother.faces(field, axis))
            _exchange.read_faces(place, axis, *self._shape, smooth, values)
            out[:, axis] = values
        return out

    def give(self, place: Array, first: Array, second: Array) -> tuple[list[Array], list[Array]]:
        """Two values of each particle, (n, 3) each, summed on faces: the transpose of reading."""
        one, two = [], []
        for axis, shape in enumerate(self.grid.face_shapes):
            a, b = np.zeros(shape), np.zeros(shape)
            _exchange.give_to_faces(
                place, axis, *self._shape, np.ascontiguousarray(first[:, axis]),
                np.ascontiguousarray(second[:, axis]), a, b,
            )  # fmt: skip
            one.append(self.smoother.faces(a, axis))
            two.append(self.smoother.faces(b, axis))
        return one, two

    def split(self, faces: list[Array]) -> tuple[Array, Array]:
        """Sums of face values inside, and at rims, (3,) each; faces that repeat count once."""
        inside, rims = np.empty(3), np.zeros(3)
        for axis, field in enumerate(faces):
            ends = np.moveaxis(field, 2 - axis, 0)
            if self.grid.periodic[axis]:
                inside[axis] = ends[:-1].sum()
            else:
                inside[axis], rims[axis] = ends[1:-1].sum(), ends[0].sum() + ends[-1].sum()
        return inside, rims
