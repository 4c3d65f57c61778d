"""Walls of a thermal case: shapes with a temperature, or adiabatic."""

from __future__ import annotations

from dataclasses import dataclass

from greybed.core.config import choice, quantity
from greybed.core.errors import InputError
from greybed.core.wall_tables import ConeShape, CylinderShape, DiscShape, MeshShape, PlaneShape

HEAT = ("fixed", "adiabatic")


def check_heat(place: str, temperature: float | None, heat: str) -> None:
    """Refuse a place that is adiabatic and has a temperature, or is and has neither."""
    if (temperature is None) != (heat == "adiabatic"):
        said = "has no temperature" if temperature is None else "has a temperature and is adiabatic"
        raise InputError(f'{place} {said}; give either temperature = ... or heat = "adiabatic".')


@dataclass(frozen=True, kw_only=True)
class _Heated:
    """What every wall of a thermal case has."""

    name: str
    temperature: float | None = quantity("temperature", None, above=0.0)  # [K]
    heat: str = choice(HEAT, "fixed")
    # Below 1 with radiation.reflections only [-].
    emissivity: float = quantity("dimensionless", 1.0, above=0.0, at_most=1.0)

    def __post_init__(self) -> None:
        check_heat(f"wall {self.name!r}", self.temperature, self.heat)


@dataclass(frozen=True, kw_only=True)
class PlaneTable(PlaneShape, _Heated):
    """``[[wall]]`` with ``kind = "plane"``."""


@dataclass(frozen=True, kw_only=True)
class CylinderTable(CylinderShape, _Heated):
    """``[[wall]]`` with ``kind = "cylinder"``."""


@dataclass(frozen=True, kw_only=True)
class ConeTable(ConeShape, _Heated):
    """``[[wall]]`` with ``kind = "cone"``."""


@dataclass(frozen=True, kw_only=True)
class DiscTable(DiscShape, _Heated):
    """``[[wall]]`` with ``kind = "disc"``."""


@dataclass(frozen=True, kw_only=True)
class MeshTable(MeshShape, _Heated):
    """``[[wall]]`` with ``kind = "mesh"``."""
