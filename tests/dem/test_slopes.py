"""Slopes averaged over samples: what the mean is of, and that a stopped run has the same one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from greybed.core.config import build, read_toml
from greybed.core.units import parse_quantity
from greybed.dem.case import ParticleCase
from greybed.dem.results import results_of
from greybed.dem.runner import ParticleRun
from greybed.residual.models.case import get, put

DRUM = Path(__file__).parents[2] / "examples/drum_study/drum.toml"


def drum(**change):
    """The drum of the study with few spheres, that turns from the start."""
    content = read_toml(DRUM)
    content |= {"duration": 0.2}
    content["particles"][0]["count"] = 300
    content["wall"][0]["starts"] = 0.0
    content["measure"][0] |= {"average": 0.1, "width": "6 mm", **change}
    if content["measure"][0]["average"] is None:
        del content["measure"][0]["average"]
    return ParticleRun(build(ParticleCase, content, DRUM), {}, threads=1)


def finished(run):
    for _ in run.go_on():
        pass
    return results_of(run)["measures"]["surface"]


def test_a_mean_slope_is_that_of_the_samples_at_the_end(tmp_path):
    run = drum()
    found = finished(run)
    rows = run.tally.history
    time = np.array([row["time [s]"] for row in rows])
    angle = np.array([row["angle of surface [deg]"] for row in rows])
    late = (time > time[-1] - 0.1 - 1e-9) & np.isfinite(angle)
    assert 3 <= late.sum() <= 6
    assert found["samples"] == late.sum()
    assert found["mean_angle_deg"] == angle[late].mean()
    assert found["mean_angle_rad"] == pytest.approx(np.radians(angle[late].mean()), rel=1e-15)
    assert found["angle_sd_deg"] == angle[late].std(ddof=1)
    assert angle[-1] == found["angle_deg"] != found["mean_angle_deg"]
    first = drum()
    for _ in first.go_on(int(0.7 * run.steps)):
        pass
    first.save(tmp_path / "part.npz")
    second = drum()
    second.restore(tmp_path / "part.npz")
    assert finished(second) == found


def test_samples_without_a_slope_are_left_out():
    run = drum(above="1 m")
    found = finished(run)
    assert found == {
        "angle_deg": None, "why": "no particle is there", "mean_angle_deg": None,
        "mean_angle_rad": None, "angle_sd_deg": None, "samples": 0,
    }  # fmt: skip
    assert "mean_angle_deg" not in finished(drum(average=None))


def test_inputs_of_a_study_reach_into_lists_by_number():
    content = read_toml(DRUM)
    assert get(content, "wall.drum.spin.1") == "30 rpm"
    put(content, "wall.drum.spin.1", parse_quantity("15 rpm", "angular velocity"))
    assert build(ParticleCase, content, DRUM).wall[0].spin[1] == pytest.approx(np.pi / 2)
    put(content, "particles.0.count", 10)
    assert content["particles"][0]["count"] == 10
