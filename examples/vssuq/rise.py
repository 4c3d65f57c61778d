"""What the study believes: the simulated rise times of predicted.csv, at the stated velocity."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np


def _table() -> tuple[dict[tuple[int, int], float], float]:
    """Mean over seeds of each condition and order, and d ln(time) / d ln(velocity)."""
    found: dict[tuple[int, int], list[float]] = {}
    at: dict[tuple[int, int, int], dict[float, float]] = {}
    with open(Path(__file__).parent / "predicted.csv", newline="") as file:
        for row in csv.DictReader(file):
            if not row["rise time [s]"]:
                continue
            key = int(row["condition [-]"]), int(row["order of emergence [-]"])
            share, time = (
                float(row["share of the stated velocity [-]"]),
                float(row["rise time [s]"]),
            )
            at.setdefault((*key, int(row["seed [-]"])), {})[share] = time
            if share == 1.0:
                found.setdefault(key, []).append(time)
    slopes = [
        np.log(time / times[1.0]) / np.log(share)
        for times in at.values() if 1.0 in times
        for share, time in times.items() if share != 1.0
    ]  # fmt: skip
    return {key: float(np.mean(v)) for key, v in found.items()}, float(np.mean(slopes))


def rise_time(columns, parameters, amplitudes):
    """Rise times [s]; ``faster-air`` and ``slower-air`` change the velocity by the share A."""
    known, slope = _table()
    time = np.array([
        known.get((round(c), round(o)), np.nan)
        for c, o in zip(columns["condition"], columns["order"], strict=True)
    ])  # fmt: skip
    for name, sign in (("faster-air", 1.0), ("slower-air", -1.0)):
        share = amplitudes.get(name, 0.0)
        if share:
            time = time * (1.0 + sign * share) ** slope
    late = amplitudes.get("late-start", 0.0)
    return time + late if late else time
