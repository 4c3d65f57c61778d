"""Velocities that fulfil continuity: what the sides hold, and the pressure that does the rest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from greybed.cfd import forces
from greybed.cfd.boundaries import Inflow, Outlet, Sides, lead
from greybed.cfd.fluid import Fluid
from greybed.cfd.pressure import Pressure

Array = NDArray[np.float64]
Faces = tuple[Array, Array, Array]


class Projection:
    """Continuity on a grid with sides; see :class:`greybed.cfd.gas.GasSolver`."""

    def __init__(self, sides: Sides, fluid: Fluid, method: str, tolerance: float) -> None:
        self.sides, self.fluid, self.tolerance = sides, fluid, tolerance
        self.pressure = Pressure(sides.grid.shape, sides.grid.periodic, method)

    def mass_on_faces(self, mass: Array, void: Array) -> Faces:
        """Mass of gas per volume at the faces; where an ideal gas flows in, at its temperature."""
        sides = self.sides
        padded = sides.cells(mass)
        found = [forces.on_faces(sides, padded, axis) for axis in range(3)]
        if self.fluid.molar_mass is not None:
            for (axis, end), side in sides.of.items():
                if isinstance(side, Inflow) and side.temperature is not None:
                    rim = lead(found[axis], axis)
                    eps = lead(void, axis)[-end]
                    rim[-end] = eps * self.fluid.density_at(side.temperature)
        return found[0], found[1], found[2]

    def hold_rims(self, velocity: Faces, void: Array) -> None:
        """Put walls and inflows into velocities."""
        for axis, end, side in self._closed_sides():
            u = lead(velocity[axis], axis)
            eps = lead(void, axis)[-end]
            flows = isinstance(side, Inflow)
            u[-end] = self.sides.inflow(axis, end) / eps if flows else 0.0

    def close_rims(self, gain: list[Array]) -> None:
        """The pressure does not move what a side holds, and only half a cell lies at an outlet."""
        for axis, end, _ in self._closed_sides():
            lead(gain[axis], axis)[-end] = 0.0
        for (axis, end), side in self.sides.of.items():
            if isinstance(side, Outlet):
                lead(gain[axis], axis)[-end] *= 2.0
            if not self.sides.wide[axis]:
                gain[axis][...] = 0.0

    def correct(
        self, velocity: Faces, gain: list[Array], mass: Faces, growth: Array, ways: bool = True
    ) -> tuple[Array, int, float, float]:
        """Make the velocities fulfil continuity.

        Returns the pressure that does it, iterations, the norm of what is left over that of the
        flow through the cells, and what a closed box has too much [kg/s].
        """
        sides, rates = self.sides, forces.rates(self.sides)
        if ways:
            found = [m * g * c**2 for m, g, c in zip(mass, gain, rates, strict=True)]
            self.pressure.update((found[0], found[1], found[2]))
        flux = [m * u for m, u in zip(mass, velocity, strict=True)]
        out = forces.outflow(sides, (flux[0], flux[1], flux[2])) + growth
        through = np.abs(growth)
        for axis, f in enumerate(flux):
            a, t = np.abs(lead(f, axis)), lead(through, axis)
            t += rates[axis] * (a[1:] + a[:-1])
        size = float(np.sqrt((through**2).sum()))
        imbalance = 0.0
        if self.pressure.singular:
            mean = float(out.mean())
            imbalance = mean * out.size * sides.grid.cell_volume
            out -= mean
        if size == 0.0:
            return np.zeros(out.shape), 0, 0.0, 0.0
        p, iterations = self.pressure.solve(-out, self.tolerance * size)
        for axis, (u, g, c) in enumerate(zip(velocity, gain, rates, strict=True)):
            a, v = lead(p, axis), lead(u, axis)
            gc = c * lead(g, axis)
            v[1:-1] -= gc[1:-1] * (a[1:] - a[:-1])
            if sides.grid.periodic[axis]:
                v[0] -= gc[0] * (a[0] - a[-1])
                v[-1] = v[0]
            else:
                v[0] -= gc[0] * a[0]
                v[-1] += gc[-1] * a[-1]
        flux = [m * u for m, u in zip(mass, velocity, strict=True)]
        left = forces.outflow(sides, (flux[0], flux[1], flux[2])) + growth
        if self.pressure.singular:
            left -= mean
        return p, iterations, float(np.sqrt((left**2).sum())) / size, imbalance

    def steer(
        self, velocity: Faces, gain: list[Array], mass: Faces, void: Array, axis: int, flow: float
    ) -> tuple[Array, float, int]:
        """Add the uniform gradient along an axis that makes its mean superficial velocity so much.

        Returns the pressure, the gradient and iterations.
        """
        unit = [np.zeros_like(u) for u in velocity]
        unit[axis] -= gain[axis]
        answer: Faces = (unit[0], unit[1], unit[2])
        p, count, _, _ = self.correct(answer, gain, mass, np.zeros_like(void), ways=False)
        eps = forces.on_faces(self.sides, self.sides.cells(void), axis)
        inner = lead(eps * velocity[axis], axis)[1:]
        change = lead(eps * answer[axis], axis)[1:]
        amount = (flow - float(inner.mean())) / float(change.mean())
        for u, extra in zip(velocity, answer, strict=True):
            u += amount * extra
        return amount * p, amount, count

    def _closed_sides(self) -> list[tuple[int, int, object]]:
        return [(a, e, s) for (a, e), s in self.sides.of.items() if not isinstance(s, Outlet)]
