"""Draws docs/images/dosta.png from the results: python examples/dosta/plot.py [--out FILE]."""

from __future__ import annotations

import argparse
import csv
import json
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

HERE = Path(__file__).parent
OURS, THEIRS, OTHERS = "#2166ac", "#b2182b", "#e08214"


def columns(path: Path) -> dict[str, NDArray[np.float64]]:
    with path.open() as stream:
        rows = list(csv.DictReader(stream))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


def results(folder: Path, start: str) -> list[tuple[dict[str, Any], Path]]:
    """Results whose names begin so, with the paths of their samples."""
    found = sorted(folder.glob(f"{start}*.json"), key=lambda path: path.stem)
    return [(json.loads(path.read_text()), path.with_suffix(".csv")) for path in found]


def silos(axes: Any, folder: Path, reference: dict[str, Any]) -> None:
    for size, opened, colour in (("large", 0.45, OURS), ("small", 0.45, "#67a9cf")):
        for result, path in results(folder, f"silo_{size}_m1"):
            table = columns(path)
            t = table["time"] - opened
            gone = (table["above"][0] - table["above"]) / 1e3
            label = f"{size}: {result['rate'] / 1e3:.1f} k/s"
            axes.plot(t[t >= 0], gone[t >= 0], color=colour, label=label)
            rate = reference[f"silo_{size}_m1"]["MUSEN"]["rate"] / 1e3
            first = result["window_from"]
            at = np.array([first, t[-1]])
            begin = np.interp(first, t, gone)
            axes.plot(at, begin + rate * (at - first), "--", color=THEIRS)
    axes.plot([], [], "--", color=THEIRS, label="slope of MUSEN: 24.2, 7.7 k/s")
    axes.set(xlabel="time after opening [s]", ylabel="spheres out [thousand]", title="Silo, M1")
    axes.legend(fontsize=8)


def trends(axes: Any, folder: Path) -> None:
    def softness(pair: tuple[dict[str, Any], Path]) -> float:
        return float(pair[0]["softness"])

    # With the friction of the case, and only friction or softness changed.
    points: dict[float, list[tuple[float, float, float]]] = {}
    for result, _ in sorted(results(folder, "silo_scaled"), key=softness):
        if "step" in result["changed"]:
            continue
        friction = result["changed"].get("friction", 0.3)
        row = (friction, result["rate"] / 1e3, result["rate_error"] / 1e3)
        points.setdefault(round(result["softness"]), []).append(row)
    for soft, mark, colour in zip(points, "os^D", (OTHERS, "k", OURS, THEIRS), strict=False):
        x, y, error = np.array(sorted(points[soft])).T
        style = f"{mark}-" if len(x) > 1 else mark
        axes.errorbar(x, y, error, fmt=style, color=colour, label=f"E / {soft:g}", capsize=3)
    axes.set(xlabel="friction of the spheres", ylabel="rate [thousand / s]", title="Half the width")
    axes.set_ylim(bottom=0.0)
    axes.legend(fontsize=8)


def drum(axes: Any, folder: Path, reference: dict[str, Any]) -> None:
    known = reference["drum"]
    for (result, path), style in zip(results(folder, "drum"), ("-", "--", ":", "-."), strict=False):
        table = columns(path)
        t = table["time"] - 0.5
        changed = result["changed"]
        label = "".join(f", {k} {v:g}" for k, v in changed.items() if k in ("coarse", "slice"))
        share = table["zone2_m1"] / result["spheres"][1]
        axes.plot(t[t >= 0], 30.0 * share[t >= 0], style, color=OURS, label="greybed" + label)
    for name, mark, colour in (("LIGGGHTS", "o", THEIRS), ("MUSEN", "x", OTHERS)):
        axes.plot(known["time"], np.array(known[name]) / 1e3, mark, color=colour, label=name)
    axes.set(xlabel="time of turning [s]", ylabel="M1 in zone 2 [thousand of 30]", title="Drum")
    axes.set_ylim(top=33.0)
    axes.legend(fontsize=8, loc="upper right")


def impact(axes: Any, folder: Path, reference: dict[str, Any]) -> None:
    for result, path in results(folder, "impact_25k"):
        table = columns(path)
        here = ~np.isnan(table["z"])
        t = 1e3 * (table["time"][here] - result["begin_s"])
        label = f"greybed, E / {result['softness']:g}"
        colour = OURS if result["softness"] == 1.0 else "k"
        axes.plot(t, 1e3 * table["z"][here], color=colour, label=label)
    for name, mark, colour in (("LIGGGHTS", "o", THEIRS), ("MUSEN", "x", OTHERS)):
        low = reference["impact_25k"][name]
        label = f"{name}, lowest"
        axes.plot(low["lowest_at_ms"], low["lowest_mm"], mark, color=colour, label=label)
    axes.set(xlabel="time [ms]", ylabel="height of the ball [mm]", title="Impact, 25,000 spheres")
    axes.legend(fontsize=8)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--results", type=Path, default=HERE / "results")
    parser.add_argument("--out", type=Path, default=HERE.parents[1] / "docs/images/dosta.png")
    options = parser.parse_args()
    reference = json.loads((HERE / "reference.json").read_text())
    figure, axes = plt.subplots(2, 2, figsize=(9.0, 7.0), layout="constrained")
    silos(axes[0, 0], options.results, reference)
    trends(axes[0, 1], options.results)
    drum(axes[1, 0], options.results, reference)
    impact(axes[1, 1], options.results, reference)
    figure.savefig(options.out, dpi=110)
    print(f"wrote {options.out}")


if __name__ == "__main__":
    main()
