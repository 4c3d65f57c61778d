"""One published drag law: its number for compiled code, its range, its source."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.closures.drag import _kernels
from greybed.core.errors import RangeError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class DragLaw:
    """One published drag law.

    Attributes
    ----------
    name : str
        As case files write it.
    code : int
        Its number for ``greybed.closures.drag._kernels.drag``.
    source : str
        Where it was published, and where the form here was read.
    limits : str
        Limits that it misses, where it jumps.
    solids : (float, float)
        Solid fractions of its data [-].
    reynolds : float
        Largest Re of its data [-].
    inertia : bool
        Whether F depends on Re.
    bed : bool
        Whether F depends on phi: a law for beds; the others are for one sphere.
    sphere : bool
        Whether it holds for one sphere too, phi = 0.
    """

    name: str
    code: int
    source: str
    limits: str
    solids: tuple[float, float]
    reynolds: float
    inertia: bool = True
    bed: bool = True
    sphere: bool = True

    def __call__(
        self, solid_fraction: ArrayLike, reynolds: ArrayLike, *, strict: bool = False
    ) -> Array:
        """F [-] for solid fractions 0 to below 1 and Re from 0, broadcast together.

        Raises
        ------
        RangeError
            If ``strict`` and anything lies outside the range of the law's data.
        """
        if strict:
            self.check(solid_fraction, reynolds)
        return self.with_slope(solid_fraction, reynolds)[0]

    def with_slope(self, solid_fraction: ArrayLike, reynolds: ArrayLike) -> tuple[Array, Array]:
        """F and Re dF/dRe [-]; F Re grows by their sum times dRe, which is finite at Re = 0."""
        phi, re = np.broadcast_arrays(
            np.asarray(solid_fraction, dtype=np.float64), np.asarray(reynolds, dtype=np.float64)
        )
        force, slope = np.empty(phi.size), np.empty(phi.size)
        _kernels.drag_into(
            self.code, np.ascontiguousarray(phi).reshape(-1), np.ascontiguousarray(re).reshape(-1),
            force, slope,
        )  # fmt: skip
        return force.reshape(phi.shape), slope.reshape(phi.shape)

    def outside(self, solid_fraction: ArrayLike, reynolds: ArrayLike) -> NDArray[np.bool_]:
        """Where the solid fraction or Re lies outside the range of the law's data."""
        phi, re = np.asarray(solid_fraction), np.asarray(reynolds)
        inside = (phi >= self.solids[0]) & (phi <= self.solids[1])
        return ~(inside & (re >= 0.0) & (re <= self.reynolds))

    def check(self, solid_fraction: ArrayLike, reynolds: ArrayLike) -> None:
        """Refuse what lies outside the range of the law's data.

        Raises
        ------
        RangeError
            With the first value that does.
        """
        phi, re = np.broadcast_arrays(solid_fraction, reynolds)
        bad = np.flatnonzero(self.outside(phi, re))
        if len(bad):
            k = int(bad[0])
            raise RangeError(
                f"drag law {self.name!r}: solid fraction {phi.flat[k]:.3g} and Re = "
                f"{re.flat[k]:.3g} [-] lie outside its data, {self.solids[0]:g} ... "
                f"{self.solids[1]:g} and 0 ... {self.reynolds:g}; take another law or leave out "
                "strict."
            )
