"""Models of users: Python functions and simulation cases."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from greybed.core.errors import InputError
from greybed.residual import Table, diagnose, read_study
from greybed.residual.model import ModelSpec
from greybed.residual.models import build
from greybed.residual.output import write_diagnosis

EXAMPLES = Path(__file__).parents[2] / "examples"
MODULE = """
import numpy as np

def rate(columns, parameters, amplitudes):
    base = parameters["k"] * columns["x"]
    drift = amplitudes.get("drift", 0.0)
    return base * (1.0 + drift * columns["age"]) if drift else base

def short(columns, parameters, amplitudes):
    return np.ones(3)

def breaks(columns, parameters, amplitudes):
    raise KeyError("x")

def leaks(columns, parameters, amplitudes):
    return columns["x"] * (1.0 + len(amplitudes))
"""
CANDIDATE = {"drift": {"low": 0.01, "high": 2.0, "columns": ["age"]}}


def own(folder, function="rate", candidates=CANDIDATE, **options):
    (folder / "own_model_of_tests.py").write_text(MODULE)
    x = np.linspace(1.0, 4.0, 30)
    columns = {"x": x, "age": np.tile([0.1, 0.5, 0.9], 10), "y": x}
    table = Table(columns=columns, units={}, rows=np.arange(30))
    options = {"function": f"own_model_of_tests:{function}", "candidates": candidates, **options}
    spec = ModelSpec(name="python", options=options, folder=str(folder))
    return build(spec, table, {"k": 2.0}), columns


def test_a_function_predicts_with_and_without_its_effect(tmp_path):
    model, columns = own(tmp_path)
    base = model.predict(columns, {"k": 2.0}, {})
    assert base == pytest.approx(2.0 * columns["x"])
    on = model.predict(columns, {"k": 2.0}, {"drift": 0.5})
    assert on == pytest.approx(base * (1.0 + 0.5 * columns["age"]))


@pytest.mark.parametrize(
    ("function", "options", "message"),
    [
        ("short", {}, r"gave an array of shape \(3,\) for 30 rows"),
        ("breaks", {}, "raised KeyError"),
        ("leaks", {}, "amplitude 0 must switch an effect off exactly"),
        ("nothing", {}, "has no nothing"),
        ("rate", {"transform": "sqrt"}, "must be 'log' or 'linear'"),
        ("rate", {"candidates": {"drift": {"low": 0.1}}}, "high is missing"),
        ("rate", {"candidates": {"drift": {"low": 2.0, "high": 1.0}}}, "must be ordered"),
        ("rate", {"catalogue": ["wall"]}, "is not known"),
        ("rate", {"fun": 1}, "is not known to the model python"),
    ],
)
def test_functions_that_do_not_answer_as_they_must(tmp_path, function, options, message):
    with pytest.raises(InputError, match=message):
        own(tmp_path, function, **{"candidates": CANDIDATE, **options})


def test_a_candidate_without_its_column_is_unavailable(tmp_path):
    lacking = {"drift": {"low": 0.01, "high": 2.0, "columns": ["humidity"]}}
    model, _ = own(tmp_path, candidates=lacking)
    assert "humidity" in model.unavailable["drift"]


@pytest.fixture(scope="module")
def bed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bed")
    for name in ("bed.toml", "bed.h5", "study.toml", "measured.csv"):
        shutil.copy(EXAMPLES / "heated_bed_study" / name, folder)
    case = (folder / "bed.toml").read_text().replace("rays = 2000", "rays = 300")
    (folder / "bed.toml").write_text(case)
    rows = (folder / "measured.csv").read_text().splitlines()
    (folder / "measured.csv").write_text("\n".join([rows[0], *rows[1::2]]) + "\n")
    return folder


@pytest.mark.usefixtures("three_folds")
def test_a_case_that_does_not_radiate_lacks_radiation(bed, tmp_path):
    study = read_study(bed / "study.toml")
    found = diagnose(study)
    assert (found.verdict, [e.name for e in found.effects]) == ("effect", ["radiation"])
    # the measured table came from 5000 rays; 300 rays shift the exchange by some per cent
    assert found.effects[0].amplitude == pytest.approx(1.0, abs=0.1)
    assert "rolling-resistance" in found.unavailable
    files = write_diagnosis(tmp_path, study, found)

    from greybed.coupling.case import load_case

    case = load_case(files["case"])
    assert case.radiation.source == "traced"
    assert case.radiation.strength == pytest.approx(found.effects[0].amplitude)
    assert case.packing.file.exists()


@pytest.mark.usefixtures("three_folds")
def test_runs_of_a_case_are_kept(bed, monkeypatch):
    from greybed.residual.models.runner import ThermalRunner

    diagnose(read_study(bed / "study.toml"))

    def again(self, content):
        raise AssertionError("this case was run before")

    monkeypatch.setattr(ThermalRunner, "simulate", again)
    assert diagnose(read_study(bed / "study.toml")).verdict == "effect"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('output = "heat_into_bed.floor"', 'output = "heat"'), "is no number; outputs are"),
        (('file = "bed.toml"', 'file = "be.toml"'), "cannot read this case"),
        (('"wall.floor.temperature"', '"wall.roof.temperature"'), "there is no wall.roof"),
        (("seeds =", "sseds ="), "did you mean 'seeds'"),
        (("floor_temperature =", "roof ="), "neither a column nor a parameter"),
    ],
)
def test_cases_that_cannot_be(bed, tmp_path, change, message):
    shutil.copytree(bed, tmp_path / "b")
    text = (bed / "study.toml").read_text()
    assert change[0] in text
    (tmp_path / "b/study.toml").write_text(text.replace(*change))
    with pytest.raises(InputError, match=message):
        diagnose(read_study(tmp_path / "b/study.toml"))
