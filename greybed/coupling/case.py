"""The case ``thermal-bed``: what its TOML file may say, and how it is run."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from greybed.core.config import choice, quantity, read_case, tables, whole
from greybed.core.errors import InputError
from greybed.core.packing import Packing
from greybed.core.walls import Wall
from greybed.coupling.case_walls import (
    HEAT,
    ConeTable,
    CylinderTable,
    DiscTable,
    MeshTable,
    PlaneTable,
    check_heat,
)
from greybed.coupling.results import ThermalResult
from greybed.coupling.rows import Rows
from greybed.coupling.thermal import Material, ThermalBed

MOST_REPEATS = 60  # of a solve whose conductivity depends on temperature
SETTLED = 1e-8  # change of the temperatures at which it is done [K]


@dataclass(frozen=True, kw_only=True)
class PackingTable:
    """``[packing]``."""

    file: Path  # relative to the case


@dataclass(frozen=True, kw_only=True)
class OpeningTable:
    """``[opening]``: what rays see that meet neither sphere nor wall; needed if there are any."""

    temperature: float | None = quantity("temperature", None, above=0.0)  # [K]
    heat: str = choice(HEAT, "fixed")

    def __post_init__(self) -> None:
        check_heat("the opening", self.temperature, self.heat)


@dataclass(frozen=True, kw_only=True)
class MaterialTable:
    """``[material]`` of the spheres and, for contacts, of the walls."""

    conductivity: float = quantity("conductivity", above=0.0)  # [W/m/K]
    density: float = quantity("density", above=0.0)  # [kg/m3]
    heat_capacity: float = quantity("heat capacity", above=0.0)  # [J/kg/K]
    emissivity: float = quantity("dimensionless", 1.0, above=0.0, at_most=1.0)  # [-]
    stiffness_ratio: float = quantity("dimensionless", 1.0, above=0.0)  # real over simulated [-]
    touching_gap: float = quantity("length", 0.0, at_least=0.0)  # [m]
    wall_conductivity: float | None = quantity("conductivity", None, above=0.0)  # None: isothermal
    # conductivity * (reference_temperature / T)^exponent; 1 is phonon scattering in ceramics
    conductivity_exponent: float = quantity("dimensionless", 0.0, at_least=-3.0, at_most=3.0)
    reference_temperature: float = quantity("temperature", 300.0, above=0.0)  # [K]


@dataclass(frozen=True, kw_only=True)
class RadiationTable:
    """``[radiation]``: where the view factors come from."""

    source: str = choice(("traced", "closure", "off"))
    rays: int = whole(10_000, at_least=1)  # per sphere, for traced [-]
    seed: int = whole(0, at_least=0)
    reflections: bool = False  # traced only: exchange factors instead of view factors
    strength: float = quantity("dimensionless", 1.0, above=0.0)  # on the exchange; 1 is physics
    closure: Path | None = None  # relative to the case, for closure

    def __post_init__(self) -> None:
        if (self.closure is None) == (self.source == "closure"):
            raise InputError('give closure = "path" with source = "closure", and only there.')
        if self.reflections and self.source != "traced":
            raise InputError(
                f'radiation.reflections = true needs source = "traced", not "{self.source}"; '
                "remove it or trace."
            )


@dataclass(frozen=True, kw_only=True)
class SolveTable:
    """``[solve]``."""

    mode: str = choice(("steady", "transient"), "steady")
    initial_temperature: float | None = quantity("temperature", None, above=0.0)  # [K]
    duration: float | None = quantity("time", None, above=0.0)  # transient only [s]
    dt: float | None = quantity("time", None, above=0.0)  # None adapts [s]
    # A plain number: an error of 1 degC is 1 K, not 274.15 K.
    temperature_tolerance: float = quantity("dimensionless", 0.05, above=0.0)  # per step [K]
    conduction: bool = True

    def __post_init__(self) -> None:
        if self.mode == "transient" and (self.duration is None or self.initial_temperature is None):
            raise InputError(
                'solve: mode = "transient" needs duration [s] and initial_temperature [K]; '
                "give both."
            )
        if self.mode == "steady" and (self.duration is not None or self.dt is not None):
            raise InputError(
                'solve: duration and dt mean nothing with mode = "steady"; remove them or set '
                'mode = "transient".'
            )


@dataclass(frozen=True, kw_only=True)
class ThermalCase:
    """A whole case file."""

    kind: str = choice(("thermal-bed",))
    packing: PackingTable
    wall: tuple[PlaneTable | CylinderTable | ConeTable | DiscTable | MeshTable, ...] = tables(
        "kind",
        {
            "plane": PlaneTable,
            "cylinder": CylinderTable,
            "cone": ConeTable,
            "disc": DiscTable,
            "mesh": MeshTable,
        },
        (),
    )
    opening: OpeningTable | None = None
    material: MaterialTable
    radiation: RadiationTable
    solve: SolveTable = SolveTable()

    def __post_init__(self) -> None:
        names = [w.name for w in self.wall]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise InputError(f"wall: name {twice[0]!r} is used twice; give every wall its own.")
        grey = [w for w in self.wall if w.emissivity < 1.0]
        if grey and not self.radiation.reflections:
            raise InputError(
                f"wall {grey[0].name!r}: emissivity = {grey[0].emissivity:g} [-] needs "
                "radiation.reflections = true; set it, or leave the emissivity out."
            )

    @property
    def walls(self) -> tuple[Wall, ...]:
        """The walls, in the order of the file."""
        return tuple(w.wall() for w in self.wall)


def load_case(path: str | os.PathLike[str]) -> ThermalCase:
    """Read and check a case file.

    Raises
    ------
    InputError
        In one sentence with file, key, value, unit, bound and remedy.
    """
    return read_case(path, ThermalCase)


def view_factors(
    case: ThermalCase, packing: Packing, *, threads: int | None = None, show: bool = False
) -> Rows | None:
    """Rows of view or exchange factors from where the case says, or None without radiation.

    With exchange factors adiabatic walls re-radiate all, the others have their emissivity.

    Parameters
    ----------
    case : ThermalCase
        The case.
    packing : Packing
        The bed with the walls of the case.
    threads : int or None
        For the ray tracer [-]; None takes all.
    show : bool
        Whether the ray tracer draws its progress.

    Raises
    ------
    InputError
        From the ray tracer, or for a closure that cannot be read or used on this bed.
    """
    radiation = case.radiation
    result: Any
    if radiation.source == "off":
        return None
    if radiation.source == "closure":
        from greybed import closures

        assert radiation.closure is not None  # checked by RadiationTable
        file = closures.model_path(radiation.closure)
        result = closures.load(file).bed_factors(packing)
    else:
        from greybed import raytrace

        how: dict[str, Any] = {
            "rays": radiation.rays,
            "seed": radiation.seed,
            "threads": threads,
            "show_progress": show,
        }
        if radiation.reflections:
            absorbs = [0.0 if w.temperature is None else w.emissivity for w in case.wall]
            grey = case.material.emissivity
            (result,) = raytrace.exchange_factors(
                packing, grey, wall_emissivity=absorbs if absorbs else 1.0, **how
            )
        else:
            result = raytrace.view_factors(packing, **how)
    rows = Rows.of(result, packing)
    return replace(rows, areas=rows.areas * radiation.strength)


def run_case(
    case: ThermalCase,
    packing: Packing,
    rows: Rows | None,
    *,
    on_progress: Callable[[float], object] | None = None,
) -> tuple[ThermalBed, ThermalResult]:
    """Solve a case whose packing and view factors are at hand.

    Parameters
    ----------
    case : ThermalCase
        The case.
    packing : Packing
        The bed with the walls of the case.
    rows : Rows or None
        From :func:`view_factors`.
    on_progress : callable, optional
        Called after every time step with the fraction of the duration that it covered [-].

    Returns
    -------
    bed : ThermalBed
        The model.
    result : ThermalResult
        Its answer.

    Raises
    ------
    InputError
        For a case that has no answer.
    SolverError
        If the solve does not converge.
    """
    m, solve, opening = case.material, case.solve, case.opening
    leaving = 0.0 if rows is None else float(rows.areas @ rows.escaped / rows.areas.sum())
    if opening is None and leaving > 0.0:
        raise InputError(
            f"{100.0 * leaving:.2g} % of the radiation of the bed meets neither sphere nor wall, "
            "but the case has no [opening]; give it one with a temperature or with "
            'heat = "adiabatic".'
        )
    material = Material(
        conductivity=m.conductivity,
        density=m.density,
        heat_capacity=m.heat_capacity,
        emissivity=m.emissivity,
        stiffness_ratio=m.stiffness_ratio,
        touching_gap=m.touching_gap,
    )

    def build(material: Material) -> ThermalBed:
        return ThermalBed(
            packing,
            rows,
            material=material,
            wall_temperatures=[w.temperature for w in case.wall],
            environment_temperature=None if opening is None else opening.temperature,
            conduction=solve.conduction,
            wall_conductivity=math.inf if m.wall_conductivity is None else m.wall_conductivity,
        )

    bed = build(material)
    if solve.mode == "steady":
        result = bed.steady(initial_temperature=solve.initial_temperature)
        if m.conductivity_exponent == 0.0:
            return bed, result
        return _variable_conductivity(m, material, build, result)
    if m.conductivity_exponent != 0.0:
        raise InputError(
            f"material.conductivity_exponent = {m.conductivity_exponent:g} [-] works with "
            'solve.mode = "steady" only; leave it out or set that mode.'
        )
    assert solve.duration is not None  # checked by SolveTable
    assert solve.initial_temperature is not None
    result = bed.run(
        solve.duration,
        initial_temperature=solve.initial_temperature,
        dt=solve.dt,
        temperature_tolerance=solve.temperature_tolerance,
        on_progress=on_progress,
    )
    return bed, result


def _variable_conductivity(
    m: MaterialTable,
    material: Material,
    build: Callable[[Material], ThermalBed],
    result: ThermalResult,
) -> tuple[ThermalBed, ThermalResult]:
    """Repeat the steady solve with each sphere's conductivity at its own temperature."""
    for _ in range(MOST_REPEATS):
        before = result.temperatures
        course = (m.reference_temperature / before) ** m.conductivity_exponent
        bed = build(replace(material, conductivity=m.conductivity * course))
        result = bed.steady(initial_temperature=before)
        if np.max(np.abs(result.temperatures - before)) < SETTLED:
            return bed, result
    raise InputError(
        f"the temperatures still move by {np.max(np.abs(result.temperatures - before)):.2g} K "
        f"after {MOST_REPEATS} repeats with material.conductivity_exponent = "
        f"{m.conductivity_exponent:g} [-]; take a smaller one."
    )


