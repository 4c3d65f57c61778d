"""Closures of filtered drag that come with greybed: limits, cards, and where they stand."""

from __future__ import annotations

import pytest

from greybed.closures import load, model_path, shipped_drag, shipped_names
from greybed.closures.drag.filtered import Material, filtered_force
from greybed.closures.drag.filtered.limits import check_limits
from greybed.closures.drag.filtered.naming import kept_drag
from greybed.closures.drag.laws import drag_law
from greybed.core.errors import InputError

NAMES = tuple(name for name in shipped_names() if name.startswith("filtered_drag"))


def test_there_are_some():
    assert "filtered_drag_mlp_plain" in NAMES
    assert "filtered_drag_mlp_full" in NAMES
    assert sum(model_path(f"shipped:{name}").stat().st_size for name in NAMES) < 1_000_000


@pytest.mark.parametrize("name", NAMES)
def test_limits_and_card(name):
    closure = shipped_drag(name)
    for case in check_limits(closure, n=5000):
        assert case.passed, (case.name, case.error)
    card = closure.card
    assert card["convention"] == "fraction kept"
    assert len(card["data_sha256"]) == 64
    assert card["score"]["cases"] >= 5
    assert len(card["learning_curve"]) > 2
    if closure.kind == "mlp":
        assert card["numbers"] <= 2000


@pytest.mark.parametrize("name", NAMES)
def test_it_beats_what_it_must(name):
    card = shipped_drag(name).card
    mine = card["score"]
    for guess in card["guesses"]:
        if guess["name"] in ("gas balance", "two constants") and "plain" in name:
            continue  # these see the pressure gradient, a plain closure does not
        assert mine["kept_rms"] < guess["kept_rms"], guess["name"]
        assert mine["drift_rms"] < guess["drift_rms"], guess["name"]


def test_drag_of_an_even_bed_is_lowered_and_a_filter_of_nothing_changes_nothing():
    fcc, law = Material(75e-6, 1500.0, 1.3, 1.8e-5), drag_law("wen-yu")
    closure = shipped_drag()
    slip = [[0.0, 0.3, 0.0]]
    large = filtered_force(closure, fcc, law, (0, -1, 0), [0.15], slip, 4e-3)
    none = filtered_force(closure, fcc, law, (0, -1, 0), [0.15], slip, 0.0)
    assert 0.1 < large.force[0, 1] / large.unfiltered[0, 1] < 1.0
    assert (none.force == none.unfiltered).all()
    assert 0.0 < float(large.prediction.stderr[0]) < 1.0


def test_names_lead_to_the_right_kind():
    assert kept_drag("shipped:filtered_drag_mlp_plain").needs_gradient is False
    assert kept_drag("shipped:filtered_drag_mlp_full").needs_gradient is True
    with pytest.raises(InputError, match="not filtered drag; read it with load"):
        kept_drag("shipped:viewfactor_mlp_pencil")
    with pytest.raises(InputError, match="read it with load_drag"):
        load(model_path("shipped:filtered_drag_mlp_plain"))
