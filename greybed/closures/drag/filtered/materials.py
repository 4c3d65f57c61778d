"""Numbers of a gas and its particles that filtered drag is scaled with: settling, lengths."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

from greybed.closures.drag.laws import drag_law
from greybed.core.errors import InputError


@dataclass(frozen=True)
class Material:
    """Particles of one size in a gas, under gravity.

    Parameters
    ----------
    diameter : float
        [m].
    particle_density, gas_density : float
        [kg m-3]; particles must be heavier than the gas.
    gas_viscosity : float
        [Pa s].
    gravity : float
        Magnitude [m s-2], above 0.

    Raises
    ------
    InputError
        If a number is not above 0, or nothing settles.
    """

    diameter: float
    particle_density: float
    gas_density: float
    gas_viscosity: float
    gravity: float = 9.81

    def __post_init__(self) -> None:
        for name, unit in (
            ("diameter", "m"), ("particle_density", "kg m-3"), ("gas_density", "kg m-3"),
            ("gas_viscosity", "Pa s"), ("gravity", "m s-2"),
        ):  # fmt: skip
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise InputError(
                    f"filtered drag: {name} = {value:g} [{unit}] must be above 0, for it is scaled "
                    "with the velocity of a settling particle; give it."
                )
        if self.particle_density <= self.gas_density:
            raise InputError(
                f"filtered drag: particle_density = {self.particle_density:g} [kg m-3] must be "
                f"above that of the gas, {self.gas_density:g}: nothing settles."
            )

    @property
    def weight(self) -> float:
        """Weight of the particles less buoyancy, per volume of particles [N m-3]."""
        return (self.particle_density - self.gas_density) * self.gravity

    @property
    def stokes_velocity(self) -> float:
        """Terminal velocity that Stokes' drag alone would give [m s-1]."""
        return self.weight * self.diameter**2 / (18.0 * self.gas_viscosity)

    @cached_property
    def terminal_velocity(self) -> float:
        """Velocity of one settling particle, drag of Schiller & Naumann [m s-1]."""
        law, scale = drag_law("schiller-naumann"), self.diameter / self.gas_viscosity
        low, high = 0.0, self.stokes_velocity
        # Drag grows with velocity, so halving finds the one root whatever the jump at Re = 1000.
        for _ in range(200):
            middle = 0.5 * (low + high)
            if middle in (low, high):
                break
            re = self.gas_density * scale * middle
            if middle * float(law(0.0, re)) < self.stokes_velocity:
                low = middle
            else:
                high = middle
        return 0.5 * (low + high)

    @property
    def terminal_reynolds(self) -> float:
        """Re of one settling particle [-]."""
        speed = self.gas_density * self.terminal_velocity
        return speed * self.diameter / self.gas_viscosity

    @property
    def froude(self) -> float:
        """Fr = u_t^2 / (g d) [-]."""
        return self.terminal_velocity**2 / (self.gravity * self.diameter)

    @property
    def length(self) -> float:
        """L_c = d Fr^(1/3), with which filter sizes are scaled [m] (Radl & Sundaresan 2014)."""
        return self.diameter * float(self.froude ** (1.0 / 3.0))

    @property
    def terminal_drag(self) -> float:
        """F of one settling particle over Stokes' drag [-]."""
        return self.stokes_velocity / self.terminal_velocity
