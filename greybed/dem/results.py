"""Results of a run of particles: what the case asks to be measured at the end, flows from sinks."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from greybed.dem import measures
from greybed.dem.bulk_tests import filling_rate, shear_result, slip_result
from greybed.dem.case_heat import conduction, heat_results
from greybed.dem.measure_tables import (
    CompartmentsTable,
    ConductionTable,
    PileTable,
    ShearTable,
    SlipTable,
    StressTable,
)
from greybed.dem.samples import Run
from greybed.dem.simulation import Simulation
from greybed.dem.slopes import mean_slope, slope_now
from greybed.dem.stress import stress_in


def results_of(run: Run) -> dict[str, Any]:
    """Plain numbers of a run, with units in their names, for ``summary.json``."""
    sim, case, tally = run.simulation, run.case, run.tally
    last = tally.history[-1]
    energy = sim.energies
    return {
        "particles": 0 if run.emptied else sim.count_of(),
        "emptied": run.emptied,
        "steps": sim.steps,
        "time_step_s": sim.time_step,
        "simulated_s": sim.time,
        "mass_kg": float(sim.masses.sum()),
        "height_m": last["height [m]"],
        "coordination": last["coordination [-]"],
        "kinetic_energy_J": energy.kinetic,
        "inserted": list(tally.inserted),
        "shapes": {
            name: {
                "spheres": len(clump.radii),
                "volume_m3": clump.volume,
                "equivalent_radius_m": clump.equivalent_radius,
                "reach_m": clump.reach,
                **clump.shape_error,
            }
            for name, clump in run.shapes.items()
        },
        "bytes_per_particle": sim.bytes_per_particle,
        **({"heat": heat_results(case, run.heat, tally.history)} if run.heat else {}),
        "sinks": {
            sink.name: {
                "mass_kg": tally.sunk[k],
                "particles": tally.taken[k],
                **_flow(run, sink.name),
            }
            for k, sink in enumerate(case.sink)
        },
        "measures": {table.name: _measure(run, table) for table in case.measure},
    }


def _flow(run: Run, sink: str) -> dict[str, float | None]:
    """Mean rates into a sink while it takes its second to eighth tenth."""
    rows = run.tally.history
    time = np.array([row["time [s]"] for row in rows])
    rates: dict[str, float | None] = {}
    for name, unit, key in (("mass", "kg", "mass_kg_per_s"), ("particles", "-", "per_second")):
        total = np.array([row[f"{name} in {sink} [{unit}]"] for row in rows])
        inside = (total >= 0.1 * total[-1]) & (total <= 0.8 * total[-1])
        rates[key] = None
        if total[-1] > 0.0 and inside.sum() >= 3:
            rates[key] = float(np.polyfit(time[inside], total[inside], 1)[0])
    return rates


def _measure(run: Run, table: Any) -> dict[str, Any]:
    sim = run.simulation
    x, r = sim.centres, sim.radii
    if isinstance(table, PileTable):
        return {**slope_now(sim, table), **mean_slope(table, run.tally.history)}
    if isinstance(table, CompartmentsTable):
        edges = np.linspace(table.lower, table.upper, table.count + 1)
        shares, intensity = measures.segregation(
            x, sim.masses, sim.kinds, edges, axis="xyz".index(table.axis)
        )
        return {
            "edges_m": edges.tolist(),
            "mass_shares": [[None if math.isnan(v) else v for v in row] for row in shares.tolist()],
            "materials": [m.name for m in sim.materials[: shares.shape[1]]],
            "intensity_of_segregation": None if math.isnan(intensity) else intensity,
        }
    if isinstance(table, StressTable):
        assert isinstance(sim, Simulation)  # no other engine tells its contacts
        tensor = stress_in(sim, table.lower, table.upper)
        return {"stress_Pa": tensor.tolist(), "pressure_Pa": float(np.trace(tensor)) / 3.0}
    if isinstance(table, ShearTable):
        return shear_result(table, run.tally.history)
    if isinstance(table, SlipTable):
        return slip_result(table, run.tally.history)
    if isinstance(table, ConductionTable):
        assert run.heat is not None  # the case has been checked
        assert isinstance(sim, Simulation)
        return conduction(table, sim, run.heat, run.tally.history)
    density = np.array([material.density for material in sim.materials])[sim.kinds]
    field = measures.solid_field(
        x, r, table.lower, table.upper, (1, 1, 1), volumes=sim.masses / density
    )
    inside = ((x > np.array(table.lower)) & (x < np.array(table.upper))).all(axis=1)
    return {
        "solid_fraction": float(field[0, 0, 0]),
        "mass_kg": float(sim.masses[inside].sum()),
        "particles": int(inside.sum()),
        "mass_kg_per_s": filling_rate(run.tally.history, table.name),
    }
