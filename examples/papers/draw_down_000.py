"""Source paper 000: the draw-down box with spheres and with tetrapods, reduced. See README.md.

    python examples/papers/draw_down_000.py [--seeds N]

Contacts are those of the paper's table 1, grains of 8 mm as there. Reduced is the box: a slice that
repeats, filled 0.25 m high by grains that fall from random places, a time step of 38 % of
Rayleigh's, half a second from the opening on. A run that is there is not made again.
"""

import argparse
import tempfile
import time
from itertools import pairwise
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from record import HERE, Record

from greybed.core.walls import Plane, Polygon
from greybed.dem import Contact, ContactLaw, Material, Simulation, SolidWall
from greybed.dem.bodies import Clumps, random_orientations, turns
from greybed.dem.checkpoint import restore, save
from greybed.dem.clump import sphere_union
from greybed.dem.clump_shapes import tetrapod

# Of the paper's table 1, as keys of the virtual experiments.
TABLE_1 = {
    "radius": 4e-3, "spread": 0.0, "density": 3400.0, "youngs_modulus": 1e8, "poissons_ratio": 0.3,
    "restitution": 0.3, "friction": 0.71, "wall_friction": 0.41, "rolling_friction": 0.8,
    "rolling_law": "epsd-modified", "cohesion_law": "sjkr", "wall_cohesion": 0.0,
    "limit_force": True, "time_step": 4e-5,
}  # fmt: skip
D, WIDTH, FALL = 8e-3, 0.52, 0.26  # of a sphere, of the box, depth of the lower box [m]
OPENINGS = (0.25, 0.32, 0.40)  # [m]
STEP, SETTLES, LASTS = 4.9e-5, 0.5, 0.5  # [s]
# grains, depth of the slice [m], cohesion [J/m3]
CASES = {
    "spheres": (7000, 0.033, 4e5),
    "tetrapods": (1450, 0.04, 3.1e5),
    "tetrapods without cohesion": (1450, 0.04, 0.0),
}


def loose(shape, count, depth, seed):
    """Random places and turns of clumps whose spheres are apart: as low as there is room."""
    rng = np.random.default_rng(seed)
    q = random_orientations(60 * count, [seed, 1])
    arms = np.einsum("bij,mj->bmi", turns(q), shape.centres)
    cells, centres, kept = {}, [], []
    ceiling, missed = 0.1, 0
    near = np.array(np.meshgrid(*3 * [[-1, 0, 1]], indexing="ij")).reshape(3, -1).T
    rows = int(depth / D)
    for k in range(len(q)):
        at = rng.random(3) * [WIDTH, depth, ceiling] + [-0.5 * WIDTH, 0.0, 0.0]
        x = at + arms[k]
        inside = abs(x[:, 0]).max() < 0.5 * (WIDTH - D) and x[:, 2].min() > 0.5 * D
        if inside and _free(x, depth, rows, cells, near):
            for p in x:
                cells.setdefault(_cell(p, depth, rows), []).append(p)
            centres.append(at)
            kept.append(k)
            missed = 0
            if len(centres) == count:
                return np.array(centres), q[kept]
        else:
            missed += 1
            if missed == 25:
                ceiling, missed = ceiling + 0.02, 0
    raise RuntimeError("no room")


