"""Designs: stratified, orthogonal, rotatable."""

import numpy as np
import pytest

from greybed.calibration.designs import (
    central_composite,
    first_design,
    fractional_factorial,
    full_factorial,
    latin_hypercube,
)
from greybed.core.errors import InputError


@pytest.mark.parametrize(("n", "d"), [(7, 1), (10, 2), (24, 7)])
def test_a_latin_hypercube_has_one_point_in_each_stratum(n, d):
    x = latin_hypercube(n, d, seed=4)
    assert (np.sort(np.floor(x * n), axis=0) == np.arange(n)[:, None]).all()
    assert (latin_hypercube(n, d, seed=4) == x).all()


@pytest.mark.parametrize("d", range(1, 10))
def test_main_effects_of_fractions_are_orthogonal_to_each_other_and_to_pairs(d):
    points, resolution = fractional_factorial(d)
    z = np.sign(points - 0.5)
    assert len(points) <= 32
    np.testing.assert_array_equal(z.T @ z, len(z) * np.eye(d))
    for i in range(d):
        for j in range(i):
            pair = z[:, i] * z[:, j]
            others = [k for k in range(d) if k not in (i, j)]
            assert not (z[:, others].T @ pair).any(), (d, i, j)  # resolution 4 at least
    assert resolution >= 4


def test_more_than_nine_factors_are_refused():
    with pytest.raises(InputError, match="10 free parameters are too many"):
        fractional_factorial(10)


@pytest.mark.parametrize("d", [2, 3, 4, 5])
def test_a_central_composite_design_is_rotatable_and_determines_a_quadratic(d):
    from greybed.calibration.surrogates.quadratic import quadratic_terms

    x = central_composite(d)
    assert x.min() >= 0.0
    assert x.max() <= 1.0
    terms, names = quadratic_terms(x)
    assert np.linalg.matrix_rank(terms) == len(names)
    # Rotatable: the variance of a prediction depends on the distance from the centre alone.
    inverse = np.linalg.inv(terms.T @ terms)
    rng = np.random.default_rng(0)
    way = rng.standard_normal((50, d))
    way /= np.linalg.norm(way, axis=1)[:, None]
    at, _ = quadratic_terms(0.5 + 0.3 * way)
    variance = np.einsum("ij,jk,ik->i", at, inverse, at)
    np.testing.assert_allclose(variance, variance[0], rtol=1e-9)


def test_factorials_and_names():
    assert full_factorial(8, 2).shape == (64, 2)
    assert first_design("factorial", 64, 2, 0).shape == (64, 2)
    assert first_design("sobol", 10, 3, 0).shape == (10, 3)
    with pytest.raises(InputError, match="must be one of 'lhs'"):
        first_design("grid", 10, 3, 0)
