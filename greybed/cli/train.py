"""Train a closure from a data set and score it on packings, or cases, that it has not seen.

Examples:
  greybed train viewfactor runs/small.h5 --model forest --out runs/forest
  greybed train viewfactor runs/viewfactor.h5 --model mlp --out runs
  greybed train drag greybed/datasets/filtered_drag.h5 --markers full --out runs

Writes NAME.closure (one file: weights, markers, ranges, golden rows), NAME.html (errors,
calibration, learning curve, model card) and summary.json. The exit code is 1 if a limiting case
fails.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

# Markers of view, wall and exchange factors.
FACTORS = ("pencil", "published", "wall", "exchange")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of ``greybed train``."""
    parser.add_argument(
        "quantity",
        choices=("viewfactor", "drag"),
        help="what the closure gives: view factors, or the fraction kept of drag on coarse grids",
    )
    parser.add_argument("data", help="data set from greybed dataset")
    parser.add_argument("--model", choices=("mlp", "forest"), default="mlp", help="default: mlp")
    parser.add_argument(
        "--markers",
        choices=("pencil", "published", "wall", "exchange", "plain", "gradient", "linear", "full"),
        help="pencil: real blockers on a pencil of lines; published: r_j/d, spheres between, "
        "r_j/r_i, solid fraction; wall: from spheres to walls; "
        "exchange: absorption after reflections (default: pencil); of drag, plain: flow only, "
        "gradient: with the pressure gradient, linear: its force beside the drag, full: both "
        "(default: plain)",
    )
    parser.add_argument("--seed", type=int, default=0, metavar="S", help="default: 0")
    parser.add_argument(
        "--epochs",
        type=int,
        metavar="N",
        help="default: 40, up to 600 where rows are few; of drag 20",
    )
    parser.add_argument(
        "--no-curve", action="store_true", help="leave out the learning curve, which takes as long "
        "as the training itself",
    )  # fmt: skip
    parser.add_argument("--name", help="name of the file (default: QUANTITY_MODEL_MARKERS)")
    parser.add_argument("--out", required=True, metavar="DIR", help="folder to write into")


def name_of(options: argparse.Namespace, quantity: str) -> str:
    """Name of the files.

    Raises
    ------
    InputError
        If the one that was given has folders.
    """
    from greybed.core import InputError

    name = str(options.name or f"{quantity}_{options.model}_{options.markers}")
    if options.name == "" or not name.strip(". ") or Path(name).name != name:
        raise InputError(f"--name = {options.name!r} is no file name; give one without folders.")
    return name


def run(options: argparse.Namespace) -> int:
    """Train, check the limits, write the artifact."""
    from greybed.closures import content_hash, save
    from greybed.closures.artifact import SUFFIX
    from greybed.closures.viewfactor import MARKER_SETS
    from greybed.closures.viewfactor.limits import check_limits
    from greybed.core import InputError
    from greybed.core.files import writable_file, write_summary
    from greybed.core.folder_lock import locked_folder
    from greybed.datasets.viewfactor import read
    from greybed.report.model import render_model
    from greybed.training import learning_curve, train
    from greybed.training.viewfactor import rows_for

    if options.epochs is not None and options.epochs < 1:
        raise InputError(f"--epochs = {options.epochs} must be at least 1.")
    known = ("plain", "gradient", "linear", "full") if options.quantity == "drag" else FACTORS
    options.markers = options.markers or known[0]
    if options.markers not in known:
        raise InputError(
            f"--markers {options.markers} is not for {options.quantity}; take one of "
            f"{', '.join(known)}."
        )
    if options.quantity == "drag":
        from greybed.cli.train_drag import run_drag

        return run_drag(options)
    quantity = MARKER_SETS[options.markers].quantity
    name = name_of(options, quantity)
    data = read(options.data)
    # Before the work: a name that is too long, or taken by a folder.
    with locked_folder(options.out) as folder:
        target = writable_file(folder / (name + SUFFIX))
        begin = time.perf_counter()
        try:
            closure = train(
                data, options.model, options.markers, seed=options.seed, epochs=options.epochs,
                show_progress=True,
            )  # fmt: skip
        except InputError as error:
            raise InputError(f"{options.data}: {error}") from None
        seconds = time.perf_counter() - begin
        if not options.no_curve:
            closure.card["learning_curve"] = learning_curve(
                data, options.model, options.markers, seed=options.seed, epochs=options.epochs
            )
        path = save(closure, target)
        cases = check_limits(closure)
        rows = rows_for(data, closure.markers)
        page = render_model(closure, rows, cases, target.with_suffix(".html"), name=name)
        score = closure.card["score"]
        write_summary(
            target.parent,
            "train viewfactor",
            {
                "file": path.name,
                "hash": content_hash(closure),
                "report": page.name,
                "score": score,
                "regimes": closure.card["regimes"],
                "learning_curve": closure.card.get("learning_curve", []),
                "limits": {case.name: case.passed for case in cases},
                "seconds": seconds,
            },
            options.data,
            seed=options.seed,
        )
    low, high = score["r2_ci95"]
    print(
        f"{path}: R2 = {score['r2']:.5f} (95 %: {low:.5f} to {high:.5f}), RMSE = "
        f"{score['rmse']:.2e} over {score['pairs']} pairs of {score['packings']} unseen packings"
    )
    print(f"report: {page}")
    failed = [case.name for case in cases if not case.passed]
    for name_ in failed:
        print(f"limiting case fails: {name_}")
    print(f"next: greybed check {path}")
    return 1 if failed else 0
