"""A small fluidised bed of 9,240 spheres: python examples/fluidised_bed/khawaja.py --out DIR.

Case B of Khawaja, J. Comput. Multiphase Flows 7 (2015) 227, with the numbers that
CFDEMcoupling-PFM has for it (tutorials/cfdemSolverPiso/bubblingFluidizedBed): 1.2 mm, 1000 kg/m3,
a box of 43.2 x 10 x 124.8 mm, cells 12 x 1 x 26, air of 1.13 kg/m3 that rises to 0.66 m/s within
0.1 s and slides along walls, front and back without friction. Spheres are softer than there,
Young's modulus 1 MPa instead of 120 MPa, so that a contact takes some 20 steps of 20 microseconds.
As in that case the gas begins one layer of cells under the floor of the spheres (--below) and the
run takes 2.1 s. Writes history.csv, khawaja.png, bed.png and summary.json: heights of the bed,
pressure drop, time spent. Minutes on one core.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
from scipy.signal import find_peaks

from greybed.cfd.boundaries import Inflow, Outlet, Wall
from greybed.cfd.fluid import Fluid
from greybed.cfd.gas import GasSolver
from greybed.cfd.grid import Grid
from greybed.core import Plane
from greybed.core.files import output_folder, write_summary
from greybed.coupling.drag_exchange import Settings
from greybed.coupling.gas_particles import GasParticles
from greybed.dem import Contact, Material, Simulation, SolidWall

N, D, SIZE, CELLS = 9240, 1.2e-3, (0.0432, 0.010, 0.1248), (12, 1, 26)
SPEED, AIR = 0.66, Fluid(density=1.13, viscosity=1.13 * 14.88e-6)
RAMP = 0.1  # of the inflow [s]
SEED, SMOOTH = Material(1000.0, 1e6, 0.3, "seed"), Material(1000.0, 1e6, 0.3, "smooth")
SETTLE = 10_000  # steps
MEASURED = 0.050  # "bed expansion observed in experiment", by the same source [m]
HEIGHTS = ("twice_the_centre", "surface", "ninety_ninth_percentile", "top_of_all")
LATE = 0.4  # from when on means are taken [s]


def particles(threads: int | None = None) -> Simulation:
    """Spheres on a loose lattice between walls."""
    nx, ny = 34, 8
    layers = -(-N // (nx * ny))
    at = np.stack(np.meshgrid(range(layers), range(ny), range(nx), indexing="ij"), -1)
    at = at.reshape(-1, 3)[:N, ::-1]
    rng = np.random.default_rng(0)
    centres = np.array([SIZE[0] / nx, SIZE[1] / ny, 1.25e-3]) * (at + 0.5)
    centres += rng.uniform(-2e-5, 2e-5, at.shape) + [0.0, 0.0, 1e-4]
    walls = []
    for axis, name in enumerate("xyz"):
        for end, inwards in ((0.0, 1.0), (SIZE[axis], -1.0)):
            point, normal = [0.0] * 3, [0.0] * 3
            point[axis], normal[axis] = end, inwards
            wall = Plane((point[0], point[1], point[2]), (normal[0], normal[1], normal[2]),
                         f"{name} = {end:g} m")  # fmt: skip
            walls.append(SolidWall(wall, "smooth" if name == "y" else "seed"))
    contacts = {("seed", "seed"): Contact(0.986, 0.1), ("seed", "smooth"): Contact(0.986, 0.0)}
    return Simulation(
        centres, 0.5 * D, [SEED, SMOOTH], contacts, time_step=2e-5, threads=threads, walls=walls
    )


def with_gas(
    simulation: Simulation,
    drag: str = "bvk",
    speed: float = SPEED,
    budget: bool = False,
    below: int = 0,
    finer: int = 1,
) -> GasParticles:
    """The same with air from below, which enters so many layers of cells under the floor.

    ``finer`` divides the edges of the cells.
    """
    slip = Wall(slip=True)
    sides = {"z-": Inflow(speed), "z+": Outlet(), "x-": slip, "x+": slip}
    deep = below * SIZE[2] / CELLS[2]
    nx, ny, nz = (finer * n for n in CELLS)
    grid = Grid(cells=(nx, ny, nz), lower=(0.0, 0.0, -deep), upper=(*SIZE[:2], SIZE[2] - deep))
    gas = GasSolver(grid, sides, AIR, budget=budget)
    return GasParticles(gas, simulation, Settings(drag=drag))


def top(centres: np.ndarray) -> float:
    """Height of the bed's surface: mean over 12 columns of their fifth highest sphere [m]."""
    column = np.minimum((centres[:, 0] / SIZE[0] * 12).astype(int), 11)
    return float(np.mean([np.sort(centres[column == k, 2])[-5] for k in range(12)])) + 0.5 * D


def heights(centres: np.ndarray) -> list[float]:
    """What may be meant by the height of a bed, in the order of HEIGHTS [m]."""
    z = centres[:, 2]
    return [2.0 * float(z.mean()), top(centres), float(np.quantile(z, 0.99)) + 0.5 * D,
            float(z.max()) + 0.5 * D]  # fmt: skip


