"""The tables of the laboratory against theory, and short runs where LIGGGHTS is installed."""

from __future__ import annotations

import csv
import importlib.util
import math
import shutil
from pathlib import Path

import numpy as np
import pytest

LABORATORY = Path(__file__).parents[2] / "examples/laboratories"
needs_liggghts = pytest.mark.skipif(
    shutil.which("liggghts") is None, reason="liggghts is not installed"
)


@pytest.fixture(scope="module")
def tables():
    spec = importlib.util.spec_from_file_location("make_tables", LABORATORY / "make_tables.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def table(name):
    rows = list(csv.reader(next(LABORATORY.glob(f"*/{name}.csv")).read_text().splitlines()))
    return {head.split(" ")[0]: [row[k] for row in rows[1:]] for k, head in enumerate(rows[0])}


def numbers(rows, *names):
    return [np.array(rows[name], dtype=float) for name in names]


def carried(rows):
    """Share of the weight that the floor carries."""
    pressure, diameter, mass = numbers(rows, "floor_pressure", "silo_diameter", "fill_mass")
    return pressure * 0.25 * math.pi * (1e-3 * diameter) ** 2 / (9.81e-3 * mass)


def test_smooth_walls_leave_the_weight_to_the_floor():
    # the fill creeps by less than a thousandth of its weight in inertia
    assert carried(table("smooth_walls")) == pytest.approx(1.0, abs=2e-3)


def test_rough_walls_carry_as_janssen_has_it():
    rows = table("rough_walls")
    height, diameter = numbers(rows, "fill_height", "silo_diameter")
    share = carried(rows)
    low, high = np.zeros_like(share), np.full_like(share, 100.0)
    for _ in range(60):  # (1 - exp(-x)) / x = share by bisection
        x = 0.5 * (low + high)
        above = -np.expm1(-x) / x > share
        low, high = np.where(above, x, low), np.where(above, high, x)
    ratio = x * diameter / (4.0 * height) / 0.5  # stress ratio; the wall's friction is 0.5
    # about 1 - sin(angle of friction), 0.5 to 0.6 for spheres; one law for all slendernesses
    assert 0.4 < ratio.mean() < 0.7
    slender = height / diameter > 2.0
    assert ratio[slender].mean() == pytest.approx(ratio[~slender].mean(), rel=0.1)


def spread(rows):
    speed, found = numbers(rows, "impact_velocity", "restitution")
    speeds = np.unique(speed)
    means = np.array([found[speed == v].mean() for v in speeds])
    sd = np.sqrt(np.mean([found[speed == v].var(ddof=1) for v in speeds]))
    return speeds, means, sd / math.sqrt(len(found) / len(speeds))


def askew(tables, restitution):
    """Restitution along the line of approach where the shots miss the centre a little."""
    return restitution - (1.0 + restitution) * 2.0 * (tables.MISS / 0.004) ** 2


def test_viscous_spheres_part_as_theory_has_it(tables):
    speeds, means, error = spread(table("viscous_impacts"))
    mass = 0.5 * tables.DENSITY * 4.0 / 3.0 * math.pi * 0.002**3
    root = math.sqrt(0.001)
    # loss at first order: 2 damping sqrt(R) (5 m / 4 k)^(3/5) v^(1/5) times the integral of
    # sqrt(s (1 - s^(5/2))), which is 0.504
    loss = 2.0 * 3.0e7 * root * (1.25 * mass / (1.33e8 * root)) ** 0.6 * speeds**0.2 * 0.504
    # coefficients of Ramirez et al., Phys. Rev. E 60 (1999) 4465; the next is below 1e-3 here
    theory = 1.0 - loss + 0.6 * loss**2 - 0.315 * loss**3 + 0.161 * loss**4
    # four errors: one in a thousand such tables would fail
    assert np.abs(means - askew(tables, theory)).max() < 4.0 * error


def test_constant_spheres_part_alike_at_all_speeds(tables):
    _, means, error = spread(table("constant_impacts"))
    assert np.abs(means - askew(tables, 0.8)).max() < 4.0 * error


@needs_liggghts
def test_a_head_on_impact_loses_what_the_deck_says(tables):
    # 2000 steps per contact: time integration is right to better than 1e-3
    assert tables.measure_impact(0.5, 0.0, 0.0, viscous=False) == pytest.approx(0.8, abs=1e-3)
    assert tables.measure_impact(0.02, 0.0, 0.0, viscous=True) == pytest.approx(0.8834, abs=1e-3)


@needs_liggghts
def test_the_shortest_pour_gives_what_the_table_has(tables):
    radius, count, top = tables.FILLS[0]
    spheres, force, _ = tables.measure_silo(radius, count, top, tables.ROUGH, tables.SEEDS[0])
    ours = np.array(table("rough_walls")["floor_pressure"][:3], dtype=float)
    assert spheres == count
    # another build may pour otherwise: then within the scatter of the three pours of the table
    margin = 4.0 * float(ours.std(ddof=1))
    assert force / (math.pi * radius**2) == pytest.approx(ours.mean(), abs=margin)
