"""Intruders rising in a small fluidised bed: python examples/vssuq/simulate.py --out DIR CONDITION.

One condition of LaMarche et al., AIChE J. (2022), doi:10.1002/aic.17643: a column of 38.09 x 38.11
mm, glass beads of 3.1 mm, polyethylene spheres that start on the distributor, air from below. All
beads are there, with the diameters, density, restitution and friction that were measured
(properties.csv); nothing is fitted. Softer than in truth (Young's modulus 2 MPa). CONDITION is the
number of a row of conditions.csv, from 1. Writes rise-CONDITION-SEED.csv: time, height of the bed
and of each intruder, and beads in the column over it; --seed takes other sizes and places. Minutes
on one core.
"""

from __future__ import annotations

import argparse
import csv
import math
import time
from pathlib import Path

import numpy as np

from greybed.cfd.boundaries import Inflow, Outlet
from greybed.cfd.fluid import Fluid
from greybed.cfd.gas import GasSolver
from greybed.cfd.grid import Grid
from greybed.core import Plane
from greybed.coupling import GasParticles, GasParticleSettings
from greybed.dem import Contact, Material, Simulation, SolidWall

HERE = Path(__file__).parent
SIZE, CELLS = (0.03809, 0.03811, 0.2286), (4, 4, 24)
# Air at 83.77 kPa and 293.15 K, as measured; its viscosity by Sutherland's law.
AIR = Fluid(density=83770.0 * 0.028964 / (8.31446 * 293.15), viscosity=1.81e-5)
GLASS, HDPE = 2522.0, 941.0  # [kg/m3]; that of the intruders is their maker's
STIFFNESS, STEP, SETTLE, EVERY = 2e6, 4e-5, 0.6, 0.01


def measured() -> dict[tuple[str, str], np.ndarray]:
    """Samples of each property: diameters [m], restitution, friction [-]."""
    found: dict[tuple[str, str], list[float]] = {}
    with open(HERE / "properties.csv", newline="") as file:
        for row in csv.DictReader(line for line in file if not line.startswith("#")):
            scale = 1e-6 if row["quantity"] == "dp" else 1.0
            key = row["quantity"], row["material_pair"]
            found.setdefault(key, []).append(scale * float(row["value"]))
    return {key: np.array(values) for key, values in found.items()}


def condition(number: int) -> dict[str, str]:
    """A row of conditions.csv."""
    with open(HERE / "conditions.csv", newline="") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    return rows[number - 1]


