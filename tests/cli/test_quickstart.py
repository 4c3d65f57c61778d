"""The quickstart as a process: all that it promises is there; a second call repeats nothing."""

import json
import subprocess
import sys
from pathlib import Path

import pytest


def quickstart(folder: Path) -> subprocess.CompletedProcess[str]:
    words = [sys.executable, "-m", "greybed", "quickstart", "--small", "--out", str(folder)]
    return subprocess.run(words, capture_output=True, text=True, timeout=300)


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    folder = tmp_path_factory.mktemp("quickstart") / "out"
    return quickstart(folder), folder


def test_it_succeeds_and_says_so(done):
    process, folder = done
    assert process.returncode == 0, process.stderr
    assert "limiting case" in process.stdout
    assert "reciprocity" in process.stdout
    assert str(folder / "report.html") in process.stdout


def test_summary(done):
    summary = json.loads((done[1] / "summary.json").read_text())
    assert summary["passed"] is True
    assert summary["failed"] == []
    forms = {form for row in summary["limits"] for form in row["errors"]}
    assert {"untrained", "trained", "reloaded", "ONNX"} <= forms
    assert {e["target"] for e in summary["exports"]} == {"cpp", "onnx"}
    for case in summary["cases"]:
        # Both solve the same bed: heat in equals heat out, and the two agree on how much.
        assert abs(case["traced"]["energy_error"]) < 1e-9
        assert abs(case["closure"]["energy_error"]) < 1e-9
        # The small run looks only six radii far: 7 and 10 % less heat; the full one 1 and 2 %.
        assert abs(case["difference"]["flux_relative"]["top"]) < 0.15
    assert summary["provenance"]["seed"] == 1


def test_every_file_that_the_page_names_is_there(done):
    summary = json.loads((done[1] / "summary.json").read_text())
    for entry in summary["files"]:
        assert (done[1] / entry["path"]).is_file(), entry
    page = (done[1] / "report.html").read_text()
    assert "<svg" in page
    assert "data:image/png" in page


def test_a_second_call_keeps_every_stage(done):
    again = quickstart(done[1])
    assert again.returncode == 0, again.stderr
    assert again.stdout.count("[kept]") == 6


def test_a_changed_file_is_made_again(done):
    path = done[1] / "viewfactor_mlp_pencil.closure"
    original = path.read_bytes()
    path.write_bytes(original[:-1])
    again = quickstart(done[1])
    assert again.returncode == 0, again.stderr
    assert path.read_bytes() == original
    assert again.stdout.count("[kept]") >= 2
