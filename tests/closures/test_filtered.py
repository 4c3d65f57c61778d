"""Filtered drag by its form: limits, signs, symmetries, derivatives, whatever the weights."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from greybed.closures import content_hash, load, load_any, load_drag, save, shipped
from greybed.closures.drag import drag_law
from greybed.closures.drag.filtered import (
    BASELINES,
    MARKER_SETS,
    FilteredDragClosure,
    Gate,
    Material,
    drag_markers,
    filtered_force,
    frame_of,
)
from greybed.closures.drag.filtered.compiled import axis_drag
from greybed.closures.drag.filtered.limits import FCC, check_limits, random_markers, vector_cases
from greybed.closures.viewfactor.closure import Domain
from greybed.core.errors import InputError, RangeError

FORMS = [(kind, markers) for kind in ("mlp", "forest") for markers in MARKER_SETS]
LAW = drag_law("wen-yu")


def flow(n, seed=0):
    """Solid fractions, slips, filters and gradients of n places."""
    rng = np.random.default_rng(seed)
    slip = FCC.terminal_velocity * rng.normal(0.0, 2.0, (n, 3))
    size = FCC.length * rng.uniform(0.0, 15.0, n)
    return rng.uniform(0.0, 0.7, n), slip, size, FCC.weight * rng.normal(0.0, 0.5, (n, 3))


@pytest.mark.parametrize(("kind", "markers"), FORMS)
def test_limits_hold_untrained_and_reloaded(kind, markers, tmp_path):
    closure = FilteredDragClosure.untrained(kind, markers, seed=3)
    again = load_drag(save(closure, tmp_path / "a.closure"))
    assert content_hash(again) == content_hash(closure)
    for form in (closure, again):
        for case in check_limits(form, n=4000):
            assert case.passed, (case.name, case.error)


@pytest.mark.parametrize("packing", [0.55, 0.64])
def test_gate_is_shut_in_three_limits_and_open_between(packing):
    gate = Gate(packing=packing)
    phi = np.array([0.0, 0.2, packing, 0.9, 0.2, 0.2])
    size = np.array([5.0, 5.0, 5.0, 5.0, 0.0, 1e-3])
    g = gate(phi, size)
    assert (g[[0, 2, 3, 4]] == 0.0).all()
    assert 0.8 < g[1] < 1.0
    # Its first effect is of the order of the filter squared.
    assert g[5] / gate(phi[5:], 0.5 * size[5:])[0] == pytest.approx(4.0, rel=1e-5)


def test_a_filter_that_changes_nothing_for_sure_is_no_extrapolation():
    closure = FilteredDragClosure.untrained(seed=1)
    features = closure.markers.features(random_markers(closure, 500))
    domain = type(closure.domain).of(features)
    known = FilteredDragClosure(closure.markers, closure.predictor, domain)
    place = {"filter_size": 5.0, "terminal_reynolds": 1e4, "slip_up": 40.0, "slip_across": 0.0}
    assert bool(known.predict(solid_fraction=0.2, **place).extrapolates)
    answer = known.predict(solid_fraction=0.0, **place)
    assert not bool(answer.extrapolates)
    assert float(answer.stderr) == 0.0


@pytest.mark.parametrize("name", [*MARKER_SETS, *BASELINES])
def test_derivative_is_that_of_the_force(name):
    closure = BASELINES.get(name) or FilteredDragClosure.untrained("mlp", name, seed=1)
    phi, slip, size, gradient = flow(200, seed=5)
    gravity = [0.3, -0.8, 0.5]

    def force(s):
        return filtered_force(closure, FCC, LAW, gravity, phi, s, size, gradient)

    found, step = force(slip), 1e-6
    for j in range(3):
        e = np.zeros(3)
        e[j] = step
        numeric = (force(slip + e).force - force(slip - e).force) / (2.0 * step)
        error = np.abs(numeric - found.derivative[:, :, j]).max(axis=1) / (found.beta + 1.0)
        # Second order of the step over a slip of u_t, and round-off over the step.
        assert np.quantile(error, 0.98) < 1e-7


@pytest.mark.parametrize("markers", MARKER_SETS)
def test_compiled_and_plain_forms_agree(markers):
    closure = FilteredDragClosure.untrained("mlp", markers, seed=6)
    some = closure.markers.features(random_markers(closure, 2000, seed=2))
    closure = dataclasses.replace(closure, domain=Domain.of(some))
    phi, slip, _, gradient = flow(500, seed=8)
    slip[0], slip[1, [0, 2]] = 0.0, 0.0
    phi[2], phi[3] = 0.0, closure.gate.packing
    for gravity in ([0, -1, 0], [0, 0, 1]):
        f = filtered_force(closure, FCC, LAW, gravity, phi, slip, 1.5e-3, gradient, 2.0)
        c = axis_drag(closure, FCC, LAW, gravity, phi, slip, 1.5e-3, gradient, 2.0)
        scale = np.abs(f.force).max(axis=1, keepdims=True) + 1e-9
        assert (np.abs(c.force - f.force) < 1e-12 * scale).all()
        diagonal = np.stack([f.derivative[:, a, a] for a in range(3)], axis=1)
        steepest = np.abs(f.derivative).max(axis=(1, 2))[:, None] + 1e-9
        assert (np.abs(c.diagonal - diagonal) < 1e-11 * steepest).all()
        assert (c.extrapolates == f.prediction.extrapolates).all()
        axis = int(np.abs(gravity).argmax())
        along = f.beta * (1.0 - f.share) * f.prediction.kept_along
        np.testing.assert_allclose(c.secant[:, axis], along, rtol=1e-12)


def test_without_slip_the_derivative_is_the_kept_drag():
    closure = FilteredDragClosure.untrained("mlp", "gradient", seed=2)
    gradient = [[10.0, -2e3, 0.0]]
    f = filtered_force(closure, FCC, LAW, [0, -1, 0], [0.2], np.zeros((1, 3)), 1e-3, gradient)
    assert (f.force == 0.0).all()
    p = f.prediction
    wanted = float(f.beta[0]) * np.diag(
        [float(p.kept_across[0]), float(p.kept_along[0]), float(p.kept_across[0])]
    )
    np.testing.assert_allclose(f.derivative[0], wanted, rtol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_the_gradient_beside_drag_never_drives_the_gas(seed):
    closure = FilteredDragClosure.untrained("mlp", "linear", seed=seed)
    phi, slip, size, gradient = flow(20_000, seed)
    slip[:50] *= 1e-6
    f = filtered_force(closure, FCC, LAW, [0, -1, 0], phi, slip, size, 30.0 * gradient)
    assert ((f.force * slip).sum(axis=1) >= 0.0).all()
    # Where it works with drag, it is the whole share: linear in the gradient.
    fall = -30.0 * gradient - FCC.gas_density * FCC.gravity * np.array([0.0, 1.0, 0.0])
    angle = (fall * slip).sum(axis=1) / np.linalg.norm(fall, axis=1)
    helped = angle > FCC.terminal_velocity
    bound = 1e-3 + 0.0 * angle
    lost = 1.0 - f.share[helped] / np.maximum(f.prediction.share[helped], 1e-12)
    assert np.median(np.abs(lost)) < bound[0]
    assert f.share.max() > 0.3


def test_a_mean_of_published_numbers_by_hand():
    # h = 0.887 + 1.03 x - 5.17 x^2 + 5.99 x^3 and a = 3.52 - 17.99 y + ..., x = y = 0.02.
    h = 0.887 + 1.03 * 0.02 - 5.17 * 0.02**2 + 5.99 * 0.02**3
    a = 3.52 - 17.99 * 0.02 + 128.8 * 0.02**2 - 603.0 * 0.02**3
    kept = BASELINES["radl-sundaresan"].predict(solid_fraction=0.2, filter_size=4.0).kept_along
    assert float(kept) == pytest.approx(1.0 - h / (1.0 + a / 4.0), abs=1e-14)
    # Igci at a filter of 2 u_t^2 / g, with Fr = 1 so that both scalings agree.
    h = 0.868 * math.exp(-0.38 * 0.2) - 0.176 * math.exp(-119.2 * 0.2)
    lost = h * 2.0**1.6 / (2.0**1.6 + 0.4)
    kept = BASELINES["igci"].predict(solid_fraction=0.2, filter_size=2.0, froude=1.0).kept_along
    assert float(kept) == pytest.approx(1.0 - lost, abs=1e-14)
    # Milioli, bin 4.112 to 8.224, slip u_t: the smaller of line and envelope.
    line = 0.35 / 0.46 * 0.2 + 0.9466 - 0.05 / 0.12
    envelope = 7.9 * 1.2 * 0.2**0.2 / (10.0 * 0.2**0.6 + 3.6)
    kept = (
        BASELINES["milioli"]
        .predict(solid_fraction=0.2, filter_size=5.0, froude=1.0, slip_up=1.0, slip_across=0.0)
        .kept_along
    )
    assert float(kept) == pytest.approx(1.0 - min(line, envelope), abs=1e-14)


def test_published_models_keep_all_drag_in_the_limits_and_are_positive():
    rng = np.random.default_rng(0)
    n = 20_000
    m = {
        "solid_fraction": rng.uniform(0.0, 0.99, n), "filter_size": rng.uniform(0.0, 40.0, n),
        "froude": np.exp(rng.uniform(0.0, 7.0, n)), "slip_up": rng.uniform(-5.0, 5.0, n),
        "slip_across": rng.uniform(0.0, 5.0, n),
    }  # fmt: skip
    for model in BASELINES.values():
        mine = {k: v for k, v in m.items() if k in model.marker_names}
        assert (model.predict(**mine).kept_along > 0.0).all()
        for limit in ({"solid_fraction": np.zeros(n)}, {"filter_size": np.zeros(n)}):
            assert (model.predict(**{**mine, **limit}).kept_along == 1.0).all()
        if model.name != "radl-sundaresan-unclamped":
            assert model.predict(**mine).kept_along.max() <= 1.0


def test_defects_that_are_listed_are_there():
    raw = BASELINES["radl-sundaresan-unclamped"].predict(solid_fraction=0.64, filter_size=1e3)
    assert float(raw.kept_along) == pytest.approx(2.36, abs=0.01)
    x = {"froude": 1.0, "slip_up": 1.0, "slip_across": 0.0}
    below, above = (
        float(BASELINES["milioli"].predict(solid_fraction=0.05, filter_size=s, **x).kept_along)
        for s in (1.0279, 1.0281)
    )
    assert below == 1.0
    assert above < 0.8


@pytest.mark.parametrize("name", BASELINES)
def test_published_models_turn_with_the_flow(name):
    for case in vector_cases(BASELINES[name], n=2000):
        assert case.passed, (case.name, case.error)


def test_scaling_of_a_particle():
    # Stokes: u_t = (rho_p - rho_g) g d^2 / 18 mu for a light particle.
    slow = Material(5e-6, 1500.0, 1.2, 1.8e-5)
    assert slow.terminal_velocity == pytest.approx(slow.stokes_velocity, rel=3e-3)
    heavy = Material(500e-6, 2500.0, 1.2, 1.8e-5)
    u = heavy.terminal_velocity
    cd = 24.0 / heavy.terminal_reynolds * (1.0 + 0.15 * heavy.terminal_reynolds**0.687)
    drag = cd * 0.5 * 1.2 * u**2 * math.pi / 4.0 * heavy.diameter**2
    assert drag == pytest.approx(heavy.weight * math.pi / 6.0 * heavy.diameter**3, rel=1e-12)
    assert heavy.length == pytest.approx(u**2 / 9.81 * heavy.froude ** (-2.0 / 3.0), rel=1e-12)


def test_settling_particles_give_markers_of_one():
    # Suspended evenly: the gradient carries both weights, the slip is u_t, the drag is the weight.
    up = np.array([0.0, 0.0, 1.0])
    phi, u_t = 1e-9, FCC.terminal_velocity
    weight = phi * FCC.particle_density + (1.0 - phi) * FCC.gas_density
    frame = frame_of(FCC, -9.81 * up, [u_t * up], [-weight * 9.81 * up])
    f = float(LAW(phi, FCC.terminal_reynolds))
    m = drag_markers(FCC, frame, phi, FCC.length, [f])
    assert m["slip_up"][0] == pytest.approx(1.0, rel=1e-12)
    # The gradient is the small difference of two weights.
    assert m["gradient_up"][0] == pytest.approx(phi, rel=1e-3)
    assert m["drag_ratio"][0] == pytest.approx(1.0, rel=1e-6)
    assert m["filter_size"][0] == pytest.approx(1.0, rel=1e-12)
    assert m["slip_across"][0] == m["gradient_work"][0] == 0.0


def test_parcels_keep_less_drag_and_one_particle_is_no_parcel():
    closure = FilteredDragClosure.untrained(seed=2)
    place = {"solid_fraction": 0.2, "filter_size": 4.0, "terminal_reynolds": 1.0, "slip_up": 1.0,
             "slip_across": 0.2}  # fmt: skip
    one, big = closure.predict(**place), closure.predict(parcels=3.0, **place)
    assert closure.predict(parcels=1.0, **place).kept_along == one.kept_along
    gate = float(closure.gate(np.array(0.2), np.array(4.0)))
    assert float(big.kept_along / one.kept_along) == pytest.approx(math.exp(-0.1 * gate), rel=1e-12)


def test_what_is_missing_is_said():
    closure = FilteredDragClosure.untrained("mlp", "gradient")
    with pytest.raises(
        RangeError, match=r"missing: drag_ratio, gradient_up, .*give those, or take"
    ):
        closure.predict(
            solid_fraction=0.2, filter_size=1.0, terminal_reynolds=1.0, slip_up=1.0, slip_across=0.0
        )
    with pytest.raises(InputError, match=r"needs the pressure gradient .* plain markers"):
        filtered_force(closure, FCC, LAW, [0, -1, 0], [0.2], np.ones((1, 3)), 1e-3)
    plain = FilteredDragClosure.untrained()
    with pytest.raises(InputError, match=r"gravity = \[0.0, 0.0, 0.0\] .* give its direction"):
        filtered_force(plain, FCC, LAW, [0, 0, 0], [0.2], np.ones((1, 3)), 1e-3)
    with pytest.raises(InputError, match=r"gravity = 0 \[m s-2\] must be above 0"):
        Material(75e-6, 1500.0, 1.2, 1.8e-5, 0.0)
    with pytest.raises(RangeError, match=r"solid_fraction\[1\] = 1.2 \[-\]"):
        plain.predict(
            solid_fraction=[0.1, 1.2], filter_size=1.0, terminal_reynolds=1.0, slip_up=1.0,
            slip_across=0.0,
        )  # fmt: skip


def test_files_of_both_kinds_are_told_apart(tmp_path):
    path = save(FilteredDragClosure.untrained(), tmp_path / "drag.closure")
    with pytest.raises(InputError, match=r"gives filtered drag, not view factors; .* load_drag"):
        load(path)
    factors = save(shipped(), tmp_path / "factors.closure")
    with pytest.raises(InputError, match=r"gives viewfactors, not filtered drag; .* load"):
        load_drag(factors)
    assert load_any(path).quantity == "filtereddrag"