def crests(height: np.ndarray) -> np.ndarray:
    """Highest values of the eruptions: crests that stand 2 mm above the troughs beside them [m]."""
    found, _ = find_peaks(height, prominence=2e-3)
    return np.asarray(height[found])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--time", type=float, default=2.1, help="of fluidisation [s]")
    parser.add_argument("--drag", default="bvk")
    parser.add_argument("--below", type=int, default=1, help="layers of cells under the floor")
    parser.add_argument("--finer", type=int, default=1, help="divides the cells along each axis")
    parser.add_argument("--steps", type=int, help="of the particles in one of the gas")
    parser.add_argument("--threads", type=int)
    given = parser.parse_args()
    out = output_folder(given.out)
    sim = particles(given.threads)
    sim.run(SETTLE)
    settled = heights(sim.centres)
    both = with_gas(sim, given.drag, 0.01 * SPEED, below=given.below, finer=given.finer)
    started, cpu = time.perf_counter(), time.process_time()
    rows, worst = [], 0.0
    while both.time < given.time:
        both.gas.set_boundary("z-", Inflow(SPEED * min(1.0, 0.01 + 0.99 * both.time / RAMP)))
        report = both.step(given.steps)
        worst = max(worst, report.defect)
        p = both.gas.pressure.mean(axis=(1, 2))
        n = given.below * given.finer
        floor = p[n - 1] if n else 1.5 * p[0] - 0.5 * p[1]
        rows.append((both.time, *heights(sim.centres), floor, report.contact_steps))
    table = np.array(rows)
    columns = ("time [s]", *(f"{name} [m]" for name in HEIGHTS), "pressure_drop [Pa]",
               "contact_steps")  # fmt: skip
    np.savetxt(out / "history.csv", table, delimiter=",", comments="", header=",".join(columns))
    # Of equal times: steps are not equally long.
    even = np.linspace(LATE, table[-1, 0], max(2, int((table[-1, 0] - LATE) / 1e-3)))
    late = np.column_stack([np.interp(even, table[:, 0], column) for column in table.T])
    weight = 9.81 * float(sim.masses.sum()) / (SIZE[0] * SIZE[1])
    high = {
        name: {"settled": settled[k], "mean": float(late[:, 1 + k].mean()),
               "quartiles": np.quantile(late[:, 1 + k], (0.25, 0.5, 0.75)).tolist(),
               "mean_of_crests": float(crests(late[:, 1 + k]).mean()),
               "crests": len(crests(late[:, 1 + k])), "highest": float(table[:, 1 + k].max()),
               "highest_late": float(late[:, 1 + k].max())}
        for k, name in enumerate(HEIGHTS)
    }  # fmt: skip
    write_summary(out, "khawaja", {
        "particles": N, "time": both.time, "gas_steps": both.steps, "late": LATE, "heights": high,
        "measured_height": MEASURED,
        "mean_pressure_drop": float(late[:, -2].mean()), "weight_over_area": weight,
        "largest_momentum_defect": worst, "wall_seconds": time.perf_counter() - started,
        "cpu_seconds": time.process_time() - cpu,
    })  # fmt: skip
    draw(table, weight, out / "khawaja.png")
    draw_bed(both, out / "bed.png")


def draw(table: np.ndarray, weight: float, path: Path) -> None:
    """Heights and pressure drop over time."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
    for k, name in enumerate(HEIGHTS):
        axes[0].plot(table[:, 0], 1e3 * table[:, 1 + k], lw=1.0, label=name.replace("_", " "))
    axes[0].axhline(1e3 * MEASURED, color="k", ls="--", lw=0.8, label="observed")
    axes[0].set(xlabel="time [s]", ylabel="height [mm]", ylim=(0, None))
    axes[0].legend(frameon=False, ncols=2)
    axes[1].plot(table[:, 0], table[:, -2] / weight, lw=0.8)
    axes[1].axhline(1.0, color="k", ls="--", lw=0.8)
    axes[1].set(xlabel="time [s]", ylabel="pressure drop over the bed's weight [-]")
    figure.savefig(path, dpi=110)
    plt.close(figure)


def draw_bed(both: GasParticles, path: Path) -> None:
    """The bed as it is: void fraction and spheres."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(2.5, 5), layout="constrained")
    low, high = (1e3 * end[2] for end in (both.gas.grid.lower, both.gas.grid.upper))
    box = (0.0, 1e3 * SIZE[0], low, high)
    middle = both.void[:, both.void.shape[1] // 2]
    axes.imshow(middle, origin="lower", extent=box, cmap="Greys_r", vmin=0.3, vmax=1.0)
    axes.plot(*(1e3 * both.simulation.centres[:, (0, 2)]).T, ".", ms=0.8, color="#d1602b")
    axes.set(xlabel="x [mm]", ylabel="z [mm]", title=f"{both.time:.2f} s")
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main()
