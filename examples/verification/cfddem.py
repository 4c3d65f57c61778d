"""Particles in a gas, checked: python examples/verification/cfddem.py --out DIR [--only CASE].

settling: MFIX's DEM06, a grain of 0.1 mm in air that rises at 0.40 m/s.
ergun: CFDEM's case, a bed of 1 mm spheres in flow from 2 to 20 mm/s: pressure drop, plateau, the
velocity at which it is lifted.
cooling: the settled bed of 4,000 spheres that comes with greybed, hot, in cold gas and between cold
surroundings: convection, contacts and radiation through traced view factors in one account. The gas
sees a square duct around the bed, not its cylinder.

Writes summary.json and, for ergun, ergun.csv. Some ten minutes on one core.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from greybed.cfd.boundaries import Inflow, Outlet, Wall
from greybed.cfd.fluid import Fluid
from greybed.cfd.gas import GasSolver
from greybed.cfd.grid import Grid
from greybed.core import Plane
from greybed.core.files import output_folder, write_summary
from greybed.core.readers import read_packing
from greybed.coupling import BedRadiation, GasHeat, GasParticles, GasParticleSettings
from greybed.dem import Contact, Material, Simulation, SolidWall
from greybed.dem.heat import Heat
from greybed.raytrace import view_factors

ROOT = Path(__file__).parents[2]
AIR = Fluid(density=1.2, viscosity=1.8e-5)


def settling(_: Path) -> dict[str, Any]:
    """Net speed at several places in a cell, against the exact one."""
    d, density, rise, edge, g = 100e-6, 2000.0, 0.40, 0.004, 9.80665
    low, high = 0.0, 2.0
    for _step in range(100):
        s = 0.5 * (low + high)
        re = AIR.density * d * s / AIR.viscosity
        drag = 3.0 * math.pi * AIR.viscosity * d * s * (1.0 + 0.15 * re**0.687)
        heavy = drag < math.pi / 6 * d**3 * (density - AIR.density) * g
        low, high = (s, high) if heavy else (low, s)
    exact, found = rise - low, []
    for where in (0.0, 0.25, 0.5, 0.75):
        size = (edge, edge, 12 * edge)
        sim = Simulation(
            [[edge * where] * 2 + [edge * (10 + where)]], 0.5 * d,
            Material(density, 5e3, 0.3, "sand"), Contact(0.9, 0.0), time_step=4e-5,
            box=[[0, 0, 0], size], periodic=(True, True, False), threads=1, gravity=(0.0, 0.0, -g),
        )  # fmt: skip
        grid = Grid(cells=(1, 1, 12), upper=size, periodic=(True, True, False))
        gas = GasSolver(grid, {"z-": Inflow(rise), "z+": Outlet()}, AIR)
        both = GasParticles(gas, sim, GasParticleSettings(drag="schiller-naumann"))
        while both.time < 0.6:
            both.step(50)
        found.append(float(sim.velocities[0, 2]))
    worst = max(abs(v / exact - 1.0) for v in found)
    return {"exact": exact, "found": found, "largest_error": worst, "mfix": -0.05801}


def ergun(out: Path) -> dict[str, Any]:
    """A random bed that settles, is blown through ever faster and lifted."""
    d, density, fluid = 1e-3, 2000.0, Fluid(density=10.0, viscosity=1.5e-3)
    size, layers = (0.006, 0.006, 0.030), 26
    at = np.stack(np.meshgrid(range(5), range(5), range(layers), indexing="ij"), -1).reshape(-1, 3)
    rng = np.random.default_rng(1)
    centres = (at + 0.5) * [1.2e-3, 1.2e-3, 1.1e-3] + rng.uniform(-5e-5, 5e-5, at.shape)
    sim = Simulation(
        centres, 0.5 * d, Material(density, 5e6, 0.45, "glass"), Contact(0.3, 0.5), time_step=1e-5,
        walls=[SolidWall(Plane((0, 0, 0), (0, 0, 1), "floor"))], box=[[0, 0, 0], size],
        periodic=(True, True, False), threads=1,
    )  # fmt: skip
    sim.run(15_000)
    grid = Grid(cells=(3, 3, 15), upper=size, periodic=(True, True, False))
    gas = GasSolver(grid, {"z-": Inflow(0.002), "z+": Outlet()}, fluid)
    both = GasParticles(gas, sim, GasParticleSettings(drag="ergun"))
    area = size[0] * size[1]
    weight = 9.81 * float(sim.masses.sum()) * (1.0 - fluid.density / density) / area
    rows = []
    for speed in np.arange(0.002, 0.0201, 0.001):
        gas.set_boundary("z-", Inflow(float(speed)))
        # A lifted bed swings for a while.
        drops, floors, n = [], [], 60 if speed < 0.0135 else 240
        for step in range(n):
            report = both.step(50)
            if step >= n // 2:
                # What the gas does to the spheres: the pressure at the floor itself, half a cell
                # below a centre, would have to be guessed, which costs up to half a per cent.
                force = float(report.given[2] + report.pressure[2]) / report.dt
                drops.append(force / area)
                floors.append(-float(sim.wall_forces[0, 2]) / area)
        height = 2.0 * float(sim.centres[:, 2].mean())
        # of the middle of the bed, which has no ends
        eps = float(np.average(both.void[2:5].mean(axis=(1, 2)), weights=(1, 2, 1)))
        slope = float(gas.pressure[2].mean() - gas.pressure[4].mean()) / (2 * grid.spacing[2])
        mu, rho = fluid.viscosity, fluid.density
        own = 150 * mu * (1 - eps) ** 2 / eps**3 * speed / d**2
        own += 1.75 * rho * (1 - eps) / eps**3 * speed**2 / d
        rows.append((speed, np.mean(drops), np.mean(floors), height, eps, slope, own))
    table = np.array(rows)
    np.savetxt(
        out / "ergun.csv",
        table,
        delimiter=",",
        comments="",
        header=("speed [m/s],drop [Pa],floor [Pa],height [m],void [-],slope [Pa/m],ergun [Pa/m]"),
    )
    # On the plateau the floor bears less than the plateau's own tolerance.
    loaded = table[:, 2] > 0.005 * weight
    fixed = table[table[:, 2] > 0.1 * weight]
    # Of the whole bed, which is looser at its ends.
    eps = 1.0 - float(len(centres)) * math.pi / 6 * d**3 / (area * float(table[0, 3]))
    a = 1.75 * fluid.density / (eps**3 * d)
    b = 150 * fluid.viscosity * (1 - eps) / (eps**3 * d**2)
    predicted = (-b + math.sqrt(b * b + 4 * a * (density - fluid.density) * 9.81)) / (2 * a)
    # Where the line of the floor's load comes to 0.
    line = np.polyfit(table[:4, 0], table[:4, 2], 1)
    plateau = table[~loaded, 1]
    both_bear = table[:, 1] + table[:, 2]
    return {
        "void": eps, "slope_over_ergun": float((fixed[:, 5] / fixed[:, 6]).mean()),
        "lift_by_load": float(-line[1] / line[0]), "lift_of_ergun": predicted,
        "weight_over_area": weight,
        "plateau_over_weight": float(plateau.mean() / weight) if len(plateau) else None,
        "gas_and_floor_over_weight": [
            float(both_bear.min() / weight), float(both_bear.max() / weight),
        ],
    }  # fmt: skip


def cooling(_: Path) -> dict[str, Any]:
    """The settled bed at 900 K in gas at 300 K, its surroundings at 300 K."""
    bed = read_packing(ROOT / "greybed/datasets/packings/settled_mono_4k.dump")
    factors = view_factors(bed, rays=512, seed=1)
    low = np.floor(bed.centres.min(axis=0) * 1e3 - 2.0) * 1e-3
    size = np.ceil((bed.centres.max(axis=0) - low) * 1e3 / 6.0 + 0.5) * 6e-3
    density = 1e9  # so heavy that it stays where it is
    sim = Simulation(
        bed.centres, bed.radii, Material(density, 5e6, 0.3, "alumina"), Contact(0.5, 0.3),
        gravity=(0.0, 0.0, 0.0), time_step=2e-5, most_overlap=0.5,
    )  # fmt: skip
    grid = Grid(cells=tuple(int(n) for n in np.round(size / 6e-3)), lower=tuple(low),
                upper=tuple(low + size))  # fmt: skip
    sides = {"z-": Inflow(0.3, 300.0), "z+": Outlet(), "x-": Wall(), "x+": Wall()}
    gas = GasSolver(grid, sides, AIR, temperature=300.0)
    light = BedRadiation(
        factors, 0.8, environment_temperature=300.0,
        wall_temperatures=[300.0] * factors.wall_factors.shape[1],
    )  # fmt: skip
    heat = GasHeat(
        Heat(sim, 2.0, 2e3 / density, np.full(len(bed.radii), 900.0)),
        AIR.conductivity,
        0.7,
        radiation=light,
    )
    both = GasParticles(gas, sim, GasParticleSettings(drag="gidaspow"), heat=heat)
    sums = np.zeros(5)
    for _step in range(60):
        both.step(40)
        r = heat.report
        sums += [r.from_gas, r.from_surroundings, r.from_walls, r.stored, r.exchanged]
    rest = abs(sums[3] - sums[:3].sum()) / sums[4]
    return {
        "time": both.time, "mean_temperature": heat.heat.mean, "from_gas": sums[0],
        "from_surroundings": sums[1], "stored": sums[3], "defect_over_exchanged": rest,
    }  # fmt: skip


def measure(out: Path, cases: Sequence[str]) -> dict[str, float]:
    """What run.py compares, of some of the cases."""
    found: dict[str, float] = {}
    if "settling" in cases:
        found["cfddem.settling"] = settling(out)["largest_error"]
    if "cooling" in cases:
        found["cfddem.cooling"] = float(cooling(out)["defect_over_exchanged"])
    if "ergun" in cases:
        bed = ergun(out)
        found |= {
            "cfddem.ergun": bed["slope_over_ergun"],
            "cfddem.plateau": bed["plateau_over_weight"] or math.nan,
            "cfddem.lift": bed["lift_by_load"] / bed["lift_of_ergun"],
        }
    return found


CASES = {"settling": settling, "ergun": ergun, "cooling": cooling}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--only", choices=CASES)
    given = parser.parse_args()
    out = output_folder(given.out)
    results = {}
    for name, case in CASES.items():
        if given.only in (None, name):
            results[name] = case(out)
            print(name, results[name], flush=True)
    write_summary(out, "cfddem", results)


if __name__ == "__main__":
    main()
