"""Balance and net radiation against closed forms and a dense reference."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_matrix

from greybed.core import InputError, Packing
from greybed.coupling import Rows, balanced, net_radiation
from greybed.coupling.radiation import STEFAN_BOLTZMANN as SIGMA

F_CONTACT = 0.0755868184216  # two equal spheres in contact, see greybed.closures.exact_view_factor


def pair_rows(f=F_CONTACT, areas=(1.0, 1.0)):
    a = np.array(areas)
    factors = csr_matrix([[0.0, f], [f * a[0] / a[1], 0.0]])
    return Rows(factors, np.zeros((2, 0)), 1.0 - np.asarray(factors.sum(axis=1)).ravel(), a)


def random_rows(seed, n=12, n_walls=2, noise=0.1):
    rng = np.random.default_rng(seed)
    a = rng.uniform(0.5, 2.0, n)
    s = rng.random((n, n)) * (rng.random((n, n)) < 0.4)
    s = s + s.T
    np.fill_diagonal(s, 0.0)
    f = s / max(s.sum(axis=1).max(), 1e-9) * 0.5 / a[:, None] * a.min()
    f *= 1.0 + noise * rng.uniform(-1, 1, (n, n))
    outside = rng.dirichlet(np.ones(n_walls + 1), n) * (1 - f.sum(axis=1))[:, None]
    return Rows(csr_matrix(f), outside[:, :-1], outside[:, -1], a)


def test_two_black_spheres_exchange():
    result = net_radiation(pair_rows(), [1000.0, 500.0], environment_temperature=500.0)
    lost = SIGMA * (1000.0**4 - 500.0**4)
    # The cold sphere and the surroundings share what the hot one loses.
    np.testing.assert_allclose(result.absorbed, [-lost, F_CONTACT * lost], rtol=1e-13)
    np.testing.assert_allclose(result.boundary_heat, [-(1 - F_CONTACT) * lost], rtol=1e-13)


def test_grey_sphere_in_a_black_enclosure():
    rows = Rows(csr_matrix((1, 1)), np.ones((1, 1)), np.zeros(1), np.array([2.0]))
    result = net_radiation(rows, 900.0, emissivity=0.6, wall_temperatures=[400.0])
    expected = 2.0 * 0.6 * SIGMA * (400.0**4 - 900.0**4)
    np.testing.assert_allclose(result.absorbed, expected, rtol=1e-13)


@pytest.mark.parametrize("emissivity", [0.05, 0.3, 0.8, 1.0])
def test_radiosity_equals_dense_reference(emissivity):
    rows = balanced(random_rows(1))
    t = np.random.default_rng(2).uniform(300, 1500, 12)
    eps = np.full(12, emissivity)
    eps[3] = 0.5 if emissivity < 1.0 else 1.0
    result = net_radiation(
        rows, t, emissivity=eps, wall_temperatures=[400.0, 1200.0], environment_temperature=300.0
    )
    f, bounds = rows.factors.toarray(), SIGMA * np.array([400.0, 1200.0, 300.0]) ** 4
    from_outside = np.c_[rows.wall_factors, rows.escaped] @ bounds
    emitted = eps * SIGMA * t**4
    j = np.linalg.solve(np.eye(12) - (1 - eps)[:, None] * f, emitted + (1 - eps) * from_outside)
    g = f @ j + from_outside
    np.testing.assert_allclose(result.radiosity, j, rtol=1e-11)
    np.testing.assert_allclose(result.irradiation, g, rtol=1e-11)
    scale = (rows.areas * g).max()
    np.testing.assert_allclose(
        result.absorbed, rows.areas * (eps * g - emitted), atol=1e-11 * scale
    )
    assert abs(result.absorbed.sum() - result.boundary_heat.sum()) < 1e-12 * scale


def test_black_is_the_limit_of_grey():
    rows, t = balanced(random_rows(3)), np.linspace(300, 1200, 12)
    options = {"wall_temperatures": [400.0, None], "environment_temperature": 300.0}
    black = net_radiation(rows, t, emissivity=1.0, **options)
    grey = net_radiation(rows, t, emissivity=1.0 - 1e-9, **options)
    scale = np.abs(black.absorbed).max()
    np.testing.assert_allclose(grey.absorbed, black.absorbed, atol=1e-8 * scale)


@pytest.mark.parametrize("emissivity", [1.0, 0.4])
def test_one_temperature_exchanges_exactly_nothing(emissivity):
    result = net_radiation(
        random_rows(4),
        800.0,
        emissivity=emissivity,
        wall_temperatures=[800.0, None],
        environment_temperature=800.0,
    )
    assert (result.absorbed == 0.0).all()
    assert (result.boundary_heat == 0.0).all()


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.integers(2, 30), st.floats(0, 0.9))
def test_balanced_rows_close_and_are_reciprocal(seed, n, noise):
    rows = random_rows(seed, n, noise=noise)
    result = balanced(rows)
    assert result.imbalance < 1e-12
    assert ((rows.factors.toarray() + rows.factors.toarray().T) > 0).sum() == result.factors.nnz
    again = balanced(result)
    assert abs(again.factors - result.factors).max() < 1e-13


def test_balance_leaves_exact_rows_alone():
    rows = pair_rows(areas=(1.0, 4.0))
    result = balanced(rows)
    np.testing.assert_allclose(result.factors.toarray(), rows.factors.toarray(), rtol=1e-14)


def test_impossible_balance_is_refused():
    closed = csr_matrix([[0.0, 1.0], [1.0, 0.0]])
    rows = Rows(closed, np.zeros((2, 0)), np.zeros(2), np.array([1.0, 2.0]))
    with pytest.raises(InputError, match="cannot be balanced"):
        balanced(rows)
    with pytest.raises(InputError, match="sphere 1 sees nothing"):
        balanced(Rows(csr_matrix((2, 2)), np.zeros((2, 0)), np.array([1.0, 0.0]), np.ones(2)))


def test_rows_from_any_result_and_refusals():
    packing = Packing([[0, 0, 0], [0, 0, 2]], 1.0)
    bare = pair_rows()
    traced = SimpleNamespace(
        factors=bare.factors, wall_factors=bare.wall_factors, escaped=bare.escaped
    )
    np.testing.assert_array_equal(Rows.of(traced, packing).areas, packing.areas)
    with pytest.raises(InputError, match="2 spheres and 0 walls"):
        Rows.of(bare, Packing([[0, 0, 0]], 1.0))
    with pytest.raises(InputError, match=r"escaped contain -0.1 \[-\]"):
        Rows(bare.factors, bare.wall_factors, np.array([-0.1, 1.0]), bare.areas)
    with pytest.raises(InputError, match="disagree"):
        Rows(bare.factors, np.zeros((3, 1)), bare.escaped, bare.areas)
    with pytest.raises(InputError, match=r"areas must be .*\[m2\]"):
        Rows(bare.factors, bare.wall_factors, bare.escaped, np.array([1.0, 0.0]))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"emissivity": 1.2}, r"emissivity = 1.2 \[-\] must be above 0 and at most 1"),
        ({"emissivity": 0.0}, r"emissivity = 0 \[-\]"),
        ({"temperatures": [300.0, -1.0]}, r"temperatures\[1\] = -1 \[K\]"),
        ({"wall_temperatures": [300.0]}, "1 wall temperatures for 0 walls"),
        ({"environment_temperature": 0.0}, r"opening: temperature = 0 \[K\]"),
    ],
)
def test_refusals(options, message):
    with pytest.raises(InputError, match=message):
        net_radiation(pair_rows(), **{"temperatures": 300.0, **options})
