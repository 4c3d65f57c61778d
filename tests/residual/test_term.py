"""Grey-box terms: exact limits untrained, trained, reloaded and exported; run like any effect."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic import spheres

from greybed.cli import main
from greybed.closures.term import GreyBoxTerm, load_term
from greybed.core.errors import InputError, VerificationError
from greybed.export import (
    CompiledClosure,
    OnnxClosure,
    compile_cpp,
    export_cpp,
    export_onnx,
    find_compiler,
)
from greybed.export.replay import replay
from greybed.residual import diagnose
from greybed.residual.output import write_diagnosis

FREE = GreyBoxTerm(
    name="free_term", covariate="humidity", unit="", response="velocity", reference=10.0,
    amplitude=0.3, exponent=1.5, side=-1, window=(1.0, 10.0),
)  # fmt: skip


@given(
    amplitude=st.floats(0.0, 50.0), exponent=st.floats(0.1, 4.0), side=st.sampled_from([1, -1]),
    z=st.floats(0.0, 1e6),
)  # fmt: skip
def test_limits_hold_whatever_was_fitted(amplitude, exponent, side, z):
    up = replace(FREE, amplitude=amplitude, exponent=exponent, side=side)
    down = replace(up, exponent=-exponent)
    assert float(up.evaluate(0.0)) == 1.0
    assert float(down.evaluate(np.inf)) == 1.0
    assert float(up.evaluate(z)) > 0.0
    off = replace(up, amplitude=0.0)
    assert float(off.evaluate(z)) == 1.0


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("exponent", [1.5, -0.5])
def test_every_form_answers_the_same(tmp_path, side, exponent):
    term = replace(FREE, side=side, exponent=exponent)
    again = load_term(term.save(tmp_path / "t.json"))
    assert again == term
    z = np.geomspace(0.01, 100.0, 50)
    assert np.array_equal(again.evaluate(z), term.evaluate(z))
    graph = OnnxClosure(export_onnx(term, tmp_path / "t.onnx"))
    assert replay(term, graph, 1e-12)["passed"]
    if find_compiler() is not None:
        program = CompiledClosure(compile_cpp(export_cpp(term, tmp_path), tmp_path / "build"))
        assert replay(term, program, 1e-12)["passed"]


def test_a_changed_term_is_refused(tmp_path):
    path = FREE.save(tmp_path / "t.json")
    content = json.loads(path.read_text())
    content["term"]["amplitude"] = 0.31
    path.write_text(json.dumps(content))
    with pytest.raises(VerificationError, match="was changed"):
        load_term(path)
    path.write_text("{}")
    with pytest.raises(InputError, match="not a grey-box term"):
        load_term(path)
    with pytest.raises(InputError, match="amplitude = -1 "):
        replace(FREE, amplitude=-1.0)


def test_an_unknown_dependence_becomes_a_term_that_runs_and_exports(tmp_path, capsys):
    def humidity(rng, n):
        return {"humidity": np.exp(rng.uniform(0.0, 2.7, n))}

    study = spheres(6, n=100, columns=humidity, factor=lambda c: 1.0 / (1.0 + 0.05 * c["humidity"]))
    found = diagnose(study)
    assert found.verdict == "unknown"
    (term,) = found.closures
    assert (term.covariate, term.side) == ("humidity", -1)
    z = np.array([2.0, 6.0, 12.0])
    assert term.evaluate(z) == pytest.approx(1.0 / (1.0 + 0.05 * z), rel=0.03)
    files = write_diagnosis(tmp_path, study, found)

    options = {**study.model.options, "terms": [files["humidity_term"].name]}
    model = replace(study.model, options=options, folder=str(tmp_path))
    again = diagnose(replace(study, model=model))
    assert again.verdict == "none"

    words = ["export", str(files["humidity_term"]), "--to", "cpp,onnx", "--out", f"{tmp_path}/x"]
    assert main(words) == 0
    assert {p.name for p in (tmp_path / "x").iterdir()} == {
        "CMakeLists.txt", "README.md", "humidity_term.hpp", "humidity_term_test.cpp",
        "humidity_term.onnx", "summary.json",
    }  # fmt: skip


def test_a_term_without_its_column_is_refused(tmp_path):
    FREE.save(tmp_path / "t.json")
    study = spheres(6)
    model = replace(study.model, options={"terms": ["t.json"]}, folder=str(tmp_path))
    with pytest.raises(InputError, match="needs the column humidity"):
        diagnose(replace(study, model=model))
