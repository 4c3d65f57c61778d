"""Find the parameters of a simulation from measured bulk behaviour, and say how far they are known.

Writes calibration.json, posterior.csv, report.html and summary.json, and keeps every finished run
in runs.sqlite: the same command goes on after Ctrl-C or a kill and repeats none.

examples:
  greybed calibrate examples/calibration/twin.toml --out runs/twin
  greybed calibrate examples/calibration/heap_and_hopper.toml --out runs/heap --workers 2
"""

from __future__ import annotations

import argparse
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of ``greybed calibrate``."""
    parser.add_argument("study", type=Path, help="study file (TOML)")
    parser.add_argument("--out", type=Path, required=True, help="folder for the results")
    parser.add_argument("--workers", type=int, help="processes (default: as the study says)")
    parser.add_argument(
        "--scheduler",
        help="dask: local, an address such as tcp://host:8786, or a TOML file of Slurm jobs",
    )
    parser.add_argument("--quiet", action="store_true", help="no progress bar")


def run(options: argparse.Namespace) -> int:
    """Calibrate the study that ``options`` names; returns 0 whatever the answer."""
    # Loaded here so that --help answers at once.
    from dataclasses import replace

    from greybed.calibration import calibrate
    from greybed.calibration.output import write_answer
    from greybed.calibration.read import read_study
    from greybed.core.errors import InputError
    from greybed.core.files import write_summary
    from greybed.core.folder_lock import locked_folder
    from greybed.report.calibration import write_page

    study = read_study(options.study)
    if options.workers is not None and not 0 <= options.workers <= 1024:
        raise InputError(f"--workers {options.workers} [-] must be 0 to 1024.")
    changed = study.options
    if options.workers is not None:
        changed = replace(changed, workers=options.workers)
    if options.scheduler is not None:
        changed = replace(changed, scheduler=options.scheduler)
    study = replace(study, options=changed)
    with locked_folder(options.out) as folder:
        found = calibrate(study, folder, show=not options.quiet)
        write_answer(folder, study, found)
        write_page(study, found, folder / "report.html")
        results = {
            "sentence": found.sentence,
            "fits": found.fits,
            "best": found.best,
            "verdicts": {v.name: v.word for v in found.verdicts},
            "open_directions": [d.words for d in found.open_directions],
            "next_test": found.next_tests[0].name if found.next_tests else None,
            "runs": found.runs,
            "made_now": found.made,
            "from_store": found.found,
            "failed": found.failed,
            "seconds": found.seconds,
        }
        write_summary(
            folder, "calibrate", results, options.study, *study.inputs, seed=study.options.seed
        )

    print(found.sentence)
    for name in study.space.names:
        word = next(v for v in found.verdicts if v.name == name)
        print(f"{name}: {found.best[name]:.4g}, {word.word}; {word.sentence}")
    if found.p_value is not None:
        print(f"chi-squared {found.chi2:.3g} of {found.freedom:.3g} (p = {found.p_value:.2g})")
    for check in found.checks:
        if check.held_out:
            print(f"held out {check.label}: {check.pull:+.2f} standard deviations")
    print(found.limits)
    print(
        f"{found.runs} runs ({found.made} made now, {found.found} from the store, {found.failed} "
        f"failed)"
    )
    print(f"results in {folder}")
    return 0
