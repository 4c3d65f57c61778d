"""Smoothing: exact reciprocity and row sums, zeros kept, errors that cover the truth."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse

from greybed.core import InputError, Packing
from greybed.core.sizes import Uniform
from greybed.datasets.containers import Box
from greybed.datasets.generate import random_packing
from greybed.raytrace import smoothed, smoothing, view_factors


def beds():
    return {
        "periodic": random_packing(60, 0.5, Uniform(1.0, 2.0), seed=3),
        "walls": random_packing(60, 0.4, Uniform(1.0, 2.0), seed=3, container=Box()),
        "overlaps": random_packing(60, 0.3, Uniform(1.0, 2.0), seed=3),
    }


def swollen(packing):
    return Packing(packing.centres, 1.1 * packing.radii, packing.box, packing.periodic)


@pytest.mark.parametrize("name", ["periodic", "walls", "overlaps"])
def test_reciprocity_and_sums(name):
    packing = beds()[name]
    if name == "overlaps":
        packing = swollen(packing)
    raw = view_factors(packing, rays=2000, seed=1)
    result = smoothed(raw)
    exchange = result.factors.toarray() * result.areas[:, None]
    assert np.abs(exchange - exchange.T).max() <= 1e-14 * exchange.max()
    sums = result.factors.sum(axis=1) + result.wall_factors.sum(axis=1) + result.escaped
    assert np.abs(sums - 1.0).max() <= 1e-12
    assert (result.factors.data > 0.0).all()
    assert (result.wall_factors >= 0.0).all()
    # Zeros stay zero, in walls too, and no pair appears that neither direction saw.
    seen = (raw.factors + raw.factors.T).toarray() > 0.0
    assert ((result.factors.toarray() > 0.0) == seen).all()
    assert ((result.wall_factors > 0.0) == (raw.wall_factors > 0.0)).all()
    assert np.median(result.stderr.data) < np.median(raw.stderr.data)


def test_coverage_of_propagated_errors():
    packing = beds()["walls"]
    reference = smoothed(view_factors(packing, rays=150_000, seed=99))
    truth = np.hstack([reference.factors.toarray(), reference.wall_factors])
    inside = np.zeros(truth.shape)
    seeds = 20
    for seed in range(seeds):
        s = view_factors(packing, rays=2048, seed=seed, smooth=True)
        value = np.hstack([s.factors.toarray(), s.wall_factors])
        error = np.hstack([s.stderr.toarray(), s.wall_stderr])
        inside += np.abs(value - truth) <= 1.959964 * error
    fair = truth * 2048 >= 10.0
    # Some 1,500 pairs, 20 seeds: the share itself is known to 0.3 %.
    assert 0.93 <= inside[fair].mean() / seeds <= 0.97


def test_series_of_the_inverse_agrees_with_the_inverse(monkeypatch):
    raw = view_factors(beds()["walls"], rays=1000, seed=5)
    whole = smoothed(raw)
    monkeypatch.setattr(smoothing, "DENSE", 0)
    series = smoothed(raw)
    np.testing.assert_array_equal(whole.factors.toarray(), series.factors.toarray())
    np.testing.assert_allclose(series.stderr.data, whole.stderr.data, rtol=0.02)


def test_known_answer_by_weighted_least_squares():
    """Small corrections are those of the textbook formula."""
    raw = view_factors(beds()["walls"], rays=100_000, seed=6)
    measured = smoothing.gathered(raw)
    closed = smoothing.closed(measured)
    m, n, k = len(measured.i), len(measured.areas), measured.outside.shape[1]
    rows, cols = [], []
    for q in range(m):
        for sphere in {int(measured.i[q]), int(measured.j[q])}:
            rows.append(sphere)
            cols.append(q)
    for sphere in range(n):
        for w in range(k):
            rows.append(sphere)
            cols.append(m + sphere * k + w)
    c = sparse.coo_array((np.ones(len(rows)), (rows, cols)), shape=(n, m + n * k)).toarray()
    x = np.concatenate([measured.value, measured.outside.ravel()])
    v = np.concatenate([measured.variance, measured.outside_variance.ravel()])
    gain = np.linalg.solve((c * v) @ c.T, c @ x - measured.areas)
    expected = x - v * (c.T @ gain)
    got = np.concatenate([closed.value, closed.outside.ravel()])
    change = np.abs(expected - x).max()
    assert change > 0.0
    np.testing.assert_allclose(got, expected, atol=0.02 * change)


def test_needs_all_rows():
    packing = beds()["periodic"]
    with pytest.raises(InputError, match="was not traced"):
        smoothed(view_factors(packing, rays=100, emitters=[0, 1]))
