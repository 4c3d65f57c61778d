"""Exchange factors from view factors: limits, sums, reciprocity, closed forms, a direct solve."""

import numpy as np
import pytest
from scipy.sparse import csr_matrix

from greybed.core import InputError
from greybed.core.diffuse import diffuse_exchange
from greybed.core.rows import Rows, balanced


def made(n=12, n_walls=2, seed=3):
    """Balanced rows of unequal spheres that see some others, walls and an opening."""
    rng = np.random.default_rng(seed)
    areas = rng.uniform(0.5, 3.0, n)
    s = rng.random((n, n)) * (rng.random((n, n)) < 0.5)
    s = s + s.T
    outside = rng.random((n, n_walls + 1))
    scale = (areas / (s.sum(axis=1) + outside.sum(axis=1)))[:, None]
    f, outside = scale * s / areas[:, None], scale * outside / areas[:, None]
    return balanced(Rows(csr_matrix(f), outside[:, :-1], outside[:, -1], areas))


def whole(rows, wall_exchange):
    """View factors and areas of spheres, walls and opening, full."""
    n, n_walls = rows.wall_factors.shape
    size = n + n_walls + 1
    s = np.zeros((size, size))
    s[:n, :n] = rows.areas[:, None] * rows.factors.toarray()
    s[:n, n:] = rows.areas[:, None] * np.column_stack([rows.wall_factors, rows.escaped])
    s[n:, :n] = s[:n, n:].T
    s[n:-1, n:-1] = wall_exchange
    areas = s.sum(axis=1)
    return s / areas[:, None], areas


EPS = np.random.default_rng(1).uniform(0.1, 1.0, 12)
BETWEEN = np.array([[0.2, 0.7], [0.7, 0.0]])


@pytest.mark.parametrize("eps", [0.001, 0.3, EPS])
@pytest.mark.parametrize("wall_eps", [1.0, (0.4, 0.9), (0.0, 0.5), 0.0])
def test_the_direct_solve_of_the_definition(eps, wall_eps):
    rows = made()
    f, areas = whole(rows, BETWEEN)
    e = np.concatenate([np.broadcast_to(eps, 12), np.broadcast_to(wall_eps, 2), [1.0]])
    d = np.linalg.solve(np.eye(len(e)) - f * (1.0 - e), f * e)
    got = diffuse_exchange(rows, eps, wall_emissivity=wall_eps, wall_exchange=BETWEEN)
    shares = got.emitted_by([7, 2])
    ours = np.column_stack([shares.factors, shares.wall_factors, shares.escaped])
    np.testing.assert_allclose(ours, d[[7, 2]], rtol=0, atol=2e-13)
    np.testing.assert_allclose(ours.sum(axis=1), 1.0, rtol=0, atol=1e-13)
    exchange = (areas * e)[:, None] * d
    np.testing.assert_allclose(exchange, exchange.T, rtol=0, atol=1e-12)


def test_black_surfaces_leave_the_view_factors():
    rows = made()
    again = diffuse_exchange(rows, 1.0).rows()
    # Balanced rows close to 1e-14, and the areas here are their sums.
    np.testing.assert_allclose(again.factors.toarray(), rows.factors.toarray(), rtol=5e-14, atol=0)
    np.testing.assert_allclose(again.wall_factors, rows.wall_factors, rtol=5e-14, atol=0)
    near = diffuse_exchange(rows, 1.0 - 1e-9).rows()
    np.testing.assert_allclose(near.factors.toarray(), rows.factors.toarray(), rtol=0, atol=2e-9)


def test_rows_are_closed_and_reciprocal_to_round_off():
    rows = diffuse_exchange(made(), EPS, wall_emissivity=0.5, wall_exchange=BETWEEN).rows()
    assert rows.imbalance < 1e-13
    np.testing.assert_allclose(rows.areas, made().areas * EPS, rtol=1e-15)
    np.testing.assert_array_equal(rows.emissivity, EPS)


