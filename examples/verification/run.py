"""Verification in one run: python examples/verification/run.py [--all] [--only GROUP ...].

Runs the scripts beside it, compares what they find with the references in bounds.py, and writes
results/verification.json, the plots in docs/images and the table of docs/verification.md. Groups
that are left out keep their former figures, with their date. Exit code 1 if a figure does not
hold or a script fails. About ten minutes on one core; --all adds the random bed in a flow and the
beds beside LIGGGHTS, which must be installed (ten minutes each).
"""

from __future__ import annotations

import argparse
import json
import platform
import sys
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(HERE))

from bounds import BOUNDS  # noqa: E402

from greybed import __version__  # noqa: E402
from greybed.core.files import atomic_path  # noqa: E402

RESULTS = HERE / "results/verification.json"
PAGE = ROOT / "docs/verification.md"
BEGIN, END = "<!-- table: begin -->", "<!-- table: end -->"


@dataclass(frozen=True)
class Group:
    """A script, what it draws, and whether it is run without being asked for."""

    title: str
    run: Callable[[Path], dict[str, float]]
    pictures: tuple[tuple[str, str], ...] = ()  # file, what it shows
    long: bool = False


def _radiation(images: Path) -> dict[str, float]:
    import radiation

    return radiation.measure(images / "radiation.png")


def _particles(images: Path) -> dict[str, float]:
    import particles

    return particles.measure(images / "dem_verification.png")


def _drag(images: Path) -> dict[str, float]:
    import drag_laws

    return drag_laws.measure(images / "drag_laws.png")


def _gas(images: Path) -> dict[str, float]:
    import gas

    return gas.measure(images / "gas_verification.png")


def _budgets(images: Path) -> dict[str, float]:
    import budgets

    return budgets.measure(images / "budgets.png")


def _coupled(images: Path) -> dict[str, float]:
    import cfddem

    return cfddem.measure(images, ("settling", "cooling"))


def _random_bed(images: Path) -> dict[str, float]:
    import cfddem

    return cfddem.measure(HERE / "results", ("ergun",))


def _two_fluids(images: Path) -> dict[str, float]:
    import twofluid

    return twofluid.measure(images / "twofluid_verification.png", images / "twofluid_clusters.png")


def _diagnosis(images: Path) -> dict[str, float]:
    import diagnosis

    return diagnosis.measure(images / "diagnosis.png")


def _settled_beds(images: Path) -> dict[str, float]:
    import settled_beds

    return settled_beds.measure(HERE / "results/settled_beds.json", images / "settled_beds.png")


GROUPS = {
    "radiation": Group(
        "Radiation and closures", _radiation,
        (("radiation.png", "Traced factors of two spheres on the exact curves; differences to the "
          "published factors of lattices; exchange in the face-centred lattice on the values of "
          "other hands"),),
    ),
    "particles": Group(
        "Particles", _particles,
        (("dem_verification.png", "Hertz's curve, restitution, oblique impacts, order of the "
          "steps, a body that tumbles, a ball that slides and then rolls"),),
    ),
    "drag": Group(
        "Drag laws", _drag, (("drag_laws.png", "All laws of beds over solid fraction and Re"),)
    ),
    "gas": Group(
        "Gas", _gas,
        (("gas_verification.png", "Cavity on Ghia's values, vortices, gas that is heated"),),
    ),
    "cfddem": Group("Particles in a gas", _coupled),
    "budgets": Group(
        "Budgets", _budgets,
        (("budgets.png", "Budgets of momentum and heat, and what does not add up"),),
    ),
    "twofluid": Group(
        "Two fluids", _two_fluids,
        (("twofluid_verification.png", "Growth of waves on the linear theory, second order, fronts "
          "on Kynch's lines"),
         ("twofluid_clusters.png", "A box that has fallen into clusters")),
    ),
    "diagnosis": Group(
        "Residuals", _diagnosis,
        (("diagnosis.png", "Error before, recalibrated and with the effects; amplitudes over "
          "theory with their intervals"),),
    ),
    "random_bed": Group("A random bed that is lifted", _random_bed, long=True),
    "settled_beds": Group(
        "Settled beds beside LIGGGHTS", _settled_beds,
        (("settled_beds.png", "Energy, height and contacts of both engines on top of each other"),),
        long=True,
    ),
}  # fmt: skip


def rows(found: dict[str, float]) -> list[dict[str, Any]]:
    """Figures beside their references, each with pass or fail."""
    table = []
    for key, value in found.items():
        if key in BOUNDS:
            bound = BOUNDS[key]
            table.append({
                "key": key, "what": bound.what, "value": value, "reference": bound.reference,
                "source": bound.source, "bound": bound.said, "pass": bound.holds(value),
            })  # fmt: skip
    return table


def text(recorded: dict[str, Any]) -> str:
    """The generated part of the page."""
    lines = []
    for name, group in GROUPS.items():
        if name not in recorded:
            continue
        entry = recorded[name]
        table = rows({row["key"]: row["value"] for row in entry["rows"]})
        lines += [f"### {group.title}", ""]
        lines += ["| what | found | reference | by | bound | |", "|---|---|---|---|---|---|"]
        lines += [
            f"| {row['what']} | {row['value']:.4g} | {row['reference']:.6g} | {row['source']} "
            f"| {row['bound']} | {'pass' if row['pass'] else '**FAIL**'} |"
            for row in table
        ]
        lines += ["", f"`--only {name}`, {entry['seconds']:.0f} s, {entry['date']}.", ""]
        for file, shows in group.pictures:
            lines += [f"![{shows}](images/{file})", ""]
    return "\n".join(lines)


def write_page(recorded: dict[str, Any]) -> None:
    """Put the table between its marks."""
    page = PAGE.read_text()
    before, rest = page.split(BEGIN)
    _, after = rest.split(END)
    with atomic_path(PAGE) as part:
        part.write_text(f"{before}{BEGIN}\n\n{text(recorded)}\n{END}{after}")


def main() -> int:
    """Run, compare, write; 1 if something does not hold."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--all", action="store_true", help="also what takes long")
    parser.add_argument("--only", nargs="+", choices=GROUPS, help="these groups alone")
    parser.add_argument("--page", action="store_true", help="only write the page anew")
    given = parser.parse_args()
    recorded = json.loads(RESULTS.read_text())["groups"] if RESULTS.exists() else {}
    failed = []
    for name, group in GROUPS.items():
        wanted = name in given.only if given.only else given.all or not group.long
        if given.page or not wanted:
            continue
        print(f"{group.title} ...", flush=True)
        begun = time.process_time()
        try:
            found = rows(group.run(ROOT / "docs/images"))
        except Exception:  # one script that fails must not hide the others
            traceback.print_exc()
            failed.append(name)
            continue
        recorded[name] = {
            "date": date.today().isoformat(), "greybed": __version__,
            "machine": f"{platform.machine()}, Python {platform.python_version()}",
            "seconds": round(time.process_time() - begun, 1), "rows": found,
        }  # fmt: skip
        for row in found:
            print(f"  {'pass' if row['pass'] else 'FAIL'}  {row['value']:.4g}  {row['what']}")
            if not row["pass"]:
                failed.append(row["key"])
        # After each group, so that a run that is stopped keeps what it has.
        with atomic_path(RESULTS) as part:
            part.write_text(json.dumps({"groups": recorded}, indent=1) + "\n")
        write_page(recorded)
    write_page(recorded)
    print(f"wrote {RESULTS.relative_to(ROOT)} and {PAGE.relative_to(ROOT)}")
    if failed:
        print(f"does not hold: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
