"""Why DPMFoam's pressure drop is not ours: python benchmarks/cfddem_checks.py [--work DIR].

First the bed of cfddem.py at one instant, ours alone, with cells as there and of a half and a third
of their edges. Then a lattice of heavy spheres at rest, whose pressure gradient Ergun's equation
tells: both codes, layer by layer of cells, over Ergun's, and the flux of the gas that the
velocities of the cells carry (all of what enters, 0.66 m/s, in a code that is consistent).
"""

from __future__ import annotations

import argparse
import math
import shutil
import tempfile
from pathlib import Path

import cfddem
import numpy as np

from greybed.coupling.gas_particles import GasParticles
from greybed.dem import Contact, Material, Simulation
from greybed.dem.checkpoint import restore

khawaja = cfddem.khawaja
LAYERS, STEP, STEPS = 9, 1e-4, 40  # of cells; of the gas [s]


def still() -> GasParticles:
    """Three by eight by three spheres in each cell of the lowest layers, nearly at rest."""
    khawaja.D, khawaja.SEED = 1.19e-3, Material(1e6, 1e6, 0.3, "seed")
    at = np.stack(np.meshgrid(range(3 * LAYERS), range(8), range(36), indexing="ij"), -1)
    centres = (at.reshape(-1, 3)[:, ::-1] + 0.5) * np.array([1.2e-3, 1.25e-3, 1.6e-3])
    sim = Simulation(
        centres, 0.5 * khawaja.D, [khawaja.SEED, khawaja.SMOOTH], Contact(0.986, 0.1),
        time_step=1e-5, gravity=(0.0, 0.0, 0.0), threads=1,
    )  # fmt: skip
    return khawaja.with_gas(sim, "gidaspow")


def ergun() -> float:
    """Pressure drop of a layer of cells [Pa]."""
    size = khawaja.SIZE[2] / khawaja.CELLS[2]
    cell = math.prod(khawaja.SIZE) / math.prod(khawaja.CELLS)
    phi = 72 * math.pi / 6 * khawaja.D**3 / cell
    mu, rho, u, d = khawaja.AIR.viscosity, khawaja.AIR.density, khawaja.SPEED, khawaja.D
    eps = 1.0 - phi
    return size * (150 * phi**2 * mu * u / d**2 + 1.75 * phi * rho * u**2 / d) / eps**3


def tell(name: str, pressure: np.ndarray, flux: np.ndarray) -> None:
    layers = -np.diff(pressure)[: LAYERS + 2] / ergun()
    print(f"{name}: drops of layers over Ergun's {np.round(layers, 3)}")
    print(f"{name}: flux of the cells [m/s] {np.round(flux[: LAYERS + 3], 3)}", flush=True)


def lattice(work: Path) -> None:
    both = still()
    for _ in range(STEPS):
        both.step(10)
    w = both.gas.velocity[2]
    flux = (both.void * 0.5 * (w[1:] + w[:-1])).mean(axis=(1, 2))
    tell("greybed", both.gas.pressure.mean(axis=(1, 2)), flux)
    if not shutil.which("DPMFoam"):
        print("DPMFoam is not here.")
        return
    case = work / "lattice"
    shutil.rmtree(case, ignore_errors=True)
    cfddem.write_case(case, both, STEP)
    span = STEP * STEPS
    cfddem.edit(case / "system/controlDict", (r"^endTime\s.*;", f"endTime {span:g};"),
                (r"^deltaT\s.*;", f"deltaT {STEP:g};"),
                (r"^writeInterval\s.*;", f"writeInterval {span:g};"))  # fmt: skip
    cfddem.edit(case / "constant/g", (r"-9.81", "0"))
    cfddem.run(case, "blockMesh > mesh.log && DPMFoam")
    end, layers = case / f"{span:g}", khawaja.CELLS[2]
    p = np.array(cfddem.listed(end / "p"), dtype=float).reshape(layers, -1).mean(axis=1)
    alpha = np.array(cfddem.listed(end / "alpha.air"), dtype=float).reshape(layers, -1)
    up = [float(row.strip("()").split()[2]) for row in cfddem.listed(end / "U.air")]
    flux = (alpha * np.array(up).reshape(layers, -1)).mean(axis=1)
    tell("DPMFoam", khawaja.AIR.density * p, flux)


def cells(work: Path) -> None:
    cfddem.flowing(work)
    coarse = khawaja.CELLS
    for finer in (1, 2, 3):
        sim = khawaja.particles(threads=1)
        restore(sim, work / "flowing.npz")
        khawaja.CELLS = tuple(finer * n for n in coarse)
        both = khawaja.with_gas(sim, "gidaspow")
        for _ in range(20):
            both.step(1)
        p = both.gas.pressure.mean(axis=(1, 2))
        print(f"cells {khawaja.CELLS}: pressure at the floor {1.5 * p[0] - 0.5 * p[1]:.1f} Pa")
    khawaja.CELLS = coarse


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--work", type=Path, default=Path(tempfile.gettempdir()) / "greybed_cfddem")
    given = parser.parse_args()
    given.work.mkdir(parents=True, exist_ok=True)
    cells(given.work)
    lattice(given.work)


if __name__ == "__main__":
    main()
