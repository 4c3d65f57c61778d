"""Sides of the gas's box, and the values that they put around its arrays."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from greybed.cfd.grid import AXES, Grid
from greybed.core.errors import InputError

Array = NDArray[np.float64]

# Cells around those of the grid: the limiter looks two cells upwind.
PAD = 2


@dataclass(frozen=True)
class Wall:
    """Nothing passes.

    Parameters
    ----------
    slip : bool
        The gas slides without friction; it sticks by default.
    velocity : three floats
        Of the wall, along itself [m s-1].
    temperature : float, optional
        [K]; no heat passes by default.
    """

    slip: bool = False
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    temperature: float | None = None


@dataclass(frozen=True, eq=False)
class Inflow:
    """Gas comes in at right angles.

    Parameters
    ----------
    velocity : float or array over the side
        Superficial velocity into the box [m s-1]: volume per time and area of the whole side.
        Arrays are [z, y], [z, x] or [y, x].
    temperature : float, optional
        [K]; required where temperature is solved for.
    """

    velocity: float | Array
    temperature: float | None = None


@dataclass(frozen=True)
class Outlet:
    """A given pressure; gas passes both ways.

    Parameters
    ----------
    pressure : float
        [Pa], gauge.
    temperature : float, optional
        Of gas that comes back in [K]; by default that of the cell inside. It comes from rest.
    """

    pressure: float = 0.0
    temperature: float | None = None


Side = Wall | Inflow | Outlet


_FIRST = ((2, 0, 1), (1, 0, 2), (0, 1, 2))
_BACK = ((1, 2, 0), (1, 0, 2), (0, 1, 2))


def lead(a: Array, axis: int) -> Array:
    """A view [z, y, x] with an axis (0 is x) first; the others keep their order."""
    return a.transpose(_FIRST[axis])


def back(a: Array, axis: int) -> Array:
    """The inverse of :func:`lead`."""
    return a.transpose(_BACK[axis])


class Sides:
    """The six sides of a grid, checked.

    Parameters
    ----------
    grid : Grid
    sides : mapping from ``"x-"``, ``"x+"``, ``"y-"``, ... to a side
        Of axes that do not repeat and have more than one cell; walls where nothing is said.

    Raises
    ------
    InputError
        For sides that do not exist, numbers out of range, or an inflow that cannot leave.
    """

    def __init__(self, grid: Grid, sides: Mapping[str, Side]) -> None:
        self.grid = grid
        self.wide = tuple(n > 1 or p for n, p in zip(grid.cells, grid.periodic, strict=True))
        self.of: dict[tuple[int, int], Side] = {}
        for axis in range(3):
            if not grid.periodic[axis]:
                for end in (0, 1):
                    self.of[axis, end] = Wall(slip=not self.wide[axis])
        if not any(self.wide):
            raise InputError("grid: one cell without neighbours; take more cells along an axis.")
        for name, side in sides.items():
            self.set(name, side, check=False)
        self._check_balance()

    def set(self, name: str, side: Side, *, check: bool = True) -> None:
        """Put another side in place, for the steps to come."""
        names = {f"{AXES[a]}{'-+'[e]}": (a, e) for a in range(3) for e in (0, 1)}
        if name not in names:
            raise InputError(f"side {name!r} must be one of {', '.join(names)}.")
        axis, end = names[name]
        if self.grid.periodic[axis]:
            raise InputError(f"side {name}: {AXES[axis]} repeats; leave the side out.")
        if not self.wide[axis]:
            raise InputError(f"side {name}: {AXES[axis]} has one cell and no sides; leave it out.")
        if isinstance(side, Wall):
            if side.velocity[axis] != 0.0 or not all(map(math.isfinite, side.velocity)):
                raise InputError(
                    f"side {name}: a wall moves along itself only, not by {side.velocity[axis]:g} "
                    f"[m/s] along {AXES[axis]}."
                )
        elif isinstance(side, Inflow):
            shape = self._shape(axis)
            v = np.asarray(side.velocity, dtype=np.float64)
            if v.shape not in ((), shape) or not np.isfinite(v).all():
                raise InputError(
                    f"side {name}: the inflow's velocity must be finite and a number or an array "
                    f"of shape {shape}, not {v.shape}."
                )
        elif not (isinstance(side, Outlet) and math.isfinite(side.pressure)):
            raise InputError(f"side {name}: {side!r} must be a Wall, an Inflow or an Outlet.")
        t = side.temperature
        if t is not None and not (math.isfinite(t) and t > 0.0):
            raise InputError(f"side {name}: temperature = {t:g} [K] must be above 0.")
        self.of[axis, end] = side
        if check:
            self._check_balance()

    @property
    def closed(self) -> bool:
        """Whether no side has an outlet."""
        return not any(isinstance(s, Outlet) for s in self.of.values())

    def _shape(self, axis: int) -> tuple[int, ...]:
        nz, ny, nx = self.grid.shape
        return ((nz, ny), (nz, nx), (ny, nx))[axis]

    def _check_balance(self) -> None:
        """Refuse an inflow that has no way out; what comes in may be drawn off elsewhere."""
        if not self.closed:
            return
        total, size = 0.0, 0.0
        for (axis, _), side in self.of.items():
            if isinstance(side, Inflow):
                part = self.grid.cell_volume / self.grid.spacing[axis]
                v = np.broadcast_to(np.asarray(side.velocity, float), self._shape(axis))
                total += part * float(v.sum())
                size += part * float(np.abs(v).sum())
        if abs(total) > 1e-9 * size:
            raise InputError(
                f"sides: {total:g} [m3/s] more flow in than out and nothing lets them out; give "
                "one side an Outlet."
            )

    # -- rims -------------------------------------------------------------------------------

    def inflow(self, axis: int, end: int) -> Array:
        """Superficial velocity along the axis over a side [m/s]."""
        side = self.of[axis, end]
        given = side.velocity if isinstance(side, Inflow) else 0.0
        v = np.broadcast_to(np.asarray(given, dtype=np.float64), self._shape(axis))
        return v if end == 0 else -v

    def pad(self, inner: Array) -> Array:
        """A copy with room around it; :meth:`cells` and :meth:`faces` fill that."""
        out = np.zeros(tuple(n + 2 * PAD for n in inner.shape))
        out[PAD:-PAD, PAD:-PAD, PAD:-PAD] = inner
        return out

    def cells(self, inner: Array) -> Array:
        """Cell values with copies around them, or what repeats."""
        out = self.pad(inner)
        for axis in range(3):
            a = lead(out, axis)
            if self.grid.periodic[axis]:
                self._repeat(a, self.grid.cells[axis])
            else:
                a[:PAD], a[-PAD:] = a[PAD], a[-PAD - 1]
        return out

    def temperatures(self, inner: Array, flux: tuple[Array, Array, Array]) -> Array:
        """Temperatures of cells with those of the sides around them."""
        out = self.pad(inner)
        for axis in range(3):
            a = lead(out, axis)
            if self.grid.periodic[axis]:
                self._repeat(a, self.grid.cells[axis])
                continue
            core = lead(out[PAD:-PAD, PAD:-PAD, PAD:-PAD], axis)
            for end in (0, 1):
                side = self.of[axis, end]
                rim = core[-end]
                if isinstance(side, Outlet) and side.temperature is not None:
                    f = lead(flux[axis], axis)[-end] * (1 - 2 * end)
                    outer = np.where(f > 0.0, side.temperature, rim)
                    self._place(a, end, outer, outer)
                elif side.temperature is not None:
                    outer = 2.0 * side.temperature - rim
                    self._place(a, end, outer, 2.0 * outer - rim)
                else:
                    self._place(a, end, rim, rim)
        return out

    def faces(self, inner: Array, own: int, flux: tuple[Array, Array, Array]) -> Array:
        """Velocities along ``own`` on its faces, with what surrounds them.

        ``flux`` are mass fluxes of all faces; where they come back in through an outlet, the gas
        comes from rest.
        """
        out = self.pad(inner)
        for axis in range(3):
            a = lead(out, axis)
            if self.grid.periodic[axis]:
                self._repeat(a, self.grid.cells[axis])
                continue
            core = lead(out[PAD:-PAD, PAD:-PAD, PAD:-PAD], axis)
            for end in (0, 1):
                side = self.of[axis, end]
                rim = core[-end]
                if isinstance(side, Outlet):
                    f = lead(flux[axis], axis)[-end] * (1 - 2 * end)
                    if axis != own:
                        f = self._beside(f, own, axis)
                    outer = np.where(f > 0.0, 0.0, rim)
                    self._place(a, end, outer, outer)
                elif axis == own:
                    step = core[1 - 3 * end] - rim
                    self._place(a, end, rim - step, rim - 2.0 * step)
                elif isinstance(side, Wall) and side.slip:
                    self._place(a, end, rim, rim)
                else:
                    at = side.velocity[own] if isinstance(side, Wall) else 0.0
                    outer = 2.0 * at - rim
                    self._place(a, end, outer, 2.0 * outer - rim)
        return out

    def mass_fluxes(self, flux: tuple[Array, Array, Array], own: int) -> list[Array]:
        """Mass fluxes through the control faces of velocities along ``own``: means of two."""
        out = []
        for axis in range(3):
            f = lead(flux[axis], own)
            if axis == own:
                before, after = (f[-2:-1], f[1:2]) if self.grid.periodic[own] else (f[:1], f[-1:])
            else:
                before, after = (f[-1:], f[:1]) if self.grid.periodic[own] else (f[:1], f[-1:])
            f = np.concatenate([before, f, after])
            out.append(np.ascontiguousarray(back(0.5 * (f[:-1] + f[1:]), own)))
        return out

    def _beside(self, f: Array, own: int, axis: int) -> Array:
        """Fluxes through cells of a side at the faces across ``own``."""
        at = 2 - own - (1 if 2 - own > 2 - axis else 0)
        f = np.moveaxis(f, at, 0)
        repeats = self.grid.periodic[own]
        first, last = (f[-1:], f[:1]) if repeats else (f[:1], f[-1:])
        f = np.concatenate([first, f, last])
        return np.moveaxis(0.5 * (f[:-1] + f[1:]), 0, at)

    @staticmethod
    def _repeat(a: Array, n: int) -> None:
        """Around values that repeat after ``n``; faces hold one more than cells."""
        size = len(a) - 2 * PAD
        for k in range(1, PAD + 1):
            a[PAD - k] = a[PAD + (-k) % n]
            a[PAD + size - 1 + k] = a[PAD + (size - 1 + k) % n]

    @staticmethod
    def _place(a: Array, end: int, near: Array, far: Array) -> None:
        inside = (slice(PAD, -PAD), slice(PAD, -PAD))
        first, second = (PAD - 1, PAD - 2) if end == 0 else (-PAD, -PAD + 1)
        a[first][inside], a[second][inside] = near, far
