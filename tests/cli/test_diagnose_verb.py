"""``greybed diagnose`` and ``greybed blindtest`` as a user runs them."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path

import pytest

from greybed.cli import main

EXAMPLE = Path(__file__).parents[2] / "examples/settling_spheres"


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    folder = tmp_path_factory.mktemp("diagnosed")
    shutil.copytree(EXAMPLE, folder / "study")
    code = main(["diagnose", f"{folder}/study/study.toml", "--out", f"{folder}/out", "--quiet"])
    assert code == 0
    return folder


def test_everything_that_is_promised_is_written(ran):
    out = ran / "out"
    names = {"diagnosis.json", "report.html", "model_with_effect.toml", "residuals.csv"}
    assert {p.name for p in out.iterdir()} == {*names, "summary.json"}
    found = json.loads((out / "diagnosis.json").read_text())
    assert found["verdict"] == "effect"
    for effect in found["effects"]:
        assert set(effect) == {"name", "amplitude", "ci95", "theory", "p_value"}
    for name in ("base", "recalibrated", "with_effect", "gp_discrepancy", "ratio"):
        low, high = found["error"][name]["ci95"]
        assert low <= found["error"][name]["value"] <= high
    assert found["parameters"]["viscosity"]["sd"] == pytest.approx(0.002)
    rows = list(csv.DictReader((out / "residuals.csv").read_text().splitlines()))
    assert len(rows) == 45
    assert float(rows[0]["predicted by the base model [m/s]"]) > 0.0


def test_the_report_stands_alone_and_says_what_was_found(ran):
    text = (ran / "out/report.html").read_text()
    assert "http://" not in text.replace("http://www.w3.org", "")
    assert 'src="http' not in text
    for words in ("A named effect is missing", "wall", "Residual against diameter", "held-out"):
        assert words in text
    assert text.count("<svg") >= 4


def test_the_model_with_the_effect_runs_and_lacks_nothing(ran, capsys):
    again = ran / "again"
    assert main(["diagnose", f"{ran}/out/model_with_effect.toml", "--out", f"{again}"]) == 0
    assert json.loads((again / "diagnosis.json").read_text())["verdict"] == "none"
    assert capsys.readouterr().out.startswith("none: ")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('name = "terminal-velocity"', 'name = "terminal"'), "did you mean 'terminal-velocity'"),
        (('drag = "stokes"', 'drag = "stokse"'), "did you mean 'stokes'"),
        (('response = "velocity"', 'response = "time"'), "predicts velocity"),
        (("[parameters.viscosity]", "[parameters.visc]"), "needs viscosity; give a column"),
    ],
)
def test_bad_studies_end_in_one_sentence(ran, tmp_path, capsys, change, message):
    shutil.copytree(EXAMPLE, tmp_path / "study")
    file = tmp_path / "study/study.toml"
    assert change[0] in file.read_text()
    file.write_text(file.read_text().replace(*change))
    assert main(["diagnose", str(file), "--out", str(tmp_path / "out"), "--quiet"]) == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert message in said[-1]
    assert "Traceback" not in "".join(said)


def test_a_folder_that_cannot_be_written(ran, tmp_path, capsys):
    (tmp_path / "taken").write_text("")
    assert main(["diagnose", f"{ran}/study/study.toml", "--out", f"{tmp_path}/taken"]) == 2
    assert "taken" in capsys.readouterr().err


def test_a_small_blind_test_prints_its_card(tmp_path, capsys):
    words = f"blindtest --sets 4 --seed 5 --kinds none --jobs 1 --quiet --out {tmp_path}/b"
    assert main(words.split()) == 0
    assert "false alarms on clean sets | 4 |" in capsys.readouterr().out
    card = json.loads((tmp_path / "b/scorecard.json").read_text())
    assert card["lines"][0]["count"] == 4
    assert len((tmp_path / "b/sets.csv").read_text().splitlines()) == 5
    assert main(words.replace("--sets 4", "--sets 5").split()) == 2
    assert "holds another blind test" in capsys.readouterr().err


def test_blind_tests_refuse_what_they_do_not_know(tmp_path, capsys):
    assert main(["blindtest", "--kinds", "noe", "--out", f"{tmp_path}/b"]) == 2
    assert "'noe' is not known" in capsys.readouterr().err
