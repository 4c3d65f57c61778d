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

        # Where the values of arrays with one layer more come from, along z, y and x.
        self._from = [
            [_beyond(grid.cells[a], grid.periodic[a], a == axis) for a in (2, 1, 0)]
            for axis in range(3)
        ]

    def read(self, velocity: Faces, place: Array) -> Array:
        """Values of faces at particles (n, 4), (n, 3)."""
        out, wide = np.empty((len(place), 3)), []
        for axis, field in enumerate(velocity):
            wide.append(np.empty([len(at) for at in self._from[axis]]))
            smooth = np.ascontiguousarray(self.smoother.faces(field, axis))
            _exchange.surround(smooth, *self._from[axis], wide[-1])
        _exchange.read_faces(place, *self._shape, *(a.reshape(-1) for a in wide), out)
        return out

    def give(self, place: Array, k: Array, target: Array) -> tuple[list[Array], list[Array]]:
        """Sums of k (n, 3), or (n, 1), and of k target (n, 3) on faces: the transpose of read."""
        sums = [np.zeros((*(len(at) for at in lists), 2)) for lists in self._from]
        _exchange.give_to_faces(place, *self._shape, k, target, *(a.reshape(-1) for a in sums))
        one, two = [], []
        for axis, shape in enumerate(self.grid.face_shapes):
            a, b = np.zeros(shape), np.zeros(shape)
            _exchange.gather(sums[axis], *self._from[axis], a, b)
            if self.grid.periodic[axis]:  # the last face is the first one
                for ends in (np.moveaxis(a, 2 - axis, 0), np.moveaxis(b, 2 - axis, 0)):
                    ends[-1] = ends[0]
            one.append(self.smoother.faces(a, axis))
            two.append(self.smoother.faces(b, axis))
        return one, two

    def split(self, faces: list[Array]) -> tuple[Array, Array]:
        """Sums of face values inside, and at rims, (3,) each; faces that repeat count once."""
        inside, rims = np.empty(3), np.zeros(3)
        for axis, field in enumerate(faces):
            sums = field.sum(axis=tuple(a for a in range(3) if a != 2 - axis))
            if self.grid.periodic[axis]:
                inside[axis] = sums[:-1].sum()
            else:
                inside[axis], rims[axis] = sums[1:-1].sum(), sums[0] + sums[-1]
        return inside, rims


def _beyond(n: int, periodic: bool, faces: bool) -> NDArray[np.int64]:
    """Numbers along an axis of n cells from one before the first point to one after the last."""
    points = np.arange(-1, n + 1 + faces)
    return points % n if periodic else np.clip(points, 0, n - 1 + faces)
