"""The quickstart as a process: all that it promises is there; a second call repeats nothing."""

import json
import shutil

import pytest

from greybed.cli import main


@pytest.fixture(scope="module")
def done(small_quickstart):
    return small_quickstart / "out"


def test_it_says_what_it_found(small_quickstart):
    said = (small_quickstart / "said.txt").read_text()
    assert "limiting case" in said
    assert "reciprocity" in said
    assert "look at out/report.html" in said


def test_summary(done):
    summary = json.loads((done / "summary.json").read_text())
    assert summary["passed"] is True
    assert summary["failed"] == []
    forms = {form for row in summary["limits"] for form in row["errors"]}
    assert {"untrained", "trained", "reloaded", "ONNX"} <= forms
    assert {e["target"] for e in summary["exports"]} == {"cpp", "onnx"}
    for case in summary["cases"]:
        # Both solve the same bed: heat in equals heat out, and the two agree on how much.
        assert abs(case["traced"]["energy_error"]) < 1e-9
        assert abs(case["closure"]["energy_error"]) < 1e-9
        # The small run looks only six radii far: 1 and 2 % less heat.
        assert abs(case["difference"]["flux_relative"]["top"]) < 0.05
    assert summary["provenance"]["seed"] == 1


def test_every_file_that_the_page_names_is_there(done):
    summary = json.loads((done / "summary.json").read_text())
    for entry in summary["files"]:
        assert (done / entry["path"]).is_file(), entry
    page = (done / "report.html").read_text()
    assert "<svg" in page
    assert "data:image/png" in page


def test_a_second_call_repeats_only_what_is_damaged(done, tmp_path, capsys):
    folder = tmp_path / "again"
    shutil.copytree(done, folder)
    path = folder / "bed_tridisperse.vtu"  # of the last stage
    original = path.read_bytes()
    path.write_bytes(original[:-1])
    assert main(["quickstart", "--small", "--out", str(folder)]) == 0
    assert capsys.readouterr().out.count("[kept]") == 5
    assert path.read_bytes() == original
