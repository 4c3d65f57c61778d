"""Factors to a wanted accuracy: reached, honest, and what it cost."""

from __future__ import annotations

import numpy as np
import pytest

from greybed.core import InputError, Packing
from greybed.core.sizes import Uniform
from greybed.datasets.containers import Box
from greybed.datasets.generate import random_packing
from greybed.raytrace import view_factors


def everything(result):
    return (
        np.hstack([result.factors.toarray(), result.wall_factors, result.escaped[:, None]]),
        np.hstack([result.stderr.toarray(), result.wall_stderr, result.escaped_stderr[:, None]]),
    )


@pytest.mark.parametrize("kind", ["periodic", "walls", "overlapping"])
def test_reached_and_true(kind):
    if kind == "walls":
        packing = random_packing(40, 0.45, Uniform(1.0, 2.0), seed=8, container=Box())
    else:
        packing = random_packing(40, 0.45, Uniform(1.0, 2.0), seed=8)
    if kind == "overlapping":
        packing = Packing(packing.centres, 1.05 * packing.radii, packing.box, packing.periodic)
    result = view_factors(packing, rays=2048, rel_error=0.04, least=0.01, seed=1)
    value, error = everything(result)
    large = value >= 0.01
    assert (error[large] <= 0.04 * value[large]).all()
    assert result.reciprocal
    exchange = result.factors.toarray() * result.areas[:, None]
    assert np.abs(exchange - exchange.T).max() <= 1e-14 * exchange.max()
    reference = view_factors(packing, rays=50_000, seed=77)
    truth, noise = everything(reference)
    z = (value - truth)[large] / np.hypot(error, noise)[large]
    assert large.sum() > 350
    assert np.abs(z).max() < 5.0
    assert 0.92 < (np.abs(z) < 1.96).mean() < 0.995
    assert (result.cost >= 2048).all()
    # Independent rays would need (1 - F) / (F 0.04^2), 62,000 for F = 0.01.
    assert result.cost.mean() < 37_500


def test_same_bits_and_smooth():
    packing = random_packing(40, 0.4, Uniform(1.0, 2.0), seed=8)
    options = {"rel_error": 0.05, "least": 0.02, "seed": 4}
    one = view_factors(packing, threads=1, **options)
    two = view_factors(packing, threads=2, **options)
    np.testing.assert_array_equal(one.factors.toarray(), two.factors.toarray())
    np.testing.assert_array_equal(one.stderr.toarray(), two.stderr.toarray())
    np.testing.assert_array_equal(one.cost, two.cost)
    smooth = view_factors(packing, smooth=True, **options)
    assert np.abs(smooth.factors.sum(axis=1) + smooth.escaped - 1.0).max() <= 1e-12


def test_refusals():
    pair = Packing([[0, 0, 0], [2, 0, 0]], 1.0)
    for wrong in ({"rel_error": 0.0}, {"rel_error": 0.1, "least": 0.0}):
        with pytest.raises(InputError, match="must"):
            view_factors(pair, **wrong)
    with pytest.raises(InputError, match="leave out emitters"):
        view_factors(pair, rel_error=0.1, emitters=[0])
