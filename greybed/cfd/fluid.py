"""Properties of the gas."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from greybed.core.errors import InputError

Array = NDArray[np.float64]

GAS_CONSTANT = 8.31446261815324  # J/mol/K, CODATA 2018


@dataclass(frozen=True, kw_only=True)
class Fluid:
    """A gas of constant viscosity; its density is constant or that of an ideal gas.

    Parameters
    ----------
    density : float
        [kg m-3]; of an ideal gas, that at ``temperature``, which then need not be given.
    viscosity : float
        [Pa s].
    heat_capacity : float
        At constant pressure [J kg-1 K-1].
    conductivity : float
        [W m-1 K-1].
    molar_mass : float, optional
        Of an ideal gas [kg mol-1]: its density is ``pressure * molar_mass / (R T)`` at low Mach
        number, where only the mean pressure counts.
    pressure, temperature : float
        Mean pressure [Pa], without an outlet the first one, and first temperature [K] of an ideal
        gas.

    Raises
    ------
    InputError
        For numbers out of range.
    """

    density: float = 0.0
    viscosity: float
    heat_capacity: float = 1005.0
    conductivity: float = 0.026
    molar_mass: float | None = None
    pressure: float = 101325.0
    temperature: float = 293.15

    def __post_init__(self) -> None:
        if self.molar_mass is not None:
            if not (math.isfinite(self.molar_mass) and self.molar_mass > 0.0):
                raise InputError(f"molar_mass = {self.molar_mass:g} [kg/mol] must be above 0.")
            if self.density == 0.0:
                first = self.pressure * self.molar_mass / (GAS_CONSTANT * self.temperature)
                object.__setattr__(self, "density", first)
        for name, unit in (
            ("density", "kg/m3"), ("heat_capacity", "J/kg/K"), ("pressure", "Pa"),
            ("temperature", "K"),
        ):  # fmt: skip
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise InputError(f"{name} = {value:g} [{unit}] must be above 0.")
        for name, unit in (("viscosity", "Pa s"), ("conductivity", "W/m/K")):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise InputError(f"{name} = {value:g} [{unit}] must be at least 0.")

    @property
    def gas_constant(self) -> float:
        """Of an ideal gas [J kg-1 K-1]."""
        if self.molar_mass is None:
            raise InputError("a gas of constant density has no gas constant; give a molar_mass.")
        return GAS_CONSTANT / self.molar_mass

    def density_at(self, temperature: Array | float) -> Array | float:
        """Of the gas at a temperature [K] in [kg m-3]."""
        if self.molar_mass is None:
            return self.density + 0.0 * temperature
        return self.pressure * self.molar_mass / (GAS_CONSTANT * temperature)
