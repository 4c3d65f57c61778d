"""Pressure: conjugate gradients with a multigrid cycle as preconditioner."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from greybed.cfd import _multigrid
from greybed.core.errors import InputError

Array = NDArray[np.float64]

# Cells of the coarsest grid, which is solved directly.
_DIRECT = 64
_MOST_ITERATIONS = 200
# Couplings weaker than this share of the strongest axis wait until they have caught up.
_WEAK = 0.3


@dataclass
class _Level:
    tx: Array
    ty: Array
    tz: Array
    diag: Array
    inverse: Array
    halved: tuple[bool, bool, bool]  # z, y, x, on the way down
    p: Array
    b: Array
    r: Array


class Poisson:
    """Solver of sums of fluxes: each cell's net outflow is given, its value is sought.

    Parameters
    ----------
    tx, ty, tz : ndarray, shapes (nz, ny, nx + 1), (nz, ny + 1, nx), (nz + 1, ny, nx)
        Transmissibilities of the faces, at least 0: flux over difference of values. On the rim of
        an axis that is not periodic they lead to the value 0; 0 is a wall.
    periodic : three bools
        x, y, z.

    Raises
    ------
    InputError
        For shapes that do not belong together, or numbers out of range.
    """

    def __init__(self, tx: Array, ty: Array, tz: Array, periodic: tuple[bool, bool, bool]) -> None:
        nz, ny, nx = ty.shape[0], tx.shape[1], ty.shape[2]
        shapes = ((nz, ny, nx + 1), (nz, ny + 1, nx), (nz + 1, ny, nx))
        if tuple(t.shape for t in (tx, ty, tz)) != shapes:
            raise InputError(
                f"transmissibilities of shapes {tx.shape}, {ty.shape}, {tz.shape} must be {shapes}."
            )
        self.shape = (nz, ny, nx)
        # The compiled loops are fast where the axis of one cell is z: turn such planes.
        self._turn = -1
        if ny == 1 and nz > 1 and not periodic[1] and not ty.any():
            self._turn, periodic = 1, (periodic[0], periodic[2], False)
        elif nx == 1 and nz > 1 and not periodic[0] and not tx.any():
            self._turn, periodic = 0, (periodic[1], periodic[2], False)
        self.periodic = periodic
        self.levels: list[_Level] = []
        self.update(tx, ty, tz)

    def _turned(self, tx: Array, ty: Array, tz: Array) -> tuple[Array, Array, Array]:
        nz, ny, nx = self.shape
        if self._turn == 1:
            return tx.reshape(1, nz, nx + 1), tz.reshape(1, nz + 1, nx), np.zeros((2, nz, nx))
        if self._turn == 0:
            return ty.reshape(1, nz, ny + 1), tz.reshape(1, nz + 1, ny), np.zeros((2, nz, ny))
        return tx, ty, tz

    def update(self, tx: Array, ty: Array, tz: Array) -> None:
        """Take other transmissibilities of the same shapes."""
        for name, t in (("tx", tx), ("ty", ty), ("tz", tz)):
            if not (np.isfinite(t).all() and (t >= 0.0).all()):
                raise InputError(f"{name}: transmissibilities must be finite and at least 0.")
        closed = {0: tx, 1: ty}.get(self._turn)
        if closed is not None and closed.any():
            raise InputError("transmissibilities: an axis of one cell was closed before; keep it.")
        tx, ty, tz = self._turned(tx, ty, tz)
        if not self.levels:
            self._lay_levels(tx, ty, tz)
        top = self.levels[0]
        top.tx[...], top.ty[...], top.tz[...] = tx, ty, tz
        for number, level in enumerate(self.levels):
            _multigrid.diagonal(level.tx, level.ty, level.tz, level.diag)
            with np.errstate(divide="ignore"):
                level.inverse[...] = np.where(level.diag > 0.0, 1.0 / level.diag, 0.0)
            if number + 1 < len(self.levels):
                below = self.levels[number + 1]
                for axis, name in enumerate(("tz", "ty", "tx")):
                    _multigrid.coarsen(
                        getattr(level, name), axis, level.halved, getattr(below, name)
                    )
        rims = (top.tx[..., 0], top.tx[..., -1], top.ty[:, 0], top.ty[:, -1], top.tz[0], top.tz[-1])
        self.singular = all(self.periodic[k // 2] or not rim.any() for k, rim in enumerate(rims))
        self._inverse = np.linalg.pinv(self._dense(self.levels[-1]), hermitian=True)

    def _lay_levels(self, tx: Array, ty: Array, tz: Array) -> None:
        """Grids of half as many cells along those axes that are strongly coupled."""
        shape = (ty.shape[0], tx.shape[1], ty.shape[2])
        strength = np.array([float(t.mean()) for t in (tz, ty, tx)])
        while True:
            nz, ny, nx = shape
            last = nz * ny * nx <= _DIRECT
            wide = np.array(shape) > 1
            halved = (False, False, False)
            if not last:
                strong = wide & (strength >= _WEAK * strength[wide].max())
                halved = (bool(strong[0]), bool(strong[1]), bool(strong[2]))
            self.levels.append(
                _Level(
                    np.zeros((nz, ny, nx + 1)), np.zeros((nz, ny + 1, nx)),
                    np.zeros((nz + 1, ny, nx)), np.zeros(shape), np.zeros(shape), halved,
                    np.zeros(shape), np.zeros(shape), np.zeros(shape),
                )
            )  # fmt: skip
            if last:
                return
            across = 2.0 ** sum(halved)
            for axis, half in enumerate(halved):
                # Faces in parallel, each over a longer way where its own axis is halved.
                strength[axis] *= across / 4.0 if half else across
            nz, ny, nx = (-(-n // 2) if half else n for n, half in zip(shape, halved, strict=True))
            shape = (nz, ny, nx)

    def _dense(self, level: _Level) -> Array:
        """The coarsest grid as a matrix."""
        n = level.diag.size
        matrix, out = np.empty((n, n)), np.empty(level.diag.shape)
        for k in range(n):
            unit = np.zeros(n)
            unit[k] = 1.0
            self._times(level, unit.reshape(out.shape), out)
            matrix[:, k] = out.ravel()
        return 0.5 * (matrix + matrix.T)

    def _times(self, level: _Level, p: Array, out: Array) -> float:
        px, py, pz = self.periodic
        return float(_multigrid.times(p, level.tx, level.ty, level.tz, level.diag, px, py, pz, out))

    def _cycle(self, number: int) -> None:
        """One V-cycle: ``p`` of this level from its ``b``, beginning with 0."""
        level = self.levels[number]
        if number == len(self.levels) - 1:
            level.p[...] = (self._inverse @ level.b.ravel()).reshape(level.p.shape)
            return
        px, py, pz = self.periodic
        faces = (level.tx, level.ty, level.tz, level.inverse, px, py, pz)
        level.p[...] = 0.0
        # Black after red on the way up only: the cycle is its own transpose.
        for colour in (0, 1):
            _multigrid.sweep(level.p, level.b, *faces, colour)
        self._times(level, level.p, level.r)
        np.subtract(level.b, level.r, out=level.r)
        hz, hy, hx = level.halved
        below = self.levels[number + 1]
        _multigrid.restrict(level.r, below.b, hx, hy, hz, px, py, pz)
        self._cycle(number + 1)
        _multigrid.prolong(below.p, level.p, hx, hy, hz, px, py, pz)
        for colour in (1, 0):
            _multigrid.sweep(level.p, level.b, *faces, colour)

    def solve(
        self,
        outflow: Array,
        start: Array | None = None,
        *,
        tolerance: float = 1e-8,
        enough: float = 0.0,
    ) -> tuple[Array, int]:
        """Values of the cells.

        Parameters
        ----------
        outflow : ndarray, shape (nz, ny, nx)
            Net flux out of each cell; its mean is taken off where no value is fixed anywhere.
        start : ndarray, optional
            First guess; 0 by default.
        tolerance : float
            Largest norm of the residual over that of ``outflow`` [-].
        enough : float
            A norm of the residual that is small enough anyhow.

        Returns
        -------
        values : ndarray, shape (nz, ny, nx)
            With mean 0 where no value is fixed anywhere.
        iterations : int

        Raises
        ------
        InputError
            If the residual does not come down.
        """
        top = self.levels[0]
        outflow = outflow.reshape(top.b.shape)
        start = None if start is None else start.reshape(top.b.shape)
        b = outflow - outflow.mean() if self.singular else outflow
        size = float(np.sqrt((b**2).sum()))
        p = np.zeros_like(b) if start is None else start.copy()
        work = np.empty_like(b)
        self._times(top, p, work)
        r = b - work
        direction, old = np.zeros_like(b), 1.0
        for iteration in range(_MOST_ITERATIONS + 1):
            if float(np.sqrt((r**2).sum())) <= max(tolerance * size, enough):
                return (p - p.mean() if self.singular else p).reshape(self.shape), iteration
            top.b[...] = r
            self._cycle(0)
            z = top.p
            if self.singular:
                z -= z.mean()
            new = float((r * z).sum())
            direction *= new / old if iteration else 0.0
            direction += z
            old = new
            share = new / self._times(top, direction, work)
            p += share * direction
            r -= share * work
        raise InputError(
            f"pressure: the residual is {float(np.sqrt((r**2).sum())) / size:.2g} of the outflow "
            f"after {_MOST_ITERATIONS} iterations; take a smaller time step."
        )