def bed(row: dict[str, str], seed: int) -> tuple[Simulation, int]:
    """Beads above intruders, not settled yet, and how many intruders there are."""
    rng, known = np.random.default_rng(seed), measured()
    count = int(row["intruders [-]"])
    sizes = known["dp", "hdpe_l" if row["size"] == "large" else "hdpe_s"]
    large = rng.choice(sizes, count)
    mass, beads = float(row["bed mass [g]"]) * 1e-3, []
    while mass > 0.0:
        beads.append(float(rng.choice(known["dp", "glass"])))
        mass -= GLASS * math.pi / 6.0 * beads[-1] ** 3
    # Intruders on the floor, apart from each other and from the corners.
    places: list[list[float]] = []
    while len(places) < count:
        r = 0.5 * large[len(places)]
        x, y = (rng.uniform(r, edge - r) for edge in SIZE[:2])
        corner = min(x, SIZE[0] - x) < 2.0 * r and min(y, SIZE[1] - y) < 2.0 * r
        near = any(math.hypot(x - a, y - b) < r + q for a, b, q in places)
        if not (corner and large[0] > 5e-3) and not near:
            places.append([x, y, r])
    floor = [[x, y, r + 1e-5] for x, y, r in places]
    n, pitch = 11, SIZE[0] / 11
    layers = -(-len(beads) // (n * n))
    at = np.stack(np.meshgrid(range(layers), range(n), range(n), indexing="ij"), -1)
    at = at.reshape(-1, 3)[: len(beads), ::-1]
    lattice = (at + 0.5) * pitch + [0.0, 0.0, 0.0102] + rng.uniform(-1e-5, 1e-5, at.shape)
    contacts = {
        (a, b): Contact(float(known[e, pair].mean()), float(known[mu, pair].mean()))
        for a, b, e, mu, pair in (
            ("glass", "glass", "epp", "mupp", "glass-glass"),
            ("glass", "hdpe", "epp", "mupp", "glass-hdpe"),
            ("hdpe", "hdpe", "epp", "mupp", "hdpe-hdpe"),
            ("glass", "acrylic", "epw", "mupw", "glass-acrylic"),
            # not measured: as on glass
            ("hdpe", "acrylic", "epp", "mupp", "glass-hdpe"),
        )
    }
    walls = []
    for axis in range(3):
        for end, inwards in ((0.0, 1.0), (SIZE[axis], -1.0)):
            point, normal = [0.0] * 3, [0.0] * 3
            point[axis], normal[axis] = end, inwards
            plane = Plane(point, normal, f"{'xyz'[axis]} = {end:g}")
            walls.append(SolidWall(plane, "acrylic"))
    materials = [
        Material(GLASS, STIFFNESS, 0.3, "glass"), Material(HDPE, STIFFNESS, 0.3, "hdpe"),
        Material(GLASS, STIFFNESS, 0.3, "acrylic"),
    ]  # fmt: skip
    simulation = Simulation(
        np.concatenate([floor, lattice]), 0.5 * np.concatenate([large, beads]), materials,
        contacts, kinds=[1] * count + [0] * len(beads), kinds_to_come=2, walls=walls,
        time_step=STEP, threads=1,
    )  # fmt: skip
    return simulation, count


def over(centres: np.ndarray, radius: float, who: int, count: int) -> int:
    """Beads that hide an intruder from above: over its centre, within its radius."""
    apart = centres[count:] - centres[who]
    return int(((apart[:, 2] > 0.0) & (np.hypot(apart[:, 0], apart[:, 1]) < radius)).sum())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("condition", type=int)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--time", type=float, default=15.0, help="at most [s]")
    parser.add_argument("--velocity", type=float, default=1.0, help="times that of the condition")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    row = condition(given.condition)
    simulation, count = bed(row, given.seed)
    simulation.run(round(SETTLE / STEP))
    gas = GasSolver(
        Grid(cells=CELLS, upper=SIZE),
        {"z-": Inflow(given.velocity * float(row["U [m/s]"])), "z+": Outlet()}, AIR,
    )  # fmt: skip
    both = GasParticles(gas, simulation, GasParticleSettings(drag="bvk", mixture="bvk"))
    names = [f"{what} {k + 1} {unit}" for what, unit in (("intruder", "[m]"), ("over", "[-]"))
             for k in range(count)]  # fmt: skip
    label = "" if given.velocity == 1.0 else f"-{given.velocity:g}"
    path = given.out / f"rise-{given.condition}-{given.seed}{label}.csv"
    started, seen = time.process_time(), np.zeros(count, bool)
    with open(path, "w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["time [s]", "bed height [m]", "pressure drop [Pa]", *names])
        while both.time < given.time and not (seen.all() and both.time > 1.0):
            due = both.time + EVERY
            while both.time < due - 1e-9:
                both.step(min(both.steps_for(), max(1, round((due - both.time) / STEP))))
            centres, radii = simulation.centres, simulation.radii
            hidden = [over(centres, float(radii[k]), k, count) for k in range(count)]
            seen |= np.array(hidden) == 0
            p = gas.pressure.mean(axis=(1, 2))
            table.writerow(
                [f"{both.time:.4f}", f"{2.0 * centres[count:, 2].mean():.5f}",
                 f"{1.5 * p[0] - 0.5 * p[1]:.2f}", *(f"{z:.5f}" for z in centres[:count, 2]),
                 *hidden]
            )  # fmt: skip
            file.flush()
    spent = time.process_time() - started
    print(f"{path.name}: {len(simulation.radii)} spheres, {both.time:.2f} s simulated, "
          f"{spent:.0f} s of the processor, seen: {seen.tolist()}")  # fmt: skip


if __name__ == "__main__":
    main()
