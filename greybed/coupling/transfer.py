"""Values from faces to particles and back, with the same weights."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from greybed.cfd.grid import Grid
from greybed.closures.drag import DragLaw
from greybed.coupling import _exchange
from greybed.coupling.drag_exchange import DragTerms, refuse
from greybed.coupling.gas import Faces, Fluid
from greybed.coupling.void_fraction import Overlaps, Smoother

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

        # Faces across x, y and z lie one after the other in one array, which numpy takes at once.
        self._ends = np.cumsum([0, *(math.prod(shape) for shape in grid.face_shapes)])
        # Where the values of arrays with one layer more come from, along z, y and x.
        self._from = [
            [_beyond(grid.cells[a], grid.periodic[a], a == axis) for a in (2, 1, 0)]
            for axis in range(3)
        ]

    def faces(self, flat: Array) -> Faces:
        """Views of values of all faces as faces across x, y and z."""
        u, v, w = (
            flat[self._ends[axis] : self._ends[axis + 1]].reshape(shape)
            for axis, shape in enumerate(self.grid.face_shapes)
        )
        return u, v, w

    def flat(self, faces: Faces) -> Array:
        """A copy of values of faces in one array."""
        return np.concatenate([field.reshape(-1) for field in faces])

    def read(self, velocity: Faces, place: Array) -> Array:
        """Values of faces at particles (n, 4), (n, 3)."""
        out = np.empty((len(place), 3))
        _exchange.read_faces(place, *self._shape, *self._wide(velocity), out)
        return out

    def give(self, place: Array, k: Array, target: Array) -> tuple[Array, Array]:
        """Sums of k (n, 3), or (n, 1), and of k target (n, 3) on faces: the transpose of read.

        Both are flat, as of :meth:`flat`.
        """
        sums = self._none()
        _exchange.give_to_faces(place, *self._shape, k, target, *(a.reshape(-1) for a in sums))
        return self._gathered(sums)

    def drag(
        self, place: Array, motion: Array, overlaps: Overlaps, void: Array, velocity: Faces,
        law: DragLaw, fluid: Fluid, over: bool,
    ) -> tuple[DragTerms, float, Array, Array]:  # fmt: skip
        """Drag of a law, if ``over`` over the void fraction, and what is given of it.

        The second is the fastest relaxation of a particle [1/s]; the others are the sums of k and
        of k times the particles' velocities on faces, flat.
        """
        sums = self._none()
        at, re, k, steep = np.empty((4, len(place)))
        count, bad, fastest = _exchange.drag_both_ways(
            place, motion, overlaps.first, overlaps.cell, overlaps.volume, void.reshape(-1),
            law.code, *map(float, law.solids), float(law.reynolds), float(fluid.density),
            float(fluid.viscosity), over, *self._shape, *self._wide(velocity),
            *(a.reshape(-1) for a in sums), at, re, k, steep,
        )  # fmt: skip
        if bad >= 0:
            refuse(float(law(1.0 - at[bad], re[bad])), 1.0 - at[bad], re[bad])
        terms = DragTerms(k, steep, at, re, count / max(len(place), 1))
        return terms, fastest, *self._gathered(sums)

    def forces(
        self, place: Array, velocity: Faces, k: Array, target: Array, steady: Array,
        overlaps: Overlaps, slopes: Array, lift: Array,
    ) -> tuple[Array, Array]:  # fmt: skip
        """What the gas does to particles, (n, 3) [N], and the sums of its parts, (3, 3) [N].

        See :func:`greybed.coupling._exchange.forces_of`.
        """
        out, sums = np.empty((len(place), 3)), np.empty((3, 3))
        _exchange.forces_of(
            k, target, steady, overlaps.first, overlaps.cell, overlaps.volume, slopes, lift, place,
            *self._shape, *self._wide(velocity), out, sums,
        )  # fmt: skip
        return out, sums

    def _wide(self, velocity: Faces) -> list[Array]:
        """Smoothed faces with one layer more around them, flat."""
        wide = []
        for axis, field in enumerate(velocity):
            out = np.empty([len(at) for at in self._from[axis]])
            smooth = field if self.smoother.idle else self.smoother.faces(field, axis)
            smooth = np.ascontiguousarray(smooth)
            _exchange.surround(smooth, *self._from[axis], out)
            wide.append(out.reshape(-1))
        return wide

    def _none(self) -> list[Array]:
        return [np.zeros((*(len(at) for at in lists), 2)) for lists in self._from]

    def _gathered(self, sums: list[Array]) -> tuple[Array, Array]:
        one, two = np.zeros((2, self._ends[-1]))
        both = zip(self.faces(one), self.faces(two), strict=True)
        for axis, (a, b) in enumerate(both):
            _exchange.gather(sums[axis], *self._from[axis], a, b)
            for field in (a, b):
                if self.grid.periodic[axis]:  # the last face is the first one
                    ends = np.moveaxis(field, 2 - axis, 0)
                    ends[-1] = ends[0]
                if not self.smoother.idle:
                    field[...] = self.smoother.faces(field, axis)
        return one, two

    def split(self, flat: Array) -> tuple[Array, Array]:
        """Sums of face values inside, and at rims, (3,) each; faces that repeat count once."""
        sums = [
            _exchange.inside_and_rims(field, 2 - axis, self.grid.periodic[axis])
            for axis, field in enumerate(self.faces(flat))
        ]
        inside, rims = np.array(sums).T
        return inside, rims


def _beyond(n: int, periodic: bool, faces: bool) -> NDArray[np.int64]:
    """Numbers along an axis of n cells from one before the first point to one after the last."""
    points = np.arange(-1, n + 1 + faces)
    return points % n if periodic else np.clip(points, 0, n - 1 + faces)
