"""The measure of a closure of filtered drag: coarse simulations against a fine one.

python examples/filtered_drag/coarse.py --out runs/coarse

A box that repeats, gas carries particles as two fluids. The fine grid resolves clusters; grids 4
and 8 times as coarse do not, and are run without correction, with published models and with the
closures that come with greybed. Compared are the slip of the means (gas less solids along gravity,
each weighted with its phase) and the spread of the solid fraction, filtered to the coarse cells in
the fine run. Intervals are over seeds of the perturbation that clusters grow from.

Fine runs are kept in the folder as they finish (fine.json): a second call with the same settings
does not repeat them, so other closures (--models) cost coarse runs only.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from greybed.closures.drag import drag_law
from greybed.closures.drag.filtered import Material
from greybed.core.files import atomic_path
from greybed.coupling.filtered_drag import filtered_drag
from greybed.datasets.drag_design import FlowDesign
from greybed.datasets.drag_filters import box_mean
from greybed.datasets.drag_flows import GRAVITY, TwoFluidFlow, clock

COARSE = (4, 8)
MODELS = (
    "none", "radl-sundaresan", "igci", "milioli", "shipped:filtered_drag_mlp_plain",
    "shipped:filtered_drag_mlp_full", "shipped:filtered_drag_forest_plain",
)  # fmt: skip
# What decides a fine run besides its seed.
OF_FLOW = ("cells", "cell", "fraction", "diameter", "density", "develop", "length")


def design_of(options: argparse.Namespace, factor: int, seed: int) -> FlowDesign:
    """The box on a grid so many times as coarse as the fine one."""
    nx, ny = options.cells
    return FlowDesign(
        name="box", kind="two-fluid", diameter=options.diameter,
        particle_density=options.density, solid_fraction=options.fraction,
        cells=(nx // factor, ny // factor, 1), cell=options.cell * factor, seed=seed,
    )  # fmt: skip


def run(
    design: FlowDesign, model: str, options: argparse.Namespace, widths: tuple[int, ...]
) -> dict[str, float]:
    """Slip of the means [m/s], and spread of the solid fraction over boxes so many cells wide."""
    correction = None
    if model != "none":
        material = Material(
            design.diameter, design.particle_density, design.gas_density, design.gas_viscosity
        )
        correction = filtered_drag(
            model, material, drag_law(design.law), (0.0, -GRAVITY, 0.0), gas_weight=True
        )
    flow = TwoFluidFlow(design, correction)
    unit = clock(design)
    end, look = options.develop + options.length, options.develop
    rows: list[list[float]] = []
    begin = time.perf_counter()
    while unit * end - flow.time > 1e-12:
        flow.step(unit * end)
        if flow.time >= unit * look:
            look += 0.05
            seen = flow.look()
            phi, eps = seen.solid_fraction, 1.0 - seen.solid_fraction
            gas = (eps * seen.gas[1]).mean() / eps.mean()
            solids = (phi * seen.solids[1]).mean() / phi.mean()
            rows.append([gas - solids, *(box_mean(phi, w, 2).std() for w in widths)])
    means = np.mean(rows, axis=0)
    found = {"slip": float(means[0]), "seconds": time.perf_counter() - begin}
    return found | {f"spread_{w}": float(m) for w, m in zip(widths, means[1:], strict=True)}


def fine_runs(options: argparse.Namespace, out: Path) -> list[dict[str, float]]:
    """The fine runs, those of the folder where their settings are the same."""
    settings = json.loads(json.dumps({name: getattr(options, name) for name in OF_FLOW}))
    file = out / "fine.json"
    kept = json.loads(file.read_text()) if file.exists() else {}
    fine: list[dict[str, float]] = kept["fine"] if kept.get("settings") == settings else []
    for seed in range(options.seeds):
        again = seed < len(fine)
        if not again:
            fine.append(run(design_of(options, 1, seed), "none", options, COARSE))
            with atomic_path(file) as path:
                path.write_text(json.dumps({"settings": settings, "fine": fine}, indent=1))
        took = "of an earlier call" if again else f"{fine[seed]['seconds']:.0f} s"
        print(f"fine, seed {seed}: slip {fine[seed]['slip']:.4g} m/s, {took}", flush=True)
    return fine[: options.seeds]


def interval(values: list[float]) -> float:
    """Half of the 95 % interval of a mean, by Student's t."""
    from scipy.stats import t

    n = len(values)
    return float(t.ppf(0.975, n - 1) * np.std(values, ddof=1) / math.sqrt(n)) if n > 1 else math.nan


