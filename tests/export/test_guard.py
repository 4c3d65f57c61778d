"""Derivatives against torch, and what a guard does out of range: clamp, baseline, abort, counts."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from exported_closures import FITTED

from greybed.closures.viewfactor.limits import random_markers
from greybed.core.exact import quadrature
from greybed.export import find_compiler

pytestmark = pytest.mark.skipif(
    find_compiler() is None, reason="no C++ compiler (CXX, g++, clang++, c++)"
)
MLP, FOREST = FITTED
FAST = "fast-math native"
INSIDE, CLAMPED, BASELINE, REFUSED, EXTRAPOLATED = range(5)


def by_torch(closure, markers):
    """Factors (n,) and derivatives (n, 4) of a network with pencil markers, by autograd."""
    columns = [torch.tensor(markers[n], dtype=torch.float64) for n in closure.marker_names]
    x, ratio, blocked, per_line = (c.requires_grad_() for c in columns)
    square, weight = (torch.tensor(v, dtype=torch.float64)[:, None] for v in quadrature())
    kappa = 4.0 * x * x / ratio
    eps = torch.clamp(1.0 - (x + x / ratio) ** 2, min=0.0)
    exact = x * x * (weight / (1.0 + torch.sqrt(eps + kappa * square))).sum(axis=0)
    near, alike = x * (1.0 + 1.0 / ratio), 4.0 * ratio / (1.0 + ratio) ** 2
    y = torch.stack([near, alike, blocked, torch.log1p(per_line)], axis=1)
    network = closure.predictor
    y = (y - torch.tensor(network.mean)) / torch.tensor(network.scale)
    for k, (w, b) in enumerate(zip(network.weights, network.biases, strict=True)):
        y = y @ torch.tensor(w) + torch.tensor(b)
        y = torch.tanh(y) if k + 1 < len(network.weights) else y
    free = 1.0 - blocked
    v0 = 0.01 + 0.98 * (1.0 - 1.0 / (1.0 + free * (1.0 + free * (1.0 + free))))
    odds = v0 * torch.exp(4.0 * torch.tanh(y[:, 0]))
    clear = free**4
    factor = exact * (clear + (1.0 - clear) * odds / (1.0 - v0 + odds))
    slopes = torch.autograd.grad(factor.sum(), columns)
    return factor.detach().numpy(), np.stack([s.numpy() for s in slopes], axis=1)


@pytest.mark.parametrize("flags", ["O2", FAST])
def test_derivatives_are_those_of_torch(flags, closures, compiled):
    markers = random_markers(closures[MLP], 1000, seed=4)
    expected, slopes = by_torch(closures[MLP], markers)
    value, gradient = compiled(MLP, flags).gradients(**markers)
    assert (np.abs(value[:, 0] - expected) <= 1e-12 * expected).all()
    scale = np.abs(slopes).max(axis=1, keepdims=True)
    # Touching pairs stand at the bend of the exact law: torch has half a slope there.
    apart = markers["radius_over_distance"] * (1.0 + 1.0 / markers["radius_ratio"]) < 1.0 - 1e-9
    assert apart.sum() > 800
    assert (np.abs(gradient[:, 0] - slopes)[apart] <= 1e-12 * scale[apart]).all()


@pytest.mark.parametrize("name", ["fitted forest published", "shipped exchange_mlp_exchange"])
def test_derivatives_are_those_of_differences(name, closures, compiled):
    # A forest is constant between its cuts: where a step crosses one, the difference is no slope.
    closure, program = closures[name], compiled(name, FAST)
    drawn = random_markers(closure, 400, seed=5)
    _, gradient = program.gradients(**drawn)
    # The first tenth touches, where the exact law has a bend.
    agree = np.ones(400, dtype=bool)
    for k, marker in enumerate(closure.marker_names):
        step = 1e-6 * np.maximum(np.abs(drawn[marker]), 1e-3)
        if marker in ("visible_share", "emissivity"):
            drawn[marker] = np.clip(drawn[marker], 2.0 * step, 1.0 - 2.0 * step)
            _, gradient = program.gradients(**drawn)
        up, down = ({**drawn, marker: drawn[marker] + s} for s in (step, -step))
        with np.errstate(all="ignore"):
            slope = (closure_of(closure, up) - closure_of(closure, down)) / (2.0 * step)
        scale = np.abs(slope) + closure.evaluate(**drawn) / np.abs(drawn[marker])
        agree &= np.abs(gradient[:, 0, k] - slope) <= 1e-6 * scale
    assert agree[40:].mean() > (0.95 if closure.kind == "forest" else 0.99)


def closure_of(closure, markers):
    """Factors, NaN where a step has left the range."""
    reach = markers["radius_over_distance"] * (1.0 + 1.0 / markers["radius_ratio"])
    sound = reach <= 1.05
    found = np.full(len(sound), np.nan)
    found[sound] = closure.evaluate(**{k: v[sound] for k, v in markers.items()})
    return found


def physical(markers):
    """Rows of radius i, radius j, distance [m] and the rest, of pencil markers."""
    radius = 1.5e-3
    ratio = markers["radius_ratio"]
    distance = radius * ratio / markers["radius_over_distance"]
    rest = [markers["blocked_fraction"], markers["blockers_per_line"]]
    return np.column_stack([np.full_like(ratio, radius), radius * ratio, distance, *rest])


@pytest.fixture
def rows(closures):
    """Pairs inside and outside of the training data, and their markers."""
    markers = random_markers(closures[MLP], 500, seed=11)
    markers["radius_over_distance"][::4] *= 0.05
    return physical(markers), markers


@pytest.mark.parametrize("flags", ["O2", FAST])
def test_policies_and_counts(flags, rows, closures, compiled):
    physical_rows, markers = rows
    program, closure = compiled(MLP, flags), closures[MLP]
    plain = closure.predict(**markers)
    outside = plain.extrapolates
    assert 0.03 < outside.mean() < 0.9
    for policy, status in (
        ("clamp", CLAMPED), ("baseline", BASELINE), ("abort", REFUSED),
        ("extrapolate", EXTRAPOLATED),
    ):  # fmt: skip
        table, counts = program.guarded(physical_rows, policy)
        assert counts == (500, outside.sum(), 0)
        np.testing.assert_array_equal(table[:, -1], np.where(outside, status, INSIDE))
        np.testing.assert_allclose(
            table[~outside, 0], plain.view_factor[~outside], rtol=1e-12, atol=0.0
        )
        if policy == "abort":
            assert np.isnan(table[outside, 0]).all()
        if policy == "extrapolate":
            np.testing.assert_allclose(table[:, 0], plain.view_factor, rtol=1e-12)
        if policy == "baseline":  # the law without the learnt part: odds that are not bent
            m = {name: value[outside] for name, value in markers.items()}
            gate = closure.markers.gate(m)
            law = closure.markers.exact(m) * (1.0 - gate + gate * closure.markers.baseline(m))
            np.testing.assert_allclose(table[outside, 0], law, rtol=1e-12)


def test_clamped_is_the_closure_at_a_place_that_it_knows(rows, closures, compiled):
    physical_rows, markers = rows
    closure = closures[MLP]
    table, _ = compiled(MLP, "O2").guarded(physical_rows, "clamp")
    features = closure.markers.features(markers)
    domain = closure.domain
    inner = np.clip(features, domain.low, domain.high) - domain.centre
    far = np.sqrt(np.einsum("ij,jk,ik->i", inner, domain.precision, inner))
    inner *= np.minimum(1.0, domain.limit / far)[:, None]
    raw = closure.predictor(domain.centre + inner)[:, 0]
    v0, gate = closure.markers.baseline(markers), closure.markers.gate(markers)
    odds = v0 * np.exp(4.0 * np.tanh(raw))
    expected = closure.markers.exact(markers) * (1.0 - gate + gate * odds / (1.0 - v0 + odds))
    where = gate > 0.0
    np.testing.assert_allclose(table[where, 0], expected[where], rtol=1e-11)


def test_derivatives_for_physical_numbers_also_where_clamped(rows, compiled):
    physical_rows, _ = rows
    program = compiled(MLP, "O2")
    table, _ = program.guarded(physical_rows, "clamp")
    apart = physical_rows[:, 2] > 1.001 * (physical_rows[:, 0] + physical_rows[:, 1])
    for k in range(5):
        step = 1e-6 * np.maximum(np.abs(physical_rows[:, k]), 1e-3 if k > 2 else 0.0)
        up, down = physical_rows.copy(), physical_rows.copy()
        up[:, k] += step
        down[:, k] -= step
        some = apart & (down[:, 3] >= 0.0) & (up[:, 3] <= 1.0) & (down[:, 4] >= 0.0)
        high, low = (program.guarded(r, "clamp")[0][:, 0] for r in (up, down))
        slope = (high - low) / (2.0 * step)
        scale = np.abs(slope) + table[:, 0] / np.maximum(np.abs(physical_rows[:, k]), 1e-3)
        wrong = np.abs(table[:, 1 + k] - slope)[some] > 1e-5 * scale[some]
        # A few stand at the edge of the training data, where the slope jumps.
        assert wrong.mean() < 0.02


@pytest.mark.parametrize("flags", ["O2", FAST])
def test_numbers_that_make_no_sense_are_refused_and_counted(flags, compiled):
    sound = [1e-3, 1e-3, 4e-3, 0.5, 1.0]
    wrong = [(0, 0.0), (0, np.nan), (1, -1.0), (2, np.inf), (2, 0.0), (3, np.nan), (4, np.inf)]
    table = np.tile(sound, (len(wrong) + 3, 1))
    for row, (column, value) in enumerate(wrong):
        table[row, column] = value
    table[-3, 2] = 1.5e-3  # spheres that overlap too far
    table[-2, 3] = 1.2  # more than all lines blocked
    for policy in ("clamp", "baseline", "extrapolate"):
        answers, counts = compiled(MLP, flags).guarded(table, policy)
        # An infinite distance is a number that makes no sense as well.
        assert (answers[: len(wrong), -1] == REFUSED).all()
        assert np.isnan(answers[: len(wrong), 0]).all()
        assert np.isfinite(answers[len(wrong) :, :-1]).all()
        assert (answers[-3:-1, -1] != INSIDE).all()
        assert answers[-1, -1] in (INSIDE, CLAMPED, BASELINE, EXTRAPOLATED)
        assert counts[0] == len(table)
        assert counts[2] == len(wrong)
