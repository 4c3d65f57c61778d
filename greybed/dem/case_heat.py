"""Heat of a case of particles: what its tables must say, and the temperatures that run along."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from greybed.core.errors import InputError
from greybed.dem.heat import Heat
from greybed.dem.measure_tables import ConductionTable
from greybed.dem.simulation import Simulation

if TYPE_CHECKING:
    from greybed.dem.case import ParticleCase


def check_heat(case: ParticleCase) -> None:
    """Refuse heat that lacks a number, and numbers of heat that nothing would read.

    Raises
    ------
    InputError
        With the table and the remedy.
    """
    walls = [wall.name for wall in case.wall if wall.temperature is not None]
    for table in case.measure:
        for name in table.walls if isinstance(table, ConductionTable) else ():
            if name not in walls:
                raise InputError(
                    f"measure {table.name!r}: no wall {name!r} has a temperature; those that have "
                    f"one are {', '.join(walls) or 'none'}."
                )
    if case.heat is None:
        warm = [f"wall {name!r}" for name in walls]
        warm += [f"particles[{k}]" for k, t in enumerate(case.particles) if t.temperature]
        if warm:
            raise InputError(
                f"{warm[0]} has a temperature, but the case has no [heat]; give [heat] with the "
                "temperature at the start, or take this one out."
            )
        return
    used = {table.material for table in case.particles}
    for material in case.material:
        for part, unit in (("conductivity", "W/m/K"), ("heat_capacity", "J/kg/K")):
            if material.name in used and getattr(material, part) is None:
                raise InputError(
                    f"material {material.name!r} has no {part}, which [heat] needs of what "
                    f"particles are made of; give it [{unit}]."
                )
    if any(getattr(table, "shape", None) is not None for table in case.particles):
        raise InputError(
            "[heat] knows spheres only: inside a body of several spheres no heat would flow; take "
            "the shapes out, or [heat]."
        )


def heat_of(
    case: ParticleCase, simulation: Simulation, names: Sequence[str], counts: Sequence[int]
) -> Heat | None:
    """Temperatures of a case at its start; None where it has no ``[heat]``.

    Parameters
    ----------
    case : ParticleCase
        The case.
    simulation : Simulation
        Its particles.
    names : sequence of str
        Materials in the order of the simulation.
    counts : sequence of int
        Particles that each table has at the start.
    """
    if case.heat is None:
        return None
    tables = {material.name: material for material in case.material}
    # Materials of walls alone may have none: their conductivity is never read.
    conductivity = [tables[name].conductivity or 1.0 for name in names]
    capacity = [tables[name].heat_capacity or 1.0 for name in names]
    warm = [start_of(case, k) for k in range(len(case.particles))]
    return Heat(
        simulation, conductivity, capacity, np.repeat(warm, counts),
        wall_temperatures={w.name: w.temperature for w in case.wall if w.temperature is not None},
        arriving=case.heat.temperature, stiffness_ratio=case.heat.stiffness_ratio,
    )  # fmt: skip


def start_of(case: ParticleCase, number: int) -> float:
    """Temperature with which particles of a table come [K]."""
    assert case.heat is not None
    own = case.particles[number].temperature
    return case.heat.temperature if own is None else own


def sample_of(case: ParticleCase, heat: Heat) -> dict[str, float]:
    """What a row of the history says of heat."""
    return {
        "mean temperature [K]": heat.mean,
        **{
            f"heat from {wall.name}{heat.beside} [J]": float(given)
            for wall, given in zip(case.wall, heat.from_walls, strict=True)
            if wall.temperature is not None
        },
    }


def heat_results(case: ParticleCase, heat: Heat, history: Sequence[dict[str, float]]) -> Any:
    """Temperatures at the end, and what walls have given."""
    t = heat.temperatures
    return {
        "mean_temperature_K": heat.mean,
        "lowest_temperature_K": float(t.min()),
        "highest_temperature_K": float(t.max()),
        "from_walls_J": {
            f"{wall.name}{heat.beside}": history[-1][f"heat from {wall.name}{heat.beside} [J]"]
            for wall in case.wall
            if wall.temperature is not None
        },
    }


def conduction(
    table: ConductionTable, simulation: Simulation, heat: Heat, history: Sequence[dict[str, float]]
) -> dict[str, Any]:
    """Effective conductivity: heat between two walls over area and gradient inside the bed.

    The gradient is that of a line through the temperatures of the particles between the two
    places: walls resist more than the bed does, so their temperatures would mislead.
    """
    found: dict[str, Any] = {"conductivity_W_per_m_K": None}
    time = np.array([row["time [s]"] for row in history])
    late = time >= (1.0 - table.share) * time[-1]
    axis = "xyz".index(table.axis)
    at = simulation.centres[:, axis]
    inside = (at > table.lower) & (at < table.upper)
    if late.sum() < 3 or inside.sum() < 10:
        return {**found, "why": "fewer than 3 samples or 10 particles; take more of them"}
    total = np.array([[row[f"heat from {wall} [J]"] for row in history] for wall in table.walls])
    given = np.polyfit(time[late], total[:, late].T, 1)[0]
    gradient = float(np.polyfit(at[inside], heat.temperatures[inside], 1)[0])
    flow = float(0.5 * (given[0] - given[1]))
    found |= {
        "heat_flow_W": flow,
        # Of the flow, what one wall gives and the other one does not take: 0 when steady.
        "imbalance": float(given.sum()) / flow if flow else None,
        "gradient_K_per_m": gradient,
    }
    if gradient:
        found["conductivity_W_per_m_K"] = abs(flow / (table.area * gradient))
    return found
