"""A small fluidised bed of 9,240 spheres: python examples/fluidised_bed/khawaja.py --out DIR.

The bed of Khawaja and of Muller's experiments: 1.2 mm, 1000 kg/m3, 43.2 x 10 x 124.8 mm, cells
12 x 1 x 26, air at 0.9 m/s. Spheres are softer than seeds, Young's modulus 1 MPa, so that a contact
takes some 20 steps of 20 microseconds. Writes history.csv and summary.json: height of the bed
(twice that of its centre of mass), pressure drop, time spent. Minutes on one core.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

from greybed.cfd.boundaries import Inflow, Outlet, Wall
from greybed.cfd.fluid import Fluid
from greybed.cfd.gas import GasSolver
from greybed.cfd.grid import Grid
from greybed.core import box_walls
from greybed.core.files import output_folder, write_summary
from greybed.coupling.drag_exchange import Settings
from greybed.coupling.gas_particles import GasParticles
from greybed.dem import Contact, Material, Simulation, SolidWall

N, D, SIZE, CELLS = 9240, 1.2e-3, (0.0432, 0.010, 0.1248), (12, 1, 26)
SPEED, AIR = 0.9, Fluid(density=1.2, viscosity=1.8e-5)
SEED = Material(1000.0, 1e6, 0.3, "seed")
SETTLE = 10_000  # steps


def particles(threads: int | None = None) -> Simulation:
    """Spheres on a loose lattice between walls."""
    nx, ny = 34, 8
    layers = -(-N // (nx * ny))
    at = np.stack(np.meshgrid(range(layers), range(ny), range(nx), indexing="ij"), -1)
    at = at.reshape(-1, 3)[:N, ::-1]
    rng = np.random.default_rng(0)
    centres = np.array([SIZE[0] / nx, SIZE[1] / ny, 1.25e-3]) * (at + 0.5)
    centres += rng.uniform(-2e-5, 2e-5, at.shape) + [0.0, 0.0, 1e-4]
    return Simulation(
        centres, 0.5 * D, SEED, Contact(0.98, 0.1), time_step=2e-5, threads=threads,
        walls=[SolidWall(w) for w in box_walls((0.0, 0.0, 0.0), SIZE)],
    )  # fmt: skip


def with_gas(simulation: Simulation, drag: str = "bvk") -> GasParticles:
    """The same with air from below."""
    sides = {"z-": Inflow(SPEED), "z+": Outlet(), "x-": Wall(), "x+": Wall()}
    gas = GasSolver(Grid(cells=CELLS, upper=SIZE), sides, AIR)
    return GasParticles(gas, simulation, Settings(drag=drag))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--time", type=float, default=1.0, help="of fluidisation [s]")
    parser.add_argument("--drag", default="bvk")
    parser.add_argument("--threads", type=int)
    given = parser.parse_args()
    out = output_folder(given.out)
    sim = particles(given.threads)
    sim.run(SETTLE)
    both = with_gas(sim, given.drag)
    started, cpu = time.perf_counter(), time.process_time()
    rows, worst = [], 0.0
    while both.time < given.time:
        report = both.step()
        worst = max(worst, report.defect)
        height = 2.0 * float(sim.centres[:, 2].mean())
        rows.append((both.time, height, float(both.gas.pressure[0].mean()), report.contact_steps))
    table = np.array(rows)
    np.savetxt(out / "history.csv", table, delimiter=",", comments="",
               header="time [s],height [m],pressure_drop [Pa],contact_steps")  # fmt: skip
    late = table[:, 0] > 0.4 * given.time
    weight = 9.81 * float(sim.masses.sum()) / (SIZE[0] * SIZE[1])
    write_summary(out, "khawaja", {
        "particles": N, "time": both.time, "gas_steps": both.steps,
        "settled_height": float(rows[0][1]), "mean_height": float(table[late, 1].mean()),
        "mean_pressure_drop": float(table[late, 2].mean()), "weight_over_area": weight,
        "largest_momentum_defect": worst, "wall_seconds": time.perf_counter() - started,
        "cpu_seconds": time.process_time() - cpu,
    })  # fmt: skip


if __name__ == "__main__":
    main()
