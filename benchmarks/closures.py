"""Measure closures against traced factors of packings that no training has seen.

Run: python benchmarks/closures.py --data runs/viewfactor.h5 --out runs/closures.json
     (without --data the closures shipped with greybed are measured, and no table of distances)

Prints, for pairs of held-out packings at solid fractions 0.20 to 0.55, what each closure, a table
of distances and solid fractions, and the same inputs with whole counts of spheres reach, and for
whole beds the net radiative flux of every sphere and wall beside that with traced factors. The
truth has so many rays that its noise is far below the bars; its variance is subtracted where
root mean squares are compared, and stated.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.linalg import lsqr

from greybed.closures import shipped
from greybed.core.rows import Rows, balanced
from greybed.coupling.radiation import net_radiation
from greybed.datasets.beds import RandomBed, WalledBed
from greybed.datasets.viewfactor import COLUMNS, ViewFactorData, read, rows_of
from greybed.raytrace import view_factors
from greybed.training import train

SEED = 700_000  # far from the seeds of any campaign
SIZES = ("mono:1mm", "lognormal:1mm,1.3", "discrete:0.7mm=0.5,1.4mm=0.5")
FRACTIONS = (0.20, 0.27, 0.34, 0.41, 0.48, 0.55)
# What other closures reach: Tausendschoen, Stoeckl & Radl 2023, Particuology 74:119, their
# network re-evaluated on their own demonstration rows.
PUBLISHED = {"r2": 0.98984, "mae": 4.66e-4, "mape_above_1e-2": 0.132, "mape_above_1e-3": 0.39}
LEAST = 1e-4


def held_out(emitters: int, rays: int) -> ViewFactorData:
    """Pairs of new packings, traced with many rays; every pair in reach, none thinned away."""
    parts, tables = [], []
    beds = [
        RandomBed(fraction=phi, sizes=SIZES[k % 3], count=500, shake=100 * (k % 2), split="test")
        for k, phi in enumerate((*FRACTIONS, *FRACTIONS[::-1]))
    ]
    for k, bed in enumerate(beds):
        parts.append(rows_of(bed.packing(SEED + k), emitters, rays, SEED + k))
        tables.append({"split": "test", "fraction": bed.fraction, "sizes": bed.sizes})
    columns = {name: np.concatenate([part[name] for part in parts]) for name in COLUMNS}
    number = np.repeat(np.arange(len(parts)), [len(part["factor"]) for part in parts])
    return ViewFactorData(columns, number, tables)


def figures(predicted: np.ndarray, data: ViewFactorData) -> dict[str, float]:
    """R2, errors and negative predictions over all pairs, and over those with F > 1e-4."""
    c = data.columns
    truth, w, noise2 = c["factor"], c["weight"], c["stderr"] ** 2
    error = predicted - truth
    result: dict[str, float] = {"negative": int((predicted < 0.0).sum())}
    for name, chosen in (("", truth >= 0.0), ("_above_1e-4", truth > LEAST)):
        e, v = error[chosen], w[chosen]
        own = np.average(e**2, weights=v) - np.average(noise2[chosen], weights=v)
        mean = np.average(truth[chosen], weights=v)
        spread = np.average((truth[chosen] - mean) ** 2, weights=v)
        result |= {
            f"r2{name}": 1.0 - own / spread,
            f"rmse{name}": float(np.sqrt(max(own, 0.0))),
            f"mae{name}": float(np.average(np.abs(e), weights=v)),
            f"noise_rms{name}": float(np.sqrt(np.average(noise2[chosen], weights=v))),
        }
    for least, name in ((1e-2, "mape_above_1e-2"), (1e-3, "mape_above_1e-3")):
        big = truth > least
        result[name] = float(np.average(np.abs(error[big]) / truth[big], weights=w[big]))
    return result


# Knots of the table: distance over the sum of the radii, solid fraction.
DISTANCES = np.array([1, 1.02, 1.05, 1.1, 1.15, 1.2, 1.3, 1.4, 1.55, 1.75, 2, 2.3, 2.7, 3.3, 4, 5,
                      6.5, 8.5, 12, 20])  # fmt: skip
SOLID = np.array([0.05, 0.15, 0.25, 0.35, 0.45, 0.55, 0.65])


def _hats(data: ViewFactorData) -> csr_array:
    """Bilinear weights of the table's knots for every pair, shape (m, knots)."""
    c = data.columns
    x = 1.0 / (c["radius_over_distance"] * (1.0 + 1.0 / c["radius_ratio"]))
    rows, columns, values = [], [], []
    at, share = [], []
    for value, knots in ((x, DISTANCES), (c["solid_fraction"], SOLID)):
        k = np.clip(np.searchsorted(knots, value) - 1, 0, len(knots) - 2)
        at.append(k)
        share.append(np.clip((value - knots[k]) / (knots[k + 1] - knots[k]), 0.0, 1.0))
    for a in (0, 1):
        for b in (0, 1):
            rows.append(np.arange(len(x)))
            columns.append((at[0] + a) * len(SOLID) + at[1] + b)
            values.append((share[0] if a else 1.0 - share[0]) * (share[1] if b else 1.0 - share[1]))
    shape = (len(x), len(DISTANCES) * len(SOLID))
    return csr_array(
        (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=shape
    )


def table_of_distances(train_data: ViewFactorData, data: ViewFactorData) -> np.ndarray:
    """Factors from a bilinear table of the visible share by distance and solid fraction.

    The knots are fitted by least squares of the factor itself, the figure that it is judged by;
    the exact factor takes care of the sizes.
    """
    mine = train_data.in_split("train")
    c = {name: column[mine] for name, column in train_data.columns.items()}
    some = ViewFactorData(c, train_data.packing[mine], train_data.packings)
    weight = np.sqrt(c["weight"])
    design = _hats(some) * (weight * c["exact"])[:, None]
    share = lsqr(design, weight * c["factor"], atol=1e-10, btol=1e-10, iter_lim=2000)[0]
    return data.columns["exact"] * np.clip(_hats(data) @ share, 0.0, 1.0)


def whole_beds(pair: Any, wall: Any, rays: int) -> list[dict[str, Any]]:
    """Net radiative flux of heated beds, closure beside traced factors."""
    beds = {
        "box, equal spheres, 0.50": WalledBed(fraction=0.50, count=600),
        "cylinder, two sizes, 0.45": WalledBed(
            fraction=0.45, container="cylinder", count=600, sizes=SIZES[2]
        ),
        "box, log-normal, 0.30": WalledBed(fraction=0.30, count=600, sizes=SIZES[1]),
    }
    results = []
    for k, (name, bed) in enumerate(beds.items()):
        packing = bed.packing(SEED + 100 + k)
        begin = time.perf_counter()
        rows = pair.factors(packing, wall_closure=wall)
        seconds = time.perf_counter() - begin
        halves = [
            balanced(Rows.of(view_factors(packing, rays=rays, seed=s), packing)) for s in (1, 2)
        ]
        height = packing.centres[:, 2] / packing.edges[2]
        rng = np.random.default_rng(k)
        hot = [1073.15 if wall_.name == "floor" else 473.15 for wall_ in packing.walls]
        fields = {
            "cold bed, hot walls": (np.full(len(packing), 298.15), [1073.15] * packing.n_walls),
            "hot below, cold above": (1073.15 - 600.0 * height, hot),
            "every sphere its own": (rng.uniform(400.0, 1100.0, len(packing)), hot),
        }
        for field, (temperatures, walls) in fields.items():
            q, *truths = [
                net_radiation(
                    r, temperatures, emissivity=0.9, wall_temperatures=walls,
                    environment_temperature=298.15,
                )
                for r in (rows, *halves)
            ]  # fmt: skip
            truth = 0.5 * (truths[0].absorbed + truths[1].absorbed)
            # The mean of the two halves is off by half their difference.
            noise = 0.5 * np.std(truths[0].absorbed - truths[1].absorbed)
            size = np.sqrt((truth**2).mean())
            heat = 0.5 * (truths[0].boundary_heat + truths[1].boundary_heat)[: packing.n_walls]
            off = q.boundary_heat[: packing.n_walls] - heat
            results.append(
                {
                    "bed": name, "field": field, "spheres": len(packing), "seconds": seconds,
                    "flux_rms": float(np.sqrt(max(((q.absorbed - truth) ** 2).mean() - noise**2, 0))
                                      / size),
                    "noise_rms": float(noise / size),
                    "walls_largest": float(np.abs(off).max() / np.abs(heat).max()),
                    "walls_total": float(abs(off.sum()) / np.abs(heat).sum()),
                }
            )  # fmt: skip
    return results


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", help="data set to train on; without it shipped closures")
    parser.add_argument("--epochs", type=int)
    parser.add_argument("--emitters", type=int, default=12, help="per held-out packing")
    parser.add_argument("--rays", type=int, default=2_000_000, help="per emitter of the truth")
    parser.add_argument("--bed-rays", type=int, default=100_000, help="per sphere, twice")
    parser.add_argument("--pairs-only", action="store_true", help="no whole beds")
    parser.add_argument("--out", help="also write these numbers as JSON")
    options = parser.parse_args()
    truth = held_out(options.emitters, options.rays)
    print(f"{len(truth)} pairs of {len(truth.packings)} held-out packings")
    pairs: dict[str, dict[str, float]] = {}

    def note(name: str, predicted: np.ndarray) -> None:
        pairs[name] = f = figures(predicted, truth)
        print(
            f"{name:<28} R2 {f['r2']:.5f} | {f['r2_above_1e-4']:.5f}  RMSE {f['rmse']:.2e} | "
            f"{f['rmse_above_1e-4']:.2e}  MAE {f['mae']:.2e} | {f['mae_above_1e-4']:.2e}  MAPE "
            f"{100 * f['mape_above_1e-2']:.1f} % {100 * f['mape_above_1e-3']:.1f} %  "
            f"below 0: {f['negative']}  noise {f['noise_rms']:.1e} | "
            f"{f['noise_rms_above_1e-4']:.1e}",
            flush=True,
        )

    if options.data:
        data = read(options.data)
        assert data.walls is not None
        closures = {
            f"{kind}, {markers}": train(data, kind, markers, epochs=options.epochs)
            for markers in ("published", "pencil")
            for kind in ("mlp", "forest")
        }
        note("distance by solid fraction", table_of_distances(data, truth))
        whole = train(_whole(data), "mlp", "published", epochs=options.epochs)
        other = _whole(truth)
        note("mlp, published, whole counts",
             whole.evaluate(**{n: other.columns[n] for n in whole.marker_names}))  # fmt: skip
        wall = train(data, "mlp", "wall", epochs=options.epochs)
    else:
        names = ("mlp_published", "mlp_pencil")
        closures = {name.replace("_", ", "): shipped(f"viewfactor_{name}") for name in names}
        wall = shipped("wallfactor_mlp_wall")
    for name, closure in closures.items():
        note(name, closure.evaluate(**{n: truth.columns[n] for n in closure.marker_names}))
    print("published network, on its authors' rows:", PUBLISHED)
    beds = [] if options.pairs_only else whole_beds(closures["mlp, pencil"], wall, options.bed_rays)
    for row in beds:
        print(
            f"{row['bed']:<28}{row['field']:<24} flux {100 * row['flux_rms']:.2f} % rms (noise "
            f"{100 * row['noise_rms']:.2f} %), walls {100 * row['walls_largest']:.2f} % at most, "
            f"{100 * row['walls_total']:.2f} % together"
        )
    if options.out:
        from greybed.core.files import write_json

        write_json(options.out, {"pairs": pairs, "beds": beds, "published": PUBLISHED})


def _whole(data: ViewFactorData) -> ViewFactorData:
    """The same rows, every sphere between counted as one."""
    columns = {**data.columns, "n_between": data.columns["whole_between"]}
    return ViewFactorData(columns, data.packing, data.packings, data.walls)


if __name__ == "__main__":
    main()
