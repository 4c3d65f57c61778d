"""From two settled beds to a trained, exported, running radiation closure, in under five minutes.

Example:
  greybed quickstart --out runs/quickstart

Open runs/quickstart/report.html afterwards. A killed run continues where it stopped when the
same command is given again. The exit code is 1 if a limiting case or a replay fails.
"""

from __future__ import annotations

import argparse
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of ``greybed quickstart``."""
    parser.add_argument("--out", required=True, metavar="DIR", help="folder to write into")
    parser.add_argument("--seed", type=int, default=1, metavar="S", help="default: 1")
    parser.add_argument(
        "--small",
        action="store_true",
        help="few packings and rays: shows the way in half a minute, its numbers mean nothing",
    )


def run(options: argparse.Namespace) -> int:
    """Run the chain and print the limiting cases."""
    from greybed.core import InputError
    from greybed.core.folder_lock import locked_folder
    from greybed.datasets.viewfactor import MOST_SEED
    from greybed.report.quickstart import quickstart

    if not 0 <= options.seed <= MOST_SEED:
        raise InputError(
            f"--seed = {options.seed} must be at least 0 and at most {MOST_SEED}; mend it."
        )
    with locked_folder(options.out):
        results = quickstart(options.out, seed=options.seed, small=options.small)
    width = max(len(row["case"]) for row in results["limits"])
    print(f"\n{'limiting case':<{width}}  {'largest deviation':>17}  bound")
    for closure in results["closures"]:
        score = closure["score"]
        low, high = score["r2_ci95"]
        print(f"{closure['name']}: R2 = {score['r2']:.5f} (95 %: {low:.5f} to {high:.5f})")
        for row in results["limits"]:
            if row["closure"] != closure["name"]:
                continue
            worst = max(row["errors"].values())
            mark = "" if row["passed"] else "  FAILS"
            print(f"  {row['case']:<{width}}{worst:>17.2e}  {row['bound']:.0e}{mark}")
    for case in results["cases"]:
        d = case["difference"]
        print(
            f"{case['bed']} bed, closure against trace: {d['rms_K']:.2f} K rms, "
            f"{d['max_K']:.2f} K at most, of {d['span_K']:.0f} K between the walls"
        )
    for failure in results["failed"]:
        print(f"fails: {failure}")
    print(f"\nlook at {Path(options.out) / 'report.html'}")
    return 0 if results["passed"] else 1
