"""Exchange factors of whole beds by a diffuse network, beside traced reflecting paths.

Run: python benchmarks/exchange.py --out runs/exchange.json

The network gets the traced view factors, then those of the shipped closures, so that what it costs
to spread reflected light evenly stands apart from what the closure's factors cost. The truth is the
mean of two traces; its noise is half the difference of the two, its variance is subtracted from
the mean squares. For pairs the shipped exchange closure stands beside.
"""

from __future__ import annotations

import argparse
import time
from itertools import product
from typing import Any

import numpy as np
from scipy.sparse import coo_array

from greybed.closures import shipped
from greybed.closures.viewfactor import exact_view_factor, neighbourhood, pair_markers
from greybed.closures.viewfactor.bed import inner_fraction
from greybed.core import Packing
from greybed.core.rows import Rows, balanced
from greybed.coupling import diffuse_exchange, radiative_network
from greybed.datasets.generate import Box, Mono, random_packing
from greybed.raytrace import exchange_factors

SEED = 900_000  # far from the seeds of any campaign
EMISSIVITIES = (0.3, 0.65, 0.8)
COUNT, FRACTION, RADIUS = 300, 0.5, 1e-3
NEAR = 1e-2  # view factor from which a pair counts as neighbours
REACH = 8.0  # of the exchange closure [mean radii]


def full(rows: Any) -> np.ndarray:
    """Spheres and walls beside each other, shape (n, n + n_walls)."""
    return np.column_stack([rows.factors.toarray(), rows.wall_factors])


def by_pairs(packing: Packing, emissivity: float) -> np.ndarray:
    """D_ij of the shipped exchange closure, shape (n, n); nothing beyond its reach."""
    phi = inner_fraction(packing)
    hood = neighbourhood(packing, REACH * float(packing.radii.mean()))
    markers = pair_markers(packing, hood, solid_fraction=phi)
    view, grey = shipped(), shipped("exchange_mlp_exchange")
    factor = view.evaluate(**markers.of(view.marker_names))
    i, j = hood.owner[hood.within], hood.sphere[hood.within]
    x, ratio = markers.radius_over_distance, markers.radius_ratio
    free = exact_view_factor(packing.radii[i], packing.radii[j], packing.radii[j] / x)
    d = grey.evaluate(
        radius_over_distance=x, radius_ratio=ratio, visible_share=np.minimum(factor / free, 1.0),
        emissivity=emissivity, solid_fraction=phi,
    )  # fmt: skip
    return coo_array((d, (i, j)), shape=(len(packing), len(packing))).toarray()


def fields(packing: Packing) -> dict[str, tuple[np.ndarray, list[float]]]:
    """Temperatures of spheres and walls [K]."""
    height = packing.centres[:, 2] / packing.edges[2]
    rng = np.random.default_rng(1)
    single = rng.uniform(400.0, 1100.0, len(packing))
    if not packing.walls:
        half = np.where(height < 0.5, 1073.15, 473.15)
        return {"lower half hot": (half, []), "every sphere its own": (single, [])}
    hot = [1073.15 if wall.name == "floor" else 473.15 for wall in packing.walls]
    return {
        "cold bed, hot walls": (np.full(len(packing), 298.15), [1073.15] * packing.n_walls),
        "hot below, cold above": (1073.15 - 600.0 * height, hot),
        "every sphere its own": (single, hot),
    }


def off(value: np.ndarray, halves: list[np.ndarray], where: np.ndarray) -> dict[str, float]:
    """Error against the mean of two traces where ``where`` holds, their noise taken out."""
    truth = 0.5 * (halves[0] + halves[1])[where]
    noise2 = 0.25 * np.mean((halves[0] - halves[1])[where] ** 2)
    error = value[where] - truth
    return {
        "rms": float(np.sqrt(max(np.mean(error**2) - noise2, 0.0))),
        "noise": float(np.sqrt(noise2)),
        "bias": float(error.mean()),
        "mean": float(truth.mean()),
    }