def summary(case: ThermalCase, bed: ThermalBed, result: ThermalResult) -> dict[str, Any]:
    """Plain numbers of a result, with units in their names, for ``summary.json``."""
    t = result.temperatures
    exchange = bed.network.exchange
    seen = 0.0
    if exchange is not None:
        seen = float(exchange.areas @ exchange.rows.escaped / exchange.areas.sum())
    names = [w.name for w in case.wall]
    flows = {
        name: {"conduction_W": conduction, "radiation_W": radiation}
        for name, conduction, radiation in zip(
            names, result.wall_conduction, result.wall_radiation, strict=True
        )
    }
    return {
        "kind": case.kind,
        "mode": case.solve.mode,
        "radiation": case.radiation.source,
        "spheres": len(t),
        "contacts": bed.contacts.n_contacts,
        "mean_temperature_K": float(np.average(t, weights=bed.capacity)),
        "lowest_temperature_K": t.min(),
        "highest_temperature_K": t.max(),
        "heat_into_bed": {**flows, "opening": {"radiation_W": result.opening_heat}},
        "energy_error": result.energy_error,
        "opening_view_factor": seen,
        "view_factor_imbalance": bed.imbalance,
        "isolated_spheres": len(result.isolated),
        "converged": result.status.converged,
        "status": result.status.reason,
        "newton_iterations": result.status.iterations,
        "time_s": result.time if math.isfinite(result.time) else None,
    }
