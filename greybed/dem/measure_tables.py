"""Tables ``[[measure]]`` of the case ``particles``."""

from __future__ import annotations

from dataclasses import dataclass

from greybed.core.config import choice, quantity, vector, whole, words
from greybed.core.errors import InputError
from greybed.dem.insertion import Region


@dataclass(frozen=True, kw_only=True)
class PileTable:
    """``[[measure]]`` with ``kind = "pile"``: profile and angle of repose at the end."""

    name: str
    width: float = quantity("length", above=0.0)  # of a bin [m]
    axis: str = choice(("heap", "x", "y"), "heap")
    above: float = quantity("length", -1e30)  # only spheres with centres above this height [m]
    below: float = quantity("length", 1e30)  # and below this one [m]
    lower: float = quantity("length", -1e30)  # and between these two along the axis [m]
    upper: float = quantity("length", 1e30)
    # The mean angle over the samples of this time before the end; of the end only by default [s].
    average: float | None = quantity("time", None, above=0.0)


@dataclass(frozen=True, kw_only=True)
class CompartmentsTable:
    """``[[measure]]`` with ``kind = "compartments"``: mass shares of the materials at the end."""

    name: str
    axis: str = choice(("x", "y", "z"))
    lower: float = quantity("length")  # [m]
    upper: float = quantity("length")  # [m]
    count: int = whole(at_least=1)


@dataclass(frozen=True, kw_only=True)
class SolidTable:
    """``[[measure]]`` with ``kind = "solid"``: solid fraction and mass in a box at the end."""

    name: str
    lower: tuple[float, float, float] = vector("length")  # [m]
    upper: tuple[float, float, float] = vector("length")  # [m]


@dataclass(frozen=True, kw_only=True)
class StressTable:
    """``[[measure]]`` with ``kind = "stress"``: mean stress of the contacts in a box at the end."""

    name: str
    lower: tuple[float, float, float] = vector("length")  # [m]
    upper: tuple[float, float, float] = vector("length")  # [m]

    def __post_init__(self) -> None:
        Region(self.lower, self.upper)


@dataclass(frozen=True, kw_only=True)
class ConductionTable:
    """``[[measure]]`` with ``kind = "conduction"``: heat between two walls over the gradient."""

    name: str
    walls: tuple[str, ...] = words()  # the two that heat flows between
    axis: str = choice(("x", "y", "z"), "z")
    lower: float = quantity("length")  # of the particles that the gradient is found from [m]
    upper: float = quantity("length")  # [m]
    area: float = quantity("area", above=0.0)  # across the axis [m2]
    share: float = quantity("dimensionless", 0.2, above=0.0, at_most=1.0)  # of the time, last [-]

    def __post_init__(self) -> None:
        if len(self.walls) != 2 or self.walls[0] == self.walls[1]:
            raise InputError(f'walls = {list(self.walls)} must be two names, ["hot", "cold"].')
        if not self.lower < self.upper:
            raise InputError(f"lower = {self.lower:g} must be below upper = {self.upper:g} [m].")


@dataclass(frozen=True, kw_only=True)
class ShearTable:
    """``[[measure]]`` with ``kind = "shear"``: force along an axis on some walls over a load."""

    name: str
    walls: tuple[str, ...] = words()  # whose forces are added
    axis: str = choice(("x", "y", "z"), "x")
    load: str  # wall whose force along ``load_axis`` is the load
    load_axis: str = choice(("x", "y", "z"), "z")
    after: float = quantity("time", 0.0, at_least=0.0)  # before it, shear has not begun [s]
    share: float = quantity("dimensionless", 0.3, above=0.0, at_most=1.0)  # of the rest, last [-]


@dataclass(frozen=True, kw_only=True)
class SlipTable:
    """``[[measure]]`` with ``kind = "slip"``: tilt of a plane at which particles move on it."""

    name: str
    wall: str  # a plane
    speed: float = quantity("velocity", above=0.0)  # mean speed along the wall that counts [m/s]
    after: float = quantity("time", 0.0, at_least=0.0)  # before it, they are still settling [s]


MeasureTable = (
    PileTable
    | CompartmentsTable
    | SolidTable
    | StressTable
    | ConductionTable
    | ShearTable
    | SlipTable
)
MEASURES = {
    "pile": PileTable,
    "compartments": CompartmentsTable,
    "solid": SolidTable,
    "stress": StressTable,
    "conduction": ConductionTable,
    "shear": ShearTable,
    "slip": SlipTable,
}
