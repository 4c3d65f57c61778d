"""A gas as plain as can be, for tests of the coupling: no convection, no viscous stress.

eps rho du/dt = -eps grad p + eps rho g - drag (u - target) + source, d(eps)/dt + div(eps u) = 0.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from greybed.cfd.poisson import Poisson


class PlainGas:
    """Flow in at the lowest z, out at the highest; walls or periodic axes across."""

    def __init__(self, grid, density, viscosity, inflow=0.0, gravity=(0.0, 0.0, 0.0), closed=False):
        self.grid, self.model = grid, "A"
        self.fluid = SimpleNamespace(density=density, viscosity=viscosity)
        self.gravity = np.array(gravity, dtype=float)
        self.inflow, self.closed = inflow, closed  # superficial velocity [m/s]
        self.velocity = tuple(np.zeros(s) for s in grid.face_shapes)
        self.velocity[2][...] = inflow
        self.pressure = np.zeros(grid.shape)
        self.solver = None

    def on_faces(self, field, axis):
        """Means of the cells beside each face; on a rim that of the one cell."""
        along = 2 - axis
        low, high = np.roll(field, 1, axis=along), field
        mean = 0.5 * (low + high)
        first = mean.take([0], axis=along)
        last = first
        if not self.grid.periodic[axis]:
            first, last = field.take([0], axis=along), field.take([-1], axis=along)
        inner = mean.take(range(1, field.shape[along]), axis=along)
        return np.concatenate([first, inner, last], axis=along)

    def free(self, axis):
        """Faces whose velocity is not given."""
        free = np.ones(self.grid.face_shapes[axis], dtype=bool)
        if not self.grid.periodic[axis]:
            ends = np.moveaxis(free, 2 - axis, 0)
            ends[0] = False
            ends[-1] = axis == 2 and not self.closed
        return free

    def step(self, dt, *, void_fraction, void_rate, drag, target, source):
        g, rho = self.grid, self.fluid.density
        flux, ways, star, gain = [], [], [], []
        for axis in range(3):
            eps = self.on_faces(void_fraction, axis)
            along, free = 2 - axis, self.free(axis)
            inertia = rho * eps / dt + drag[axis]
            u = inertia_u = rho * eps / dt * self.velocity[axis]
            u = (inertia_u + eps * rho * self.gravity[axis] + drag[axis] * target[axis]
                 + source[axis]) / inertia  # fmt: skip
            fixed = np.zeros_like(u)
            if axis == 2 and not g.periodic[2]:
                fixed[0] = self.inflow / eps[0]
            u = np.where(free, u, fixed)
            h, area = g.spacing[axis], g.cell_volume / g.spacing[axis]
            share = np.where(free, eps / inertia / h, 0.0)
            if axis == 2 and not g.periodic[2]:
                share[-1] *= 2.0  # the pressure 0 is on the face
            ways.append(area * eps * share)
            gain.append(share)
            star.append(u)
            flux.append(area * np.diff(eps * u, axis=along))
        outflow = sum(flux) + void_rate * g.cell_volume
        if self.solver is None:
            self.solver = Poisson(*ways, g.periodic)
        else:
            self.solver.update(*ways)
        # T (p_low - p_high) is the flux, so that the net outflow by pressure is minus what is there
        self.pressure, _ = self.solver.solve(-outflow, self.pressure, tolerance=1e-11)
        new = []
        for axis in range(3):
            p, along = self.pressure, 2 - axis
            if g.periodic[axis]:
                low = p.take([-1, *range(p.shape[along])], axis=along)
                high = p.take([*range(p.shape[along]), 0], axis=along)
            else:
                zero = np.zeros_like(p.take([0], axis=along))
                low, high = np.concatenate([zero, p], axis=along), np.concatenate([p, zero], along)
            new.append(star[axis] + gain[axis] * (low - high))
        self.velocity = tuple(new)
        return SimpleNamespace(velocity=self.velocity)
