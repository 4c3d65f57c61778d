"""Measures of bulk tests over time: masses in boxes, shear over load, slip on a tilting plane."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from greybed.dem.measure_tables import ShearTable, SlipTable, SolidTable

if TYPE_CHECKING:
    from greybed.dem.case import ParticleCase
    from greybed.dem.samples import State

History = Sequence[Mapping[str, float]]


def measured(case: ParticleCase, simulation: State) -> dict[str, float]:
    """What a row of the history says: masses in boxes, tilt of planes and mean speed along them."""
    row: dict[str, float] = {}
    x, masses = simulation.centres, simulation.masses
    for table in case.measure:
        if isinstance(table, SolidTable):
            inside = ((x > np.array(table.lower)) & (x < np.array(table.upper))).all(axis=1)
            row[f"mass in {table.name} [kg]"] = float(masses[inside].sum())
        if isinstance(table, SlipTable):
            tilt, speed = _slip(simulation, table.wall)
            row[f"tilt of {table.wall} [deg]"] = tilt
            row[f"slip on {table.wall} [m/s]"] = speed
    return row


def _slip(simulation: State, name: str) -> tuple[float, float]:
    """Angle between a plane's normal and the upward vertical [degrees], mean speed on it [m/s]."""
    normal, motion = simulation.plane_of(name)
    moves = motion[:3] + np.cross(motion[3:6], simulation.centres - motion[6:9])
    along = simulation.velocities - moves
    along = along - np.outer(along @ normal, normal)
    up = -simulation.gravity / (np.linalg.norm(simulation.gravity) or 1.0)
    tilt = math.degrees(math.acos(float(np.clip(normal @ up, -1.0, 1.0))))
    return tilt, float(np.sqrt((along**2).sum(axis=1)).mean())


def filling_rate(history: History, name: str) -> float | None:
    """Mean rate into a box that was empty, from a tenth to 80 % of what it has at the end [kg/s].

    None where it was not empty at the start, or fewer than three samples are in between.
    """
    total = np.array([row[f"mass in {name} [kg]"] for row in history])
    inside = (total >= 0.1 * total[-1]) & (total <= 0.8 * total[-1])
    if total[0] > 0.0 or not total[-1] > 0.0 or inside.sum() < 3:
        return None
    time = np.array([row["time [s]"] for row in history])
    return float(np.polyfit(time[inside], total[inside], 1)[0])


def slip_result(table: SlipTable, history: History) -> dict[str, Any]:
    """Tilt and time at which the mean speed is above the wanted one for the first time."""
    for row in history:
        if row["time [s]"] >= table.after and row[f"slip on {table.wall} [m/s]"] > table.speed:
            return {"angle_deg": row[f"tilt of {table.wall} [deg]"], "time_s": row["time [s]"]}
    return {"angle_deg": None, "why": f"no sample has a mean speed above {table.speed:g} m/s"}


def shear_result(table: ShearTable, history: History) -> dict[str, Any]:
    """Peak and mean of the late part of shear force over load, and their angles."""
    rows = [row for row in history if row["time [s]"] >= table.after]
    if len(rows) < 3:
        return {"residual": None, "why": "fewer than 3 samples; take more of them"}
    shear = [sum(row[f"force {table.axis} on {wall} [N]"] for wall in table.walls) for row in rows]
    load = np.array([row[f"force {table.load_axis} on {table.load} [N]"] for row in rows])
    if not (load != 0.0).all():
        return {"residual": None, "why": f"no load on {table.load} in some sample"}
    ratio = np.abs(shear) / np.abs(load)
    time = np.array([row["time [s]"] for row in rows])
    late = ratio[time >= time[-1] - table.share * (time[-1] - time[0])]
    residual = float(late.mean())
    return {
        "peak": float(ratio.max()),
        "residual": residual,
        # Samples of one run follow each other: this is their spread, not an error of the mean.
        "residual_spread": float(late.std()),
        "residual_angle_deg": math.degrees(math.atan(residual)),
        "mean_load_N": float(np.abs(load).mean()),
    }
