"""Touching lattices: exchange of the nearest pair and conductivity, by every radiation model."""

import argparse
import csv
from pathlib import Path

import numpy as np

from greybed.coupling import radiative_network
from greybed.datasets.lattices import lattice
from greybed.raytrace import breitbach_barthels, exchange_factors, radiative_exchange_factor

EMISSIVITIES = [0.3, 0.65, 0.8, 0.9, 1.0]
NEIGHBOURS = {"sc": 6, "bcc": 8, "fcc": 12}
SIGMA = 5.670374419e-8  # [W/m2/K4]


def distances(bed, pairs):
    """Centre to centre, in diameters."""
    apart = bed.centres[pairs.target] + pairs.image * bed.edges - bed.centres[pairs.emitter]
    return np.linalg.norm(apart, axis=1) / (2.0 * bed.radii[0])


def gebhart(kind, cells, rays):
    """Share of one sphere's emission that a neighbour absorbs, times emissivity, from F alone."""
    bed = lattice(kind, cells, 1.0)
    (view,) = exchange_factors(bed, 1.0, rays=rays)
    near, _ = bed.neighbours(1e-6)
    near = near[(near == 0).any(axis=1)].sum(axis=1)
    hot = np.full(len(bed), 1.0)  # next to nothing beside the hot one
    hot[0] = 1000.0
    shares = []
    for emissivity in EMISSIVITIES:
        heats = radiative_network(view, temperatures=hot, emissivity=emissivity).heats
        shares.append(-heats[near].mean() / (bed.areas[0] * SIGMA * 1000.0**4))
    assert len(near) == NEIGHBOURS[kind]
    return shares


def rows(kind, rays, cells):
    """One row per emissivity."""
    bed = lattice(kind, 1, 1.0)
    results = exchange_factors(bed, EMISSIVITIES, rays=rays, emitters=[0], images=True)
    view = results[-1].pairs
    far = distances(bed, view) ** 2
    solid = bed.solid_fraction
    for result, by_gebhart in zip(results, gebhart(kind, cells, rays // 200), strict=True):
        emissivity = result.emissivity[0]
        pairs, apart = result.pairs, distances(bed, result.pairs)
        near = abs(apart - 1.0) < 1e-6
        exchange = emissivity * pairs.factor[near].mean()
        # Sums over equal neighbours: their errors are all but independent.
        error = emissivity * np.sqrt((pairs.stderr[near] ** 2).sum()) / near.sum()
        whole = radiative_exchange_factor(bed, result)
        first = view.factor[abs(far - 1.0) < 1e-6].mean()
        surface = 2.0 * (1.0 - emissivity) / emissivity
        pairwise = solid * (view.factor / (1.0 + surface * view.factor) * far).sum()
        yield {
            "lattice": kind,
            "emissivity [-]": emissivity,
            "eps D nearest [-]": exchange,
            "stderr [-]": error,
            "D own [-]": pairs.factor[apart < 1e-6].sum(),
            "Gebhart F nearest, error [%]": 100.0 * (by_gebhart / exchange - 1.0),
            "pairwise F nearest, error [%]": 100.0
            * (first / (1.0 + surface * first) / exchange - 1),
            "F_E [-]": whole.factor,
            "F_E stderr [-]": whole.stderr,
            # Spheres that give off nothing have J = sigma T^4 whatever they reflect.
            "Gebhart F_E, error [%]": 100.0
            * (solid * (view.factor * far).sum() / whole.factor - 1),
            "pairwise F_E, error [%]": 100.0 * (pairwise / whole.factor - 1.0),
            "Breitbach-Barthels F_E [-]": float(breitbach_barthels(1.0 - solid, emissivity)),
        }


def main():
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--rays", type=int, default=4_000_000, help="per lattice")
    arguments.add_argument("--out", type=Path, default=Path(__file__).parent / "results")
    ask = arguments.parse_args()
    ask.out.mkdir(parents=True, exist_ok=True)
    table = [row for kind in NEIGHBOURS for row in rows(kind, ask.rays, 5)]
    with (ask.out / "lattices.csv").open("w", newline="") as file:
        out = csv.DictWriter(file, list(table[0]), lineterminator="\n")
        out.writeheader()
        for row in table:
            out.writerow(
                {k: f"{round(v, 9):.5g}" if isinstance(v, float) else v for k, v in row.items()}
            )


if __name__ == "__main__":
    main()
