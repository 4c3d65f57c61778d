"""Walls of a case file: a table for every kind, with a temperature or adiabatic."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from greybed.core.config import choice, quantity, vector
from greybed.core.errors import InputError
from greybed.core.walls import Cone, Cylinder, Disc, Plane, Wall

HEAT = ("fixed", "adiabatic")


def check_heat(place: str, temperature: float | None, heat: str) -> None:
    """Refuse a place that is adiabatic and has a temperature, or is and has neither."""
    if (temperature is None) != (heat == "adiabatic"):
        said = "has no temperature" if temperature is None else "has a temperature and is adiabatic"
        raise InputError(f'{place} {said}; give either temperature = ... or heat = "adiabatic".')


@dataclass(frozen=True, kw_only=True)
class PlaneTable:
    """``[[wall]]`` with ``kind = "plane"``."""

    name: str
    point: tuple[float, float, float] = vector("length", (0.0, 0.0, 0.0))  # [m]
    normal: tuple[float, float, float] = vector("dimensionless")  # into the bed, any length [-]
    temperature: float | None = quantity("temperature", None, above=0.0)  # [K]
    heat: str = choice(HEAT, "fixed")
    # Below 1 with radiation.reflections only [-].
    emissivity: float = quantity("dimensionless", 1.0, above=0.0, at_most=1.0)

    def __post_init__(self) -> None:
        check_heat(f"wall {self.name!r}", self.temperature, self.heat)

    def wall(self) -> Wall:
        """The wall itself."""
        return Plane(self.point, self.normal, self.name)


@dataclass(frozen=True, kw_only=True)
class CylinderTable:
    """``[[wall]]`` with ``kind = "cylinder"``; the bed is inside."""

    name: str
    point: tuple[float, float, float] = vector("length", (0.0, 0.0, 0.0))  # of the axis [m]
    axis: tuple[float, float, float] = vector("dimensionless", (0.0, 0.0, 1.0))  # any length [-]
    radius: float = quantity("length", above=0.0)  # [m]
    length: float | None = quantity("length", None, above=0.0)  # from point on; None: no end [m]
    temperature: float | None = quantity("temperature", None, above=0.0)  # [K]
    heat: str = choice(HEAT, "fixed")
    # Below 1 with radiation.reflections only [-].
    emissivity: float = quantity("dimensionless", 1.0, above=0.0, at_most=1.0)

    def __post_init__(self) -> None:
        check_heat(f"wall {self.name!r}", self.temperature, self.heat)

    def wall(self) -> Wall:
        """The wall itself."""
        return Cylinder(self.point, self.axis, self.radius, self.name, self.length)


@dataclass(frozen=True, kw_only=True)
class ConeTable:
    """``[[wall]]`` with ``kind = "cone"``; the bed is inside."""

    name: str
    point: tuple[float, float, float] = vector("length", (0.0, 0.0, 0.0))  # of the first end [m]
    axis: tuple[float, float, float] = vector("dimensionless", (0.0, 0.0, 1.0))  # any length [-]
    radius: float = quantity("length", at_least=0.0)  # of the first end [m]
    end_radius: float = quantity("length", at_least=0.0)  # [m]
    length: float = quantity("length", above=0.0)  # [m]
    temperature: float | None = quantity("temperature", None, above=0.0)  # [K]
    heat: str = choice(HEAT, "fixed")
    # Below 1 with radiation.reflections only [-].
    emissivity: float = quantity("dimensionless", 1.0, above=0.0, at_most=1.0)

    def __post_init__(self) -> None:
        check_heat(f"wall {self.name!r}", self.temperature, self.heat)

    def wall(self) -> Wall:
        """The wall itself."""
        return Cone(self.point, self.axis, self.radius, self.end_radius, self.length, self.name)


@dataclass(frozen=True, kw_only=True)
class DiscTable:
    """``[[wall]]`` with ``kind = "disc"``."""

    name: str
    point: tuple[float, float, float] = vector("length", (0.0, 0.0, 0.0))  # its middle [m]
    normal: tuple[float, float, float] = vector("dimensionless")  # into the bed, any length [-]
    radius: float = quantity("length", above=0.0)  # [m]
    temperature: float | None = quantity("temperature", None, above=0.0)  # [K]
    heat: str = choice(HEAT, "fixed")
    # Below 1 with radiation.reflections only [-].
    emissivity: float = quantity("dimensionless", 1.0, above=0.0, at_most=1.0)

    def __post_init__(self) -> None:
        check_heat(f"wall {self.name!r}", self.temperature, self.heat)

    def wall(self) -> Wall:
        """The wall itself."""
        return Disc(self.point, self.normal, self.radius, self.name)


@dataclass(frozen=True, kw_only=True)
class MeshTable:
    """``[[wall]]`` with ``kind = "mesh"``: all groups of one file, at one temperature."""

    name: str
    file: Path  # relative to the case
    unit: str = "m"  # of the file
    temperature: float | None = quantity("temperature", None, above=0.0)  # [K]
    heat: str = choice(HEAT, "fixed")
    # Below 1 with radiation.reflections only [-].
    emissivity: float = quantity("dimensionless", 1.0, above=0.0, at_most=1.0)

    def __post_init__(self) -> None:
        check_heat(f"wall {self.name!r}", self.temperature, self.heat)

    def wall(self) -> Wall:
        """The wall itself."""
        from greybed.core.readers.mesh import joined, read_mesh

        return joined(read_mesh(self.file, self.unit), self.name)
