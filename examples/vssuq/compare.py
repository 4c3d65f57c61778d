"""Rise times found against those measured: python examples/vssuq/compare.py --runs DIR.

Reads what simulate.py has written, takes for each intruder the first time at which no bead hides it
from above, and writes predicted.csv (all runs), measured.csv (the measured times of the conditions
that were simulated, for `greybed diagnose examples/vssuq/study.toml`) and vssuq.png.
"""

from __future__ import annotations

import argparse
import csv
import re
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from scipy.stats import t as student

matplotlib.use("Agg")
import matplotlib.pyplot as plt

HERE = Path(__file__).parent


def rows_of(name: str) -> list[dict[str, str]]:
    """Rows of a table beside this file."""
    with open(HERE / name, newline="") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def run(path: Path) -> dict[str, Any]:
    """Condition, seed, share of the stated velocity, and the course of one run."""
    condition, seed, share = re.fullmatch(r"rise-(\d+)-(\d+)(?:-([\d.]+))?", path.stem).groups()
    with open(path, newline="") as file:
        names = next(csv.reader(file))
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    time = table[:, 0]
    hidden = table[:, [k for k, n in enumerate(names) if n.startswith("over")]]
    seen = np.array([time[h == 0][0] if (h == 0).any() else np.inf for h in hidden.T])
    return {
        "condition": int(condition), "seed": int(seed), "share": float(share or 1.0),
        "time": time, "height": table[:, 1], "seen": np.sort(seen),
        "places": table[:, [k for k, n in enumerate(names) if n.startswith("intruder")]],
    }  # fmt: skip


def write_predicted(runs: list[dict[str, Any]], slope: float) -> None:
    """All runs, and the slope of all; times that were not reached are left empty."""
    with open(HERE / "predicted.csv", "w", newline="") as file:
        out = csv.writer(file)
        out.writerow(["condition [-]", "seed [-]", "share of the stated velocity [-]",
                      "order of emergence [-]", "rise time [s]", "simulated [s]",
                      "d ln(time) / d ln(velocity) [-]"])  # fmt: skip
        for r in runs:
            for order, time in enumerate(r["seen"], start=1):
                shown = f"{time:.2f}" if np.isfinite(time) else ""
                out.writerow([r["condition"], r["seed"], r["share"], order, shown,
                              f"{r['time'][-1]:.2f}", f"{slope:.3f}"])  # fmt: skip


def write_measured(simulated: set[tuple[int, int]]) -> None:
    """Measured times of the conditions and orders of emergence that were simulated."""
    conditions = rows_of("conditions.csv")
    with open(HERE / "measured.csv", "w", newline="") as file:
        out = csv.writer(file)
        out.writerow(["condition [-]", "velocity [m/s]", "intruders [-]", "order [-]",
                      "replicate [-]", "rise_time [s]"])  # fmt: skip
        for row in rows_of("rise_times.csv"):
            n, order = int(row["condition [-]"]), int(row["order of emergence [-]"])
            if (n, order) in simulated:
                c = conditions[n - 1]
                out.writerow([n, c["U [m/s]"], c["intruders [-]"], order, row["replicate [-]"],
                              row["rise time [s]"]])  # fmt: skip


def sensitivity(runs: list[dict[str, Any]]) -> float:
    """d ln(rise time) / d ln(velocity), from runs that differ in nothing but the velocity."""
    found, conditions = [], rows_of("conditions.csv")
    for r in runs:
        for other in runs:
            one, two = conditions[r["condition"] - 1], conditions[other["condition"] - 1]
            same = all(one[k] == two[k] for k in ("bed mass [g]", "intruders [-]", "size"))
            fast, slow = (
                float(c["U [m/s]"]) * x["share"] for c, x in ((one, r), (two, other))
            )  # fmt: skip
            if same and r["seed"] == other["seed"] and fast > slow:
                both = np.isfinite(r["seen"]) & np.isfinite(other["seen"])
                found += list(np.log(other["seen"] / r["seen"])[both] / np.log(slow / fast))
    return float(np.mean(found)) if found else np.nan


def main() -> None:
    """Write the tables, draw, and print a row for each condition and order."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=Path, required=True)
    runs = [run(p) for p in sorted(parser.parse_args().runs.glob("rise-*.csv"))]
    as_stated = [r for r in runs if r["share"] == 1.0]
    slope, conditions = sensitivity(runs), rows_of("conditions.csv")
    write_predicted(runs, slope)
    print(f"d ln(rise time) / d ln(velocity) = {slope:.2f}")
    measured, predicted = {}, {}
    for row in rows_of("rise_times.csv"):
        key = int(row["condition [-]"]), int(row["order of emergence [-]"])
        measured.setdefault(key, []).append(float(row["rise time [s]"]))
    for r in as_stated:
        for order, time in enumerate(r["seen"], start=1):
            if np.isfinite(time):
                predicted.setdefault((r["condition"], order), []).append(time)
    write_measured(set(predicted))
    figure, axes = plt.subplots(1, 2, figsize=(10.5, 4), layout="constrained")
    colours = dict(zip(sorted({k[0] for k in predicted}), ("#1b6ca8", "#d1602b", "#3a8f5c", "C4"),
                       strict=False))  # fmt: skip
    for key in sorted(predicted):
        m, p = np.array(measured[key]), np.array(predicted[key])
        mine = conditions[key[0] - 1]
        by_velocity = abs(slope) * float(mine["u(U) [m/s]"]) / float(mine["U [m/s]"]) * p.mean()
        scatter = p.std(ddof=1) if len(p) > 1 else 0.0
        error = float(np.hypot(scatter, by_velocity))
        half = student.ppf(0.975, len(m) - 1) * m.std(ddof=1) / np.sqrt(len(m))
        print(f"condition {key[0]}, order {key[1]}: measured {m.mean():.2f} +- {half:.2f} s, sd "
              f"{m.std(ddof=1):.2f}; found {p.mean():.2f} s, sd of {len(p)} seeds {scatter:.2f}, "
              f"by u(U) {by_velocity:.2f}")  # fmt: skip
        label = (f"{float(mine['U [m/s]']):.2f} m/s, {mine['intruders [-]']} {mine['size']}"
                 if key[1] == 1 else None)  # fmt: skip
        axes[0].errorbar(m.mean(), p.mean(), xerr=half, yerr=error, fmt="o", ms=4, capsize=2,
                         color=colours[key[0]], label=label)  # fmt: skip
    top = 1.15 * max(np.mean(v[k]) for v in (measured, predicted) for k in predicted)
    axes[0].plot([0, top], [0, top], "k--", lw=0.8)
    axes[0].set(xlabel="measured rise time [s]", ylabel="found [s]", xlim=(0, top), ylim=(0, top),
                title="Bars: 95 % of the mean; seeds and velocity")  # fmt: skip
    axes[0].legend(fontsize=8, frameon=False)
    for r in as_stated:
        if r["seed"] == 1:
            for k, z in enumerate(r["places"].T):
                speed = float(conditions[r["condition"] - 1]["U [m/s]"])
                axes[1].plot(
                    r["time"], 1e3 * z, lw=0.9, color=colours.get(r["condition"], "0.5"),
                    label=f"{speed:.2f} m/s, {r['places'].shape[1]}" if k == 0 else None,
                )  # fmt: skip
    axes[1].set(xlabel="time [s]", ylabel="height of an intruder [mm]", ylim=(0, None))
    axes[1].legend(fontsize=8, frameon=False)
    figure.savefig(HERE / "vssuq.png", dpi=110)


if __name__ == "__main__":
    main()
