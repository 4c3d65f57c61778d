"""One part of a step of the gas: forces, pressure, temperature, budget."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from greybed.cfd import _momentum, energy, forces, sealed
from greybed.cfd.boundaries import Sides, lead
from greybed.cfd.fluid import Fluid
from greybed.cfd.gas_state import Gas, Inputs, Tally
from greybed.cfd.grid import AXES, Grid
from greybed.cfd.projection import Projection
from greybed.core.errors import InputError

Array = NDArray[np.float64]
Faces = tuple[Array, Array, Array]

# Explicit convection: cells crossed in a step, summed over the axes.
_COURANT = 0.5
# Share of the limit of stability of explicit viscosity.
_VISCOUS = 0.8
_MOST_STAGES = 99


class TooLong(Exception):
    """This step must be shorter."""


class Part:
    """Advances states of a gas; see :class:`greybed.cfd.gas.GasSolver`."""

    def __init__(
        self, sides: Sides, fluid: Fluid, projection: Projection, model: str,
        mean_flow: tuple[float | None, ...], budget: bool,
    ) -> None:  # fmt: skip
        self.grid, self.sides, self.fluid = sides.grid, sides, fluid
        self._projection, self.model, self.mean_flow = projection, model, mean_flow
        self.budget = budget

    def advance(self, s: Gas, dt: float, given: Inputs, share: float, tally: Tally) -> Gas:
        """The state after ``dt``; ``share`` of its step goes into the sums."""
        sides, grid, project = self.sides, self.grid, self._projection
        courant = self.crossings(s.velocity) * dt
        if courant > 1.01 * _COURANT:
            raise TooLong(f"gas crosses {courant:.2g} cells at {self._fastest(s.velocity)}.")
        flux = _products(project.mass_on_faces(s.mass, s.void_fraction), s.velocity)
        convection = forces.convection(sides, s.velocity, flux)
        friction = self._friction(s, s.velocity, flux)
        a, b = 1.0, 0.0
        if s.convection is not None and s.friction is not None:
            a, b = 1.0 + 0.5 * dt / s.before, -0.5 * dt / s.before
        stages = self._stages(s, dt, courant)
        mass, growth = self._masses(s, dt, given, flux)
        faces = project.mass_on_faces(mass, given.void)
        shares = self._shares(given.void)
        slope = forces.slopes(sides, s.pressure)
        star = [np.empty(shape) for shape in grid.face_shapes]
        gain = [np.empty(shape) for shape in grid.face_shapes]
        rate = [a * c for c in convection]
        if s.convection is not None and s.friction is not None:
            for axis in range(3):
                rate[axis] += b * s.convection[axis]
                if stages == 1:
                    rate[axis] += b * s.friction[axis]
        if stages == 1:
            for axis in range(3):
                rate[axis] += a * friction[axis]
        push = [slope[axis] + s.gradient[axis] for axis in range(3)]

        def predict() -> None:
            for axis in range(3):
                arrays = (
                    s.velocity[axis], rate[axis], faces[axis], shares[axis], push[axis],
                    given.drag[axis], given.target[axis], given.source[axis],
                )  # fmt: skip
                _momentum.predict(
                    *(x.ravel() for x in arrays), given.gravity[axis], dt,
                    star[axis].ravel(), gain[axis].ravel(),
                )  # fmt: skip

        predict()
        if stages > 1:
            whole = [m / dt + d for m, d in zip(faces, given.drag, strict=True)]
            smeared = self._smear(s, (star[0], star[1], star[2]), whole, friction, flux, stages,
                                  given.void)  # fmt: skip
            for axis in range(3):
                rate[axis] += whole[axis] * (smeared[axis] - star[axis])
            predict()
        velocity: Faces = (star[0], star[1], star[2])
        project.hold_rims(velocity, given.void)
        project.close_rims(gain)
        try:
            p, iterations, left, imbalance = project.correct(velocity, gain, faces, growth)
            gradient = s.gradient
            for axis, flow in enumerate(self.mean_flow):
                if flow is not None:
                    extra, more, count = project.steer(
                        velocity, gain, faces, given.void, axis, flow
                    )
                    p, iterations, gradient = p + extra, iterations + count, gradient.copy()
                    gradient[axis] += more
        except InputError as reason:
            raise TooLong(str(reason)) from None
        for axis, u in enumerate(velocity):
            if not np.isfinite(u).all():
                place = _place(grid, axis, int(np.argmin(np.isfinite(u))), u.shape)
                raise TooLong(f"the velocity along {AXES[axis]} at {place} is not finite.")
        temperature, mean = s.temperature, s.mean_pressure
        if given.heating is not None:
            temperature, heat, mean = self._temperatures(
                s, mass - dt * growth, mass, _products(faces, velocity), given, given.heating, dt
            )
            tally.heat = share * heat + (0.0 if tally.heat is None else tally.heat)
        new = Gas(
            velocity, s.pressure + p, given.void, mass, temperature, s.time + dt, gradient,
            convection, friction, dt, mean_pressure=mean,
        )  # fmt: skip
        if self.budget:
            new = self._account(tally.budget, s, new, given, rate, flux, shares, (a, b))
        if tally.seen is None:
            tally.seen = [share * u for u in velocity]
        else:
            for total, u in zip(tally.seen, velocity, strict=True):
                total += share * u
        tally.parts += 1
        tally.iterations += iterations
        tally.divergence = max(tally.divergence, left)
        tally.courant = max(tally.courant, courant)
        tally.imbalance += share * imbalance
        return new

    def _friction(self, s: Gas, velocity: Faces, flux: Faces) -> Faces:
        if self.fluid.viscosity == 0.0:
            x, y, z = (np.zeros(u.shape) for u in velocity)
            return x, y, z
        viscosity = self.fluid.viscosity * self.sides.cells(s.void_fraction)
        return forces.friction(self.sides, velocity, flux, viscosity)

    def _stages(self, s: Gas, dt: float, courant: float) -> int:
        """1 for Adams and Bashforth; an odd number for Runge, Kutta and Legendre."""
        share = dt / self.viscous_limit(s)
        # Adams and Bashforth end where the fastest mode decays by 1 per step: twice the cells
        # crossed from convection, and twice the share of the plain limit from viscosity.
        if 2.0 * courant + 2.0 * _VISCOUS * share <= 1.0 or self.fluid.viscosity == 0.0:
            return 1
        least = math.ceil(0.5 * (math.sqrt(9.0 + 16.0 * share) - 1.0))
        stages = max(3, least + 1 - least % 2)
        if stages > _MOST_STAGES:
            raise TooLong(f"viscosity takes {stages} stages, more than {_MOST_STAGES}.")
        return stages

    def _smear(
        self, s: Gas, free: Faces, whole: list[Array], friction: Faces, flux: Faces, stages: int,
        void: Array,
    ) -> list[Array]:  # fmt: skip
        """Velocities with viscosity from those without, by Runge, Kutta and Legendre's method.

        Meyer, Balsara & Aslam, Mon. Not. R. Astron. Soc. 422 (2012) 2102, second order. All other
        forces are constant in the stages, with the inertia that implicit drag leaves: a steady
        flow stays as it is whatever the length of the step.
        """
        force = [w * (f - u) for w, f, u in zip(whole, free, s.velocity, strict=True)]
        first = [(r + f) / w for r, f, w in zip(friction, force, whole, strict=True)]
        width = 4.0 / (stages**2 + stages - 2.0)
        b = [1.0 / 3.0] * 2 + [
            (j * j + j - 2.0) / (2.0 * j * (j + 1.0)) for j in range(2, stages + 1)
        ]
        older = list(s.velocity)
        newer = [u + width / 3.0 * r for u, r in zip(older, first, strict=True)]
        for j in range(2, stages + 1):
            held: Faces = (newer[0], newer[1], newer[2])
            self._projection.hold_rims(held, void)
            rate = self._friction(s, held, flux)
            mu, nu = (2.0 * j - 1.0) / j * b[j] / b[j - 1], (1.0 - j) / j * b[j] / b[j - 2]
            new, old = mu * width, -(1.0 - b[j - 1]) * mu * width
            newest = [
                mu * y + nu * x + (1.0 - mu - nu) * u + new * (r + f) / w + old * r0
                for y, x, u, r, f, w, r0 in zip(
                    newer, older, s.velocity, rate, force, whole, first, strict=True
                )
            ]
            older, newer = newer, newest
        return newer

    def _masses(self, s: Gas, dt: float, given: Inputs, flux: Faces) -> tuple[Array, Array]:
        """Mass of gas per volume after the step and its rate.

        That of an ideal gas is from temperatures that the last mass fluxes would bring about; in
        a sealed box it stays the same in all.
        """
        if self.fluid.molar_mass is None or given.heating is None:
            return self.fluid.density * given.void, self.fluid.density * given.rate
        after = s.mass - dt * forces.outflow(self.sides, flux)
        t, _, _ = self._temperatures(s, s.mass, after, flux, given, given.heating, dt)
        if sealed.is_sealed(self.sides, self.fluid):
            mass = sealed.masses(float(s.mass.sum()), given.void, t)
        else:
            mass = given.void * self.fluid.density_at(t)
        return mass, (mass - s.mass) / dt

    def _temperatures(
        self, s: Gas, old: Array, new: Array, flux: Faces, given: Inputs, heating: energy.Heating,
        dt: float,
    ) -> tuple[Array, Array, float]:  # fmt: skip
        """Temperatures after a step, heat from particles and the mean pressure."""

        def advance(work: Array | None) -> tuple[Array, Array]:
            return energy.advance(
                self.sides, self.fluid, s.temperature, old, new, flux, given.void, heating, dt, work
            )

        if not sealed.is_sealed(self.sides, self.fluid):
            return *advance(None), s.mean_pressure
        t, heat, mean = sealed.warmed(advance, new, given.void, s.mean_pressure, self.fluid, dt)
        if not (t > 0.0).all():
            raise TooLong(f"the temperature falls to {float(t.min()):.3g} K.")
        return t, heat, mean

    def _shares(self, void: Array) -> Faces:
        """Share of the pressure's slope that the gas bears, on faces."""
        if self.model == "B":
            x, y, z = (np.ones(shape) for shape in self.grid.face_shapes)
        else:
            padded = self.sides.cells(void)
            x, y, z = (forces.on_faces(self.sides, padded, axis) for axis in range(3))
        return x, y, z

    def _account(
        self, sums: list[Array], s: Gas, new: Gas, given: Inputs, transport: list[Array],
        flux: Faces, shares: Faces, weights: tuple[float, float],
    ) -> Gas:  # fmt: skip
        """Add the budget of momentum of a part; the state with what the next one needs for it."""
        project, dt, volume = self._projection, new.before, self.grid.cell_volume
        old, now = (project.mass_on_faces(x.mass, x.void_fraction) for x in (s, new))
        slope = forces.slopes(self.sides, new.pressure)
        spill = self.sides.cells(forces.outflow(self.sides, flux))
        spilled = np.zeros(3)
        for axis in range(3):
            u, v = s.velocity[axis], new.velocity[axis]
            lost = forces.on_faces(self.sides, spill, axis) * u  # u div F, which convection leaves
            parts = (
                now[axis] * v - old[axis] * u,
                dt * transport[axis],
                -dt * shares[axis] * (slope[axis] + new.gradient[axis]),
                -dt * given.drag[axis] * (v - given.target[axis]),
                dt * given.source[axis],
                dt * now[axis] * given.gravity[axis],
                (now[axis] - old[axis]) * u,
                lost,
            )
            periodic = self.grid.periodic[axis]
            found = [
                volume * float(lead(part, axis)[1 : None if periodic else -1].sum())
                for part in parts
            ]
            spilled[axis] = found.pop()
            left = dt * (weights[0] * spilled[axis] + weights[1] * s.spilled[axis])
            found[1] -= left
            found[6] += left
            for total, amount in zip(sums, found, strict=True):
                total[axis] += amount
        return replace(new, spilled=spilled)

    # -- checks and limits ------------------------------------------------------------------

    def crossings(self, velocity: Faces) -> float:
        """Largest number of cells crossed per time, summed over axes [1/s]."""
        total = np.zeros(self.grid.shape)
        for axis, (u, c) in enumerate(zip(velocity, forces.rates(self.sides), strict=True)):
            a, t = np.abs(lead(u, axis)), lead(total, axis)
            t += c * np.maximum(a[1:], a[:-1])
        return float(total.max())

    def _fastest(self, velocity: Faces) -> str:
        """Where the gas is fastest."""
        axis = int(np.argmax([np.abs(u).max() for u in velocity]))
        u = velocity[axis]
        return _place(self.grid, axis, int(np.abs(u).argmax()), u.shape)

    def viscous_limit(self, s: Gas) -> float:
        """Longest step of explicit viscosity [s]."""
        c = forces.rates(self.sides)
        lightest = self.fluid.density
        if self.fluid.molar_mass is not None:
            lightest = float((s.mass / s.void_fraction).min())
        # Normal stresses count 4/3, and shear once more through the transposed gradient.
        spread = 2.0 * self.fluid.viscosity / lightest * (sum(x**2 for x in c) + max(c) ** 2 / 3.0)
        return _VISCOUS / max(spread, 1e-300)


def _products(mass: Faces, velocity: Faces) -> Faces:
    x, y, z = (m * u for m, u in zip(mass, velocity, strict=True))
    return x, y, z


def _place(grid: Grid, axis: int, number: int, shape: tuple[int, ...]) -> str:
    k, j, i = (int(n) for n in np.unravel_index(number, shape))
    return f"face {i}, {j}, {k} (x, y, z) across {AXES[axis]}"
