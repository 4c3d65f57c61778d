"""Temperatures of particles that move: heat through contacts, between runs of the mechanics."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.core.errors import InputError
from greybed.dem import _heat
from greybed.dem.simulation import Simulation

Array = NDArray[np.float64]

# Largest share of a particle's difference to its neighbours that one step may take away.
_SHARE = 0.1


class Heat:
    r"""Temperatures of the particles of a simulation.

    Heat flows through a contact with radius a as :math:`2 k a \Delta T`, k the harmonic mean of the
    two conductivities (on a wall that of the particle), a the root of :math:`R^* \delta`
    (Batchelor & O'Brien, Proc. R. Soc. A 355 (1977) 313). Each particle has one temperature.

    Parameters
    ----------
    simulation : Simulation
        The particles.
    conductivity : array_like, shape () or (materials,)
        Of the materials, above 0 [W/m/K].
    heat_capacity : array_like, shape () or (materials,)
        Of the materials, above 0 [J/kg/K].
    temperature : array_like, shape () or (n,)
        At the start, above 0 [K].
    wall_temperatures : mapping of str to float
        By the names of walls [K]; heat goes to no other wall.
    arriving : float, optional
        Of particles that are inserted later [K]; the mean at the start by default.
    stiffness_ratio : float
        Real over simulated Young's modulus, above 0 [-]: contacts of particles that are simulated
        softer than they are are too wide, by the cube root of it.

    Raises
    ------
    InputError
        For numbers out of range, a wall that is not there, or clumps.
    """

    beside = ""  # what else the heat of a wall holds, in words; see Warmth of dem/lammps

    def __init__(
        self,
        simulation: Simulation,
        conductivity: ArrayLike,
        heat_capacity: ArrayLike,
        temperature: ArrayLike,
        *,
        wall_temperatures: Mapping[str, float] | None = None,
        arriving: float | None = None,
        stiffness_ratio: float = 1.0,
    ) -> None:
        if len(simulation.bodies.masses):
            raise InputError("heat: clumps have no temperature; take spheres.")
        self.simulation = simulation
        n, kinds = len(simulation.labels), len(simulation.materials)
        self._conductivity = _checked(conductivity, kinds, "conductivity", "W/m/K")
        self._capacity = _checked(heat_capacity, kinds, "heat_capacity", "J/kg/K")
        self._narrower = _checked(stiffness_ratio, 1, "stiffness_ratio", "-")[0] ** (-1.0 / 3.0)
        start = _checked(temperature, n, "temperature", "K")
        self._arriving = float(start.mean()) if arriving is None else float(arriving)
        self._by_label = np.full(int(simulation.labels.max()) + 1, self._arriving)
        self._by_label[simulation.labels] = start
        names = [wall.shape.name for wall in simulation.walls]
        self._walls = np.full(len(names), np.nan)
        for name, value in (wall_temperatures or {}).items():
            if name not in names:
                raise InputError(f"no wall is called {name!r}; there are {', '.join(names)}.")
            self._walls[names.index(name)] = _checked(value, 1, f"of wall {name!r}", "K")[0]
        self.from_walls = np.zeros(len(names))  # heat that each wall has given [J]
        self._steps = simulation.steps

    @property
    def temperatures(self) -> Array:
        """Of the particles, shape (n,), in the order of ``simulation.centres`` [K]."""
        self.arrive(self._arriving)
        return self._by_label[self.simulation.labels]

    @property
    def mean(self) -> float:
        """Mean temperature, weighted by heat capacity [K]."""
        capacity = self.capacities
        return float(capacity @ self.temperatures / capacity.sum())

    def arrive(self, temperature: float) -> None:
        """Give particles that have been inserted since the last call a temperature [K].

        Raises
        ------
        InputError
            If it is not above 0.
        """
        new = int(self.simulation.labels.max()) + 1 - len(self._by_label)
        if new > 0:
            value = _checked(temperature, 1, "temperature", "K")[0]
            self._by_label = np.concatenate([self._by_label, np.full(new, value)])

    @property
    def capacities(self) -> Array:
        """Heat capacities of the particles, shape (n,) [J/K]."""
        return self.simulation.masses * self._capacity[self.simulation.kinds]

    def conductances(self) -> tuple[NDArray[np.int64], Array, NDArray[np.int64], Array]:
        """Pairs (m, 2) and their conductances, particle and wall (k, 2) and theirs [W/K]."""
        sim = self.simulation
        x, r, k = sim.centres, sim.radii, self._conductivity[sim.kinds]
        pairs = sim.contacts
        i, j = pairs.T
        lists = sim._lists
        away = x[j] - x[i]
        for axis in np.flatnonzero(lists.periodic):
            away[:, axis] -= lists.edge[axis] * np.round(away[:, axis] / lists.edge[axis])
        overlap = np.maximum(r[i] + r[j] - np.sqrt((away**2).sum(axis=1)), 0.0)
        radius = np.sqrt(r[i] * r[j] / (r[i] + r[j]) * overlap)
        between = 4.0 * k[i] * k[j] / (k[i] + k[j]) * radius * self._narrower
        s = lists.surfaces
        who, what, deep = _heat.wall_contacts(
            lists.state.place, s.first, s.surface, s.touch, s.kinds, s.data, s.wall
        )
        who = lists.ident[who]
        warm = np.isfinite(self._walls[what]) & (deep > 0.0)
        who, what, deep = who[warm], what[warm], deep[warm]
        at_wall = 2.0 * k[who] * np.sqrt(r[who] * deep) * self._narrower
        return pairs, between, np.stack([who, what], axis=1), at_wall

    def catch_up(self) -> None:
        """Let heat flow until the time of the simulation, through the contacts of now."""
        steps = self.simulation.steps - self._steps
        if steps > 0:
            self.advance(steps * self.simulation.time_step)
            self._steps = self.simulation.steps

    def state(self) -> dict[str, NDArray[Any]]:
        """What goes beside a checkpoint."""
        return {
            "heat_steps": np.array(self._steps),
            "heat_by_label": self._by_label,
            "heat_from_walls": self.from_walls,
        }

    def go_back(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Take up what :meth:`state` has given.

        Raises
        ------
        InputError
            If it is not there.
        """
        try:
            self._steps = int(state["heat_steps"])
            self._by_label, self.from_walls = state["heat_by_label"], state["heat_from_walls"]
        except KeyError:
            raise InputError(
                "this checkpoint holds no temperatures; give the case that wrote it."
            ) from None

    def give(self, heat: ArrayLike) -> None:
        """Add heat to the particles, shape (n,), in the order of ``simulation.centres`` [J].

        Raises
        ------
        InputError
            If it is not one finite number for each, or takes a temperature to 0 or below.
        """
        given = np.asarray(heat, dtype=np.float64)
        t = self.temperatures
        if given.shape != t.shape or not np.isfinite(given).all():
            raise InputError(f"heat of shape {given.shape} must be {t.shape}, all finite [J].")
        after = t + given / self.capacities
        if not (after > 0.0).all():
            who = int(after.argmin())
            raise InputError(
                f"particle {who}: heat of {given[who]:.3g} [J] takes it from {t[who]:.4g} to "
                f"{after[who]:.4g} [K]; take a smaller time step."
            )
        self._by_label[self.simulation.labels] = after

    def advance(self, time: float) -> None:
        """Let heat flow for a time through the contacts of now [s].

        Raises
        ------
        InputError
            If the time is negative.
        """
        if not time >= 0.0:
            raise InputError(f"time = {time:g} [s] must be at least 0.")
        t, capacity = self.temperatures, self.capacities
        pairs, between, at, wall = self.conductances()
        n = len(t)
        ends = np.concatenate([pairs.ravel(), at[:, 0]])
        leaving = np.bincount(ends, np.concatenate([np.repeat(between, 2), wall]), n)
        fastest = float((leaving / capacity).max(initial=0.0))
        steps = max(1, int(np.ceil(time * fastest / _SHARE)))
        dt = time / steps
        i, j = pairs.T

        def rates(t: Array) -> tuple[Array, Array]:
            flow = between * (t[j] - t[i])
            given = wall * (self._walls[at[:, 1]] - t[at[:, 0]])
            gained = np.zeros(n)
            for where, what in ((i, flow), (j, -flow), (at[:, 0], given)):
                gained = gained + np.bincount(where, what, n)
            return gained, given

        for _ in range(steps):
            # Midpoint: second order, and what one gains another one loses.
            half = t + 0.5 * dt * rates(t)[0] / capacity
            gained, given = rates(half)
            t = t + dt * gained / capacity
            self.from_walls += dt * np.bincount(at[:, 1], given, len(self._walls))
        self._by_label[self.simulation.labels] = t


def _checked(values: ArrayLike, n: int, name: str, unit: str) -> Array:
    array = np.asarray(values, dtype=np.float64)
    if array.shape not in ((), (n,)):
        raise InputError(f"{name} has shape {array.shape}; give one value or ({n},) of them.")
    if not (np.isfinite(array).all() and (array > 0.0).all()):
        raise InputError(f"{name} [{unit}] must be finite and above 0; mend it.")
    return np.array(np.broadcast_to(array, (n,)))