def draw(
    out: Path, models: list[str], table: list[dict[str, Any]], truth: float, half: float
) -> None:
    """Slips with their intervals, beside the band of the fine run."""
    figure, axes = plt.subplots(figsize=(7.0, 3.6), layout="constrained")
    x = np.arange(len(models))
    for k, factor in enumerate(COARSE):
        rows = [row for row in table if row["factor"] == factor]
        axes.errorbar(
            x + 0.15 * (k - 0.5), [row["slip"] for row in rows],
            [row["slip_interval"] for row in rows], fmt="os"[k], capsize=3,
            label=f"cells {factor} times as wide",
        )  # fmt: skip
    axes.axhspan(truth - half, truth + half, color="0.85", label="fine, 95 %")
    names = [Path(m.removeprefix("shipped:filtered_drag_")).stem for m in models]
    axes.set_xticks(x, names, rotation=20)
    axes.set_ylabel("slip of the means [m/s]")
    axes.legend(frameon=False)
    figure.savefig(out / "coarse.svg")
    figure.savefig(out / "coarse.png", dpi=120)


def main() -> int:
    """Run all, print the table, draw it."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", default="runs/coarse", help="folder (default: runs/coarse)")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--cells", type=int, nargs=2, default=(48, 144), help="of the fine grid")
    parser.add_argument("--cell", type=float, default=4.0, help="fine cell over diameter")
    parser.add_argument("--fraction", type=float, default=0.12, help="mean solid fraction")
    parser.add_argument("--diameter", type=float, default=85e-6, help="[m]")
    parser.add_argument("--density", type=float, default=1300.0, help="[kg/m3]")
    parser.add_argument("--develop", type=float, default=5.0, help="terminal velocities over g")
    parser.add_argument("--length", type=float, default=4.0, help="the same, averaged over")
    parser.add_argument("--models", nargs="+", default=MODELS, help="published, shipped:, files")
    options = parser.parse_args()
    out = Path(options.out)
    out.mkdir(parents=True, exist_ok=True)
    fine = fine_runs(options, out)
    truth = float(np.mean([f["slip"] for f in fine]))
    table: list[dict[str, Any]] = []
    for factor in COARSE:
        spread = float(np.mean([f[f"spread_{factor}"] for f in fine]))
        for model in options.models:
            runs = [
                run(design_of(options, factor, seed), model, options, (1,))
                for seed in range(options.seeds)
            ]
            slips = [r["slip"] for r in runs]
            row = {
                "factor": factor, "model": model, "slip": float(np.mean(slips)), "slips": slips,
                "slip_interval": interval(slips),
                "slip_error": float(np.mean(slips)) / truth - 1.0,
                "spread": float(np.mean([r["spread_1"] for r in runs])), "spread_fine": spread,
            }  # fmt: skip
            table.append(row)
            print(
                f"{factor} x {model:38s} slip {row['slip']:.4g} +- {row['slip_interval']:.2g} m/s, "
                f"error {100 * row['slip_error']:+.1f} %, spread {row['spread']:.3f} "
                f"(fine {spread:.3f})",
                flush=True,
            )
    half = interval([f["slip"] for f in fine])
    print(f"fine: slip {truth:.4g} +- {half:.2g} m/s")
    (out / "coarse.json").write_text(
        json.dumps({"fine": fine, "slip": truth, "slip_interval": half, "table": table}, indent=1)
    )
    draw(out, options.models, table, truth, half)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
