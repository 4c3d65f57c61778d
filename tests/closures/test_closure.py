"""Limits of view-factor closures, untrained, trained, reloaded; inputs, errors, extrapolation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from greybed.closures import ViewFactorClosure, exact_view_factor, load, save
from greybed.closures.viewfactor.limits import check_limits, random_markers
from greybed.closures.viewfactor.visibility import unblocked_share
from greybed.core import RangeError
from tests.closures.conftest import synthetic_rows


def assert_limits(closure):
    cases = check_limits(closure, n=5000)
    assert len(cases) == (7 if closure.kind == "mlp" else 6)
    for case in cases:
        assert case.passed, f"{case.name}: {case.error:g} > {case.bound:g}"


@pytest.mark.parametrize("seed", [0, 1])
def test_limits_untrained(form, seed):
    assert_limits(ViewFactorClosure.untrained(*form, seed=seed))


def test_limits_trained(fitted):
    assert_limits(fitted)


def test_limits_reloaded(fitted, tmp_path):
    assert_limits(load(save(fitted, tmp_path / "a.closure")))


def test_a_broken_gate_is_caught(form):
    """The table can fail: a closure that ignores its gate does not pass."""
    closure = ViewFactorClosure.untrained(*form)

    def leaky(**markers):
        return 0.999 * closure.evaluate(**markers)

    failed = {case.name for case in check_limits(closure, leaky, n=500) if not case.passed}
    assert "nothing between: F = F_exact" in failed
    assert any(name.startswith("equal spheres") for name in failed)


def test_a_jump_is_caught():
    closure = ViewFactorClosure.untrained("mlp", "pencil")

    def jumping(**markers):
        x = markers["radius_over_distance"] * (1.0 + 1.0 / markers["radius_ratio"])
        return closure.evaluate(**markers) * np.where(x > 0.5, 1.0, 0.9)

    failed = [case.name for case in check_limits(closure, jumping, n=500) if not case.passed]
    assert any(name.startswith("no jump") for name in failed)


def test_training_beats_the_prior(fitted, form):
    """A fit that learnt nothing would leave the error of the untrained closure."""
    rows = synthetic_rows(form[1], 3000, 9)
    raw = fitted.predictor(rows.features)
    # The fit weighs by the factor itself: faint pairs may keep the prior.
    near = rows.exact > 5e-3

    def rmse(share):
        factor = rows.exact * (1.0 - rows.gate * (1.0 - share))
        return np.sqrt(np.mean(((factor - rows.factor) / rows.exact)[near] ** 2))

    learnt = rmse(unblocked_share(fitted.kind, rows.baseline, raw[:, 0]))
    # Measured: 0.02 (the noise of the rows) to 0.06, against 0.10 to 0.35.
    assert learnt < 0.7 * rmse(rows.baseline)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**31), st.sampled_from(["mlp", "forest"]), st.integers(0, 50))
def test_bounds_and_reciprocity_for_any_weights(seed, kind, weights):
    closure = ViewFactorClosure.untrained(kind, "pencil", seed=weights)
    m = random_markers(closure, 50, seed)
    factor = closure.evaluate(**m)
    exact = exact_view_factor(
        m["radius_over_distance"] / m["radius_ratio"], m["radius_over_distance"], np.ones(50)
    )
    assert (factor > 0.0).all()
    assert (factor <= exact * (1 + 1e-14)).all()
    back = closure.evaluate(
        **m
        | {
            "radius_over_distance": m["radius_over_distance"] / m["radius_ratio"],
            "radius_ratio": 1.0 / m["radius_ratio"],
        }
    )
    np.testing.assert_allclose(m["radius_ratio"] ** 2 * back, factor, rtol=4e-14)


def test_uncertainty_is_zero_where_nothing_stands_between(fitted):
    m = random_markers(fitted, 100, 4)
    for marker in fitted.markers.markers:
        if marker.free is not None:
            m[marker.name][:] = marker.free
    prediction = fitted.predict(**m)
    assert (prediction.stderr == 0.0).all()
    assert not prediction.extrapolates.any()


def test_extrapolation_is_flagged(fitted):
    inside = random_markers(fitted, 2000, 1)
    share = fitted.predict(**inside).extrapolates.mean()
    assert share < 0.2
    far = {k: v[:5].copy() for k, v in inside.items()}
    if "n_between" in far:
        far["n_between"] = np.full(5, 5000.0)
    else:
        far["blocked_fraction"] = np.full(5, 0.5)
        far["blockers_per_line"] = np.full(5, 5000.0)
    assert fitted.predict(**far).extrapolates.all()


def test_scalars_and_shapes():
    closure = ViewFactorClosure.untrained()
    one = closure.evaluate(
        radius_over_distance=0.5, radius_ratio=1.0, blocked_fraction=0.0, blockers_per_line=0.0
    )
    assert one.shape == ()
    assert float(one) == float(exact_view_factor(1.0, 1.0, 2.0))
    grid = closure.evaluate(
        radius_over_distance=np.full((3, 1), 0.2),
        radius_ratio=1.0,
        blocked_fraction=np.linspace(0, 1, 4),
        blockers_per_line=1.0,
    )
    assert grid.shape == (3, 4)


GOOD = {
    "radius_over_distance": 0.3,
    "radius_ratio": 1.0,
    "blocked_fraction": 0.1,
    "blockers_per_line": 0.1,
}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"blocked_fraction": 1.5}, r"blocked_fraction = 1\.5 \[-\] .* must lie in \[0, 1\]"),
        ({"blocked_fraction": np.nan}, r"blocked_fraction = nan"),
        ({"radius_ratio": [1.0, -2.0]}, r"radius_ratio\[1\] = -2"),
        ({"radius_over_distance": 0.0}, r"radius_over_distance = 0"),
        ({"radius_over_distance": 0.7}, r"exceeds 1 by more than soft contact.*separate them"),
        ({"n_between": 1}, r"takes the markers .*unknown: n_between"),
    ],
)
def test_refusals(change, message):
    with pytest.raises(RangeError, match=message):
        ViewFactorClosure.untrained().evaluate(**(GOOD | change))


def test_missing_marker():
    with pytest.raises(RangeError, match="missing: blockers_per_line"):
        ViewFactorClosure.untrained().evaluate(
            radius_over_distance=0.3, radius_ratio=1.0, blocked_fraction=0.1
        )
