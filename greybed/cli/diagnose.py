"""Trace the residual between a model and measured data to the effect that the model lacks.

Writes diagnosis.json, report.html, model_with_effect.toml (the study with the effect switched on),
residuals.csv and summary.json.

example: greybed diagnose examples/settling_spheres/study.toml --out runs/settling
"""

from __future__ import annotations

import argparse
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of ``greybed diagnose``."""
    parser.add_argument("study", type=Path, help="study file (TOML)")
    parser.add_argument("--out", type=Path, required=True, help="folder for the results")
    parser.add_argument("--quiet", action="store_true", help="no progress bar")


def run(options: argparse.Namespace) -> int:
    """Diagnose the study that ``options`` names; returns 0 whatever the verdict."""
    # Loaded here so that --help answers at once.
    from greybed.core.files import write_summary
    from greybed.core.folder_lock import locked_folder
    from greybed.report.diagnosis import write_page
    from greybed.residual import diagnose, read_study
    from greybed.residual.output import write_diagnosis

    study = read_study(options.study)
    with locked_folder(options.out) as folder:
        found = diagnose(study, show=not options.quiet)
        write_diagnosis(folder, study, found)
        write_page(study, found, folder / "report.html")
        inputs = [options.study] + ([study.table.file] if study.table.file else [])
        results = {
            "verdict": found.verdict,
            "sentence": found.sentence,
            "effects": {e.name: e.amplitude for e in found.effects},
            "error_before": found.error.base.value,
            "error_after": found.error.with_effect.value,
            "seconds": found.seconds,
        }
        write_summary(folder, "diagnose", results, *inputs, seed=study.options.seed)

    print(f"{found.verdict}: {found.sentence}")
    for effect in found.effects:
        theory = f", theory {effect.theory:.3g}" if effect.theory is not None else ""
        low, high = effect.ci95
        print(f"{effect.name}: amplitude {effect.amplitude:.3g} ({low:.3g} to {high:.3g}{theory})")
    for item in found.depends_on:
        low, high = item.ci95
        print(f"{item.covariate}: exponent {item.exponent:.3g} ({low:.3g} to {high:.3g})")
    error = found.error
    print(
        f"{error.metric}, held out: {error.base.value:.3g} -> {error.with_effect.value:.3g} "
        f"(recalibrated {error.recalibrated.value:.3g})"
    )
    if found.left_out:
        print(f"{len(found.left_out)} rows left out (see residuals.csv)")
    print(f"results in {folder}")
    return 0
