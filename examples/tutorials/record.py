"""Numbers of the full runs of both tutorials, from runs/tutorial into recorded.json of each.

python examples/tutorials/record.py

Run it after all commands of docs/tutorials/ have run; the tests compare the pages with the files.
"""

from __future__ import annotations

import csv
import json
import statistics
from pathlib import Path
from typing import Any

RUNS, HERE = Path("runs/tutorial"), Path(__file__).parent
SETTLED = 0.1  # from when on the slip of a flow is averaged [s]


def summary(name: str) -> Any:
    """What a command has written of its run."""
    return json.loads((RUNS / name / "summary.json").read_text())


def column(name: str, heading: str) -> tuple[list[float], list[float]]:
    """Times [s] and a column of the history of a run."""
    with open(RUNS / name / "history.csv") as stream:
        rows = list(csv.DictReader(stream))
    return [float(row["time [s]"]) for row in rows], [float(row[heading]) for row in rows]


def slip(name: str) -> tuple[float, float]:
    """Mean slip along gravity, and half the difference between both halves of the time [m/s]."""
    times, slips = column(name, "slip y [m/s]")
    late = [s for t, s in zip(times, slips, strict=True) if t >= SETTLED]
    first, second = late[: len(late) // 2], late[len(late) // 2 :]
    return statistics.fmean(late), abs(statistics.fmean(first) - statistics.fmean(second)) / 2.0


def combustion() -> dict[str, tuple[float, str]]:
    """Numbers of the hot bed, with how the page prints them."""
    against = summary("check")["against"]
    gas = summary("gas")
    return {
        "closure against trace, R2": (against["r2"], ".5f"),
        "closure against trace, F above 0.01 [%]": (
            100.0 * against["mean_relative_error_above_0.01"], ".1f",
        ),
        "floor, contacts, greybed [J]": (column("contacts", "heat from floor [J]")[1][-1], ".4f"),
        "floor, contacts, LAMMPS [J]": (
            column("contacts_lammps", "heat from floor [J]")[1][-1], ".4f",
        ),
        "all walls, radiation, greybed [J]": (column("radiation", "supplied [J]")[1][-1], ".2f"),
        "all walls, radiation, LAMMPS [J]": (
            column("radiation_lammps", "heat from floor and radiation [J]")[1][-1], ".2f",
        ),
        "with gas, mean temperature [K]": (gas["heat"]["mean_temperature_K"], ".1f"),
        "with gas, floor [J]": (gas["heat"]["from_walls_J"]["floor"], ".2f"),
        "with gas, side [J]": (gas["heat"]["from_walls_J"]["side"], ".2f"),
        "with gas, gas [J]": (gas["gas"]["heat from the gas [J]"], ".2f"),
        "with gas, radiation [J]": (
            gas["gas"]["heat by radiation from walls and opening [J]"], ".2f",
        ),
    }  # fmt: skip


def fluidisation() -> dict[str, tuple[float, str]]:
    """Numbers of the powder, with how the page prints them."""
    trained = summary("closure")["score"]
    found = {
        "closure, R2 of the drift flux": (trained["drift_r2"], ".3f"),
        "closure, R2 of H": (trained["kept_r2"], ".3f"),
    }
    for name in ("fine", "coarse", "coarse_mine", "coarse_shipped"):
        mean, half = slip(name)
        found[f"{name}, slip [m/s]"] = (mean, ".3f")
        found[f"{name}, half of the drift of the slip [m/s]"] = (half, ".3f")
    return found


def main() -> None:
    """Write both files."""
    for name, numbers in (("combustion", combustion()), ("fluidisation", fluidisation())):
        entries = {key: {"value": value, "as": how} for key, (value, how) in numbers.items()}
        text = json.dumps({"numbers": entries}, indent=1) + "\n"
        (HERE / name / "recorded.json").write_text(text)
        for key, (value, how) in numbers.items():
            print(f"{key}: {value:{how}}")


if __name__ == "__main__":
    main()
