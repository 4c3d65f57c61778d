"""Study files: what is read, and what is refused in one sentence before anything runs."""

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
import tomli_w

from greybed.calibration.read import read_study
from greybed.core.errors import InputError

ROOT = Path(__file__).parents[2]
GOOD = {
    "study": {"runs": 20, "seed": 3},
    "parameter": [
        {"name": "friction", "low": 0.1, "high": 0.9},
        {"name": "rolling_friction", "low": 0.02, "high": 0.8},
        {"name": "youngs_modulus", "value": "5 MPa"},
    ],
    "experiment": [
        {"name": "heap", "kind": "twin", "twin": "heap"},
        {"name": "hopper", "kind": "twin", "twin": "hopper", "role": "candidate",
         "errors": {"flow": "5 g/s"}},
    ],
    "data": [
        {"experiment": "heap", "measure": "angle", "value": "0.6 rad", "sd": "1 deg"},
    ],
}  # fmt: skip


def changed(path, value):
    content = tomllib.loads(tomli_w.dumps(GOOD))
    *front, last = path
    here = content
    for key in front:
        here = here[key]
    if value is None:
        del here[last]
    else:
        here[last] = value
    return content


def written(tmp_path, content):
    path = tmp_path / "study.toml"
    path.write_text(tomli_w.dumps(content))
    return path


def test_units_and_roles(tmp_path):
    study = read_study(written(tmp_path, GOOD))
    assert study.targets[0].value[0] == pytest.approx(np.degrees(0.6))
    assert study.targets[0].sd[0] == pytest.approx(1.0)
    assert study.planned == {"hopper.flow": pytest.approx(0.005)}
    assert study.space.fixed == {"youngs_modulus": 5e6}
    assert study.with_role("calibration") == ("heap",)
    assert study.options.runs == 20


REFUSED = [
    (("parameter", 0, "high"), None, "parameter 'friction' has no range; give low and high"),
    (("parameter", 0, "high"), 0.05, "low = 0.1 must be below high = 0.05; exchange them"),
    (("data", 0, "sd"), 0.0, "data of heap.angle: sd = 0 must be above 0; give the error"),
    (("data", 0, "sd"), -1.0, "sd = -1 must be above 0"),
    (("data", 0, "sd"), None, "data of heap.angle have no sd; give it"),
    (("data", 0, "measure"), "flow", "experiment 'heap' cannot produce the measure 'flow'; it "
     "gives angle"),
    (("data", 0, "experiment"), "drum", "data name the experiment 'drum'; there are heap, hopper"),
    (("data", 0, "value"), "3 kg", "does not measure the same as deg"),
    (("data", 0, "value"), float("nan"), "must be finite"),
    (("parameter", 0, "name"), "colour", "parameter 'colour' reaches no experiment"),
    (("experiment", 0, "role"), "candidate", "is a candidate and has no errors"),
    (("experiment", 1, "errors"), {"speed": 1.0}, "errors.speed is no measure of it"),
    (("experiment", 1, "name"), "heap", "experiment 'heap' is there twice"),
    (("study", "runs"), 3, "runs = 3 [-] must be at least 4"),
    (("study", "strategy"), "best", "study.strategy = 'best' must be one of 'response-surface'"),
    (("study", "surrogat"), "gp", "study.surrogat is not a known key; did you mean 'surrogate'?"),
    (("parameter", 1, "name"), "friction", "parameter 'friction' is there twice"),
    (("data",), [], "no data belong to an experiment with role 'calibration'"),
]  # fmt: skip


@pytest.mark.parametrize(("path", "value", "said"), REFUSED, ids=[r[2][:50] for r in REFUSED])
def test_refusals(tmp_path, path, value, said):
    file = written(tmp_path, changed(path, value))
    with pytest.raises(InputError, match=re.escape(said)) as refusal:
        read_study(file)
    assert str(refusal.value).startswith(str(file))
    assert str(refusal.value).count("\n") == 0


def test_a_measure_that_responds_to_no_free_parameter_is_refused(tmp_path):
    content = tomllib.loads(tomli_w.dumps(GOOD))
    content["experiment"].append({"name": "plate", "kind": "inclined-wall"})
    content["parameter"] = [{"name": "rolling_friction", "low": 0.0, "high": 0.5}]
    content["data"] = [
        {"experiment": "heap", "measure": "angle", "value": 30.0, "sd": 1.0},
        {"experiment": "plate", "measure": "slip_angle", "value": "20 deg", "sd": "1 deg"},
    ]
    with pytest.raises(InputError, match=r"plate\.slip_angle responds to no free parameter"):
        read_study(written(tmp_path, content))


CURVE = {
    "": "line 1 must name the columns at, value, sd",
    "t,v,e\n": "it has t, v, e",
    "at,value,sd\n1,2,x\n": "line 2 is not three numbers",
    "at,value,sd\n1,2\n2,3\n3,4\n": "line 2 is not three numbers",
    "at,value,sd\n1,2,0.1\n2,3,0.1\n": "2 rows follow the header; a curve needs 3",
    "at,value,sd\n1,2,0.1\n2,3,0\n3,4,0.1\n": "sd = 0 must be above 0",
    "at,value,sd\n1,2,0.1\n3,3,0.1\n2,4,0.1\n": "the places of a curve must increase",
}


@pytest.mark.parametrize("text", CURVE, ids=[v[:30] for v in CURVE.values()])
def test_refusals_of_curves(tmp_path, text):
    content = tomllib.loads(tomli_w.dumps(GOOD))
    content["experiment"][0] = {"name": "drop", "kind": "twin", "twin": "drop"}
    content["parameter"] = [{"name": "dynamic_friction", "low": 0.0, "high": 1.0}]
    content["experiment"].pop()
    content["data"] = [{"experiment": "drop", "measure": "front", "file": "front.csv"}]
    (tmp_path / "front.csv").write_text(text)
    with pytest.raises(InputError, match=re.escape(CURVE[text])):
        read_study(written(tmp_path, content))


def test_a_scalar_where_a_curve_is_needed_is_refused(tmp_path):
    content = tomllib.loads(tomli_w.dumps(GOOD))
    content["experiment"][0] = {"name": "drop", "kind": "twin", "twin": "drop"}
    content["parameter"] = [{"name": "dynamic_friction", "low": 0.0, "high": 1.0}]
    content["experiment"].pop()
    content["data"] = [{"experiment": "drop", "measure": "front", "value": 1.0, "sd": 0.1}]
    with pytest.raises(InputError, match="are of a signal; give a file with at, value and sd"):
        read_study(written(tmp_path, content))


@pytest.mark.parametrize("file", sorted((ROOT / "examples/calibration").glob("*.toml")),
                         ids=lambda p: p.name)  # fmt: skip
def test_the_examples_are_accepted(file):
    if tomllib.loads(file.read_text()).get("kind") != "particles":
        assert read_study(file).targets