@pytest.mark.parametrize(("eps", "wall_eps"), [(0.5, 1.0), (0.9, 0.2), (0.01, 0.01)])
def test_a_sphere_in_a_shell(eps, wall_eps):
    # Concentric grey surfaces: q = A1 (E1 - E2) / (1/e1 + (A1/A2) (1/e2 - 1)), where one
    # radiosity per surface is exact.
    inner, outer = 2.0, 7.0
    rows = Rows(csr_matrix((1, 1)), [[1.0]], [0.0], [inner])
    bed = diffuse_exchange(rows, eps, wall_emissivity=wall_eps, wall_exchange=[[outer - inner]])
    q = bed.heats(500.0, 200.0)
    expected = inner * 300.0 / (1.0 / eps + inner / outer * (1.0 / wall_eps - 1.0))
    assert q.spheres[0] == pytest.approx(expected, rel=1e-12)
    assert q.walls[0] == pytest.approx(-expected, rel=1e-12)
    assert q.opening == 0.0


def test_heats_are_what_the_rows_say_and_add_up_to_zero():
    bed = diffuse_exchange(made(), EPS)
    rng = np.random.default_rng(5)
    power, walls, outer = rng.uniform(1e3, 9e3, 12), np.array([2e3, 5e3]), 4e3
    q = bed.heats(power, walls, outer)
    shares = bed.emitted_by(np.arange(12))
    seen = shares.factors @ power + shares.wall_factors @ walls + shares.escaped * outer
    np.testing.assert_allclose(q.spheres, bed.emission_areas * (power - seen), rtol=0, atol=1e-9)
    total = np.abs(q.spheres).sum() + np.abs(q.walls).sum() + abs(q.opening)
    assert abs(q.spheres.sum() + q.walls.sum() + q.opening) < 1e-14 * total
    level = bed.heats(7e3, 7e3, 7e3)
    assert not np.abs(level.spheres).any()


def test_a_wall_of_no_emissivity_takes_no_heat():
    bed = diffuse_exchange(made(), 0.6, wall_emissivity=(0.0, 1.0), wall_exchange=BETWEEN)
    q = bed.heats(np.linspace(1e3, 5e3, 12), (9e9, 2e3), 3e3)
    assert q.walls[0] == 0.0
    assert not bed.emitted_by([0]).wall_factors[0, 0]


def test_many_rows_are_the_same_as_few():
    rows = made(n=300, seed=8)
    bed = diffuse_exchange(rows, 0.4)
    every = bed.emitted_by(np.arange(300))
    some = bed.emitted_by([299, 17])
    np.testing.assert_allclose(every.factors[[299, 17]], some.factors, rtol=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"emissivity": 0.0}, "emissivity = 0 .* outside 0.001"),
        ({"emissivity": [0.5, 0.5]}, "emissivity of shape"),
        ({"emissivity": np.nan}, "emissivity of shape .* finite"),
        ({"wall_emissivity": 1.5}, r"wall_emissivity = 1.5 .* outside 0 \.\.\. 1"),
        ({"wall_exchange": [[0.0, 1.0], [2.0, 0.0]]}, "symmetric"),
        ({"wall_exchange": [1.0]}, r"must be \(2, 2\)"),
    ],
)
def test_bad_numbers_are_one_sentence(change, message):
    options = {"emissivity": 0.5, **change}
    with pytest.raises(InputError, match=message):
        diffuse_exchange(made(), options.pop("emissivity"), **options)


def test_what_is_refused():
    bed = diffuse_exchange(made(), 0.5)
    with pytest.raises(InputError, match="hold reflections already"):
        diffuse_exchange(bed.rows(), 0.5)
    for wrong in ([12], [-1], [0.5], [[0]]):
        with pytest.raises(InputError, match=r"whole numbers in 0 \.\.\. 11"):
            bed.emitted_by(wrong)
    with pytest.raises(InputError, match="power of shape"):
        bed.heats([1.0, 2.0])
