"""Resolved flows for filtered drag: particles that collide in a gas, in a box that repeats."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed.cfd.fluid import Fluid
from greybed.cfd.gas import GasSolver
from greybed.closures.drag.filtered import Material as DragMaterial
from greybed.core.sizes import Mono
from greybed.coupling.drag_exchange import Settings
from greybed.coupling.gas import cell_slopes
from greybed.coupling.gas_particles import GasParticles
from greybed.datasets.drag_design import FlowDesign
from greybed.datasets.drag_filters import Resolved
from greybed.datasets.drag_flows import GRAVITY, centred, grid_of
from greybed.datasets.generate import PeriodicBox, random_packing
from greybed.dem import Contact, Material, Simulation, restore, save

Array = NDArray[np.float64]

# Young's modulus over rho u_t^2: particles that meet with u_t overlap by 5 % of a diameter.
_STIFFNESS = 2e3
_POISSON, _FRICTION = 0.3, 0.3
# Time step over Rayleigh's time.
_OF_RAYLEIGH = 0.2
# Solid fraction that round-off leaves in a cell without particles.
_NOTHING = 1e-12


class ParticleFlow:
    """Particles in a gas, in a box that repeats; the mean pressure gradient carries the weight.

    The start is a random packing at rest. Springs are softened: what clusters do hangs on the
    loss in a collision, not on how long it lasts.

    Parameters
    ----------
    design : FlowDesign
        Of kind ``cfd-dem``, three-dimensional.
    """

    def __init__(self, design: FlowDesign) -> None:
        self.design, self.grid = design, grid_of(design)
        d, density = design.diameter, design.particle_density
        volume = math.prod(self.grid.upper)
        sphere = math.pi / 6.0 * d**3
        number = max(1, round(design.solid_fraction * volume / sphere))
        solid = number * sphere / volume
        bed = random_packing(
            number, solid, Mono(0.5 * d), container=PeriodicBox(aspect=self.grid.upper),
            seed=design.seed,
        )  # fmt: skip
        u_t = DragMaterial(
            d, density, design.gas_density, design.gas_viscosity
        ).terminal_velocity  # fmt: skip
        modulus = _STIFFNESS * density * u_t**2
        shear = modulus / (2.0 * (1.0 + _POISSON))
        rayleigh = math.pi * 0.5 * d * math.sqrt(density / shear) / (0.1631 * _POISSON + 0.8766)
        down = (0.0, -GRAVITY, 0.0)
        self.particles = Simulation(
            bed.centres, bed.radii, Material(density, modulus, _POISSON),
            Contact(design.restitution, _FRICTION), box=[[0.0, 0.0, 0.0], self.grid.upper],
            periodic=(True, True, True), gravity=down, time_step=_OF_RAYLEIGH * rayleigh,
        )  # fmt: skip
        weight = solid * density + (1.0 - solid) * design.gas_density
        self.gas = GasSolver(
            self.grid, {}, Fluid(density=design.gas_density, viscosity=design.gas_viscosity),
            gravity=down, gradient=(0.0, -weight * GRAVITY, 0.0), tolerance=1e-6,
        )  # fmt: skip
        self.both = GasParticles(self.gas, self.particles, Settings(drag=design.law))

    @property
    def time(self) -> float:
        """Since the start [s]."""
        return self.both.time

    @property
    def steps(self) -> int:
        """Of the gas, since the start."""
        return self.both.steps

    def step(self, until: float) -> None:
        """One step of the gas, beyond a time [s] by less than one of the particles."""
        left = math.ceil((until - self.time) / self.particles.time_step - 1e-6)
        self.both.step(max(1, min(self.both.steps_for(), left)))

    def look(self) -> Resolved:
        """The fields of now: what particles have is shared out to cells as their volume is.

        Drag is that of the coupling, particle by particle, at the gas velocity that each has seen.
        """
        both, state = self.both, self.particles._state
        overlaps, smoother, volume = both._look(), both.smoother, self.grid.cell_volume
        void = 1.0 - smoother.cells(overlaps.solids()) / volume
        phi = 1.0 - void
        seen = both._read(self.gas.velocity)
        before, both.void = both.void, void
        terms = both._terms(overlaps, seen)
        both.void = before
        v = state.motion[:, :3]
        sphere = math.pi / 6.0 * self.design.diameter**3

        def shared(values: Array) -> Array:
            cells = overlaps.share_out(values)
            return np.stack([smoother.cells(cells[..., c]) for c in range(3)]) / volume

        solids = shared(sphere * v) / np.maximum(phi, _NOTHING)
        slopes = cell_slopes(self.gas.pressure, self.grid) + self.gas.state.gradient
        return Resolved(
            solid_fraction=phi, gas=centred(self.gas.velocity), solids=solids,
            gradient=np.moveaxis(slopes, -1, 0),
            drag=shared(terms.coefficient[:, None] * (seen - v)),
            edge=self.grid.spacing[0], dimension=3,
        )  # fmt: skip

    def save(self) -> dict[str, NDArray[Any]]:
        """The state."""
        gas = {f"gas_{name}": a for name, a in self.gas.save().items()}
        with tempfile.TemporaryDirectory() as folder:
            path = save(self.particles, Path(folder) / "particles.npz")
            kept = np.frombuffer(path.read_bytes(), dtype=np.uint8)
        return {**gas, **self.both.state(), "particles": kept}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Take a state."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "particles.npz"
            path.write_bytes(np.asarray(saved["particles"]).tobytes())
            restore(self.particles, path)
        self.gas.restore({n.removeprefix("gas_"): a for n, a in saved.items() if n[:4] == "gas_"})
        self.both.go_back(saved)
