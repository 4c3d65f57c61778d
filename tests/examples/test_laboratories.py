"""Verdicts of the laboratories from their tables, and what their models say of new experiments."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

FOLDER = Path(__file__).parents[2] / "examples/laboratories"

# study, experiment that it does not read, verdict, effects. "settling/study_spheres" is executed
# on the page of the tutorial; the silo with smooth walls is there for the verdict alone.
CASES = {
    "grains": ("settling/study_grains", "settling/grains_held_out", "unknown", []),
    "viscous": (
        "impacts/study_viscous",
        "impacts/viscous_impacts_held_out",
        "effect",
        ["velocity-dependent-restitution"],
    ),
    "constant": ("impacts/study_constant", "impacts/constant_impacts_held_out", "none", []),
    "spheres": ("settling/study_spheres", "settling/spheres_held_out", "effect", ["inertia"]),
    "rough": ("silo/study_rough", "silo/rough_walls_held_out", "effect", ["wall-friction"]),
}


@pytest.fixture(scope="module")
def program():
    spec = importlib.util.spec_from_file_location("circle", FOLDER / "circle.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules["circle"] = module  # its dataclass looks there
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", CASES)
def test_the_laboratory_is_diagnosed_rightly(program, name, tmp_path):
    study, held_out, verdict, effects = CASES[name]
    found = program.circle(FOLDER / f"{study}.toml", FOLDER / f"{held_out}.csv", tmp_path)
    assert found.diagnosis.verdict == verdict
    assert [effect.name for effect in found.diagnosis.effects] == effects
    after, recalibrated = found.with_effect, found.recalibrated
    if verdict == "none":
        # nothing to gain: the recalibrated model is the answer, and the scatter is what is left
        assert after[0] == pytest.approx(recalibrated[0], abs=5e-3)
        assert after[0] < 0.02
    else:
        # an experiment outside of the table: better than recalibration beyond all doubt
        assert after[2] < recalibrated[1]
    # the file that the diagnosis wrote carries the finding
    assert ("effects" in found.diagnosis.model) == (verdict == "effect")
    assert len(found.diagnosis.closures) == (verdict == "unknown")


def test_grains_and_spheres_differ_where_inertia_counts():
    # Haider and Levenspiel's drag of a sphericity of 0.6 is above that of spheres, the more so
    # the faster the flow; the tables hold the same sizes
    ratio = []
    for name in ("grains", "spheres"):
        rows = (FOLDER / f"settling/{name}.csv").read_text().splitlines()[1:]
        ratio.append(np.array([float(row.split(",")[3]) for row in rows]).reshape(-1, 4).mean(1))
    assert np.all(ratio[0] < ratio[1])
    # means of four rows of 1.8 % each: their double ratio is good to 1.8 %; five times that
    assert ratio[0][-1] / ratio[1][-1] < (1.0 - 5 * 0.018) * ratio[0][0] / ratio[1][0]
