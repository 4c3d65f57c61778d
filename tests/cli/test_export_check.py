"""``greybed export`` and ``greybed check``: files, tables, summaries, exit codes, refusals."""

from __future__ import annotations

import hashlib
import json
import os
import re
import subprocess
import sys

import numpy as np
import pytest

import greybed.export.replay as replay_module
from greybed.cli import main
from greybed.closures import ViewFactorClosure, artifact, content_hash, save
from greybed.closures.viewfactor import visibility
from greybed.export import find_compiler

needs_compiler = pytest.mark.skipif(
    find_compiler() is None, reason="no C++ compiler (CXX, g++, clang++, c++)"
)


@pytest.fixture(params=["mlp pencil", "forest published"])
def closure(request):
    return ViewFactorClosure.untrained(*request.param.split(), seed=3)


@pytest.fixture
def model(closure, tmp_path):
    return str(save(closure, tmp_path / "bed.closure"))


@needs_compiler
def test_export_replays_and_writes(model, closure, tmp_path, capsys):
    out = tmp_path / "host"
    assert main(["export", model, "--to", "cpp,onnx", "--name", "bed", "--out", str(out)]) == 0
    text = capsys.readouterr().out
    assert re.search(
        r"cpp: 64 of 64 golden rows replayed, largest relative error \S+e-1[5-9]|0", text
    )
    files = {"bed.hpp", "bed_test.cpp", "CMakeLists.txt", "README.md", "bed.onnx"}
    assert {path.name for path in out.iterdir()} == files | {"summary.json"}
    summary = json.loads((out / "summary.json").read_text())
    assert summary["verb"] == "export"
    assert summary["hash"] == content_hash(closure)
    assert set(summary["files"]) == files
    assert "bed.closure" in summary["provenance"]["inputs"]
    for target, tolerance in (("cpp", 1e-12), ("onnx", 1e-6)):
        assert summary["targets"][target]["passed"] is True
        assert summary["targets"][target]["max_relative_error"] <= 1e-13 < tolerance


def test_without_a_compiler_the_header_is_written_unreplayed(model, tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("CXX", "/nowhere/g++")
    assert main(["export", model, "--to", "cpp", "--out", str(tmp_path / "host")]) == 0
    text = capsys.readouterr().out
    assert "cpp: golden rows not replayed (no C++ compiler found" in text
    assert list((tmp_path / "host").glob("*.hpp"))
    summary = json.loads((tmp_path / "host/summary.json").read_text())
    assert summary["targets"]["cpp"]["passed"] is None


def test_failing_rows_leave_no_files(model, tmp_path, capsys, monkeypatch):
    right = replay_module.golden_rows

    def wrong(closure):
        inputs, outputs = right(closure)
        outputs[7] *= 1.0 + 1e-5
        return inputs, outputs

    monkeypatch.setattr(replay_module, "golden_rows", wrong)
    assert main(["export", model, "--to", "onnx", "--out", str(tmp_path / "host")]) == 1
    text = capsys.readouterr().out
    assert "63 of 64 golden rows" in text
    assert "refused, nothing written" in text
    assert list((tmp_path / "host").iterdir()) == []


@needs_compiler
def test_check_prints_every_case_for_every_form(model, closure, tmp_path, capsys):
    out = tmp_path / "check"
    assert main(["check", model, "--exported", "cpp,onnx", "--out", str(out)]) == 0
    text = capsys.readouterr().out
    cases = 6 + (closure.kind == "mlp")
    assert len(re.findall(r"  pass$", text, re.MULTILINE)) == 3 * cases
    assert "FAIL" not in text
    assert content_hash(closure) in text
    assert "no bounds (untrained)" in text
    assert text.rstrip().endswith("all hold")
    summary = json.loads((out / "summary.json").read_text())
    assert summary["passed"] is True
    assert len(summary["limiting_cases"]) == cases
    assert {len(form["limiting_cases"]) for form in summary["exported"].values()} == {cases}
    assert set(summary["limiting_cases"][0]) == {"name", "deviation", "bound", "passed"}


def test_a_limit_that_fails_gives_one(model, capsys, monkeypatch):
    # A law that leaks: everything 1e-6 too large, golden rows made with it as well.
    right = visibility.pair_factor
    monkeypatch.setattr(visibility, "pair_factor", lambda x, ratio: right(x, ratio) * 1.000001)
    monkeypatch.setattr(artifact, "GOLDEN_TOLERANCE", 1e-5)
    assert main(["check", model]) == 1
    text = capsys.readouterr().out
    assert re.search(r"in free contact: 0\.0755868184216 +1\.00e-06 +1\.00e-14  FAIL", text)
    assert text.rstrip().endswith("a check FAILED")


def test_a_golden_row_that_fails_gives_one(model, capsys, monkeypatch):
    right = visibility.pair_factor
    monkeypatch.setattr(visibility, "pair_factor", lambda x, ratio: right(x, ratio) * 1.000001)
    assert main(["check", model]) == 1
    assert "golden row" in capsys.readouterr().err


def _resealed(path, content):
    path.write_bytes(
        artifact.MAGIC + hashlib.sha256(content).hexdigest().encode() + b"\n" + content
    )


@pytest.mark.parametrize("verb", [("check",), ("export", "--to", "onnx,cpp", "--out", "host")])
@pytest.mark.parametrize("damage", ["missing", "cut", "flipped", "text", "no archive"])
def test_a_broken_artifact_ends_in_one_sentence(verb, damage, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = save(ViewFactorClosure.untrained(), tmp_path / "bed.closure")
    content = path.read_bytes()
    if damage == "missing":
        path.unlink()
    elif damage == "cut":
        path.write_bytes(content[: len(content) // 2])
    elif damage == "flipped":
        path.write_bytes(content[:-100] + bytes([content[-100] ^ 1]) + content[-99:])
    elif damage == "text":
        path.write_text("temperature 300 K\n")
    else:
        _resealed(path, b"sealed, but no archive")
    assert main([verb[0], "bed.closure", *verb[1:]]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith(f"greybed {verb[0]}: bed.closure: ")
    assert len(said.err.splitlines()) == 1
    assert not (tmp_path / "host").exists()


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--to", "java"], "must be one or more of cpp, c, fortran, onnx"),
        (["--to", ""], "must be one or more of cpp, c, fortran, onnx"),
        ([], "the following arguments are required: --to"),
    ],
)
def test_unknown_targets_are_refused(words, sentence, tmp_path, capsys):
    with pytest.raises(SystemExit) as stop:
        main(["export", "bed.closure", "--out", str(tmp_path), *words])
    assert stop.value.code == 2
    assert sentence in capsys.readouterr().err


def test_a_name_that_cpp_cannot_take_ends_in_one_sentence(model, tmp_path, capsys):
    words = ["export", model, "--to", "onnx", "--out", str(tmp_path / "host"), "--name", "1st"]
    assert main(words) == 2
    assert "cannot be a namespace in C++" in capsys.readouterr().err


def test_as_a_process(tmp_path):
    save(ViewFactorClosure.untrained(), tmp_path / "bed.closure")
    done = subprocess.run(
        [sys.executable, "-W", "error", "-m", "greybed", "export", "bed.closure"]
        + ["--to", "onnx", "--out", "host"],
        cwd=tmp_path,
        env={**os.environ, "NUMBA_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert (done.returncode, done.stderr) == (0, "")
    model = tmp_path / "host/viewfactor_pencil_mlp.onnx"
    assert f"wrote {model.relative_to(tmp_path)}" in done.stdout
    assert np.frombuffer(model.read_bytes(), np.uint8).size > 1000
