"""Tables that cases with a gas share: grid, gas, sides, drag, output."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from greybed.cfd.grid import AXES, Grid
from greybed.core.config import choice, counts, quantity, vector
from greybed.core.errors import InputError

SIDES = tuple(f"{axis}{end}" for axis in AXES for end in "-+")


@dataclass(frozen=True, kw_only=True)
class GridTable:
    """``[grid]``: equal cells in a box."""

    cells: tuple[int, int, int] = counts()  # along x, y, z [-]; 1 makes an axis flat
    lower: tuple[float, float, float] = vector("length", (0.0, 0.0, 0.0))  # [m]
    upper: tuple[float, float, float] = vector("length")  # [m]
    periodic: str = ""  # axes that repeat, such as "xy"

    def __post_init__(self) -> None:
        if set(self.periodic) - set(AXES) or len(set(self.periodic)) != len(self.periodic):
            raise InputError(f"grid: periodic = {self.periodic!r} must name axes, such as 'xy'.")
        _ = self.grid

    @property
    def grid(self) -> Grid:
        """The grid itself."""
        x, y, z = (axis in self.periodic for axis in AXES)
        return Grid(cells=self.cells, lower=self.lower, upper=self.upper, periodic=(x, y, z))


@dataclass(frozen=True, kw_only=True)
class WallSide:
    """``[[side]]`` of kind ``wall``: nothing passes."""

    name: str = choice(SIDES)
    slip: bool = False
    velocity: tuple[float, float, float] = vector("velocity", (0.0, 0.0, 0.0))  # along it [m/s]
    temperature: float | None = quantity("temperature", None, above=0.0)  # [K]
    specularity: float = quantity("dimensionless", 0.0, at_least=0.0, at_most=1.0)  # two-fluid [-]


@dataclass(frozen=True, kw_only=True)
class InflowSide:
    """``[[side]]`` of kind ``inflow``: gas comes in at right angles, over the whole side."""

    name: str = choice(SIDES)
    velocity: float = quantity("velocity")  # superficial, into the box [m/s]
    temperature: float | None = quantity("temperature", None, above=0.0)  # [K]


@dataclass(frozen=True, kw_only=True)
class OutletSide:
    """``[[side]]`` of kind ``outlet``: a gauge pressure of 0."""

    name: str = choice(SIDES)
    temperature: float | None = quantity("temperature", None, above=0.0)  # of backflow [K]


SIDE_KINDS = {"wall": WallSide, "inflow": InflowSide, "outlet": OutletSide}
SideTable = WallSide | InflowSide | OutletSide


@dataclass(frozen=True, kw_only=True)
class FlowOutput:
    """``[output]``: times between samples, frames and checkpoints."""

    samples: float = quantity("time", above=0.0)  # [s]
    frames: float | None = quantity("time", None, above=0.0)  # [s]; none by default
    checkpoints: float | None = quantity("time", None, above=0.0)  # [s]


def check_sides(sides: Sequence[SideTable], grid: GridTable) -> None:
    """Refuse sides that are named twice or do not exist, and an inflow that has no way out.

    Raises
    ------
    InputError
        With the side and the remedy.
    """
    names = [side.name for side in sides]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"side {name!r} is given twice; keep one.")
        if name[0] in grid.periodic:
            raise InputError(
                f"side {name!r}: {name[0]} repeats and has no sides; take it out of "
                "grid.periodic, or take the side out."
            )
        if grid.cells[AXES.index(name[0])] == 1:
            raise InputError(
                f"side {name!r}: {name[0]} has one cell and no sides; take the side out."
            )
    inflow = [s for s in sides if isinstance(s, InflowSide) and s.velocity != 0.0]
    if inflow and not any(isinstance(side, OutletSide) for side in sides):
        into = sum(s.velocity for s in inflow)
        if len(inflow) == 1 or into != 0.0:
            raise InputError(
                f"side {inflow[0].name!r} lets gas in and no side lets it out; give one side "
                'kind = "outlet".'
            )


def check_cells(grid: GridTable, diameter: float) -> None:
    """Refuse cells smaller than a tenth of a diameter: an average over them means nothing.

    Raises
    ------
    InputError
        With the axis, its cells and the bound.
    """
    laid = grid.grid
    for axis, name in enumerate(AXES):
        if laid.cells[axis] > 1 and laid.spacing[axis] < 0.1 * diameter:
            most = int((laid.upper[axis] - laid.lower[axis]) / (0.1 * diameter))
            raise InputError(
                f"grid: cells of {laid.spacing[axis]:.3g} [m] along {name} are smaller than a "
                f"tenth of the diameter {diameter:.3g} [m]; take at most {most} cells there."
            )
