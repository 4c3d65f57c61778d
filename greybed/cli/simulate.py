"""Run a case from a TOML file: a bed between walls, particles that move, gas, or both together.

kind = "thermal-bed" writes temperatures.csv, bed.vtu (for ParaView) and summary.json; a transient
case also history.csv. kind = "particles" writes history.csv, final.h5, final.vtu, final.png,
frames.pvd with its frames (or frames.vtkhdf), and summary.json; stopped by Ctrl-C or a kill, it
goes on from its checkpoint when the same command is given again, and ends with the same bits.
kind = "gas-particles" is particles in a gas, "gas" a gas alone, "two-fluid" gas and particles as
two fluids; they write frames of the grid as frames.vtkhdf (gas_frames.vtkhdf beside particles).
--engine liggghts or lammps hands the same case to that engine and reads its results back
(docs/liggghts.md, docs/hosts.md).

examples:
  greybed simulate examples/heated_bed/case.toml --out runs/heated_bed
  greybed simulate examples/particles/hopper.toml --out runs/hopper --movie
  greybed simulate examples/flows/clusters.toml --out runs/clusters --movie
  greybed simulate examples/particles/hopper.toml --out runs/hopper2 --engine liggghts --ranks 2
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from greybed.cli.simulate_engine import run_engine
from greybed.cli.simulate_flow import run_flow
from greybed.cli.simulate_particles import run_particles
from greybed.core.config import read_toml
from greybed.core.errors import InputError
from greybed.core.files import atomic_path, write_summary
from greybed.core.folder_lock import locked_folder
from greybed.core.packing import Packing
from greybed.core.progress import progress

TICKS = 1000  # of a progress bar that counts a fraction


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of ``greybed simulate``."""
    parser.add_argument("case", type=Path, help="case file (TOML)")
    parser.add_argument("--out", type=Path, required=True, help="folder for the results")
    parser.add_argument("--threads", type=int, help="threads (default: all); changes no bit")
    parser.add_argument("--movie", action="store_true", help="movie.gif of the frames")
    parser.add_argument(
        "--engine", choices=("greybed", "liggghts", "lammps"), default="greybed",
        help="particles: who moves them (default: greybed); the others run through MPI",
    )  # fmt: skip
    parser.add_argument("--ranks", type=int, help="liggghts, lammps: MPI ranks (default: 1)")
    parser.add_argument(
        "--plugin",
        type=Path,
        metavar="FILE",
        help="made by greybed host: plugin of lammps, program of liggghts",
    )
    parser.add_argument(
        "--fix", action="append", default=[], metavar="WORDS",
        help="a fix of the plugin for all particles; may be repeated",
    )  # fmt: skip
    parser.add_argument("--quiet", action="store_true", help="no progress bars")


def run(options: argparse.Namespace) -> int:
    """Run the case that ``options`` names; returns 0."""
    # Loaded here so that --help answers at once.
    from greybed.core.readers import read_packing
    from greybed.core.writers import write_packing
    from greybed.coupling.case import load_case, run_case, summary, view_factors
    from greybed.coupling.case_walls import MeshTable

    if options.threads is not None and options.threads < 1:
        raise InputError(
            f"--threads = {options.threads} [-] must be at least 1; leave it out for all."
        )
    if options.ranks is not None and options.engine == "greybed":
        raise InputError(
            "--ranks is for --engine liggghts or lammps only; take --threads, or leave it out."
        )
    if (options.plugin is not None or options.fix) and options.engine == "greybed":
        raise InputError("--plugin and --fix are for --engine liggghts or lammps; leave them out.")
    kind = read_toml(options.case).get("kind")
    if kind == "particles" and options.engine != "greybed":
        return run_engine(options)
    if options.engine != "greybed":
        raise InputError(f"--engine {options.engine} is for particles only; leave it out.")
    if kind in ("particles", "gas-particles"):
        return run_particles(options, gas=kind == "gas-particles")
    if kind in ("two-fluid", "gas"):
        return run_flow(options, str(kind))
    if options.movie:
        raise InputError("--movie is for particles and flows only; leave it out.")
    case = load_case(options.case)
    with locked_folder(options.out) as folder:
        packing = read_packing(case.packing.file, walls=case.walls)
        show = not options.quiet
        rows = view_factors(case, packing, threads=options.threads, show=show)
        transient = case.solve.mode == "transient"
        with progress(TICKS, "heating", show=show and transient) as advance:
            done = 0.0

            def on_progress(fraction: float) -> None:
                nonlocal done
                before, done = done, done + fraction
                advance(round(done * TICKS) - round(before * TICKS))

            bed, result = run_case(case, packing, rows, on_progress=on_progress)

        inputs = [options.case, case.packing.file]
        inputs += [wall.file for wall in case.wall if isinstance(wall, MeshTable)]
        if case.radiation.closure is not None:
            inputs.append(case.radiation.closure)
        _write_temperatures(folder / "temperatures.csv", packing, result.temperatures)
        write_packing(packing, folder / "bed.vtu", fields={"temperature [K]": result.temperatures})
        if transient:
            names = [w.name for w in case.wall]
            _write_history(folder / "history.csv", result.history, names)
        results = summary(case, bed, result)
        write_summary(folder, "simulate", results, *inputs, seed=case.radiation.seed)

    print(f"{len(packing)} spheres, {results['status']}")
    t = result.temperatures
    print(
        f"temperature {t.min():.2f} to {t.max():.2f} K, mean {results['mean_temperature_K']:.2f} K"
    )
    for name, flow in results["heat_into_bed"].items():
        parts = ", ".join(f"{key[:-2]} {value:.5g} W" for key, value in flow.items())
        print(f"heat from {name}: {parts}")
    if case.opening is not None and rows is not None and results["opening_view_factor"] == 0.0:
        print(
            "note: no sphere sees the opening, because walls are unbounded (a cylinder closes its "
            "own top); for an open top add a plane with the temperature of the surroundings"
        )
    if len(result.isolated):
        print(f"{len(result.isolated)} spheres have no path to a temperature (see summary.json)")
    print(f"results in {folder}")
    return 0


def _write_temperatures(path: Path, packing: Packing, temperatures: np.ndarray) -> None:
    table = np.column_stack([packing.centres, packing.radii, temperatures])
    with atomic_path(path) as temporary, open(temporary, "w") as stream:
        stream.write("x [m],y [m],z [m],radius [m],temperature [K]\n")
        np.savetxt(stream, table, delimiter=",", fmt="%.9g")


def _write_history(path: Path, history: dict[str, np.ndarray], walls: list[str]) -> None:
    names = ("time", "mean", "lowest", "highest", "opening_heat", "stored", "supplied")
    units = ("s", "K", "K", "K", "W", "J", "J")
    header = [f"{name} [{unit}]" for name, unit in zip(names, units, strict=True)]
    header += [f"heat of {name} [W]" for name in walls]
    table = np.column_stack([*(history[name] for name in names), history["wall_heat"]])
    with atomic_path(path) as temporary, open(temporary, "w") as stream:
        stream.write(",".join(header) + "\n")
        np.savetxt(stream, table, delimiter=",", fmt="%.9g")
