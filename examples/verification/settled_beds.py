"""Settled beds by both engines over seeds: height, coordination and decay of the energy.

    python examples/verification/settled_beds.py --out DIR

Spheres of 1.7 to 2.3 mm (radii) fall into a box and come to rest, with greybed and with LIGGGHTS
(which must be installed), from the same random places for each seed. Writes settled_beds.json and
settled_beds.png; the recorded ones are examples/verification/results/settled_beds.json and
docs/images/settled_beds.png. About ten minutes for the defaults on half a core.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path

import numpy as np

from greybed.dem.case import load_particle_case
from greybed.dem.liggghts import LiggghtsRun
from greybed.dem.runner import ParticleRun

CASE = """
kind = "particles"
duration = {duration}
time_step = 4e-5
seed = {seed}
[output]
samples = 4e-3
[[material]]
name = "glass"
density = 2500
youngs_modulus = 5e6
poissons_ratio = 0.3
[[contact]]
between = ["glass", "glass"]
restitution = 0.5
friction = 0.4
[[particles]]
kind = "pack"
material = "glass"
sizes = "uniform:1.7mm,2.3mm"
count = {count}
lower = [0, 0, 0]
upper = [{wide}, {wide}, {high}]
{walls}
"""
ENGINES = ("greybed", "liggghts")
# Share of its largest value below which the kinetic energy counts as gone.
GONE = 1e-3


def case_text(count: int, seed: int, duration: float) -> str:
    """The case: spheres at random in a box that they fill to 22 % of its height."""
    wide = 4.6e-3 * (count / 4.0) ** (1.0 / 3.0)
    high = count * 3.5e-8 / (0.22 * wide**2)
    sides = [([0, 0, 0], n) for n in ([1, 0, 0], [0, 1, 0], [0, 0, 1])]
    sides += [([wide, wide, 0], n) for n in ([-1, 0, 0], [0, -1, 0])]
    walls = "".join(
        f'[[wall]]\nname = "w{k}"\nkind = "plane"\npoint = {point}\nnormal = {normal}\n'
        for k, (point, normal) in enumerate(sides)
    )
    return CASE.format(
        count=count, seed=seed, duration=duration, wide=wide, high=high, walls=walls
    )  # fmt: skip


def settle(count: int, seed: int, duration: float, engine: str, ranks: int = 1) -> dict[str, list]:
    """Columns of the history of one bed."""
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "case.toml"
        path.write_text(case_text(count, seed, duration))
        case = load_particle_case(path)
        if engine == "greybed":
            run = ParticleRun(case, {})
        else:
            run = LiggghtsRun(case, {}, Path(name) / "work", ranks=ranks)
        for _ in run.go_on():
            pass
    rows = run.tally.history
    return {
        key: [row[name] for row in rows]
        for key, name in (
            ("time_s", "time [s]"), ("kinetic_energy_J", "kinetic energy [J]"),
            ("height_m", "height [m]"), ("coordination", "coordination [-]"),
        )
    }  # fmt: skip


def figures(history: dict[str, list]) -> dict[str, float]:
    """Height and coordination at the end, and when the kinetic energy is gone."""
    energy, time = np.array(history["kinetic_energy_J"]), np.array(history["time_s"])
    last = int(np.flatnonzero(energy > GONE * energy.max())[-1])
    if last + 1 == len(energy):
        raise SystemExit("the bed still moves at the end; make the duration longer.")
    # Between two samples, along the logarithm.
    a, b = np.log(energy[last : last + 2])
    share = (a - np.log(GONE * energy.max())) / (a - b)
    return {
        "height_m": history["height_m"][-1],
        "coordination": history["coordination"][-1],
        "energy_gone_s": float(time[last] + share * (time[last + 1] - time[last])),
        "largest_kinetic_energy_J": float(energy.max()),
    }


def compared(found: dict[str, list[dict[str, float]]]) -> dict[str, dict[str, float]]:
    """Means and spreads over seeds, and the difference of the means over its standard error."""
    result = {}
    for name in found["greybed"][0]:
        a, b = (np.array([f[name] for f in found[engine]]) for engine in ENGINES)
        error = np.sqrt((a.var(ddof=1) + b.var(ddof=1)) / len(a))
        result[name] = {
            "greybed": float(a.mean()), "greybed_sd": float(a.std(ddof=1)),
            "liggghts": float(b.mean()), "liggghts_sd": float(b.std(ddof=1)),
            "difference_over_error": float((b.mean() - a.mean()) / error),
        }  # fmt: skip
    return result


def draw(histories: dict[str, list[dict[str, list]]], path: Path) -> None:
    """Energy, height and coordination over time, a line for each seed."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 3, figsize=(11, 3.4), layout="constrained")
    parts = (
        ("kinetic_energy_J", "kinetic energy [J]", 1.0),
        ("height_m", "height [mm]", 1e3),
        ("coordination", "contacts per sphere [-]", 1.0),
    )
    for axis, (key, label, factor) in zip(axes, parts, strict=True):
        for engine, colour in zip(ENGINES, ("#1b6ca8", "#d1602b"), strict=True):
            for k, history in enumerate(histories[engine]):
                axis.plot(
                    history["time_s"][1:], factor * np.array(history[key][1:]), color=colour,
                    lw=0.8, alpha=0.8, label=engine if k == 0 else None,
                )  # fmt: skip
        axis.set(xlabel="time [s]", ylabel=label)
    axes[0].set_yscale("log")
    axes[0].legend(frameon=False)
    figure.savefig(path, dpi=120)


def measure(
    data: Path,
    picture: Path,
    count: int = 2000,
    seeds: int = 6,
    duration: float = 0.5,
    ranks: int = 1,
) -> dict[str, float]:
    """Run all beds, write what they have come to, draw, and give what is compared."""
    histories: dict[str, list[dict[str, list]]] = {engine: [] for engine in ENGINES}
    for seed in range(1, seeds + 1):
        for engine in ENGINES:
            histories[engine].append(settle(count, seed, duration, engine, ranks))
            print(engine, seed, figures(histories[engine][-1]), flush=True)
    found = {engine: [figures(h) for h in histories[engine]] for engine in ENGINES}
    answer = {
        "spheres": count, "seeds": seeds, "ranks": ranks,
        "compared": compared(found), "beds": found,
    }  # fmt: skip
    data.write_text(json.dumps(answer, indent=1) + "\n")
    draw(histories, picture)
    return outcome(answer)


def outcome(answer: dict) -> dict[str, float]:
    """Differences of the means over their standard errors."""
    rows = answer["compared"]
    return {
        f"settled_beds.{name}": abs(rows[key]["difference_over_error"])
        for name, key in (
            ("height", "height_m"), ("contacts", "coordination"), ("decay", "energy_gone_s"),
        )
    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--count", type=int, default=2000)
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--duration", type=float, default=0.5)
    parser.add_argument("--ranks", type=int, default=1)
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    print(
        measure(
            given.out / "settled_beds.json", given.out / "settled_beds.png",
            given.count, given.seeds, given.duration, given.ranks,
        )
    )  # fmt: skip


if __name__ == "__main__":
    main()
