"""The pressure of a step: multigrid, or transforms where coefficients are equal."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from greybed.cfd.grid import Shape
from greybed.cfd.poisson import Poisson

Array = NDArray[np.float64]
Faces = tuple[Array, Array, Array]


class Pressure:
    """Values of cells from their net outflow, with the faster of two solvers.

    Parameters
    ----------
    shape : three ints
        Cells, (nz, ny, nx).
    periodic : three bools
        x, y, z.
    method : {"auto", "multigrid", "transform"}
        ``auto`` transforms where no side is open and the transmissibilities of an axis are equal.
    """

    def __init__(self, shape: Shape, periodic: tuple[bool, bool, bool], method: str) -> None:
        self.shape, self.periodic, self.method = shape, periodic, method
        self._multigrid: Poisson | None = None
        self._known: Faces | None = None
        self._values: list[float] | None = None
        self.singular = False

    def update(self, ways: Faces) -> None:
        """Take transmissibilities."""
        if self._known is not None and all(
            np.array_equal(a, b) for a, b in zip(ways, self._known, strict=True)
        ):
            return
        self._known = ways
        self._values = None if self.method == "multigrid" else self._equal(ways)
        if self._values is not None:
            self.singular = True
            self._eigenvalues = self._sum_of_eigenvalues(self._values)
            return
        if self._multigrid is None:
            self._multigrid = Poisson(*ways, self.periodic)
        else:
            self._multigrid.update(*ways)
        self.singular = self._multigrid.singular

    def solve(self, outflow: Array, enough: float) -> tuple[Array, int]:
        """Values (mean 0 without an open side) and iterations."""
        if self._values is None:
            if self._multigrid is None:
                raise RuntimeError("update comes before solve.")
            return self._multigrid.solve(outflow, tolerance=0.0, enough=enough)
        return self._transform(outflow), 0

    def _equal(self, ways: Faces) -> list[float] | None:
        """The transmissibility of each axis, where there is one, and none leads outside."""
        values = []
        for axis in range(3):
            t = np.moveaxis(ways[axis], 2 - axis, 0)
            inner = t if self.periodic[axis] else t[1:-1]
            if not self.periodic[axis] and (t[0].any() or t[-1].any()):
                return None
            value = float(inner.flat[0]) if inner.size else 0.0
            if inner.size and not (np.abs(inner - value) <= 1e-13 * abs(value)).all():
                return None
            values.append(value)
        return values

    def _sum_of_eigenvalues(self, values: list[float]) -> Array:
        total = np.zeros(self.shape)
        for axis, value in enumerate(values):
            along = 2 - axis
            n = self.shape[along]
            k = np.arange(n) * (2.0 if self.periodic[axis] else 1.0)
            line = 2.0 * value * (1.0 - np.cos(np.pi * k / n))
            total += line.reshape([-1 if d == along else 1 for d in range(3)])
        total.flat[0] = 1.0
        if self.periodic[0]:
            total = total[:, :, : self.shape[2] // 2 + 1]
        return np.ascontiguousarray(total)

    def _transform(self, b: Array) -> Array:
        walls = [d for d in range(3) if not self.periodic[2 - d]]
        loops = [d for d in range(3) if self.periodic[2 - d]]
        # The real transform halves the last axis, which must be x for the eigenvalues.
        t = fft.dctn(b, type=2, axes=walls) if walls else b
        if self.periodic[0]:
            t = fft.rfftn(t, axes=loops)
        elif loops:
            t = fft.fftn(t, axes=loops)
        t = t / self._eigenvalues
        t.flat[0] = 0.0
        if self.periodic[0]:
            t = fft.irfftn(t, s=[self.shape[d] for d in loops], axes=loops)
        elif loops:
            t = fft.ifftn(t, axes=loops).real
        return fft.idctn(t, type=2, axes=walls) if walls else t
