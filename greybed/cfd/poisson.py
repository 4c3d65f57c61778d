"""Pressure: conjugate gradients with a multigrid cycle as preconditioner."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from greybed.cfd import _coarsest, _multigrid
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
    at: tuple[NDArray[np.int64], ...]  # fine faces at the coarse ones below
    share: tuple[Array, ...]  # one over the way between coarse cells, in fine ones
    p: Array
    b: Array


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
            if not _multigrid.sound(t):
                raise InputError(f"{name}: transmissibilities must be finite and at least 0.")
        closed = {0: tx, 1: ty}.get(self._turn)
        if closed is not None and closed.any():
            raise InputError("transmissibilities: an axis of one cell was closed before; keep it.")
        tx, ty, tz = self._turned(tx, ty, tz)
        if not self.levels:
            self._lay_levels(tx, ty, tz)
        top = self.levels[0]
        top.tx[...], top.ty[...], top.tz[...] = tx, ty, tz
        rims = self._rims(top)
        self.singular = all(self.periodic[k // 2] or not rim.any() for k, rim in enumerate(rims))
        for number, level in enumerate(self.levels):
            faces = (level.tx, level.ty, level.tz)
            _multigrid.diagonal(*faces, level.diag, level.inverse)
            if number + 1 < len(self.levels):
                below = self.levels[number + 1]
                _multigrid.coarsen(
                    *faces, level.halved, level.at, level.share, below.tx, below.ty, below.tz
                )
            # What a side leads to is in the diagonal: loops wrap round, and find nothing there.
            for k, rim in enumerate(self._rims(level)):
                if not self.periodic[k // 2]:
                    rim[...] = 0.0
        last = self.levels[-1]
        self._coarsest = np.empty((last.diag.size, last.diag.size))
        _coarsest.dense(last.tx, last.ty, last.tz, last.diag, self._coarsest)
        _coarsest.factor(self._coarsest)

    @staticmethod
    def _rims(level: _Level) -> tuple[Array, ...]:
        tx, ty, tz = level.tx, level.ty, level.tz
        return tx[..., 0], tx[..., -1], ty[:, 0], ty[:, -1], tz[0], tz[-1]

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
            spans = [
                _spans(n, half, self.periodic[2 - axis])
                for axis, (n, half) in enumerate(zip(shape, halved, strict=True))
            ]
            self.levels.append(
                _Level(
                    np.zeros((nz, ny, nx + 1)), np.zeros((nz, ny + 1, nx)),
                    np.zeros((nz + 1, ny, nx)), np.zeros(shape), np.zeros(shape), halved,
                    (spans[0][0], spans[1][0], spans[2][0]),
                    (spans[0][1], spans[1][1], spans[2][1]), np.zeros(shape), np.zeros(shape),
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

    def _times(self, p: Array, out: Array) -> float:
        top = self.levels[0]
        return float(_multigrid.times(p, top.tx, top.ty, top.tz, top.diag, self._deep(top), out))

    def _deep(self, level: _Level) -> bool:
        return level.p.shape[0] > 1 or self.periodic[2]

    def _cycle(self, number: int, b: Array) -> Array:
        """One V-cycle, beginning with 0: values of this level, which the next cycle overwrites."""
        level = self.levels[number]
        if number == len(self.levels) - 1:
            _coarsest.solve_factored(self._coarsest, b, level.p)
            return level.p
        faces, deep = (level.tx, level.ty, level.tz), self._deep(level)
        how = (level.halved, self.periodic[::-1])
        # Black after red on the way down, red after black on the way up: the cycle is its own
        # transpose.
        _multigrid.begin(level.p, b, level.inverse)
        _multigrid.sweep(level.p, b, *faces, level.inverse, deep, 1)
        below = self.levels[number + 1]
        _multigrid.restrict(level.p, b, *faces, level.diag, deep, *how, below.b)
        _multigrid.prolong(self._cycle(number + 1, below.b), level.p, *how)
        for colour in (1, 0):
            _multigrid.sweep(level.p, b, *faces, level.inverse, deep, colour)
        return level.p

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
        shape = self.levels[0].diag.shape
        outflow = outflow.reshape(shape)
        b = outflow - outflow.mean() if self.singular else outflow
        size = float(np.sqrt((b**2).sum()))
        flux, direction, share = np.empty(shape), np.zeros(shape), 0.0
        if start is None:
            p, r = np.zeros(shape), b.copy()
        else:
            p = start.reshape(shape).copy()
            self._times(p, flux)
            r = b - flux
        left, old = float((r**2).sum()), 1.0
        for iteration in range(_MOST_ITERATIONS + 1):
            if math.sqrt(left) <= max(tolerance * size, enough):
                return (p - p.mean() if self.singular else p).reshape(self.shape), iteration
            z = self._cycle(0, r)
            new = float(_multigrid.product(r, z))
            share = new / old if iteration else 0.0
            _multigrid.turn(z, float(z.mean()) if self.singular else 0.0, share, direction)
            old = new
            step = new / self._times(direction, flux)
            left = float(_multigrid.go(step, direction, flux, p, r))
        raise InputError(
            f"pressure: the residual is {math.sqrt(left) / size:.2g} of the outflow "
            f"after {_MOST_ITERATIONS} iterations; take a smaller time step."
        )


def _spans(n: int, halved: bool, periodic: bool) -> tuple[NDArray[np.int64], Array]:
    """Of each coarse face along an axis: the fine one there, and one over the way of its flux."""
    if not halved:
        return np.arange(n + 1), np.ones(n + 1)
    at = np.minimum(2 * np.arange(-(-n // 2) + 1), n)
    widths = np.diff(at).astype(np.float64)
    way = np.empty(at.size)
    way[1:-1] = 0.5 * (widths[1:] + widths[:-1])
    # A side is half a cell away.
    way[0], way[-1] = widths[0], widths[-1]
    if periodic:
        way[0] = way[-1] = 0.5 * (widths[0] + widths[-1])
    return at, 1.0 / way
