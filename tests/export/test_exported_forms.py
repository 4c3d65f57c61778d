"""Python, a reloaded file, C++ at several flags and ONNX: the same limits and the same numbers."""

from __future__ import annotations

import numpy as np
import pytest
from exported_closures import EVERY, FITTED, FLAGS, HARD, UNTRAINED

from greybed.closures import ViewFactorClosure, content_hash, load, save
from greybed.closures.predictors import Forest
from greybed.closures.viewfactor.closure import Domain
from greybed.closures.viewfactor.limits import check_limits, random_markers
from greybed.export.replay import relative_error, replay

NAMES = UNTRAINED + FITTED
# What is compiled: untrained and fitted, network and forest, each marker set.
BUILT = [UNTRAINED[0], UNTRAINED[-1], *FITTED]
# The compiler takes seconds a call: the network, whose loops become vectors, with all flags.
FORMS = [(name, "onnx") for name in NAMES]
FORMS += [(BUILT[0], "O2"), (BUILT[1], "fast-math native")]
FORMS += [(name, flags) for name in FITTED for flags in EVERY]
MORE = [(FITTED[0], flags) for flags in FLAGS if flags not in EVERY]
# C++ computes in the same order but for sums of a vectorised loop; ONNX has its own exp and tanh.
# Both in double precision: what is left is rounding times the bounded odds e^4.
# V = 1 - gate (1 - v) as Python has it loses 1e-16 / V, so that small V agree to 3e-13.
AGREEMENT = 1e-12


@pytest.fixture
def form(closures, compiled, onnx_form, tmp_path):
    def make(name, which):
        if which == "python":
            return closures[name]
        if which == "reloaded":
            return load(save(closures[name], tmp_path / "closure.closure"))
        return onnx_form(name) if which == "onnx" else compiled(name, which)

    return make


@pytest.mark.parametrize(
    ("name", "which"),
    [(name, which) for name in NAMES for which in ("python", "reloaded")] + FORMS + MORE,
)
def test_limiting_cases(name, which, closures, form):
    cases = check_limits(closures[name], evaluate=form(name, which).evaluate, n=3000)
    assert len(cases) == 6 + (closures[name].kind == "mlp")
    failed = [case for case in cases if not case.passed]
    assert not failed


@pytest.mark.parametrize("which", [*EVERY, "onnx"])
@pytest.mark.parametrize("name", HARD)
def test_limiting_cases_where_almost_nothing_is_visible(name, which, closures, form):
    # V down to 1e-3: a header that forms V by subtraction breaks reciprocity here.
    assert closures[name].evaluate(**HARD[name]) < 2e-3 * 0.25 * 0.1**2
    cases = check_limits(closures[name], evaluate=form(name, which).evaluate, n=3000)
    assert [case for case in cases if not case.passed] == []


@pytest.mark.parametrize(("name", "which"), FORMS)
def test_two_thousand_random_rows(name, which, closures, form):
    closure = closures[name]
    markers = random_markers(closure, 2000, seed=11)
    for marker in closure.markers.markers:  # a tenth with nothing between, a tenth almost so
        if marker.free is not None:
            markers[marker.name][:200] = marker.free
            markers[marker.name][200:400] *= 1e-6
    expected = closure.predict(**markers)
    answer = form(name, which).predict(**markers)
    assert relative_error(answer.view_factor, expected.view_factor).max() <= AGREEMENT
    # The pencil's gate is 1 minus almost 1 near 0, rounded once more or less where fused.
    np.testing.assert_allclose(answer.stderr, expected.stderr, rtol=1e-12, atol=1e-16)
    assert not answer.stderr[:200].any()
    np.testing.assert_array_equal(answer.extrapolates, expected.extrapolates)


@pytest.mark.parametrize(("name", "which"), FORMS + MORE)
def test_golden_rows_and_hash(name, which, closures, form):
    result = replay(closures[name], form(name, which), tolerance=1e-12)
    assert result["passed"], result
    assert result["rows"] == 64
    assert form(name, which).hash == content_hash(closures[name])