def _cell(p, depth, rows):
    return int(p[0] // D), int(p[1] % depth / depth * rows), int(p[2] // D)


def _free(x, depth, rows, cells, near):
    for p in x:
        i, j, k = _cell(p, depth, rows)
        for a, b, c in near:
            for other in cells.get((i + a, (j + b) % rows, k + c), ()):
                away = p - other
                away[1] -= depth * round(away[1] / depth)
                if away @ away < D * D:
                    return False
    return True


def box(name, seed):
    """The simulation before anything moves."""
    count, depth, cohesion = CASES[name]
    clump = name.startswith("tetrapods")
    shape = tetrapod(D, 2.5 * D) if clump else sphere_union(np.zeros((1, 3)), [0.5 * D])
    x, q = loose(shape, count, depth, seed)
    edges = [-0.5 * WIDTH, *(-0.5 * np.array(OPENINGS[::-1])), *(0.5 * np.array(OPENINGS)),
             0.5 * WIDTH]  # fmt: skip
    y = -depth
    floors = [
        Polygon(((a, y, 0), (b, y, 0), (b, y + 3 * depth, 0), (a, y + 3 * depth, 0)), f"floor {k}")
        for k, (a, b) in enumerate(pairwise(edges))
    ]
    walls = [
        Plane((-0.5 * WIDTH, 0, 0), (1, 0, 0), name="left"),
        Plane((0.5 * WIDTH, 0, 0), (-1, 0, 0), name="right"),
        Plane((0, 0, -FALL), (0, 0, 1), name="ground"),
        *floors,
    ]
    both = {"restitution": 0.3, "rolling_friction": 0.8}
    grains = Material(3400.0, 1e8, 0.3, "grains")
    clumps = {"clumps": [Clumps(shape, x, q)]} if clump else {}
    return Simulation(
        np.zeros((0, 3)) if clump else x, np.zeros(0) if clump else np.full(len(x), 0.5 * D),
        [grains, Material(3400.0, 1e8, 0.3, "walls")],
        {("grains", "grains"): Contact(friction=0.71, cohesion=cohesion, **both),
         ("grains", "walls"): Contact(friction=0.41, **both)},
        law=ContactLaw(rolling="epsd-modified", cohesion="sjkr", limit_force=True),
        walls=[SolidWall(wall, "walls") for wall in walls],
        box=[[-WIDTH, 0.0, -2.0 * FALL], [WIDTH, depth, 9.0]], periodic=(False, True, False),
        time_step=STEP, threads=1, **clumps,
    )  # fmt: skip


def opened(sim, opening):
    """Open the flap: what comes down, and whether the opening is bridged."""
    x, masses = sim.centres, sim.masses
    over = (abs(x[:, 0]) < 0.25 * opening) & (x[:, 2] > 0.0)
    before = masses[over].sum()
    volume = WIDTH * float(sim._lists.edge[1])
    found = {
        "height_m": float(np.quantile(x[:, 2], 0.98)) + 0.5 * D,
        "mass_kg_per_m": float(masses.sum() * WIDTH / volume),
    }
    found["solid_fraction"] = found["mass_kg_per_m"] / (3400.0 * WIDTH * found["height_m"])
    n = len(OPENINGS)
    k = OPENINGS.index(opening)
    for floor in range(n - k, n + k + 1):
        sim.drop_wall(f"floor {floor}")
    sim.run(round(LASTS / STEP))
    x = sim.centres
    over = (abs(x[:, 0]) < 0.25 * opening) & (x[:, 2] > 0.0)
    found["over_share"] = float(masses[over].sum() / before)
    found["mass_share"] = float(masses[x[:, 2] < 0.0].sum() / masses.sum())
    found["speed_of_bridge_m_per_s"] = (
        float(np.sqrt((sim.velocities[over] ** 2).sum(axis=1)).mean()) if over.any() else 0.0
    )
    return {k: round(v, 5) for k, v in found.items()}


def bridged(run):
    """Whether the opening is bridged at the end: something is left over it, and rests."""
    return run["over_share"] >= 0.1 and run["speed_of_bridge_m_per_s"] < 0.1


def draw(name, places):
    """Where the spheres are at the end, one panel for each opening."""
    figure, panels = plt.subplots(1, len(places), figsize=(3.2 * len(places), 3.6), squeeze=False)
    for panel, (opening, x) in zip(panels[0], places.items(), strict=True):
        panel.scatter(1e3 * x[:, 0], 1e3 * x[:, 2], s=2, c=x[:, 1], cmap="viridis")
        panel.set(title=f"{1e3 * opening:.0f} mm", aspect="equal", xlabel="x / mm")
        panel.axhline(0.0, color="grey", lw=0.5)
    panels[0][0].set_ylabel("z / mm")
    figure.suptitle(name)
    figure.tight_layout()
    figure.savefig(HERE / f"draw_down_000_{name.replace(' ', '_')}.png", dpi=80)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--cases", nargs="*", default=list(CASES), choices=list(CASES))
    options = parser.parse_args()
    record = Record("draw_down_000", "slice of 0.52 m; shares of the mass below, and of what was "
                    "over the middle half of the opening, 0.5 s after it opened")  # fmt: skip
    for seed in range(options.seeds):
        for name in options.cases:
            openings = OPENINGS[:1] if name == "spheres" else OPENINGS
            keys = [f"{name} {1e3 * opening:.0f} mm seed {seed}" for opening in openings]
            if all(key in record.runs for key in keys):
                continue
            begin = time.process_time()
            sim = box(name, seed)
            sim.run(round(SETTLES / STEP))
            print(name, "settled", round(time.process_time() - begin, 1), "s", flush=True)
            places = {}
            with tempfile.TemporaryDirectory() as folder:
                state = save(sim, Path(folder) / "settled.npz")
                for key, opening in zip(keys, openings, strict=True):
                    sim = box(name, seed)
                    restore(sim, state)
                    record.runs[key] = opened(sim, opening)
                    record.runs[key]["cpu_s"] = round(time.process_time() - begin, 1)
                    print(key, record.runs[key], flush=True)
                    record.save()
                    places[opening] = sim.centres
            if seed == 0:
                draw(name, places)
    for key, run in record.runs.items():
        print(f"{key}: {'arch' if bridged(run) else 'no arch'}, {run['mass_share']:.2f} below")


if __name__ == "__main__":
    main()
