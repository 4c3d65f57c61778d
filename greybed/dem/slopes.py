"""Slope of a surface in a case: at the end, and on the mean over samples while it moves."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from greybed.core.errors import InputError
from greybed.dem import measures
from greybed.dem.measure_tables import PileTable

if TYPE_CHECKING:
    from greybed.dem.case import ParticleCase
    from greybed.dem.samples import State


def slope_now(simulation: State, table: PileTable) -> dict[str, Any]:
    """Profile of a surface, and its angle; ``angle_deg`` is None with ``why`` where it has none."""
    x, r = simulation.centres, simulation.radii
    chosen = (x[:, 2] > table.above) & (x[:, 2] < table.below)
    axis = {"heap": None, "x": 0, "y": 1}[table.axis]
    if axis is not None:
        chosen &= (x[:, axis] > table.lower) & (x[:, axis] < table.upper)
    if not chosen.any():
        return {"angle_deg": None, "why": "no particle is there"}
    profile = measures.pile_profile(x[chosen], r[chosen], table.width, axis=axis)
    known = np.isfinite(profile.height)
    found: dict[str, Any] = {
        "position_m": profile.position[known].tolist(),
        "height_m": profile.height[known].tolist(),
    }
    try:
        angle, error = profile.slope()
    except InputError as refusal:
        return {**found, "angle_deg": None, "why": str(refusal)}
    return {**found, "angle_deg": angle, "angle_stderr_deg": error}


def slopes(case: ParticleCase, simulation: State) -> dict[str, float]:
    """Angles that are to be averaged, for a row of the history [degrees]; NaN where there is none.

    Rows are kept with each checkpoint, so a run that goes on has the same mean.
    """
    found = {}
    for table in case.measure:
        if isinstance(table, PileTable) and table.average is not None:
            angle = slope_now(simulation, table)["angle_deg"]
            found[_column(table)] = math.nan if angle is None else angle
    return found


def mean_slope(table: PileTable, history: Sequence[Mapping[str, float]]) -> dict[str, Any]:
    """Mean angle of the samples in the last ``average`` seconds, and their standard deviation."""
    if table.average is None:
        return {}
    begins = history[-1]["time [s]"] - table.average * (1.0 + 1e-9)
    angles = [row[_column(table)] for row in history if row["time [s]"] > begins]
    known = np.array([angle for angle in angles if math.isfinite(angle)])
    mean = float(known.mean()) if len(known) else None
    return {
        "mean_angle_deg": mean,
        "mean_angle_rad": None if mean is None else math.radians(mean),
        "angle_sd_deg": float(known.std(ddof=1)) if len(known) > 1 else None,
        "samples": len(known),
    }


def _column(table: PileTable) -> str:
    return f"angle of {table.name} [deg]"
