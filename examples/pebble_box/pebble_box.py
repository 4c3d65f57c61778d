"""A closed box of pebbles between a hot and a cold wall: what each radiation model makes of it."""

import argparse
import csv
import json
import time
from pathlib import Path

import numpy as np

from greybed.core import Packing, box_walls
from greybed.core.sizes import Mono
from greybed.coupling import pairwise_network, radiative_network
from greybed.datasets.containers import Box
from greybed.datasets.generate import random_packing
from greybed.raytrace import exchange_factors, radiative_exchange_factor

SIGMA = 5.670374419e-8  # [W/m2/K4]
SPHERES, DIAMETER, EDGE = 332, 0.06, 0.42  # [-], [m], [m]
EMISSIVITY = 0.8  # of spheres, hot and cold wall [-]
HOT, COLD = 1073.5, 436.5  # [K]
LAYERS = 7
# Walls: x low (hot), x high (cold), and four sides that re-radiate all they receive.
BLACK = [1.0, 1.0, 0.0, 0.0, 0.0, 0.0]
GREY = [EMISSIVITY, EMISSIVITY, 0.0, 0.0, 0.0, 0.0]
GIVEN = (HOT, COLD, None, None, None, None)


def pebbles(seed):
    """The bed, with its six walls."""
    solid = SPHERES * np.pi / 6.0 * DIAMETER**3 / EDGE**3
    bed = random_packing(SPHERES, solid, Mono(0.5 * DIAMETER), container=Box(), seed=seed)
    walls = box_walls((0.0, 0.0, 0.0), (EDGE, EDGE, EDGE))
    return Packing(bed.centres, bed.radii, walls=walls, source="pebble box"), solid


def traced(bed, rays, seed):
    """Exchange factors D and view factors F (sides folded in), walls' own rows with them."""
    factors = exchange_factors(
        bed, [EMISSIVITY, 1.0], wall_emissivity=[GREY, BLACK], rays=rays, wall_rays=50 * rays,
        seed=seed,
    )  # fmt: skip
    closure = []
    for rows in factors:
        # Reciprocity: what spheres send to a wall and what it sends itself fill its A eps.
        to_wall = rows.emission_areas @ rows.wall_factors
        full = EDGE**2 * rows.wall_emissivity[:2]
        closure.append((to_wall + rows.wall_exchange.sum(axis=1))[:2] / full - 1.0)
    return factors, np.abs(closure).max()


def solve(factors, **conditions):
    """Results of all models under the same conditions."""
    exchange, view = factors
    # An F closed at its walls: they are grey to the network, not to the rays.
    grey = {
        "emissivity": EMISSIVITY,
        "wall_emissivity": EMISSIVITY,
        "wall_exchange": view.wall_exchange,
    }
    ask = {"wall_temperatures": GIVEN, **conditions}
    return {
        "D": radiative_network(exchange, **ask),
        "Gebhart F": radiative_network(view, **grey, **ask),
        "pairwise F": pairwise_network(view, wall_areas=EDGE**2, **grey, **ask),
    }


def endless(solid, rays, seed):
    """Radiative exchange factor of a random bed without walls at the same solid fraction."""
    bed = random_packing(400, solid, Mono(0.5 * DIAMETER), seed=seed)
    (factors,) = exchange_factors(bed, EMISSIVITY, rays=rays, seed=seed)
    return radiative_exchange_factor(bed, factors)


def reduced(temperatures):
    """(T^4 - T_cold^4) / (T_hot^4 - T_cold^4) [-]."""
    return (temperatures**4 - COLD**4) / (HOT**4 - COLD**4)


def heaslet_warming(optical_depth, position):
    """Flux and profile of a grey slab between grey walls, in radiative equilibrium [-].

    Heaslet & Warming, Int. J. Heat Mass Transfer 8 (1965) 979, for the flux between black walls;
    the profile is the straight line with the same flux.
    """
    black = (4.0 / 3.0) / (1.42089 + optical_depth)
    flux = black / (1.0 + black * (2.0 / EMISSIVITY - 2.0))
    return flux, 0.5 + 0.75 * flux * optical_depth * (0.5 - position)


