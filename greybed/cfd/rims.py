"""Rims of padded arrays: what repeats, what a wall mirrors, what flows in and out."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from greybed.cfd.grid import AXES, Grid
from greybed.core.errors import InputError

Array = NDArray[np.float64]

# Cells before and behind those of the grid, along each axis that has any extent.
BEFORE, BEHIND = 2, 3
# Order of [z, y, x] that brings an axis to the front.
_FIRST = ((2, 0, 1), (1, 0, 2), (0, 1, 2))


@dataclass(frozen=True)
class Wall:
    """A side that nothing passes.

    Parameters
    ----------
    specularity : float
        How much tangential momentum of particles a wall takes [-]: 0 slides freely, up to 1
        (Johnson & Jackson, J. Fluid Mech. 176 (1987) 67).
    gas_slips : bool
        Whether the gas slides along it too; it sticks by default.
    """

    specularity: float = 0.0
    gas_slips: bool = False


@dataclass(frozen=True)
class Inflow:
    """A side through which gas comes and particles do not pass: a distributor.

    Parameters
    ----------
    gas : float
        Volume flux into the box, over the whole side [m s-1].
    """

    gas: float


@dataclass(frozen=True)
class Outlet:
    """A side of gauge pressure 0: gas passes both ways, particles leave only."""


Side = Wall | Inflow | Outlet


class Rims:
    """Layout of padded arrays and what stands in their rims.

    Parameters
    ----------
    grid : Grid
    sides : mapping of ``"x-"``, ``"x+"``, ... to a side
        Of axes that do not repeat; walls where nothing is said.

    Raises
    ------
    InputError
        For a side that does not exist or repeats.
    """

    def __init__(self, grid: Grid, sides: Mapping[str, Side]) -> None:
        self.grid = grid
        self.axes = [a for a in range(3) if grid.cells[a] > 1 or grid.periodic[a]]
        if not self.axes:
            raise InputError("grid: one cell without neighbours; take more cells along an axis.")
        self.sides: dict[tuple[int, int], Side] = {}
        for a in self.axes:
            if not grid.periodic[a]:
                self.sides[a, 0], self.sides[a, 1] = Wall(), Wall()
        for name, side in sides.items():
            key = (AXES.find(name[:1]), "-+".find(name[1:])) if len(name) == 2 else (-1, -1)
            if key not in self.sides:
                known = ", ".join(f"{AXES[a]}{'-+'[e]}" for a, e in self.sides) or "none"
                raise InputError(f"sides: {name!r} is not a side of this grid; it has {known}.")
            if isinstance(side, Inflow) and not math.isfinite(side.gas):
                raise InputError(
                    f"sides: inflow of {side.gas} [m s-1] through {name} is no number."
                )
            if isinstance(side, Wall) and not 0.0 <= side.specularity <= 1.0:
                raise InputError(
                    f"sides: specularity {side.specularity:g} of {name} must be from 0 to 1."
                )
            self.sides[key] = side
        pads = [BEFORE + BEHIND if a in self.axes else 0 for a in range(3)]
        nx, ny, nz = (n + pad for n, pad in zip(grid.cells, pads, strict=True))
        self.shape = (nz, ny, nx)
        self.strides = (1, nx, nx * ny)
        self.size = nx * ny * nz

    def zeros(self) -> Array:
        """A flat padded array."""
        return np.zeros(self.size)

    def _span(self, a: int, more: int = 0) -> slice:
        if a not in self.axes:
            return slice(0, 1)
        return slice(BEFORE, BEFORE + self.grid.cells[a] + more)

    def inside(self, flat: Array, face: int | None = None) -> Array:
        """View of the cells of the grid, or of the faces across an axis."""
        spans = [self._span(a, int(a == face)) for a in (2, 1, 0)]
        return flat.reshape(self.shape)[tuple(spans)]

    def along(self, flat: Array, a: int) -> Array:
        """View with an axis first."""
        return flat.reshape(self.shape).transpose(_FIRST[a])

    def _repeat(self, box: Array, n: int) -> None:
        for to in (1, 0):
            box[to] = box[to + n]
        for to in range(BEFORE + n, BEFORE + n + BEHIND):
            box[to] = box[to - n]

    def cells(self, flat: Array, outlet: float = 1.0, also: int | None = None) -> None:
        """Values of cells: mirrored, at an outlet times ``outlet``."""
        for a in self.axes:
            if a == also:
                continue
            box, n = self.along(flat, a), self.grid.cells[a]
            if self.grid.periodic[a]:
                self._repeat(box, n)
                continue
            for end in (0, 1):
                factor = outlet if isinstance(self.sides[a, end], Outlet) else 1.0
                self._mirror(box, n, end, factor)

    @staticmethod
    def _mirror(box: Array, n: int, end: int, factor: float | Array) -> None:
        first, last = BEFORE, BEFORE + n - 1
        if end == 0:
            for k in range(BEFORE):
                box[first - 1 - k] = factor * box[min(first + k, last)]
        else:
            for k in range(BEHIND):
                box[last + 1 + k] = factor * box[max(last - k, first)]

    def velocity(
        self, flat: Array, face: int, gas: bool, slips: Mapping[tuple[int, int], Array]
    ) -> None:
        """A velocity across ``face``; ``slips`` has what a wall leaves of the solids' slip."""
        for a in self.axes:
            box, n = self.along(flat, a), self.grid.cells[a]
            if self.grid.periodic[a]:
                self._repeat(box, n)
                continue
            for end in (0, 1):
                side = self.sides[a, end]
                if a == face:
                    self._across(box, n, end, side, gas)
                elif isinstance(side, Outlet):
                    self._mirror(box, n, end, 1.0)
                elif gas:
                    free = isinstance(side, Wall) and side.gas_slips
                    self._mirror(box, n, end, 1.0 if free else -1.0)
                else:
                    self._mirror(box, n, end, slips.get((a, end), 1.0))

    @staticmethod
    def _across(box: Array, n: int, end: int, side: Side, gas: bool) -> None:
        at = BEFORE + n * end
        ghosts = range(at - 1, -1, -1) if end == 0 else range(at + 1, at + BEHIND)
        if isinstance(side, Outlet):
            if not gas:
                # Particles leave only.
                box[at] = np.minimum(box[at], 0.0) if end == 0 else np.maximum(box[at], 0.0)
            for k in ghosts:
                box[k] = box[at]
            return
        if not (gas and isinstance(side, Inflow)):
            box[at] = 0.0
        for k in ghosts:
            inner = min(max(2 * at - k, BEFORE), BEFORE + n)
            box[k] = 2.0 * box[at] - box[inner]

    def inflow(self, gas: Array, volume: Array, phi: Array, face: int) -> None:
        """What comes in through a distributor: its volume, and the velocity between particles."""
        for end in (0, 1):
            side = self.sides.get((face, end))
            if isinstance(side, Inflow):
                n, at = self.grid.cells[face], BEFORE + self.grid.cells[face] * end
                flux = side.gas * (1 - 2 * end)
                ghosts = slice(0, at + 1) if end == 0 else slice(at, None)
                self.along(volume, face)[ghosts] = flux
                solid = self.along(phi, face)[min(at, BEFORE + n - 1)]
                self.along(gas, face)[at] = flux / (1.0 - solid)

    def fluxes(self, flat: Array, face: int, closed: bool) -> None:
        """A flux or mobility across ``face``: nothing passes a side that is no outlet.

        ``closed`` leaves nothing through outlets either. Beside the grid it goes on as it is.
        """
        for a in self.axes:
            box, n = self.along(flat, a), self.grid.cells[a]
            if self.grid.periodic[a]:
                self._repeat(box, n)
                continue
            for end in (0, 1):
                if a != face:
                    self._mirror(box, n, end, 1.0)
                    continue
                at = BEFORE + n * end
                if closed or not isinstance(self.sides[a, end], Outlet):
                    box[at] = 0.0
                if end == 0:
                    box[:at] = box[at]
                else:
                    box[at + 1 :] = box[at]

    def repeat_cells(self, flat: Array) -> None:
        """Values of cells along the axes that repeat only."""
        for a in self.axes:
            if self.grid.periodic[a]:
                self._repeat(self.along(flat, a), self.grid.cells[a])
