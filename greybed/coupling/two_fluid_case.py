"""The case ``two-fluid``: what its TOML file may say, and the run that it starts."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed.cfd import rims
from greybed.cfd.kinetic import Granular
from greybed.cfd.twofluid import TwoFluid
from greybed.closures.drag import drag_law
from greybed.closures.drag.filtered import Material
from greybed.core.config import choice, quantity, read_case, tables, vector, whole
from greybed.core.errors import InputError
from greybed.coupling.filtered_drag import FilteredDrag, filtered_drag
from greybed.coupling.flow_tables import (
    SIDE_KINDS,
    FlowOutput,
    GridTable,
    InflowSide,
    OutletSide,
    SideTable,
    check_cells,
    check_sides,
)

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class TwoFluidGas:
    """``[gas]``."""

    density: float = quantity("density", above=0.0)  # [kg/m3]
    viscosity: float = quantity("viscosity", above=0.0)  # [Pa s]


@dataclass(frozen=True, kw_only=True)
class SolidsTable:
    """``[solids]``: particles as a continuum, and where they are at the start."""

    density: float = quantity("density", above=0.0)  # [kg/m3]
    diameter: float = quantity("length", above=0.0)  # [m]
    fraction: float = quantity("dimensionless", above=0.0, at_most=0.99)  # at the start [-]
    # The region that they fill at the start; the whole box by default [m].
    lower: tuple[float, float, float] | None = vector("length", None)
    upper: tuple[float, float, float] | None = vector("length", None)
    # Random part of the fraction, uniform between -1 and 1 times it [-].
    perturbation: float = quantity("dimensionless", 0.0, at_least=0.0, at_most=1.0)
    restitution: float = quantity("dimensionless", 0.9, above=0.0, at_most=1.0)  # [-]
    packing: float = quantity("dimensionless", 0.63, above=0.0, at_most=0.99)  # [-]
    friction_onset: float = quantity("dimensionless", 0.5, at_least=0.0)  # [-]

    def __post_init__(self) -> None:
        most = self.fraction * (1.0 + self.perturbation)
        if most >= self.packing:
            raise InputError(
                f"fraction = {self.fraction:g} [-] reaches {most:g} with its perturbation, and the "
                f"packing is {self.packing:g}; take less."
            )


@dataclass(frozen=True, kw_only=True)
class TwoFluidCase:
    """A whole case file."""

    kind: str = choice(("two-fluid",))
    duration: float = quantity("time", above=0.0)  # [s]
    time_step: float | None = quantity("time", None, above=0.0)  # [s]; chosen by default
    longest_step: float = quantity("time", math.inf, above=0.0)  # [s]
    courant: float = quantity("dimensionless", 0.3, above=0.0, at_most=0.5)  # [-]
    gravity: tuple[float, float, float] = vector("acceleration", (0.0, -9.81, 0.0))  # [m/s2]
    seed: int = whole(0, at_least=0)
    tolerance: float = quantity("dimensionless", 1e-6, above=0.0, at_most=0.1)  # of pressure [-]
    drag: str = "wen-yu"
    # Filtered drag: radl-sundaresan, igci, milioli, a .closure file or shipped:NAME.
    correction: Path | None = None
    filter_ratio: float = quantity("dimensionless", 1.0)  # size of a filter over a cell's [-]
    grid: GridTable
    gas: TwoFluidGas
    solids: SolidsTable
    side: tuple[SideTable, ...] = tables("kind", SIDE_KINDS, ())
    output: FlowOutput = field()

    def __post_init__(self) -> None:
        drag_law(self.drag)
        check_sides(self.side, self.grid)
        check_cells(self.grid, self.solids.diameter)
        self.filtered()
        warm = [s for s in self.side if s.temperature is not None]
        if warm:
            raise InputError(
                f"side {warm[0].name!r}: the two-fluid solver has no temperatures; take it out."
            )

    def start(self) -> Array:
        """Solid fractions of the cells at the start [z, y, x]."""
        grid = self.grid.grid
        solids = self.solids
        noise = np.random.default_rng(self.seed).uniform(-1.0, 1.0, grid.shape)
        phi = solids.fraction * (1.0 + solids.perturbation * noise)
        lower = solids.lower or grid.lower
        upper = solids.upper or grid.upper
        for axis in range(3):
            x = grid.centres(axis)
            inside = (x > lower[axis]) & (x < upper[axis])
            phi = phi * inside.reshape([-1 if k == 2 - axis else 1 for k in range(3)])
        if not phi.any():
            raise InputError("solids: lower and upper hold no cell; widen the region.")
        return phi

    def filtered(self) -> FilteredDrag | None:
        """The correction of drag, if there is one."""
        if self.correction is None:
            return None
        material = Material(
            self.solids.diameter, self.solids.density, self.gas.density, self.gas.viscosity,
            math.hypot(*self.gravity),
        )  # fmt: skip
        return filtered_drag(
            self.correction, material, drag_law(self.drag), self.gravity,
            filter_ratio=self.filter_ratio,
        )  # fmt: skip

    def solver(self, correction: FilteredDrag | None = None) -> TwoFluid:
        """The solver at the start, with a correction of the drag that :meth:`filtered` made."""
        solids = self.solids
        made: dict[str, rims.Side] = {}
        for side in self.side:
            if isinstance(side, InflowSide):
                made[side.name] = rims.Inflow(side.velocity)
            elif isinstance(side, OutletSide):
                made[side.name] = rims.Outlet()
            else:
                made[side.name] = rims.Wall(side.specularity, side.slip)
        return TwoFluid(
            self.grid.grid, self.start(),
            particle_density=solids.density, diameter=solids.diameter,
            gas_density=self.gas.density, gas_viscosity=self.gas.viscosity,
            drag=drag_law(self.drag),
            granular=Granular(
                restitution=solids.restitution, packing=solids.packing,
                friction_onset=solids.friction_onset,
            ),
            gravity=self.gravity, sides=made, time_step=self.time_step, courant=self.courant,
            longest_step=self.longest_step, tolerance=self.tolerance,
            correction=correction,
        )  # fmt: skip


class TwoFluidRun:
    """A case that runs, a :class:`greybed.coupling.flow_run.Flow`."""

    def __init__(self, case: TwoFluidCase) -> None:
        self.case, self.filtered = case, case.filtered()
        self.solver = case.solver(self.filtered)
        self.iterations = 0

    @property
    def time(self) -> float:
        """[s]."""
        return self.solver.time

    @property
    def steps(self) -> int:
        """Since the start."""
        return self.solver.steps

    def run(self, duration: float, each: Callable[[], object]) -> None:
        """Go on for so long [s]; ``each`` is called after every step."""

        def count(solver: TwoFluid) -> None:
            self.iterations += solver.pressure_iterations
            each()

        self.solver.run(duration, count)

    def sample(self) -> dict[str, float]:
        """Means over the box."""
        means, solver = self.solver.means, self.solver
        row = {
            "solids mass [kg]": solver.solids_mass,
            "solid fraction [-]": means.solid_fraction,
            "variance of solid fraction [-]": means.fraction_variance,
            "highest solid fraction [-]": float(solver.solid_fraction.max()),
        }
        for axis, slip in zip("xyz", means.slip, strict=True):
            row[f"slip {axis} [m/s]"] = slip
        return row

    def fields(self) -> dict[str, Array]:
        """Cell values for frames: scalars [z, y, x], vectors [z, y, x, 3]."""
        s = self.solver
        return {
            "solid fraction [-]": s.solid_fraction,
            "pressure [Pa]": s.pressure,
            "gas velocity [m/s]": centred(s.gas_velocity),
            "solids velocity [m/s]": centred(s.solids_velocity),
            "granular temperature [m2/s2]": s.granular_temperature,
        }

    def limits(self, field: str) -> tuple[float, float] | None:
        """Values of the first and last colour of a picture."""
        return (0.0, self.case.solids.packing) if field == "solid fraction [-]" else None

    def results(self) -> dict[str, Any]:
        """Plain numbers at the end."""
        means = self.solver.means
        found: dict[str, Any] = {}
        if self.filtered is not None and self.case.correction is not None:
            found["drag_correction"] = self.case.correction.name
            found["drag_correction_extrapolated"] = self.filtered.extrapolated
        return {
            **found,
            "solids_mass_kg": self.solver.solids_mass,
            "mean_solid_fraction": means.solid_fraction,
            "mean_slip_m_per_s": list(means.slip),
            "pressure_gradient_Pa_per_m": list(self.solver.pressure_gradient),
            "pressure_iterations": self.iterations,
        }

    def save(self) -> dict[str, Array]:
        """The state as arrays."""
        return {**self.solver.save(), "iterations": np.array([self.iterations])}

    def restore(self, saved: dict[str, Array]) -> None:
        """Take up what :meth:`save` gave."""
        self.solver.restore(saved)
        self.iterations = int(saved["iterations"][0])


def centred(faces: tuple[Array, Array, Array]) -> Array:
    """Face velocities as vectors in the cells [z, y, x, 3]."""
    parts = []
    for axis, u in enumerate(faces):
        a = np.moveaxis(u, 2 - axis, 0)
        parts.append(np.moveaxis(0.5 * (a[1:] + a[:-1]), 0, 2 - axis))
    return np.stack(parts, axis=-1)


def load_two_fluid_case(path: str | os.PathLike[str]) -> TwoFluidCase:
    """Read and check a case file.

    Raises
    ------
    InputError
        In one sentence with file, key, value, unit, bound and remedy.
    """
    return read_case(path, TwoFluidCase)
