"""Experiments: functions, commands, case files, and the library over the particle engine."""

import math
import sys
from pathlib import Path

import numpy as np
import pytest

from greybed.calibration.experiment import COST, Measure, RunFailed, named
from greybed.calibration.experiments import LIBRARY
from greybed.calibration.experiments.case import CaseExperiment, put
from greybed.calibration.experiments.command import CommandExperiment
from greybed.calibration.experiments.drum import avalanches
from greybed.calibration.experiments.flows import seen_area
from greybed.calibration.experiments.heaps import flank_angle
from greybed.calibration.experiments.python import PythonExperiment
from greybed.calibration.runs import attempt_run
from greybed.core.config import build
from greybed.core.errors import InputError
from greybed.dem.case import ParticleCase

ANGLE = named(Measure(name="angle", unit="deg"))
SCRIPT = """
import json, sys, tomllib
with open(sys.argv[1], "rb") as stream:
    given = tomllib.load(stream)
friction = given["parameters"]["friction"]
if friction > 0.8:
    sys.exit("too rough")
answer = {"angle": 20.0 + friction * given["settings"]["gain"] + given["seed"] * 0.0}
if friction < 0.1:
    answer = {}
with open(sys.argv[2], "w") as stream:
    json.dump(answer, stream)
"""


def test_a_command_gets_toml_and_gives_json(tmp_path):
    (tmp_path / "heap.py").write_text(SCRIPT)
    experiment = CommandExperiment(
        "heap", [sys.executable, "heap.py"], ANGLE, tmp_path, settings={"gain": 10.0}
    )
    assert experiment.run({"friction": 0.5}, 3)["angle"] == 25.0
    results, error, _ = attempt_run(experiment, {"friction": 0.9}, 3)
    assert results is None
    assert "ended with 1: too rough" in error
    results, error, _ = attempt_run(experiment, {"friction": 0.05}, 3)
    assert results is None
    assert "it gave no angle" in error
    before = experiment.identity()
    (tmp_path / "heap.py").write_text(SCRIPT + "\n# changed\n")
    again = CommandExperiment(
        "heap", [sys.executable, "heap.py"], ANGLE, tmp_path, settings={"gain": 10.0}
    )
    assert again.identity() != before


def test_a_command_that_hangs_is_ended(tmp_path):
    experiment = CommandExperiment(
        "heap", [sys.executable, "-c", "import time; time.sleep(60)"], ANGLE, tmp_path, limit=0.5
    )
    with pytest.raises(RunFailed, match=r"took longer than 0.5 s"):
        experiment.run({}, 1)


def test_a_program_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(InputError, match="there is no program 'no-such-simulator'"):
        CommandExperiment("heap", ["no-such-simulator"], ANGLE, tmp_path)


def test_a_python_function(tmp_path):
    (tmp_path / "my_heap.py").write_text(
        "def run(parameters, seed, settings):\n"
        "    return {'angle': parameters['friction'] * settings['gain'] + seed}\n"
    )
    experiment = PythonExperiment(
        "heap", "my_heap:run", ANGLE, tmp_path, takes=("friction",), settings={"gain": 2.0}
    )
    assert experiment.run({"friction": 0.5, "other": 1.0}, 3) == {"angle": 4.0}
    with pytest.raises(InputError, match="the module my_heap has no walk"):
        PythonExperiment("heap", "my_heap:walk", ANGLE, tmp_path)


@pytest.mark.parametrize("value", [float("nan"), "high", [[0.0, 1.0], [1.0]], [1.0, 2.0], None])
def test_results_that_are_none_count_as_failed(tmp_path, value):
    class Odd(PythonExperiment):
        def __init__(self):
            self.name, self.measures = "odd", ANGLE

        def run(self, values, seed):
            return {"angle": value}

    results, error, _ = attempt_run(Odd(), {}, 1)
    assert results is None
    assert error


CASES = Path(__file__).parents[2] / "examples" / "particles"


def test_a_case_file_takes_parameters_at_its_keys():
    experiment = CaseExperiment(
        "heap",
        CASES / "inclined_wall.toml",
        {"wall_friction": ["contact.ore-steel.friction"], "modulus": ["material.0.youngs_modulus"]},
        named(Measure(name="angle", unit="deg")),
        {"angle": "results.measures.slide.angle_deg"},
    )
    content = experiment.case({"wall_friction": 0.33, "modulus": 7e6})
    assert content["contact"][1]["friction"] == 0.33
    assert content["contact"][0]["friction"] == 0.7
    assert content["material"][0]["youngs_modulus"] == 7e6
    with pytest.raises(InputError, match="stops at 'tin'"):
        CaseExperiment("x", CASES / "inclined_wall.toml", {"f": ["contact.tin.friction"]}, ANGLE,
                       {"angle": "results.x"})  # fmt: skip
    with pytest.raises(InputError, match=r"must begin with 'results\.' or 'history\.'"):
        CaseExperiment("x", CASES / "inclined_wall.toml", {}, ANGLE, {"angle": "angle"})


