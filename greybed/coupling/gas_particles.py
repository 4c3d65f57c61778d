"""Gas and particles in one loop: drag both ways, pressure on particles, sub-steps of contacts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed.core.errors import InputError
from greybed.coupling import _drag, _exchange, _overlap
from greybed.coupling.drag_exchange import DragTerms, Settings, drag_terms
from greybed.coupling.exchange_report import ExchangeReport
from greybed.coupling.forces import added_mass, shear_lift, vorticity_of
from greybed.coupling.gas import Faces, Gas, begin_with, cell_slopes, imposed_gradient
from greybed.coupling.gas_heat import GasHeat
from greybed.coupling.lubrication import lubrication
from greybed.coupling.transfer import Transfer
from greybed.coupling.void_fraction import Overlaps, Smoother
from greybed.dem.simulation import Simulation

Array = NDArray[np.float64]

# A gas step moves no particle further than this share of a cell.
_SHARE_OF_CELL = 0.2
# Nor two particles by more than this share of the film between them.
_SHARE_OF_FILM = 0.1
_NOTHING = np.zeros((0, 3))


class GasParticles:
    """Particles in a gas.

    A gas step takes the particles where they are, solves the gas with their drag in it, and lets
    the particles run under the force that follows, constant over as many steps of their own. What
    the particles get is what the gas loses, to round-off: forces are read from faces and given to
    them with the same weights.

    Parameters
    ----------
    gas : Gas
        Solver of the gas; its grid holds all particles.
    simulation : Simulation
        The particles. Axes that repeat in one repeat in the other.
    settings : Settings, optional
        Drag law and the rest.
    heat : GasHeat, optional
        Temperatures of the same simulation; the gas must solve for its own.

    Raises
    ------
    InputError
        For settings out of range, periodic axes that differ, or clumps.
    """

    def __init__(
        self,
        gas: Gas,
        simulation: Simulation,
        settings: Settings | None = None,
        *,
        heat: GasHeat | None = None,
    ) -> None:
        self.gas, self.simulation, self.heat = gas, simulation, heat
        self.settings = settings or Settings()
        grid = gas.grid
        if len(simulation.bodies.masses):
            raise InputError("gas and particles: clumps have no drag law here; take spheres.")
        box, periodic = simulation._lists.box, simulation._lists.periodic
        for axis, name in enumerate("xyz"):
            if bool(periodic[axis]) != bool(grid.periodic[axis]):
                raise InputError(f"axis {name} repeats in the gas or in the particles only.")
            low, high = grid.lower[axis], grid.upper[axis]
            if periodic[axis] and not np.allclose(box[:, axis], [low, high], rtol=1e-9, atol=0.0):
                raise InputError(
                    f"along {name} the gas repeats from {low:g} to {high:g} and the particles from "
                    f"{box[0, axis]:g} to {box[1, axis]:g} [m]; make them the same."
                )
        self._diameter = 2.0 * float(simulation._state.place[:, 3].mean())
        self.smoother = Smoother(grid, self.settings.width * self._diameter)
        self.transfer = Transfer(grid, self.smoother)
        self.time = 0.0
        self.steps = 0
        self._passed = 0.0  # length of the last step [s]
        self.gas_report: Any = None  # of the last step
        self._rate: float | None = None
        self._seen: Array | None = None  # gas velocity at the particles, by label
        self._overlaps = self._look()
        self.void, self.least_void, self.limited = self._void_of(self._overlaps)
        begin_with(gas, self.void)

    # -- time -------------------------------------------------------------------------------

    def steps_at_most(self) -> int:
        """Steps of the particles that a gas step may hold: no particle goes far through cells.

        The gas's own limit and that of explicit drag are not in it.
        """
        # Column by column: numpy is slow across rows of three.
        rate = max(
            max(float(v.max()), -float(v.min())) / h
            for v, h in zip(self.simulation._state.motion.T, self.gas.grid.spacing, strict=False)
        )
        most = _SHARE_OF_CELL / max(rate, 1e-300) / self.simulation.time_step
        return max(1, int(min(most, 1e9)))

    def steps_for(self, courant: float = 0.5, most: int = 1000) -> int:
        """Steps of the particles for the next gas step, from the limits of both.

        Parameters
        ----------
        courant : float
            Cells that the gas may cross in a step [-].
        most : int
            Upper bound.
        """
        fastest = sum(
            float(np.abs(u).max(initial=0.0)) / h
            for u, h in zip(self.gas.velocity, self.gas.grid.spacing, strict=True)
        )
        limit = courant / max(fastest, 1e-300) / self.simulation.time_step
        steps = min(self.steps_at_most(), most, int(min(limit, 1e9)))
        if self.settings.treatment != "implicit":
            if self._rate is None:
                self._note(self._terms(self._overlaps, self._read(self.gas.velocity)))
            # Half a relaxation time: the force is of the velocity at the start.
            rate = max(self._rate or 0.0, 1e-300) * self.simulation.time_step
            steps = min(steps, int(min(0.5 / rate, 1e9)))
        if self.settings.lubrication > 0.0:
            rate = max(self._films(0.0)[1], 1e-300) * self.simulation.time_step
            steps = min(steps, int(min(_SHARE_OF_FILM / rate, 1e9)))
        return max(1, steps)

    def step(self, steps: int | None = None) -> ExchangeReport:
        """One gas step of so many steps of the particles, by default :meth:`steps_for`.

        Raises
        ------
        InputError
            If a particle leaves the grid, or as the solvers do.
        """
        count = self.steps_for() if steps is None else int(steps)
        if count < 1:
            raise InputError(f"steps = {steps} must be at least 1.")
        sim, gas = self.simulation, self.gas
        dt = count * sim.time_step
        before = self.void
        overlaps = self._overlaps = self._look()
        self.void, least, limited = self._void_of(overlaps)
        # What has moved since the last look took the time of the step before.
        rate = (self.void - before) / (self._passed or dt)
        place, motion, law = sim._state.place, sim._state.motion, self.settings.plain
        steady: Any = None
        loads: Any = None
        if law is not None and len(place):
            terms, self._rate, total, aimed = self.transfer.drag(
                place, motion, overlaps, self.void, gas.velocity, law, gas.fluid, gas.model == "B"
            )
            k, target = terms.coefficient[:, None], motion
        else:
            seen = self._read(gas.velocity)
            terms = self._terms(overlaps, seen)
            self._note(terms)
            steady = self._steady(overlaps, terms, seen, dt)
            k, target = self._linear(terms, seen, dt)
            total, aimed = self.transfer.give(place, k, target)
            if steady is not None:
                loads, _ = self.transfer.give(place, -steady, np.zeros_like(steady))
        volume = gas.grid.cell_volume
        faces = self.transfer.faces
        none = np.zeros_like(total)
        if self.settings.treatment == "explicit":
            drag = aim = none
            source = aimed - total * self.transfer.flat(gas.velocity)
            source = source if loads is None else source + loads
            source = source / volume
        else:
            drag, aim = np.empty((2, len(total)))
            _exchange.shares(total, aimed, volume, drag, aim)
            source = none if loads is None else loads / volume
        at, order, warm = gas.velocity, sim._lists.ident, {}
        if self.heat is not None:
            d = 2.0 * place[:, 3]
            warm = self.heat.offer(
                overlaps, self.smoother, terms.void, terms.reynolds, d, order, dt
            )
        report = self.gas_report = gas.step(
            dt, void_fraction=self.void, void_rate=rate, drag=faces(drag), target=faces(aim),
            source=faces(source), **warm,
        )  # fmt: skip
        if self.heat is not None:
            self.heat.take(overlaps, self.smoother, report.heat, order, dt, sim)
        if self.settings.treatment != "explicit":
            at = report.velocity
        by_gas = self.settings.pressure and gas.model == "A"
        slopes = self._slopes().reshape(-1, 3) if by_gas else _NOTHING
        pushed, sums = self.transfer.forces(
            place, at, k, target, _NOTHING if steady is None else steady, overlaps, slopes,
            self._lift(),
        )  # fmt: skip
        if not np.isfinite(sums).all():
            raise InputError("the gas's forces on particles are not finite; take shorter steps.")
        given, parts, by_pressure = dt * sums
        largest = float(terms.reynolds.max(initial=0.0))
        taken, rims = self.transfer.split(dt * (total * self.transfer.flat(at) - aimed))
        if steady is not None:
            given += dt * steady.sum(axis=0)
            inside, outside = self.transfer.split(-loads)
            taken, rims = taken + dt * inside, rims + dt * outside
        if self.settings.lubrication > 0.0:
            pushed += self._films(dt)[0]
        sim._push_in_place(pushed)
        sim.run(count)
        if self.heat is not None:
            self.heat.close()
        self.time += dt
        self.steps += 1
        self._passed = dt
        scale = float(max(parts.max(initial=0.0), 1e-300))
        return ExchangeReport(
            self.time, dt, count, given, taken, rims, by_pressure,
            float(np.abs(given - taken - rims).max()) / scale, least, limited, terms.outside,
            largest,
        )  # fmt: skip

    # -- parts of a step --------------------------------------------------------------------

    def _look(self) -> Overlaps:
        return Overlaps(self.gas.grid, self.simulation._state.place, method=self.settings.void)

    def _void_of(self, overlaps: Overlaps) -> tuple[Array, float, int]:
        solids = overlaps.solids()
        solids = solids if self.smoother.idle else self.smoother.cells(solids)
        void = np.empty(solids.shape)
        least, low = _overlap.void_of(
            solids.reshape(-1), self.gas.grid.cell_volume, self.settings.least_void,
            void.reshape(-1),
        )  # fmt: skip
        return void, least, low

    def _read(self, velocity: Faces) -> Array:
        return self.transfer.read(velocity, self.simulation._state.place)

    def _note(self, terms: DragTerms) -> None:
        """Keep the fastest relaxation of a particle [1/s], for the length of the next step."""
        mass = self.simulation._state.motion[:, 6]
        k = terms.coefficient if terms.coefficient.ndim == 1 else terms.coefficient.max(axis=1)
        self._rate = float((k / mass).max(initial=0.0))

    def _terms(self, overlaps: Overlaps, seen: Array) -> DragTerms:
        state, fluid = self.simulation._state, self.gas.fluid
        slip, void = np.empty_like(seen), np.empty(len(seen))
        _drag.surroundings(
            seen, state.motion, overlaps.first, overlaps.cell, overlaps.volume,
            self.void.reshape(-1), slip, void,
        )  # fmt: skip
        gradient = None
        if getattr(self.settings.correction, "needs_gradient", False):
            gradient = overlaps.mean(self._slopes())
        terms = drag_terms(
            self.settings, slip, void, 2.0 * state.place[:, 3], fluid.density, fluid.viscosity,
            self.gas.grid.cell_volume ** (1.0 / 3.0), gradient,
        )  # fmt: skip
        # Model B: the gas bears all of the pressure gradient, drag what particles bear in model A.
        return terms if self.gas.model == "A" else terms.over(void)

    def _linear(self, terms: DragTerms, seen: Array, dt: float) -> tuple[Array, Array]:
        """Coefficients and targets (n, 3): the force is k (u - target) with the new u."""
        v = self.simulation._state.motion[:, :3]
        secant, slope = terms.coefficient, terms.steepness
        if secant.ndim == 1:
            secant, slope = secant[:, None], slope[:, None]
        v = np.ascontiguousarray(v)
        if self.settings.treatment != "implicit":
            return secant, v if terms.push is None else v - terms.push / secant
        mass = self.simulation._state.motion[:, 6][:, None]
        # Newton's method about the old slip, then the particle's own new velocity.
        steep = secant * slope
        offset = (1.0 - secant / steep) * (seen - v)
        if terms.push is not None:
            offset = offset - terms.push / steep
        free = np.abs(self.simulation._contact_loads()[:, :3]).max(axis=1) == 0.0
        fall = self.simulation.gravity + self._buoyancy() / mass
        # A particle that rests on others is not about to fall.
        target = v + offset + np.where(free[:, None], dt * fall, 0.0)
        return np.ascontiguousarray(steep / (1.0 + steep * dt / mass)), target

    def _steady(self, overlaps: Overlaps, terms: DragTerms, seen: Array, dt: float) -> Array | None:
        """Forces besides drag that the gas gets back, of the old velocities."""
        settings, state, fluid = self.settings, self.simulation._state, self.gas.fluid
        result = None
        if settings.lift == "none" and settings.added_mass == 0.0:
            return None
        slip = seen - state.motion[:, :3]
        d, mass = 2.0 * state.place[:, 3], state.motion[:, 6]
        if settings.lift != "none":
            means = np.empty((*self.gas.grid.shape, 3))
            _exchange.cell_means(*self.gas.velocity, means)
            curl = overlaps.mean(vorticity_of(means, self.gas.grid.spacing))
            result = shear_lift(slip, curl, d, fluid.density, fluid.viscosity)
        if settings.added_mass > 0.0:
            labels = self.simulation.labels[self.simulation._lists.ident]
            kept = np.full((int(labels.max()) + 1, 3), np.nan)
            old = self._seen
            if old is not None:
                kept[: len(old)] = old[: len(kept)]
            change = seen - kept[labels]
            acceleration = np.where(np.isfinite(change), change / dt, 0.0)
            k = terms.coefficient if terms.coefficient.ndim == 2 else terms.coefficient[:, None]
            known = k * slip + mass[:, None] * self.simulation.gravity
            if terms.push is not None:
                known += terms.push
            known += self._buoyancy()
            if settings.pressure and self.gas.model == "A":
                known += self._by_pressure(overlaps)
            displaced = fluid.density * math.pi / 6.0 * d**3
            extra = added_mass(settings.added_mass, displaced, mass, known, acceleration)
            touching = np.abs(self.simulation._contact_loads()[:, :3]).max(axis=1) > 0.0
            still = settings.added_mass * displaced[:, None] * acceleration
            extra = np.where(touching[:, None], still, extra)
            result = extra if result is None else result + extra
            kept[labels] = seen
            self._seen = kept
        return None if result is None else np.ascontiguousarray(result)

    def _films(self, dt: float) -> tuple[Array, float]:
        """Forces of the films between particles, and how fast the fastest one shrinks [1/s]."""
        d, settings = self._diameter, self.settings
        return lubrication(
            self.simulation, self.gas.fluid.viscosity, settings.lubrication * d,
            settings.roughness * d, dt,
        )  # fmt: skip

    def _by_pressure(self, overlaps: Overlaps) -> Array:
        """Minus the integral of the pressure gradient over each particle, (n, 3) [N]."""
        return -overlaps.integral(self._slopes())

    def _slopes(self) -> Array:
        """Pressure gradient of the cells, smoothed as all that is exchanged is [Pa/m]."""
        slopes = cell_slopes(self.gas.pressure, self.gas.grid)
        slopes += imposed_gradient(self.gas)
        if not self.smoother.idle:
            for c in range(3):
                slopes[..., c] = self.smoother.cells(slopes[..., c])
        return slopes

    def _lift(self) -> Array:
        """What the gas's own weight lifts, over the cube of the radius, (3,) [N/m3].

        It is 0 where the gas's pressure tells it.
        """
        told = self.settings.pressure and self.gas.model == "A" and np.any(self.gas.gravity)
        if not self.settings.buoyancy or told:
            return np.zeros(3)
        lift: Array = -4.0 / 3.0 * math.pi * self.gas.fluid.density * self.simulation.gravity
        return lift

    def _buoyancy(self) -> Array:
        """The same of each particle, (n, 3) [N]."""
        return self.simulation._state.place[:, 3:] ** 3 * self._lift()

    # -- restart ----------------------------------------------------------------------------

    def state(self) -> dict[str, Array]:
        """What goes beside the states of gas and particles."""
        seen = np.zeros((0, 3)) if self._seen is None else self._seen
        rate = -1.0 if self._rate is None else self._rate
        return {"coupling_void": self.void, "coupling_seen": seen,
                "coupling_clock": np.array(
                    [self.time, float(self.steps), rate, self._passed]
                )}  # fmt: skip

    def go_back(self, state: Mapping[str, Any]) -> None:
        """Take up what :meth:`state` has given, after gas and particles have been restored.

        Raises
        ------
        InputError
            If it is not there.
        """
        try:
            self.void = np.array(state["coupling_void"])
            seen = np.array(state["coupling_seen"])
            self.time, steps, rate, self._passed = (
                float(value) for value in state["coupling_clock"]
            )
        except KeyError:
            raise InputError("this checkpoint holds no gas; give the case that wrote it.") from None
        self._seen = seen if len(seen) else None
        self._rate = None if rate < 0.0 else rate
        self.steps = int(steps)
        self._overlaps = self._look()
