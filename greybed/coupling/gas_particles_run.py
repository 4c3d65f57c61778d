"""Run of a case of particles in a gas: the particles' loop with gas steps in it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed.cfd.gas import GasSolver
from greybed.closures.drag import drag_law
from greybed.closures.drag.filtered import Material
from greybed.core.errors import InputError
from greybed.core.packing import Packing
from greybed.coupling.drag_exchange import Settings
from greybed.coupling.filtered_drag import filtered_drag
from greybed.coupling.gas_heat import BedRadiation, GasHeat, prandtl_of
from greybed.coupling.gas_particles import ExchangeReport, GasParticles
from greybed.coupling.gas_particles_case import GasParticlesCase
from greybed.coupling.gas_tables import gas_sides
from greybed.coupling.rows import Rows
from greybed.coupling.two_fluid_case import centred
from greybed.dem.runner import ParticleRun
from greybed.dem.simulation import Simulation

Array = NDArray[np.float64]

# What is added up over a run.
_FROM_GAS, _LIGHT = "heat from the gas [J]", "heat by radiation from walls and opening [J]"
_SUMS = (
    "gas steps", "pressure iterations", "lower limit of void fraction reached", _FROM_GAS, _LIGHT,
)  # fmt: skip


class GasParticlesRun(ParticleRun):
    """A case of particles in a gas that runs, from its start or a checkpoint.

    Parameters
    ----------
    case : GasParticlesCase
        The case.
    packings : mapping of table numbers to Packing
        Contents of the files that ``[[particles]]`` of kind ``file`` name.
    threads : int, optional
        Threads; they change no bit.

    Attributes
    ----------
    gas : GasSolver
        The gas.
    coupled : GasParticles
        Both together.

    Raises
    ------
    InputError
        For what the particles or the gas refuse.
    """

    case: GasParticlesCase

    def __init__(
        self, case: GasParticlesCase, packings: dict[int, Packing], *, threads: int | None = None
    ) -> None:
        self.totals = dict.fromkeys(_SUMS, 0.0)
        self.worst = {"momentum": 0.0, "energy": 0.0, "divergence": 0.0}
        self.last: ExchangeReport | None = None
        self.coupled: GasParticles | None = None
        super().__init__(case, packings, threads=threads)
        warm = case.gas_heat
        self.gas = GasSolver(
            case.grid.grid, gas_sides(case.side), case.gas.fluid, model=case.model,
            gravity=case.gravity if case.gas_gravity else (0.0, 0.0, 0.0),
            gradient=case.gradient, tolerance=case.tolerance,
            temperature=None if warm is None else case.gas.temperature,
        )  # fmt: skip
        heat = None
        if warm is not None:
            assert self.heat is not None  # the case has been checked
            heat = GasHeat(
                self.heat, case.gas.conductivity,
                prandtl_of(self.gas, case.gas.heat_capacity, case.gas.conductivity),
                nusselt=warm.nusselt, radiation=self._radiation(), contacts=warm.contacts,
            )  # fmt: skip
        self.coupled = GasParticles(self.gas, self.simulation, self._settings(), heat=heat)
        self.tally.history[0] |= self._gas_sample()

    def _settings(self) -> Settings:
        """How gas and particles act on each other, filtered drag with the mean particle."""
        case, table = self.case, self.case.coupling
        if table.correction is None:
            return table.settings
        state = self.simulation._state
        radius = float(state.place[:, 3].mean())
        volume = float((4.0 / 3.0 * math.pi * state.place[:, 3] ** 3).sum())
        fluid = case.gas.fluid
        material = Material(
            2.0 * radius, float(state.motion[:, 6].sum()) / volume, fluid.density,
            fluid.viscosity, math.hypot(*case.gravity),
        )  # fmt: skip
        correction = filtered_drag(
            table.correction, material, drag_law(table.drag), case.gravity,
            filter_ratio=table.filter_ratio, gas_weight=case.gas_gravity,
        )  # fmt: skip
        return replace(table.settings, correction=correction)

    def _radiation(self) -> BedRadiation | None:
        warm, case = self.case.gas_heat, self.case
        assert warm is not None
        if warm.radiation == "off":
            return None
        shapes = [wall.wall() for wall in case.wall]
        closure: Any = None
        if warm.radiation == "closure":
            from greybed import closures

            closure = closures.load(closures.model_path(warm.closure))

        def rows(simulation: Simulation) -> Rows:
            bed = Packing(simulation.centres, simulation.radii, walls=shapes)
            if closure is not None:
                found: Rows = closure.bed_factors(bed)
                return found
            from greybed import raytrace

            traced: Any = raytrace.view_factors(bed, rays=warm.rays, seed=case.seed)
            return traced

        return BedRadiation(
            rows, warm.emissivity, wall_temperatures=[wall.temperature for wall in case.wall],
            environment_temperature=warm.surroundings, every=warm.every,
        )  # fmt: skip

    # -- time -------------------------------------------------------------------------------

    def _move(self, steps: int) -> None:
        """Gas steps that end together with these steps of the particles."""
        assert self.coupled is not None
        table = self.case.coupling
        left = steps
        while left:
            # Parts of near equal length: gas that is pushed out by particles feels a jump.
            parts = -(-left // self.coupled.steps_for(table.courant, table.most_steps))
            count = -(-left // parts)
            report = self.coupled.step(count)
            left -= count
            self.last = report
            self.totals["gas steps"] += 1
            self.totals["pressure iterations"] += self.coupled.gas_report.iterations
            self.totals["lower limit of void fraction reached"] += report.limited > 0
            left_over = float(self.coupled.gas_report.divergence)
            self.worst["divergence"] = max(self.worst["divergence"], left_over)
            self.worst["momentum"] = max(self.worst["momentum"], report.defect)
            if self.coupled.heat is not None and self.coupled.heat.report is not None:
                warm = self.coupled.heat.report
                self.worst["energy"] = max(self.worst["energy"], warm.defect)
                self.totals[_FROM_GAS] += warm.from_gas
                self.totals[_LIGHT] += warm.from_surroundings

    def _warm(self) -> None:
        """Heat through contacts goes with the gas's steps, if at all."""
        if self.case.gas_heat is None:
            super()._warm()

    # -- what comes out ---------------------------------------------------------------------

    def _gas_sample(self) -> dict[str, float]:
        """Numbers of the gas for the history."""
        if self.coupled is None:
            return {}
        grid, p = self.gas.grid, self.gas.pressure
        row: dict[str, float] = {}
        for axis, name in enumerate("xyz"):
            if grid.cells[axis] > 1 and not grid.periodic[axis]:
                a = np.moveaxis(p, 2 - axis, 0)
                drop = 1.5 * a[0] - 0.5 * a[1] - 1.5 * a[-1] + 0.5 * a[-2]
                row[f"pressure drop along {name} [Pa]"] = float(drop.mean())
        row["lowest void fraction [-]"] = self.coupled.least_void
        if self.last is not None:
            for axis, name in enumerate("xyz"):
                force = (self.last.given[axis] + self.last.pressure[axis]) / self.last.dt
                row[f"force {name} of the gas [N]"] = float(force)
        else:
            row |= {f"force {name} of the gas [N]": 0.0 for name in "xyz"}
        if self.case.gas_heat is not None:
            row["mean gas temperature [K]"] = float(self.gas.temperature.mean())
            # With what walls give through contacts, this is all that the particles gain.
            row |= {name: self.totals[name] for name in (_FROM_GAS, _LIGHT)}
        if self.gas.sealed:
            row["mean pressure [Pa]"] = self.gas.mean_pressure
        return row

    def _note(self) -> None:
        super()._note()
        self.tally.history[-1] |= self._gas_sample()

    def gas_fields(self) -> dict[str, Array]:
        """Cell values of a frame: scalars [z, y, x], vectors [z, y, x, 3]."""
        assert self.coupled is not None
        found = {
            "void fraction [-]": self.coupled.void,
            "pressure [Pa]": self.gas.pressure,
            "gas velocity [m/s]": centred(self.gas.velocity),
        }
        if self.case.gas_heat is not None:
            found["temperature [K]"] = self.gas.temperature
        return found

    def gas_results(self) -> dict[str, Any]:
        """Plain numbers at the end."""
        steps = int(self.totals["gas steps"])
        return {
            "gas": {
                "cells": int(np.prod(self.gas.grid.cells)),
                "steps": steps,
                "steps_with_void_fraction_limited": int(
                    self.totals["lower limit of void fraction reached"]
                ),
                "pressure_iterations": int(self.totals["pressure iterations"]),
                "largest_divergence": self.worst["divergence"],
                "largest_momentum_defect": self.worst["momentum"],
                **(
                    {"largest_energy_defect": self.worst["energy"]}
                    if self.case.gas_heat is not None
                    else {}
                ),
                **{
                    k: v
                    for k, v in self._gas_sample().items()
                    if k.startswith(("pressure drop", "heat", "mean pressure"))
                },
            }
        }

    # -- files ------------------------------------------------------------------------------

    def _beside(self) -> dict[str, NDArray[Any]]:
        assert self.coupled is not None
        gas = {f"gas_{name}": a for name, a in self.gas.save().items()}
        sums = np.array([*self.totals.values(), *self.worst.values()])
        return {**super()._beside(), **gas, **self.coupled.state(), "gas_sums": sums}

    def _take_up(self, beside: dict[str, NDArray[Any]]) -> None:
        assert self.coupled is not None
        super()._take_up(beside)
        if "gas_sums" not in beside:
            raise InputError("this checkpoint holds no gas; give the case that wrote it.")
        sums = beside["gas_sums"].tolist()
        if len(sums) != len(self.totals) + len(self.worst):
            raise InputError("this checkpoint is of another version; remove it, and run again.")
        self.totals = dict(zip(self.totals, sums, strict=False))
        self.worst = dict(zip(self.worst, sums[len(self.totals) :], strict=True))
        self.gas.restore({n.removeprefix("gas_"): a for n, a in beside.items() if n[:4] == "gas_"})
        self.coupled.go_back(beside)
