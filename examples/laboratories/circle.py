"""The full circle of one laboratory: what a model predicts for an experiment that no study read.

Three models predict ``HELD_OUT.csv``: the study's as it is; the same with its parameters fitted to
the study's table wherever that takes them, whatever was measured of them; the one that the
diagnosis wrote. Errors are root mean squares of the log of predicted over measured; their 95 %
intervals come from 4000 resamplings of the rows. ``circle.png`` shows all held-out rows. Run:

    python circle.py settling/study_spheres.toml settling/spheres_held_out.csv --out runs/spheres
"""

import argparse
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter
from scipy.optimize import least_squares

from greybed.residual import Diagnosis, Study, Table, diagnose, read_study
from greybed.residual.models import build
from greybed.residual.output import write_diagnosis
from greybed.residual.table import read_table

RESAMPLES = 4000
MODELS = ("before", "recalibrated", "with_effect")


@dataclass(frozen=True)
class Circle:
    """A diagnosis, errors of held-out rows as (value, low, high), and the rows themselves."""

    diagnosis: Diagnosis
    before: tuple[float, float, float]
    recalibrated: tuple[float, float, float]
    with_effect: tuple[float, float, float]
    parameters: dict[str, float]
    measured: np.ndarray
    predictions: dict[str, np.ndarray]


def predicted(study: Study, table: Table, parameters: dict[str, float]) -> np.ndarray:
    """Log of the response of the study's model at the rows of a table."""
    model = build(study.model, table, parameters)
    return np.log(model.predict(table.columns, parameters, {}))


def recalibrated(study: Study) -> dict[str, float]:
    """The parameters that suit the study's table best, in the logarithm; fixed ones stay."""
    start = {name: item.value for name, item in study.parameters.items()}
    moved = [n for n, item in study.parameters.items() if item.free or item.sd > 0.0]
    if not moved:
        return start
    model = build(study.model, study.table, start)
    measured = np.log(study.table.columns[study.response])

    def misfit(x: np.ndarray) -> np.ndarray:
        values = {**start, **dict(zip(moved, np.exp(x) * [start[n] for n in moved], strict=True))}
        return np.log(model.predict(study.table.columns, values, {})) - measured

    best = least_squares(misfit, np.zeros(len(moved))).x
    return {**start, **{n: float(start[n] * np.exp(x)) for n, x in zip(moved, best, strict=True)}}


def error(residual: np.ndarray) -> tuple[float, float, float]:
    """Root mean square with its interval over rows."""
    rng = np.random.default_rng(1)
    rows = rng.integers(len(residual), size=(RESAMPLES, len(residual)))
    low, high = np.quantile(np.sqrt(np.mean(residual[rows] ** 2, axis=1)), (0.025, 0.975))
    return float(np.sqrt(np.mean(residual**2))), float(low), float(high)


def circle(path: Path, held_out: Path, folder: Path) -> Circle:
    """Diagnose a study and predict the held-out table with each model.

    Parameters
    ----------
    path, held_out : Path
        The study, and the table of the experiment that it does not read.
    folder : Path
        For the files of the diagnosis.

    Returns
    -------
    found : Circle
        Verdict and errors.
    """
    study = read_study(path)
    counters = () if study.replicate is None else (study.replicate,)
    table = read_table(held_out, study.response, study.labels, counters)
    measured = np.log(table.columns[study.response])
    found = diagnose(study)
    folder.mkdir(parents=True, exist_ok=True)
    after = read_study(write_diagnosis(folder, study, found)["model"])
    stated = {name: item.value for name, item in study.parameters.items()}
    fitted = recalibrated(study)
    # measured parameters stay as measured, so that the effect has to carry the improvement alone
    with_effect = {name: item.value for name, item in after.parameters.items()}
    logs = {
        "before": predicted(study, table, stated),
        "recalibrated": predicted(study, table, fitted),
        "with_effect": predicted(after, table, with_effect),
    }
    return Circle(
        diagnosis=found,
        **{name: error(log - measured) for name, log in logs.items()},
        parameters=fitted,
        measured=np.exp(measured),
        predictions={name: np.exp(log) for name, log in logs.items()},
    )


def draw(axes: Axes, record: dict[str, Any]) -> None:
    """Predicted over measured of all held-out rows, by model; ``record`` is a ``circle.json``."""
    measured = np.array(record["measured"])
    for name, marker, colour in zip(MODELS, "sDo", ("C7", "C0", "C1"), strict=True):
        ratio = np.array(record["predictions"][name]) / measured
        label = f"{name.replace('_', ' ')}: {record[name][0]:.2g}"
        axes.plot(
            np.arange(1, len(ratio) + 1), ratio, marker, color=colour, label=label, mfc="none"
        )
    axes.axhline(1.0, color="0.5", lw=0.8)
    axes.set_yscale("log")
    for ticks in (axes.yaxis.set_major_formatter, axes.yaxis.set_minor_formatter):
        ticks(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.set_xlabel("row of the held-out table")
    axes.set_ylabel(f"{record['response']}, predicted / measured")
    axes.legend(fontsize="small")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("study", type=Path)
    parser.add_argument("held_out", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    asked = parser.parse_args()
    made = circle(asked.study, asked.held_out, asked.out)
    print(made.diagnosis.sentence)
    rows = {name: getattr(made, name) for name in MODELS}
    for name, (value, low, high) in rows.items():
        print(f"{name.replace('_', ' '):14} {value:.4f} ({low:.4f} to {high:.4f})")
    record = {
        **rows, "verdict": made.diagnosis.verdict, "fitted": made.parameters,
        "response": read_study(asked.study).response, "measured": made.measured.tolist(),
        "predictions": {name: values.tolist() for name, values in made.predictions.items()},
    }  # fmt: skip
    (asked.out / "circle.json").write_text(json.dumps(record, indent=1))
    figure, axes = plt.subplots(figsize=(5.0, 3.6), layout="constrained")
    draw(axes, record)
    figure.savefig(asked.out / "circle.png", dpi=110)
