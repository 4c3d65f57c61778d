"""The shipped tables of the laboratory, and its shortest run again where LIGGGHTS is installed."""

from __future__ import annotations

import csv
import importlib.util
import math
import shutil
from pathlib import Path

import numpy as np
import pytest

LABORATORY = Path(__file__).parents[2] / "examples/laboratory"


def table(name):
    rows = list(csv.reader((LABORATORY / f"{name}.csv").read_text().splitlines()))
    return {head.split(" ")[0]: [row[k] for row in rows[1:]] for k, head in enumerate(rows[0])}


def pressures(rows):
    force = np.array(rows["floor_pressure"], dtype=float)
    area = 0.25 * math.pi * (1e-3 * np.array(rows["silo_diameter"], dtype=float)) ** 2
    weight = 9.81e-3 * np.array(rows["fill_mass"], dtype=float)
    return force * area / weight


def test_smooth_walls_leave_the_weight_to_the_floor():
    assert pressures(table("smooth_walls")) == pytest.approx(1.0, abs=2e-3)


def test_rough_walls_carry_the_more_the_higher_the_fill():
    rows = table("rough_walls")
    share = pressures(rows)
    slender = np.array(rows["fill_height"], float) / np.array(rows["silo_diameter"], float)
    assert (share < 1.02).all()
    assert share[slender > 3.0].max() < 0.6 < share[slender < 1.0].min()


@pytest.mark.skipif(shutil.which("liggghts") is None, reason="liggghts is not installed")
def test_the_shortest_run_gives_what_the_table_has():
    spec = importlib.util.spec_from_file_location("make_tables", LABORATORY / "make_tables.py")
    tables = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tables)
    radius, count, top = tables.FILLS[0]
    spheres, force, _ = tables.measure(radius, count, top, tables.ROUGH, tables.SEEDS[0])
    rows = table("rough_walls")
    ours = np.array(rows["floor_pressure"][:3], dtype=float)
    assert spheres == count
    # another build may pour otherwise: then within the scatter of the three pours of the table
    margin = 4.0 * float(ours.std(ddof=1))
    assert force / (math.pi * radius**2) == pytest.approx(ours.mean(), abs=margin)
