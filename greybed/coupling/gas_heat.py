"""Heat between gas and particles in the loop: convection, contacts and radiation in one account."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.core.errors import InputError
from greybed.coupling.gas import Gas
from greybed.coupling.nusselt import nusselt_law
from greybed.coupling.radiation import STEFAN_BOLTZMANN, Exchange, boundary_temperatures
from greybed.coupling.rows import Rows
from greybed.coupling.void_fraction import Overlaps, Smoother
from greybed.dem.heat import Heat
from greybed.dem.simulation import Simulation

Array = NDArray[np.float64]


class BedRadiation:
    """Radiation between the particles of a simulation, walls and opening.

    Parameters
    ----------
    rows : Rows, or callable
        View or exchange factors in the order of ``simulation.centres``: traced ones of a bed at
        rest, or a callable of the simulation that gives those of its present places, such as one
        that asks a closure.
    emissivity : array_like, shape () or (n,)
        [-].
    wall_temperatures : sequence of float or None
        Of the walls of the rows [K]; None where adiabatic.
    environment_temperature : float or None
        What the opening looks at [K].
    every : int
        Gas steps after which a callable is asked again.

    Raises
    ------
    InputError
        For numbers out of range.
    """

    def __init__(
        self,
        rows: Rows | Callable[[Simulation], Rows],
        emissivity: ArrayLike = 1.0,
        *,
        wall_temperatures: Sequence[float | None] = (),
        environment_temperature: float | None = None,
        every: int = 100,
    ) -> None:
        if every < 1:
            raise InputError(f"every = {every} must be at least 1.")
        self._rows, self._emissivity, self._every = rows, emissivity, every
        self._walls, self._environment = tuple(wall_temperatures), environment_temperature
        self._asked = 0
        self._exchange: Exchange | None = None

    def _renew(self, simulation: Simulation) -> Exchange:
        stale = callable(self._rows) and self._asked % self._every == 0
        if self._exchange is None or stale:
            rows = self._rows(simulation) if callable(self._rows) else self._rows
            count = rows.wall_factors.shape[1]
            bounds = boundary_temperatures(self._walls, self._environment, count)
            self._exchange = Exchange(rows, self._emissivity, bounds)
            self._bounds = bounds
        self._asked += 1
        return self._exchange

    def absorbed(self, simulation: Simulation, temperatures: Array) -> tuple[Array, float]:
        """Net radiation of each particle (n,), and from walls and opening into the bed [W]."""
        exchange = self._renew(simulation)
        if len(exchange.areas) != len(temperatures):
            raise InputError(
                f"radiation: factors of {len(exchange.areas)} spheres for {len(temperatures)} "
                "particles; give those of the present bed."
            )
        reference = STEFAN_BOLTZMANN * float(temperatures.min()) ** 4
        emission = STEFAN_BOLTZMANN * temperatures**4 - reference
        outer = np.where(
            np.isnan(self._bounds), 0.0, STEFAN_BOLTZMANN * self._bounds**4 - reference
        )
        g = exchange.irradiation(emission, outer)
        j = exchange.radiosity(emission, g)
        gained = exchange.areas * exchange.emissivity * (g - emission)
        given = exchange.boundary.sum(axis=0) * outer - exchange.boundary.T @ j
        return gained, float(given.sum())


@dataclass(frozen=True, eq=False)
class HeatReport:
    """Heat of a gas step [J].

    Attributes
    ----------
    convection, from_gas : float
        What the gas has given to the particles, summed over particles and over cells.
    radiation, from_surroundings : float
        What the particles have absorbed less emitted, and what walls and opening have given.
    from_walls : float
        Through contacts with walls.
    stored : float
        Gain of the particles.
    exchanged : float
        Sum of the sizes of all parts.
    defect : float
        Gain less what gas, surroundings and walls have given, over ``exchanged`` [-].
    """

    convection: float
    from_gas: float
    radiation: float
    from_surroundings: float
    from_walls: float
    stored: float
    exchanged: float
    defect: float


class GasHeat:
    """Temperatures of particles in a gas.

    Parameters
    ----------
    heat : greybed.dem.heat.Heat
        Temperatures of the particles and heat through their contacts.
    conductivity : float
        Of the gas, above 0 [W/m/K].
    prandtl : float
        Of the gas, above 0 [-].
    nusselt : str
        A name in ``greybed.coupling.nusselt.NUSSELT``.
    radiation : BedRadiation, optional
        Radiation.
    contacts : bool
        Whether heat goes through contacts.

    Raises
    ------
    InputError
        For a name that is not known or numbers out of range.
    """

    def __init__(
        self,
        heat: Heat,
        conductivity: float,
        prandtl: float,
        *,
        nusselt: str = "gunn",
        radiation: BedRadiation | None = None,
        contacts: bool = True,
    ) -> None:
        for name, value in (("conductivity", conductivity), ("prandtl", prandtl)):
            if not (math.isfinite(value) and value > 0.0):
                raise InputError(f"gas: {name} = {value:g} must be finite and above 0.")
        self.heat, self.conductivity, self.prandtl = heat, conductivity, prandtl
        self.law = nusselt_law(nusselt)
        self.radiation, self.contacts = radiation, contacts
        self.report: HeatReport | None = None
        self._h = self._aim = np.zeros(0)

    def offer(
        self, overlaps: Overlaps, smoother: Smoother, void: Array, re: Array, d: Array,
        order: NDArray[np.int64], dt: float,
    ) -> dict[str, Array]:  # fmt: skip
        """Fields for the gas's step; particles come in the simulation's own order.

        Parameters
        ----------
        void, re, d : ndarray, shape (n,)
            Void fractions at particles [-], Re [-], diameters [m].
        order : ndarray, shape (n,)
            Their numbers in the input.
        dt : float
            [s].
        """
        t = self.heat.temperatures[order]
        h = self.law(void, re, self.prandtl) * self.conductivity * math.pi * d
        capacity = self.heat.capacities[order]
        # Implicit in the particle's own temperature, too.
        self._h, self._aim = h / (1.0 + dt * h / capacity), t
        given = overlaps.share_out(np.stack([self._h, self._h * t], axis=1))
        volume = overlaps.grid.cell_volume
        total, aimed = (smoother.cells(given[..., c]) / volume for c in (0, 1))
        self._total = total
        self._target = np.divide(aimed, total, out=np.zeros_like(total), where=total > 0.0)
        return {"heat_coefficient": total, "heat_target": self._target}

    def take(
        self, overlaps: Overlaps, smoother: Smoother, got: Array, order: NDArray[np.int64],
        dt: float, simulation: Simulation,
    ) -> None:  # fmt: skip
        """Give the particles what the gas has lost, ``got`` (nz, ny, nx) per volume [W/m3]."""
        seen = self._target - np.divide(
            got, self._total, out=np.zeros_like(got), where=self._total > 0.0
        )
        at = overlaps.mean(smoother.cells(seen)[..., None])[:, 0]
        flow = self._h * (at - self._aim)
        gained = np.empty_like(flow)
        gained[order] = dt * flow
        before = self.heat.temperatures
        capacity = self.heat.capacities
        by_light, around = np.zeros_like(gained), 0.0
        if self.radiation is not None:
            by_light, around = self.radiation.absorbed(simulation, before)
            by_light, around = dt * by_light, dt * around
        self._convection, self._light, self._around = gained, by_light, around
        self._from_gas = -dt * float(got.sum()) * overlaps.grid.cell_volume
        self._before, self._capacity = before, capacity
        self.heat.give(gained + by_light)

    def close(self) -> HeatReport:
        """Let heat flow through the contacts of the time that has passed, and add up."""
        walls = self.heat.from_walls.copy()
        if self.contacts:
            self.heat.catch_up()
        from_walls = float((self.heat.from_walls - walls).sum())
        now = self.heat.temperatures
        stored = float(self._capacity @ (now - self._before))
        moved = float(self._capacity @ np.abs(now - self._before))
        parts = float(np.abs(self._convection).sum() + np.abs(self._light).sum())
        parts = max(parts + abs(from_walls), moved)
        rest = stored - self._from_gas - self._around - from_walls
        self.report = HeatReport(
            float(self._convection.sum()), self._from_gas, float(self._light.sum()), self._around,
            from_walls, stored, parts, abs(rest) / parts if parts > 0.0 else 0.0,
        )  # fmt: skip
        return self.report

    def state(self) -> dict[str, NDArray[Any]]:
        """What goes beside a checkpoint."""
        return self.heat.state()

    def go_back(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Take up what :meth:`state` has given."""
        self.heat.go_back(state)


def prandtl_of(gas: Gas, heat_capacity: float, conductivity: float) -> float:
    """Viscosity times heat capacity over conductivity [-]."""
    return gas.fluid.viscosity * heat_capacity / conductivity
