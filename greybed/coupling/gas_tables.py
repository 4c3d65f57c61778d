"""Tables of the gas, and the sides of its solver."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from greybed.cfd.boundaries import Inflow, Outlet, Side, Wall
from greybed.cfd.fluid import Fluid
from greybed.core.config import quantity
from greybed.core.errors import InputError
from greybed.coupling.flow_tables import InflowSide, OutletSide, SideTable


@dataclass(frozen=True, kw_only=True)
class GasTable:
    """``[gas]``: an ideal gas with ``molar_mass``, or one of constant density."""

    density: float | None = quantity("density", None, above=0.0)  # [kg/m3]
    viscosity: float = quantity("viscosity", at_least=0.0)  # [Pa s]
    heat_capacity: float = quantity("heat capacity", 1005.0, above=0.0)  # [J/kg/K]
    conductivity: float = quantity("conductivity", 0.026, at_least=0.0)  # [W/m/K]
    molar_mass: float | None = quantity("dimensionless", None, above=0.0)  # [kg/mol]
    pressure: float = quantity("pressure", 101325.0, above=0.0)  # mean, of an ideal gas [Pa]
    temperature: float | None = quantity("temperature", None, above=0.0)  # at the start [K]

    def __post_init__(self) -> None:
        if self.density is None and self.molar_mass is None:
            raise InputError("gas: give a density [kg/m3], or a molar_mass [kg/mol].")
        if self.molar_mass is not None and self.temperature is None:
            raise InputError("gas: an ideal gas needs a temperature at the start [K].")

    @property
    def fluid(self) -> Fluid:
        """The properties themselves."""
        return Fluid(
            density=self.density or 0.0, viscosity=self.viscosity,
            heat_capacity=self.heat_capacity, conductivity=self.conductivity,
            molar_mass=self.molar_mass, pressure=self.pressure,
            temperature=self.temperature or 293.15,
        )  # fmt: skip


def gas_sides(tables: Sequence[SideTable]) -> dict[str, Side]:
    """Sides of the gas solver by name."""
    made: dict[str, Side] = {}
    for table in tables:
        if isinstance(table, InflowSide):
            made[table.name] = Inflow(table.velocity, table.temperature)
        elif isinstance(table, OutletSide):
            made[table.name] = Outlet(0.0, table.temperature)
        else:
            made[table.name] = Wall(table.slip, table.velocity, table.temperature)
    return made