def run(rays, seed=1, packing_seed=1):
    """All numbers of the example: summary, table of models, layers."""
    begin = time.perf_counter()
    bed, solid = pebbles(packing_seed)
    factors, closure = traced(bed, rays, seed)
    other, _ = traced(bed, rays, seed + 1000)
    at_rest = solve(factors)
    # In equilibrium no sphere gives off heat; all of them hot, they lose it to the cold wall.
    loss = solve(factors, temperatures=HOT)
    again = radiative_network(other[0], wall_temperatures=GIVEN)
    again_loss = radiative_network(other[0], wall_temperatures=GIVEN, temperatures=HOT)
    runs = {name: (at_rest[name], loss[name]) for name in at_rest}
    runs["D, other rays"] = again, again_loss
    reference = at_rest["D"]
    full = EDGE**2 * SIGMA * (HOT**4 - COLD**4)
    table = []
    for name, (rest, cold) in runs.items():
        off = rest.temperatures - reference.temperatures
        table.append(
            {
                "model": name,
                "flux [-]": rest.wall_heats[0] / full,
                "flux error [%]": 100.0 * (rest.wall_heats[0] / reference.wall_heats[0] - 1.0),
                "rms temperature error [K]": np.sqrt((off**2).mean()),
                "largest temperature error [K]": np.abs(off).max(),
                "heat lost by hot spheres [W]": cold.heats.sum(),
                "heat lost error [%]": 100.0 * (cold.heats.sum() / loss["D"].heats.sum() - 1.0),
            }
        )
    scattered = 1.5 * solid / DIAMETER * EDGE  # each sphere casts its own shadow
    whole = endless(solid, max(rays // 10, 100), seed)
    # A slab whose 16 sigma T^3 / (3 extinction) is the conductivity of the bed.
    depths = {
        "scattered spheres": scattered,
        "measured bed": 4.0 * EDGE / (3.0 * whole.factor * DIAMETER),
    }
    layer = np.minimum((bed.centres[:, 0] / EDGE * LAYERS).astype(int), LAYERS - 1)
    slabs = {name: heaslet_warming(depth, 0.0)[0] for name, depth in depths.items()}
    profile = []
    for k in range(LAYERS):
        here = layer == k
        place = bed.centres[here, 0].mean() / EDGE
        row = {"position [-]": place, "spheres": int(here.sum())}
        for name, (rest, _) in runs.items():
            row[f"{name} [-]"] = reduced(rest.temperatures[here]).mean()
        for name, depth in depths.items():
            row[f"slab, {name} [-]"] = heaslet_warming(depth, place)[1]
        profile.append(row)
    summary = {
        "spheres": SPHERES,
        "diameter_m": DIAMETER,
        "edge_m": EDGE,
        "solid_fraction": solid,
        "emissivity": EMISSIVITY,
        "rays_per_sphere": rays,
        "seed": seed,
        "radiative_exchange_factor": {"value": whole.factor, "stderr": whole.stderr},
        "optical_depth": depths,
        "heaslet_warming_flux": slabs,
        "flux": {row["model"]: row["flux [-]"] for row in table},
        "rms_distance_of_layers_of_D_from_slab": {
            name: float(
                np.sqrt(np.mean([(r["D [-]"] - r[f"slab, {name} [-]"]) ** 2 for r in profile]))
            )
            for name in depths
        },
        "largest_violation_of_wall_reciprocity": closure,
        "imbalance_before_balancing": reference.imbalance,
        "energy_defect": max(r.defect for pair in runs.values() for r in pair),
    }
    points = bed.centres[:, 0] / EDGE, {n: reduced(r.temperatures) for n, (r, _) in runs.items()}
    return summary, table, profile, points, time.perf_counter() - begin


def draw(path, summary, profile, points):
    """Profiles of all models beside the slab."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(figsize=(6.4, 4.4), layout="constrained")
    place, spheres = points
    axes.plot(place, spheres["D"], ".", color="0.75", label="single spheres, D")
    x = np.linspace(0.0, 1.0, 50)
    for (name, depth), style in zip(summary["optical_depth"].items(), ("k--", "k-"), strict=True):
        label = f"Heaslet-Warming, {name}: depth {depth:.2f}"
        axes.plot(x, heaslet_warming(depth, x)[1], style, label=label, linewidth=1.0)
    at = [row["position [-]"] for row in profile]
    for name, mark in (("D", "o-"), ("Gebhart F", "s--"), ("pairwise F", "^:")):
        axes.plot(at, [row[f"{name} [-]"] for row in profile], mark, label=name)
    axes.set_xlabel("distance from the hot wall over the edge of the box [-]")
    axes.set_ylabel("(T⁴ − T_cold⁴) / (T_hot⁴ − T_cold⁴) [-]")
    axes.legend(loc="lower left", fontsize=8)
    figure.savefig(path, dpi=120, metadata={"Software": None})
    plt.close(figure)


def write(path, rows):
    """Rows as CSV with five digits."""
    with path.open("w", newline="") as file:
        table = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        table.writeheader()
        for row in rows:
            table.writerow({k: f"{v:.5g}" if isinstance(v, float) else v for k, v in row.items()})


def main():
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--rays", type=int, default=50_000, help="per sphere")
    arguments.add_argument("--out", type=Path, default=Path(__file__).parent / "results")
    ask = arguments.parse_args()
    summary, table, profile, points, seconds = run(ask.rays)
    ask.out.mkdir(parents=True, exist_ok=True)
    write(ask.out / "models.csv", table)
    write(ask.out / "profile.csv", profile)
    (ask.out / "summary.json").write_text(json.dumps(summary, indent=2) + "\n")
    draw(ask.out / "profile.png", summary, profile, points)
    for row in table:
        print("  ".join(f"{k} {v:.4g}" if isinstance(v, float) else str(v) for k, v in row.items()))
    print(f"{seconds:.1f} s, results in {ask.out}")


if __name__ == "__main__":
    main()
