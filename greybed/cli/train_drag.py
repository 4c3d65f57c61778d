"""Train filtered drag: what ``greybed train drag`` does."""

from __future__ import annotations

import argparse
import time


def run_drag(options: argparse.Namespace) -> int:
    """Train, score on held-out cases, check the limits, write the artifact and its page."""
    from greybed.cli.train import name_of
    from greybed.closures import content_hash, save
    from greybed.closures.artifact import SUFFIX
    from greybed.closures.drag.filtered.limits import check_limits
    from greybed.core import InputError
    from greybed.core.files import writable_file, write_summary
    from greybed.core.folder_lock import locked_folder
    from greybed.datasets.filtered_drag import read_filtered_drag
    from greybed.report.drag_model import render_drag_model
    from greybed.training.drag import EPOCHS, drag_curve, train_drag

    name = name_of(options, "filtered_drag")
    epochs = EPOCHS if options.epochs is None else options.epochs
    data = read_filtered_drag(options.data)
    # Before the work: a name that is too long, or taken by a folder.
    with locked_folder(options.out) as folder:
        target = writable_file(folder / (name + SUFFIX))
        begin = time.perf_counter()
        try:
            closure, rows, forces = train_drag(
                data, options.model, options.markers, seed=options.seed, epochs=epochs,
                show_progress=True,
            )  # fmt: skip
        except InputError as error:
            raise InputError(f"{options.data}: {error}") from None
        seconds = time.perf_counter() - begin
        if not options.no_curve:
            closure.card["learning_curve"] = drag_curve(
                data, options.model, options.markers, seed=options.seed, epochs=epochs
            )
        path = save(closure, target)
        cases = check_limits(closure, n=1_000_000)
        page = render_drag_model(
            closure, rows, forces, cases, target.with_suffix(".html"), name=name
        )
        card = closure.card
        write_summary(
            target.parent,
            "train drag",
            {
                "file": path.name,
                "hash": content_hash(closure),
                "report": page.name,
                "convention": card["convention"],
                "score": card["score"],
                "random_rows": card.get("random_rows", {}),
                "guesses": card["guesses"],
                "by_case": card["by_case"],
                "learning_curve": card.get("learning_curve", []),
                "limits": {case.name: case.passed for case in cases},
                "seconds": seconds,
            },
            options.data,
            seed=options.seed,
        )
    score = card["score"]
    print(
        f"{path}: fraction kept of drag, R2 of the drift flux = {score['drift_r2']:.3f}, of H = "
        f"{score['kept_r2']:.3f} on {score['rows']} rows of {score['cases']} cases, each held out"
    )
    for row in card["guesses"]:
        print(f"  {row['name']:<18} {row['drift_r2']:>7.3f} {row['kept_r2']:>7.3f}")
    print(f"report: {page}")
    failed = [case.name for case in cases if not case.passed]
    for name_ in failed:
        print(f"limiting case fails: {name_}")
    print(f"next: greybed check {path}")
    return 1 if failed else 0