def measured(packing: Packing, name: str, rays: int) -> list[dict[str, Any]]:
    """One row for each emissivity and source of view factors."""
    traces = [exchange_factors(packing, [*EMISSIVITIES, 1.0], rays=rays, seed=s) for s in (1, 2)]
    black = [balanced(Rows.of(trace[-1], packing)) for trace in traces]
    walls = shipped("wallfactor_mlp_wall") if packing.walls else None
    views = {"traced F": black[0], "closure's F": shipped().factors(packing, wall_closure=walls)}
    n = len(packing)
    seen = 0.5 * (full(black[0]) + full(black[1]))
    apart = np.zeros(seen.shape, bool)
    apart[:, :n] = ~np.eye(n, dtype=bool)
    kinds = {
        "near": apart & (seen > NEAR),
        "self": ~apart & (np.arange(seen.shape[1]) < n),
        "walls": np.broadcast_to(np.arange(seen.shape[1]) >= n, seen.shape),
    }
    results = []
    for k, emissivity in enumerate(EMISSIVITIES):
        halves = [balanced(Rows.of(trace[k], packing)) for trace in traces]
        truths = [full(half) for half in halves]
        for (source, view), sides in product(views.items(), (1, 24)):
            begin = time.perf_counter()
            rows = diffuse_exchange(view, emissivity, packing=packing, sides=sides).rows()
            row: dict[str, Any] = {
                "bed": name, "emissivity": emissivity, "source": f"{source}, {sides} sides",
                "seconds": time.perf_counter() - begin, "imbalance": rows.imbalance,
            }  # fmt: skip
            row |= {
                kind: off(full(rows), truths, where) for kind, where in kinds.items() if where.any()
            }
            for field, (t, t_walls) in fields(packing).items():
                q, *heats = [
                    radiative_network(r, temperatures=t, wall_temperatures=t_walls).heats
                    for r in (rows, *halves)
                ]
                flux = off(q, heats, np.ones(n, bool))
                size = np.sqrt((0.25 * (heats[0] + heats[1]) ** 2).mean())
                row[field] = {key: flux[key] / size for key in ("rms", "noise")}
                row[field]["size"] = float(
                    np.abs(q).sum() / np.abs(0.5 * (heats[0] + heats[1])).sum() - 1.0
                )
            results.append(row)
        pairs = np.zeros(seen.shape)
        pairs[:, :n] = by_pairs(packing, emissivity)
        results.append(
            {
                "bed": name, "emissivity": emissivity, "source": "exchange closure",
                "near": off(pairs, truths, kinds["near"]),
            }
        )  # fmt: skip
    return results


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rays", type=int, default=40_000, help="per sphere, twice")
    parser.add_argument("--out", help="also write these numbers as JSON")
    options = parser.parse_args()
    results = []
    for k, container in enumerate((Box(), None)):
        bed = random_packing(COUNT, FRACTION, Mono(RADIUS), container=container, seed=SEED + k)
        results += measured(bed, "box" if container else "periodic", options.rays)
    for row in results:
        print(f"{row['bed']}, emissivity {row['emissivity']}, {row['source']}")
        for key, value in row.items():
            if isinstance(value, dict) and "mean" in value:
                print(
                    f"  {key:<24} rms {value['rms']:.5f} (noise {value['noise']:.5f}), bias "
                    f"{value['bias']:+.5f} of {value['mean']:.5f} "
                    f"({100 * value['bias'] / value['mean']:+.1f} %)"
                )
            elif isinstance(value, dict):
                print(
                    f"  {key:<24} flux {100 * value['rms']:.1f} % rms (noise "
                    f"{100 * value['noise']:.1f} %), sum of sizes {100 * value['size']:+.1f} %"
                )
    if options.out:
        from greybed.core.files import write_json

        write_json(options.out, {"rays": options.rays, "rows": results})


if __name__ == "__main__":
    main()
