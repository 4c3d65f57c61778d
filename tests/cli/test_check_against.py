"""``greybed check --against``: numbers as counted by hand, refusals; shipped closures in cases."""

import json

import numpy as np
import pytest

from greybed.cli import main
from greybed.closures import shipped
from greybed.core import Packing, Plane
from greybed.core.writers import write_packing
from greybed.datasets.factors_file import read_factors, write_factors
from greybed.raytrace import view_factors

MODEL = "shipped:viewfactor_mlp_pencil"
WALL = "plane:0,0,0:0,0,1"


@pytest.fixture
def bed(tmp_path, monkeypatch):
    """Eight spheres on a plane, as a file and traced."""
    monkeypatch.chdir(tmp_path)
    places = np.stack(np.meshgrid(*[[1.1e-3, 3.3e-3]] * 3), axis=-1).reshape(-1, 3)
    bare = Packing(places, 1e-3)
    write_packing(bare, "bed.csv")
    packing = Packing(places, 1e-3, walls=[Plane((0, 0, 0), (0, 0, 1), "floor")])
    write_factors("view_factors.h5", packing, view_factors(packing, rays=2000, seed=1))
    return packing


def test_errors_are_those_of_a_sum_over_all_pairs(bed, tmp_path, capsys):
    words = ["check", MODEL, "--against", ".", "--bed", "bed.csv", "--wall", WALL, "--out", "out"]
    assert main(words) == 0
    found = json.loads((tmp_path / "out/summary.json").read_text())["against"]
    traced = read_factors("view_factors.h5").result
    made = shipped("viewfactor_mlp_pencil").bed_factors(bed)
    pairs = ~np.eye(8, dtype=bool)
    truth = traced.factors.toarray()[pairs]
    error = made.factors.toarray()[pairs] - truth
    assert found["rms_error"] == pytest.approx(np.sqrt(np.mean(error**2)))
    assert found["r2"] == pytest.approx(1.0 - np.mean(error**2) / truth.var())
    large = truth > 0.01
    assert found["factors_above_0.01"] == large.sum() > 20
    relative = np.mean(np.abs(error[large]) / truth[large])
    assert found["mean_relative_error_above_0.01"] == pytest.approx(relative)
    # Little stands between eight spheres, so the law is nearly exact and noise is what differs.
    assert found["rms_error"] < 2.0 * found["rms_stderr_of_trace"]
    shares = found["walls"]["floor"]
    assert shares["closure"] == pytest.approx(shares["traced"], abs=0.01)
    assert "against the trace of 8 spheres, 2000 rays each" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--against", "."], "--against needs the bed that was traced"),
        (["--against", ".", "--bed", "bed.csv"], "belong to another packing"),
        (["--against", "gone.h5", "--bed", "bed.csv", "--wall", WALL], "gone.h5"),
        (["--bed", "bed.csv"], "--bed is for --against only"),
    ],
)
@pytest.mark.usefixtures("bed")
def test_refusals(words, said, capsys):
    assert main(["check", MODEL, *words]) == 2
    assert said in capsys.readouterr().err


def test_a_closure_of_another_thing_is_refused(bed, capsys):
    words = ["check", "shipped:wallfactor_mlp_wall", "--against", ".", "--bed", "bed.csv"]
    assert main([*words, "--wall", WALL]) == 2
    assert "is for closures of view factors, not of" in capsys.readouterr().err


def test_a_thermal_case_takes_a_shipped_closure(bed, tmp_path):
    (tmp_path / "case.toml").write_text(
        f"""kind = "thermal-bed"
packing.file = "bed.csv"
opening.temperature = 300
radiation = {{source = "closure", closure = "{MODEL}"}}
material = {{conductivity = 8.0, density = 3900.0, heat_capacity = 1200.0}}
[[wall]]
name = "floor"
kind = "plane"
normal = [0, 0, 1]
temperature = 600
"""
    )
    assert main(["simulate", "case.toml", "--out", "run", "--quiet"]) == 0
    inputs = json.loads((tmp_path / "run/summary.json").read_text())["provenance"]["inputs"]
    assert "viewfactor_mlp_pencil.closure" in inputs
