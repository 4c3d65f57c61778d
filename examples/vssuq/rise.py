"""What the study believes: the simulated rise times of predicted.csv."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent


def _table() -> tuple[dict[tuple[int, int], float], float]:
    """Mean over seeds of each condition and order, and d ln(time) / d ln(velocity)."""
    found: dict[tuple[int, int], list[float]] = {}
    slope = 0.0
    with open(HERE / "predicted.csv", newline="") as file:
        for row in csv.DictReader(file):
            slope = float(row["d ln(time) / d ln(velocity) [-]"])
            as_stated = float(row["share of the stated velocity [-]"]) == 1.0
            if as_stated and row["rise time [s]"]:
                key = int(row["condition [-]"]), int(row["order of emergence [-]"])
                found.setdefault(key, []).append(float(row["rise time [s]"]))
    return {key: float(np.mean(times)) for key, times in found.items()}, slope


def _stated() -> list[float]:
    """Velocities at which the conditions were simulated [m/s]."""
    with open(HERE / "conditions.csv", newline="") as file:
        rows = csv.DictReader(line for line in file if not line.startswith("#"))
        return [float(row["U [m/s]"]) for row in rows]


def rise_time(columns, parameters, amplitudes):
    """Rise times [s]; ``late-start`` adds A, ``hidden-longer`` takes (1 + A) times as long."""
    known, slope = _table()
    at = np.round(columns["condition"]).astype(int)
    order = np.round(columns["order"]).astype(int)
    time = np.array([known.get(key, np.nan) for key in zip(at, order, strict=True)])
    # So that the error of the velocity is carried through.
    time = time * (columns["velocity"] / np.array(_stated())[at - 1]) ** slope
    late, longer = (amplitudes.get(name, 0.0) for name in ("late-start", "hidden-longer"))
    if longer:
        time = time * (1.0 + longer)
    return time + late if late else time
