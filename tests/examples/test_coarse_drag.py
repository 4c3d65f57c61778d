"""Coarse runs of filtered drag against a fine one: fine runs are not repeated."""

from __future__ import annotations

import importlib.util
import json
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "examples/filtered_drag/coarse.py"


@pytest.fixture
def coarse(monkeypatch):
    spec = importlib.util.spec_from_file_location("coarse", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.asked = []

    def run(design, model, options, widths):
        module.asked.append((design.cells[0], design.seed, model))
        slip = 0.3 + 0.01 * design.seed + (0.1 if model == "igci" else 0.0)
        return {"slip": slip, "seconds": 1.0} | {f"spread_{w}": 0.1 for w in widths}

    monkeypatch.setattr(module, "run", run)
    monkeypatch.setattr(module, "draw", lambda *given: None)
    return module


def test_fine_runs_are_kept_and_other_settings_make_new_ones(coarse, tmp_path, monkeypatch, capsys):
    def call(*more):
        coarse.asked.clear()
        given = ["coarse.py", "--out", str(tmp_path), "--models", "none", "igci", *more]
        monkeypatch.setattr(sys, "argv", given)
        assert coarse.main() == 0
        return [seed for cells, seed, _ in coarse.asked if cells == 48]

    assert call("--seeds", "2") == [0, 1]
    first = json.loads((tmp_path / "coarse.json").read_text())
    assert first["slip"] == pytest.approx(0.305)
    assert [row["slip_error"] for row in first["table"][:2]] == pytest.approx([0.0, 0.1 / 0.305])
    # The same again, and with one seed more: only that one is run.
    assert call("--seeds", "2") == []
    assert json.loads((tmp_path / "coarse.json").read_text()) == first
    assert "of an earlier call" in capsys.readouterr().out
    assert call("--seeds", "3") == [2]
    # Fewer seeds take the first of them; another flow takes none.
    assert call("--seeds", "1") == []
    assert call("--seeds", "2", "--fraction", "0.2") == [0, 1]
