"""Cases of Dosta et al. 2024: runs one, from its checkpoint if there is one, and measures it.

    python examples/dosta/run.py silo_large_m1 --out runs/dosta
    python examples/dosta/run.py silo_scaled --friction 0.1 --soften 100 --out runs/dosta

Writes NAME.csv (samples) and NAME.json (what is measured) to examples/dosta/results, and the
checkpoint to the folder of --out.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import json
import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from greybed.core.config import build, read_toml
from greybed.core.files import atomic_path, output_folder
from greybed.core.progress import progress
from greybed.core.units import parse_quantity
from greybed.dem.case import ParticleCase
from greybed.dem.checkpoint import kept_with
from greybed.dem.runner import ParticleRun

HERE = Path(__file__).parent
# Young's modulus of steel in the paper [Pa]: what a case file has says how much softer it is.
STEEL_MODULUS = 210e9
# What differs for M2: its own numbers, and its contact with itself (Dosta et al. 2024).
M2 = {"density": 2000.0, "modulus": 0.5e9, "restitution": 0.4, "friction": 0.4}
# Seconds of the clock between two checkpoints.
KEEP = 60.0
Row = dict[str, float]


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("case", help="name of a case file of this folder, without .toml")
    parser.add_argument("--out", type=Path, required=True, help="folder for checkpoints")
    parser.add_argument("--results", type=Path, default=HERE / "results", help="folder for results")
    parser.add_argument("--material", choices=["M1", "M2"], default="M1", help="of a silo")
    parser.add_argument("--soften", type=float, help="divides the moduli of the paper [-]")
    parser.add_argument("--friction", type=float, help="of the spheres with each other [-]")
    parser.add_argument("--wall-friction", type=float, help="of the spheres with steel [-]")
    parser.add_argument("--restitution", type=float, help="of the spheres with each other [-]")
    parser.add_argument("--count", type=int, help="spheres of the first pack")
    parser.add_argument("--slice", type=float, help="a periodic slice of the drum, so deep [m]")
    parser.add_argument("--coarse", type=float, help="spheres so many times as large [-]")
    parser.add_argument("--seed", type=int, help="other places at the start")
    parser.add_argument("--step", type=float, help="multiplies the time step [-]")
    parser.add_argument("--duration", type=float, help="of the run [s]")
    parser.add_argument("--threads", type=int, default=1, help="change no bit (default: 1)")
    parser.add_argument("--quiet", action="store_true", help="no progress bar")
    return parser.parse_args()


def softness_of(case: dict[str, Any]) -> float:
    """What the moduli of the paper are divided by: that of steel [Pa] tells."""
    modulus = case["material"][-1]["youngs_modulus"]
    if isinstance(modulus, str):
        modulus = parse_quantity(modulus, "pressure")
    return STEEL_MODULUS / modulus


def content_of(options: argparse.Namespace) -> dict[str, Any]:
    """The case file with what the options change."""
    case = read_toml(HERE / f"{options.case}.toml")
    first = case["material"][0]
    softness = softness_of(case)
    wanted = softness if options.soften is None else options.soften
    step = parse_quantity(case["time_step"], "time") * math.sqrt(wanted / softness)
    case["time_step"] = step * (options.step or 1.0)
    for material in case["material"]:
        modulus = parse_quantity(material["youngs_modulus"], "pressure")
        material["youngs_modulus"] = modulus * softness / wanted
    contact = case["contact"][0]
    if options.material == "M2":
        first["density"], first["youngs_modulus"] = M2["density"], M2["modulus"] / wanted
        contact["restitution"], contact["friction"] = M2["restitution"], M2["friction"]
    if options.friction is not None:
        contact["friction"] = options.friction
    if options.restitution is not None:
        contact["restitution"] = options.restitution
    if options.wall_friction is not None:
        for row in case["contact"]:
            if row["between"][1] == "steel" != row["between"][0]:
                row["friction"] = options.wall_friction
    if options.count is not None:
        deepen(case, options.count)
    if options.coarse is not None:
        case["coarse_graining"] = options.coarse
        case["time_step"] *= options.coarse
        case.pop("skin")
    if options.slice is not None:
        cut(case, options.slice)
    for key in ("seed", "duration"):
        if getattr(options, key) is not None:
            case[key] = getattr(options, key)
    return case


def deepen(case: dict[str, Any], count: int) -> None:
    """Another number of spheres; more of them fall from higher, and a ball waits 0.1 s longer."""
    table = case["particles"][0]
    more, table["count"] = count / table["count"], count
    if more > 1.0:
        low, high = (parse_quantity(table[end][2], "length") for end in ("lower", "upper"))
        table["upper"][2] = low + more * (high - low)
        for ball in case["particles"][1:]:
            ball["at"] = parse_quantity(ball["at"], "time") + 0.1
            case["duration"] = parse_quantity(case["duration"], "time") + 0.1


def cut(case: dict[str, Any], depth: float) -> None:
    """A slice of the drum that repeats along its axis, instead of its two ends."""
    front, back = (float(parse_quantity(w["point"][1], "length")) for w in case["wall"][1:3])
    del case["wall"][1:3]
    half = 0.5 * depth
    case["periodic"] = {"lower": [-1.0, -half, -1.0], "upper": [1.0, half, 1.0], "axes": "y"}
    for table in case["particles"]:
        table["lower"][1], table["upper"][1] = -half, half
        table["count"] = round(table["count"] * depth / (back - front))


def silo_sample(run: ParticleRun) -> Row:
    """Spheres above the lip of the hopper, and their mean kinetic energy over m g d."""
    lip = next(wall for wall in run.case.wall if wall.name == "hopper").wall().point[2]
    sim = run.simulation
    above = sim.centres[:, 2] > lip
    squares = (sim.velocities[above] ** 2).sum()
    return {
        "above": float(above.sum()),
        "agitation": float(squares / max(above.sum(), 1) / (2.0 * 9.81 * 2.0 * sim.radii[0])),
    }


def drum_sample(run: ParticleRun) -> Row:
    """Spheres of M1 and M2 in zone 1 (x > 0, z > 0) and zone 2 (x < 0, z < 0)."""
    x, radii = run.simulation.centres, run.simulation.radii
    small = radii < 0.5 * (radii.min() + radii.max())
    one = (x[:, 0] > 0.0) & (x[:, 2] > 0.0)
    two = (x[:, 0] < 0.0) & (x[:, 2] < 0.0)
    return {
        f"zone{zone}_{name}": float((where & which).sum())
        for zone, where in ((1, one), (2, two))
        for name, which in (("m1", small), ("m2", ~small))
    }


def impact_sample(run: ParticleRun) -> Row:
    """Height and speed of the ball; not a number before it comes."""
    sim = run.simulation
    ball = int(sim.radii.argmax())
    if sim.radii[ball] < 5e-3:
        return {"z": math.nan, "speed": math.nan, "top": float(np.sort(sim.centres[:, 2])[-10])}
    bed = np.delete(sim.centres[:, 2], ball)
    return {
        "z": float(sim.centres[ball, 2]),
        "speed": float(sim.velocities[ball, 2]),
        "top": float(np.sort(bed)[-10]),
    }


def flow(rows: list[Row], start: float, first: float = 0.3) -> dict[str, float]:
    """Rate of discharge [1/s]: slope of the number above the lip, and its error.

    The window begins ``first`` after the opening [s] and ends with the run; the standard error is
    that of the mean of the slopes over parts of 50 ms.
    """
    t = np.array([row["time"] - start for row in rows])
    n = np.array([row["above"] for row in rows])
    used = t > first - 1e-9
    if used.sum() < 3:
        raise ValueError("the window of the rate has not begun")
    slope = -float(np.polyfit(t[used], n[used], 1)[0])
    edges = np.arange(first, t[-1] + 1e-9, 0.05)
    parts = -np.diff(np.interp(edges, t, n)) / 0.05
    error = float(parts.std(ddof=1) / math.sqrt(len(parts))) if len(parts) > 1 else math.nan
    return {
        "rate": slope, "rate_error": error, "window_from": first, "window_to": float(t[-1]),
        "above_at_opening": float(np.interp(0.0, t, n)),
    }  # fmt: skip


def measured(name: str, case: ParticleCase, rows: list[Row]) -> dict[str, Any]:
    """What a run is judged by."""
    if name.startswith("silo"):
        start = next(wall.removed for wall in case.wall if wall.name == "gate")
        return flow(rows, start, 0.1 if name == "silo_scaled" else 0.3)
    if name == "drum":
        start = case.wall[0].starts
        t = [row["time"] - start for row in rows]
        at = [0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0]
        values = np.interp(at, t, [row["zone2_m1"] for row in rows], right=math.nan)
        return {"zone2_m1": {f"{a:g}": v for a, v in zip(at, values.tolist(), strict=True)}}
    flying = [row for row in rows if not math.isnan(row["z"])]
    lowest = min(flying, key=lambda row: row["z"])
    # Back along the free flight to where the ball was at 60 mm with 5 m/s.
    begin = flying[0]["time"] - (0.06 - flying[0]["z"]) / 5.0
    return {
        "lowest_mm": 1e3 * lowest["z"],
        "lowest_at_ms": 1e3 * (lowest["time"] - begin),
        "bed_top_mm": 1e3 * next(row["top"] for row in rows if math.isnan(row["z"]) is False),
        "begin_s": begin,
    }


def write_samples(path: Path, rows: list[Row]) -> None:
    with atomic_path(path) as part, part.open("w", newline="") as stream:
        writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows([{k: f"{v:.9g}" for k, v in row.items()} for row in rows])


def main() -> None:
    options = arguments()
    samples: dict[str, Callable[[ParticleRun], Row]] = {
        "silo": silo_sample, "drum": drum_sample, "impact": impact_sample,
    }  # fmt: skip
    sample = samples[options.case.split("_")[0]]
    content = content_of(options)
    changed = {
        key: value
        for key, value in vars(options).items()
        if value is not None and key not in ("case", "out", "results", "threads", "quiet")
        if (key, value) != ("material", "M1")
    }
    name = "-".join([options.case, *(f"{k}-{v:g}" if isinstance(v, float) else f"{k}-{v}"
                                     for k, v in changed.items())])  # fmt: skip
    case = build(ParticleCase, content, HERE / f"{options.case}.toml")
    run = ParticleRun(case, {}, threads=options.threads)
    checkpoint = output_folder(options.out) / f"{name}.npz"
    # A run that overlaps too deeply may go on with another bound.
    deciding = {k: v for k, v in content.items() if k != "most_overlap"}
    key = json.dumps(deciding, sort_keys=True)
    rows: list[Row] = []
    seconds = moved = 0.0
    kept = kept_with(checkpoint)
    if kept is not None and kept.get("key") == key:
        kept = run.restore(checkpoint)
        rows, seconds, moved = kept["rows"], kept["seconds"], kept["moved"]
    every = max(1, round(case.output.samples / run.simulation.time_step))
    written = begin = time.perf_counter()
    before = seconds

    def keep() -> dict[str, Any]:
        run.save(checkpoint, key=key, rows=rows, seconds=seconds, moved=moved)
        sim = run.simulation
        results = {
            "case": options.case, "changed": changed, "softness": softness_of(content),
            "time_step": sim.time_step, "steps": sim.steps, "simulated": sim.time,
            "spheres": run.tally.inserted, "seconds": round(seconds),
            "sphere_steps_per_second": round(moved / seconds),
        }  # fmt: skip
        with contextlib.suppress(ValueError, StopIteration):  # too early for a measurement
            results |= measured(options.case, case, rows)
        folder = output_folder(options.results)
        write_samples(folder / f"{name}.csv", rows)
        with atomic_path(folder / f"{name}.json") as part:
            part.write_text(json.dumps(results, indent=1) + "\n")
        return results

    with progress(run.steps, "time steps", show=not options.quiet) as advance:
        advance(run.simulation.steps)
        for done in run.go_on():
            moved += done * len(run.simulation.radii)
            now = time.perf_counter()
            seconds = before + now - begin
            if run.simulation.steps % every == 0:
                rows.append({"time": run.simulation.time, **sample(run)})
            if rows and now - written > KEEP:
                keep()
                written = now
            advance(done)
    print(json.dumps(keep(), indent=1))


if __name__ == "__main__":
    main()
