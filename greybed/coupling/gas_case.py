"""The case ``gas``: a gas alone, or through a bed that does not move."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed.cfd.gas import GasSolver
from greybed.closures.drag import drag_law
from greybed.core.config import choice, quantity, read_case, tables, vector, whole
from greybed.core.errors import InputError
from greybed.coupling.flow_tables import (
    SIDE_KINDS,
    FlowOutput,
    GridTable,
    SideTable,
    check_cells,
    check_sides,
)
from greybed.coupling.gas_tables import GasTable, gas_sides
from greybed.coupling.two_fluid_case import centred

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class BedTable:
    """``[bed]``: particles at rest in a region, as a drag."""

    fraction: float = quantity("dimensionless", above=0.0, at_most=0.99)  # solid fraction [-]
    diameter: float = quantity("length", above=0.0)  # [m]
    drag: str = "ergun"
    lower: tuple[float, float, float] | None = vector("length", None)  # all by default [m]
    upper: tuple[float, float, float] | None = vector("length", None)

    def __post_init__(self) -> None:
        drag_law(self.drag)
        if self.fraction > 0.74:
            raise InputError(
                f"fraction = {self.fraction:g} [-] exceeds the densest packing of equal spheres, "
                "0.74; take less."
            )


@dataclass(frozen=True, kw_only=True)
class GasCase:
    """A whole case file."""

    kind: str = choice(("gas",))
    duration: float = quantity("time", above=0.0)  # [s]
    time_step: float = quantity("time", math.inf, above=0.0)  # at most [s]
    courant: float = quantity("dimensionless", 0.4, above=0.0, at_most=1.0)  # [-]
    gravity: tuple[float, float, float] = vector("acceleration", (0.0, 0.0, 0.0))  # [m/s2]
    # Imposed along axes that repeat [Pa/m].
    gradient: tuple[float, float, float] = vector("pressure gradient", (0.0, 0.0, 0.0))
    model: str = choice(("A", "B"), "A")
    seed: int = whole(0, at_least=0)  # of nothing random; for the record
    tolerance: float = quantity("dimensionless", 1e-8, above=0.0, at_most=0.1)  # of pressure [-]
    grid: GridTable
    gas: GasTable
    side: tuple[SideTable, ...] = tables("kind", SIDE_KINDS, ())
    bed: BedTable | None = None
    output: FlowOutput

    def __post_init__(self) -> None:
        check_sides(self.side, self.grid)
        if self.bed is not None:
            check_cells(self.grid, self.bed.diameter)
        warm = [s.name for s in self.side if s.temperature is not None]
        if warm and not self.warm:
            raise InputError(
                f"side {warm[0]!r} has a temperature and [gas] none; give it one [K], or take the "
                "side's out."
            )

    @property
    def warm(self) -> bool:
        """Whether the temperature is solved for."""
        return self.gas.temperature is not None


class GasRun:
    """A gas that runs, a :class:`greybed.coupling.flow_run.Flow`."""

    def __init__(self, case: GasCase) -> None:
        self.case = case
        grid = case.grid.grid
        self.void = np.ones(grid.shape)
        bed = case.bed
        if bed is not None:
            inside = np.ones(grid.shape, bool)
            for axis in range(3):
                x = grid.centres(axis)
                low, high = (bed.lower or grid.lower)[axis], (bed.upper or grid.upper)[axis]
                part = (x > low) & (x < high)
                inside &= part.reshape([-1 if k == 2 - axis else 1 for k in range(3)])
            self.void[inside] = 1.0 - bed.fraction
        self.solver = GasSolver(
            grid, gas_sides(case.side), case.gas.fluid, model=case.model, gravity=case.gravity,
            gradient=case.gradient, void_fraction=self.void, tolerance=case.tolerance,
            temperature=case.gas.temperature,
        )  # fmt: skip
        self.steps = 0
        self.iterations = 0
        self.divergence = 0.0

    @property
    def time(self) -> float:
        """[s]."""
        return self.solver.time

    def run(self, duration: float, each: Callable[[], object]) -> None:
        """Go on for so long [s]; ``each`` is called after every step."""
        end = self.time + duration
        while end - self.time > 1e-12 * max(end, duration):
            left = end - self.time
            dt = min(left, self.solver.time_step(self.case.courant, self.case.time_step))
            # Two equal steps rather than a long one and a sliver.
            dt = 0.5 * left if dt < left < 2.0 * dt else dt
            report = self.solver.step(dt, drag=self._drag())
            self.steps += 1
            self.iterations += report.iterations
            self.divergence = max(self.divergence, report.divergence)
            each()

    def _drag(self) -> tuple[Array, Array, Array] | None:
        """Drag coefficients of the bed on faces [kg/m3/s]."""
        bed, fluid = self.case.bed, self.solver.fluid
        if bed is None:
            return None
        speed = np.sqrt((centred(self.solver.velocity) ** 2).sum(axis=-1))
        phi, void = 1.0 - self.void, self.void
        density = self.solver.state.mass / void
        re = void * density * bed.diameter * speed / fluid.viscosity
        force = drag_law(bed.drag)(phi, re)
        beta = 18.0 * fluid.viscosity * void * phi * force / bed.diameter**2
        found = []
        for axis in range(3):
            a = np.moveaxis(beta, 2 - axis, 0)
            low, high = a[:1], a[-1:]
            if self.solver.grid.periodic[axis]:
                low, high = a[-1:], a[:1]
            a = np.concatenate([low, a, high])
            found.append(np.ascontiguousarray(np.moveaxis(0.5 * (a[1:] + a[:-1]), 0, 2 - axis)))
        return found[0], found[1], found[2]

    def sample(self) -> dict[str, float]:
        """Speed, pressure drops, temperature."""
        s = self.solver
        v = centred(s.velocity)
        row = {
            f"mean superficial velocity {name} [m/s]": float((self.void * v[..., axis]).mean())
            for axis, name in enumerate("xyz")
        }
        row["highest speed [m/s]"] = float(np.sqrt((v**2).sum(axis=-1)).max())
        for axis, name in enumerate("xyz"):
            if s.grid.cells[axis] > 1 and not s.grid.periodic[axis]:
                a = np.moveaxis(s.pressure, 2 - axis, 0)
                drop = 1.5 * a[0] - 0.5 * a[1] - 1.5 * a[-1] + 0.5 * a[-2]
                row[f"pressure drop along {name} [Pa]"] = float(drop.mean())
        if self.case.warm:
            row["mean temperature [K]"] = float(s.temperature.mean())
        if s.sealed:
            row["mean pressure [Pa]"] = s.mean_pressure
        return row

    def fields(self) -> dict[str, Array]:
        """Cell values for frames: scalars [z, y, x], vectors [z, y, x, 3]."""
        v = centred(self.solver.velocity)
        found = {
            "speed [m/s]": np.sqrt((v**2).sum(axis=-1)),
            "velocity [m/s]": v,
            "pressure [Pa]": self.solver.pressure,
            "void fraction [-]": self.void,
        }
        if self.case.warm:
            found["temperature [K]"] = self.solver.temperature
        return found

    def limits(self, field: str) -> tuple[float, float] | None:
        """Values of the first and last colour of a picture; its own range."""
        return None

    def results(self) -> dict[str, Any]:
        """Plain numbers at the end."""
        row = self.sample()
        drops = {
            f"pressure_drop_{name}_Pa": row[key]
            for name in "xyz"
            if (key := f"pressure drop along {name} [Pa]") in row
        }
        return {
            "mean_superficial_velocity_m_per_s": [
                row[f"mean superficial velocity {name} [m/s]"] for name in "xyz"
            ],
            **drops,
            **({"mean_pressure_Pa": self.solver.mean_pressure} if self.solver.sealed else {}),
            "pressure_iterations": self.iterations,
            "largest_divergence": self.divergence,
        }

    def save(self) -> dict[str, Array]:
        """The state as arrays."""
        numbers = np.array([self.steps, self.iterations, self.divergence])
        return {**self.solver.save(), "numbers_of_run": numbers}

    def restore(self, saved: dict[str, Array]) -> None:
        """Take up what :meth:`save` gave."""
        self.solver.restore(saved)
        steps, iterations, self.divergence = saved["numbers_of_run"].tolist()
        self.steps, self.iterations = int(steps), int(iterations)


def load_gas_case(path: str | os.PathLike[str]) -> GasCase:
    """Read and check a case file.

    Raises
    ------
    InputError
        In one sentence with file, key, value, unit, bound and remedy.
    """
    return read_case(path, GasCase)
