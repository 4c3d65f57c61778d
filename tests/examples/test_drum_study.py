"""The drum of the study: its effects, and that rolling resistance shows in its slope."""

from __future__ import annotations

import copy
from pathlib import Path

import numpy as np
import pytest

from greybed.core.config import read_toml
from greybed.residual import read_study
from greybed.residual.models.particle_runner import ParticleRunner

FOLDER = Path(__file__).parents[2] / "examples/drum_study"


def test_the_tables_are_those_of_the_drum():
    for name, mean in (("study", 38.0), ("study_clean", 24.4)):
        study = read_study(FOLDER / f"{name}.toml")
        assert len(study.table) == 12
        slope, speed = study.table.columns["slope"], study.table.columns["speed"]
        assert np.degrees(slope).mean() == pytest.approx(mean, abs=0.5)
        np.testing.assert_allclose(np.unique(speed), np.pi * np.array([0.5, 1.0]), rtol=1e-12)


def test_the_drum_switches_what_the_study_may_find(tmp_path):
    content = read_toml(FOLDER / "drum.toml")
    runner = ParticleRunner(FOLDER / "drum.toml", "measures.surface.mean_angle_rad", tmp_path)
    free = {n for n, s in runner.switches().items() if s.excluded(content) is None}
    assert free == {
        "rolling-resistance",
        "cohesion",
        "velocity-dependent-restitution",
        "particle-shape",
    }
    content["duration"], content["time_step"] = 0.5, 1e-4
    content["wall"][0]["starts"] = 0.15
    content["measure"][0]["average"] = 0.15
    rolls = copy.deepcopy(content)
    runner.switches()["rolling-resistance"].apply(rolls, 0.4)
    steep, flat = runner.run(rolls), runner.run(content)
    assert steep > flat + np.radians(3.0)
