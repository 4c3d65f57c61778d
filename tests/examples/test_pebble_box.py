"""The pebble box: a short run agrees with what is recorded, and the laws hold."""

from __future__ import annotations

import csv
import importlib.util
import json
from pathlib import Path

import pytest

EXAMPLE = Path(__file__).parents[2] / "examples/pebble_box"


@pytest.fixture(scope="module")
def short():
    spec = importlib.util.spec_from_file_location("pebble_box", EXAMPLE / "pebble_box.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.run(1_000, seed=7)


def test_a_short_run_agrees_with_the_record(short):
    summary, table, profile, _, _ = short
    recorded = json.loads((EXAMPLE / "results/summary.json").read_text())
    # 1,000 rays a sphere: the fluxes of two seeds differ by half a per cent
    for name, flux in recorded["flux"].items():
        assert summary["flux"][name] == pytest.approx(flux, rel=0.015)
    assert summary["energy_defect"] < 1e-12
    # wall rows from wall rays, sphere rows from sphere rays: reciprocity ties them together
    assert summary["largest_violation_of_wall_reciprocity"] < 0.01
    with (EXAMPLE / "results/models.csv").open() as file:
        models = {row["model"]: row for row in csv.DictReader(file)}
    for row in table[:3]:
        there = float(models[row["model"]]["heat lost error [%]"])
        assert row["heat lost error [%]"] == pytest.approx(there, abs=1.5)
    with (EXAMPLE / "results/profile.csv").open() as file:
        for row, known in zip(profile, csv.DictReader(file), strict=True):
            assert row["D [-]"] == pytest.approx(float(known["D [-]"]), abs=6e-3)


def test_view_factors_let_too_much_through(short):
    flux = short[0]["flux"]
    assert 1.15 < flux["Gebhart F"] / flux["D"] < 1.28
    assert 1.18 < flux["pairwise F"] / flux["D"] < 1.33
