"""Closures that come with greybed: loaded by name, small, within their limits."""

import pytest

from greybed.cli.main import main
from greybed.closures import load, model_path, shipped, shipped_names
from greybed.closures.viewfactor.limits import check_limits
from greybed.core import InputError

NAMES = ("exchange_mlp_exchange", "viewfactor_mlp_pencil", "viewfactor_mlp_published",
         "wallfactor_mlp_wall")  # fmt: skip


def test_names_and_size():
    # Those of filtered drag have tests of their own.
    assert tuple(n for n in shipped_names() if not n.startswith("filtered_drag")) == NAMES
    assert sum(model_path(f"shipped:{name}").stat().st_size for name in NAMES) < 1_000_000


@pytest.mark.parametrize("name", NAMES)
def test_limits_and_card(name):
    closure = shipped(name)
    assert [case.name for case in check_limits(closure, n=3000) if not case.passed] == []
    score = closure.card["score"]
    assert score["r2"] > 0.99
    assert score["negative"] == 0
    assert len(closure.card["data_sha256"]) == 64
    assert len(closure.card["regimes"]) > 8
    assert len(closure.card["learning_curve"]) > 2


def test_pencil_is_three_times_closer_than_published():
    own, published = (
        shipped(f"viewfactor_mlp_{markers}").card["score"]["rmse_own"]
        for markers in ("pencil", "published")
    )
    assert 3.0 * own < published


def test_a_path_stays_a_path(tmp_path):
    assert model_path(tmp_path / "a.closure") == tmp_path / "a.closure"
    # As a case file names it: beside itself.
    assert load(model_path(tmp_path / "shipped:wallfactor_mlp_wall")).quantity == "wallfactor"


def test_an_unknown_name_is_refused():
    with pytest.raises(InputError, match=r"shipped:nobody is not a closure.*shipped:viewfactor"):
        shipped("nobody")


def test_verbs_take_shipped_closures(capsys, tmp_path):
    assert main(["check", "shipped:wallfactor_mlp_wall"]) == 0
    assert "all hold" in capsys.readouterr().out
    assert main(["info", "shipped:viewfactor_mlp_pencil", "--out", str(tmp_path)]) == 0
    assert "held-out packings: R2" in capsys.readouterr().out
    assert (tmp_path / "summary.json").exists()
    wall = ["export", "shipped:wallfactor_mlp_wall", "--to", "onnx", "--out", str(tmp_path)]
    assert main(wall) == 0
    assert "64 of 64 golden rows" in capsys.readouterr().out
    assert (tmp_path / "wallfactor_wall_mlp.onnx").exists()