def test_numbers_are_put_into_vectors():
    content = {"wall": [{"name": "drum", "spin": [0.0, 1.0, 0.0]}]}
    put(content, "wall.drum.spin.1", 5.0, "here")
    assert content["wall"][0]["spin"] == [0.0, 5.0, 0.0]


@pytest.mark.parametrize("kind", LIBRARY)
def test_the_library_makes_cases_that_the_engine_accepts(kind):
    experiment = LIBRARY[kind](name=kind)
    values = {"friction": 0.37, "wall_friction": 0.21, "rolling_friction": 0.05}
    content = experiment.case(values)
    case = build(ParticleCase, {**content, "seed": 1}, Path("study"))
    contacts = {tuple(t.between): t for t in case.contact}
    if kind != "inclined-wall":
        assert contacts["grains", "grains"].friction == 0.37
        # A wall has the grains' numbers where the study gives it none of its own.
        assert contacts["grains", "walls"].rolling_friction == 0.05
    assert contacts["grains", "walls"].friction == 0.21
    assert experiment.measures
    assert experiment.identity() != LIBRARY[kind](name=kind, radius=1e-3).identity()


def test_larger_grains_come_in_a_larger_vessel():
    small, large = (LIBRARY["drum"](name="drum", radius=r) for r in (1e-3, 2e-3))
    walls = [next(w for w in e.case({})["wall"] if w["name"] == "drum") for e in (small, large)]
    assert walls[1]["radius"] == pytest.approx(2.0 * walls[0]["radius"])
    # The Froude number stays: the spin falls with the root of the size.
    assert walls[1]["spin"][1] == pytest.approx(walls[0]["spin"][1] / math.sqrt(2.0))


def test_grains_rebound_with_their_restitution():
    experiment = LIBRARY["restitution"](name="drop", radius=2e-3, youngs_modulus=1e7)
    ratio = experiment.run({"wall_restitution": 0.6}, 1)["ratio"]
    # The velocity ratio is the restitution; heights go with its square. Samples are 1/800 of the
    # time apart, and gravity acts during the contact.
    assert ratio == pytest.approx(0.6, rel=0.03)


def test_grains_slide_at_the_angle_of_friction():
    experiment = LIBRARY["inclined-wall"](name="plate", count=12)
    found = experiment.run({"wall_friction": 0.4}, 1)
    # They are seen to move at 2 mm/s, about a degree later at this rate of tilt.
    assert found["slip_angle"] == pytest.approx(math.degrees(math.atan(0.4)), abs=2.0)
    assert found[COST] > 0.0


def test_the_bulk_density_is_kept():
    """Grains of any friction settle to the same bulk density: their own follows."""
    experiment = LIBRARY["compression"](name="c", count=60, bulk_density=1500.0)
    fraction, work = experiment._solid_fraction({"friction": 0.5}, 1)
    assert 0.5 < fraction < 0.66
    assert work > 0.0


def test_avalanches_of_a_saw():
    time = np.linspace(0.0, 10.0, 1001)
    energy = 3.0 + 0.5 * ((time % 2.0) / 2.0)
    high, low, fall, period = avalanches(time, energy)
    assert high == pytest.approx(3.5, abs=0.01)
    assert low == pytest.approx(3.0, abs=0.01)
    assert fall == pytest.approx(0.5, abs=0.01)
    assert period == pytest.approx(2.0, abs=0.01)
    with pytest.raises(RunFailed, match="fewer than two avalanches"):
        avalanches(time, np.full(1001, 3.0))


def test_the_visible_area_of_discs():
    rng = np.random.default_rng(0)
    apart = np.stack(np.meshgrid(np.arange(5.0), np.arange(5.0)), axis=-1).reshape(-1, 2)
    radii = np.full(25, 0.3)
    # A grid of a quarter radius: 1 % of an area of 50 cells a disc, on the mean of 25 discs.
    assert seen_area(apart + 0.1 * rng.random(2), radii) == pytest.approx(
        25 * math.pi * 0.09, rel=0.03
    )
    assert seen_area(np.zeros((9, 2)), np.full(9, 0.3)) == pytest.approx(math.pi * 0.09, rel=0.08)
    assert seen_area(np.zeros((0, 2)), np.zeros(0)) == 0.0


def test_the_angle_of_a_slope_of_few_bins():
    x = np.linspace(0.0, 0.05, 9)
    z = np.clip(0.03 - np.tan(np.radians(35.0)) * x, 0.005, 0.025)
    found = flank_angle({"position_m": x, "height_m": z})
    assert found == pytest.approx(35.0, abs=0.1)
    with pytest.raises(RunFailed, match="fewer than three bins"):
        flank_angle({"position_m": x[:2], "height_m": z[:2]})