@pytest.mark.parametrize("name", FITTED)
def test_fitted_closures_flag_extrapolation_somewhere_only(name, closures):
    # Guards the comparison above: a flag that never changes would agree for no reason.
    markers = random_markers(closures[name], 2000, seed=11)
    markers["radius_over_distance"][::4] *= 0.05
    flags = closures[name].predict(**markers).extrapolates
    assert 0.05 < flags.mean() < 0.95


@pytest.mark.parametrize("which", [*EVERY, "onnx"])
@pytest.mark.parametrize("name", FITTED)
def test_extrapolation_flags(name, which, closures, form):
    markers = random_markers(closures[name], 2000, seed=11)
    markers["radius_over_distance"][::4] *= 0.05
    expected = closures[name].predict(**markers).extrapolates
    np.testing.assert_array_equal(form(name, which).predict(**markers).extrapolates, expected)


@pytest.mark.parametrize("which", [*EVERY, "onnx"])
def test_splits_are_decided_in_single_precision(which, closures, form):
    name = "fitted forest published"
    closure = closures[name]
    forest = closure.predictor
    cuts = np.unique(forest.threshold[forest.feature == 3]).astype(np.float64)  # solid fraction
    assert len(cuts) > 50
    # Above the threshold in double precision, equal to it in single: the left branch is right.
    above = cuts * (1.0 + 1e-9)
    beyond = np.nextafter(cuts.astype(np.float32), np.float32(2.0))
    assert (above > cuts).all()
    markers = {
        "radius_over_distance": np.linspace(0.05, 0.5, 10)[:, None, None],
        "n_between": np.linspace(0.0, 20.0, 10)[1:, None, None, None],
        "radius_ratio": 1.0,
        "solid_fraction": np.stack([cuts, above, beyond]),
    }
    expected = closure.evaluate(**markers)
    np.testing.assert_array_equal(expected[:, :, 0], expected[:, :, 1])
    assert (expected[:, :, 0] != expected[:, :, 2]).any(axis=(0, 1)).mean() > 0.5
    assert relative_error(form(name, which).evaluate(**markers), expected).max() <= AGREEMENT


@pytest.mark.parametrize("which", [*EVERY, "onnx"])  # ranges hold with -ffast-math too
def test_markers_out_of_range_give_nan(which, form):
    sound = {
        "radius_over_distance": 0.3,
        "radius_ratio": 1.0,
        "blocked_fraction": 0.5,
        "blockers_per_line": 1.0,
    }
    wrong = [
        ("radius_over_distance", 0.0),
        ("radius_over_distance", 0.6),  # spheres that overlap
        ("radius_over_distance", np.nan),
        ("radius_ratio", 0.0),
        ("radius_ratio", np.inf),
        ("blocked_fraction", -1e-9),
        ("blocked_fraction", 1.0 + 1e-9),
        ("blocked_fraction", np.nan),
        ("blockers_per_line", -1.0),
        ("blockers_per_line", np.nan),
    ]
    columns = {name: np.full(len(wrong) + 1, value) for name, value in sound.items()}
    for row, (name, value) in enumerate(wrong):
        columns[name][row] = value
    for name in (FITTED[0], "forest pencil 3") if which == "onnx" else (FITTED[0],):
        answer = form(name, which).predict(**columns)
        assert np.isnan(answer.view_factor).tolist() == [True] * len(wrong) + [False]
        assert np.isnan(answer.stderr).tolist() == [True] * len(wrong) + [False]
        assert answer.extrapolates[: len(wrong)].all()


def test_a_tree_of_one_leaf(tmp_path, closures):
    from greybed.export import OnnxClosure, export_onnx

    published = closures["forest published 3"].markers
    forest = Forest(
        np.array([0, 1, 4], np.int32),
        np.array([-1, 2, -1, -1, -1], np.int32),
        np.array([0.0, 1.0, 0.0, 0.0, 0.0], np.float32),
        np.array([0, 2, 0, 0, 0], np.int32),
        np.array([[0.2, 0.1], [0.0, 0.0], [0.3, 0.2], [0.9, 0.4], [0.5, 0.3]]),
    )
    closure = ViewFactorClosure(published, forest, Domain.everywhere(4))
    session = OnnxClosure(export_onnx(closure, tmp_path / "small.onnx"))
    assert replay(closure, session, tolerance=1e-13)["passed"]
