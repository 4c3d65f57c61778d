"""Exchange factors of whole beds from a closure's view factors, beside traced reflecting paths."""

import numpy as np
import pytest

from greybed.closures import ViewFactorClosure, shipped
from greybed.core import InputError
from greybed.core.rows import Rows
from greybed.coupling import balanced, diffuse_exchange, radiative_network
from greybed.coupling.radiation import STEFAN_BOLTZMANN
from greybed.datasets.generate import Box, Mono, random_packing
from greybed.raytrace import exchange_factors

EMISSIVITY = 0.65


@pytest.fixture(scope="module")
def bed():
    return random_packing(120, 0.5, Mono(1e-3), container=Box(), seed=21)


@pytest.fixture(scope="module")
def traced(bed):
    """Grey and black factors of one trace."""
    return exchange_factors(bed, [EMISSIVITY, 1.0], rays=4000, seed=3)


@pytest.fixture(scope="module")
def closed(bed):
    return shipped().exchange(bed, EMISSIVITY, wall_closure=shipped("wallfactor_mlp_wall"), sides=1)


def test_rows_of_a_bed_with_walls(bed, closed):
    rows = closed.rows()
    assert rows.factors.shape == (120, 120)
    assert rows.wall_factors.shape == (120, 6)
    assert rows.imbalance < 1e-13
    # Reflections fill the diagonal and reach pairs that do not see each other.
    assert (rows.factors.diagonal() > 0.0).all()
    assert rows.factors.nnz > closed.view.factors.nnz
    np.testing.assert_allclose(closed.emission_areas, EMISSIVITY * bed.areas, rtol=1e-15)


@pytest.mark.parametrize(("kind", "sides"), [("mlp", 1), ("mlp", 6), ("forest", 1)])
def test_limits_hold_untrained(kind, sides, bed):
    closure = ViewFactorClosure.untrained(kind, "pencil", 3)
    view = closure.factors(bed)
    black = closure.exchange(bed, 1.0, sides=sides).rows()
    np.testing.assert_allclose(
        black.factors.toarray(), view.factors.toarray(), rtol=1e-12, atol=1e-17
    )
    grey = closure.exchange(bed, 0.3, wall_emissivity=0.5, sides=sides).rows()
    np.testing.assert_allclose(grey.sums, 1.0, rtol=0, atol=1e-13)
    assert grey.imbalance < 1e-13
    direct = 0.3 * view.factors.toarray()
    assert (grey.factors.toarray() >= direct * (1.0 - 1e-12)).all()


def test_heats_are_those_of_the_radiative_network(bed, closed):
    t = 600.0 + 300.0 * np.random.default_rng(2).random(120)
    walls = [900.0, 500.0, 700.0, 700.0, 650.0, 700.0]
    power, wall_power = (STEFAN_BOLTZMANN * np.asarray(v) ** 4 for v in (t, walls))
    ours = closed.heats(power, wall_power)
    ask = {"temperatures": t, "wall_temperatures": walls}
    from_view = radiative_network(closed.view, emissivity=EMISSIVITY, **ask)
    from_rows = radiative_network(closed.rows(), **ask)
    scale = np.abs(ours.spheres).max()
    np.testing.assert_allclose(ours.spheres, from_view.heats, rtol=0, atol=1e-9 * scale)
    np.testing.assert_allclose(ours.spheres, from_rows.heats, rtol=0, atol=1e-11 * scale)
    np.testing.assert_allclose(ours.walls, from_view.wall_heats[:-1], rtol=0, atol=1e-8 * scale)


def test_traced_paths_keep_more_light_near(bed, traced, closed):
    """Where the network is off against traced paths, in which direction and how far."""
    grey, black = traced
    truth = balanced(Rows.of(grey, bed))
    near = black.factors.toarray() > 1e-2
    np.fill_diagonal(near, False)
    d = truth.factors.toarray()
    for network in (diffuse_exchange(black, EMISSIVITY), closed):
        rows = network.rows()
        mine = rows.factors.toarray()
        assert -0.13 < mine[near].mean() / d[near].mean() - 1.0 < -0.06
        assert 0.1 < np.diag(mine).mean() / np.diag(d).mean() < 0.3
        assert 1.05 < rows.wall_factors.sum() / truth.wall_factors.sum() < 1.2


def test_sides_take_out_most_of_the_bias(bed, traced, closed):
    grey, black = traced
    truth = balanced(Rows.of(grey, bed))
    near = black.factors.toarray() > 1e-2
    np.fill_diagonal(near, False)
    d = truth.factors.toarray()
    network = shipped().exchange(bed, EMISSIVITY, wall_closure=shipped("wallfactor_mlp_wall"))
    assert network.sides == 24  # by default; half of them do, and are quicker
    network = diffuse_exchange(network.view, EMISSIVITY, packing=bed, sides=12)
    rows = network.rows()
    assert rows.imbalance < 1e-11
    mine = rows.factors.toarray()
    assert abs(mine[near].mean() / d[near].mean() - 1.0) < 0.03
    assert 0.7 < np.diag(mine).mean() / np.diag(d).mean() < 1.0
    assert abs(rows.wall_factors.sum() / truth.wall_factors.sum() - 1.0) < 0.06
    temperatures = np.random.default_rng(4).uniform(500.0, 1100.0, len(bed))
    ask = {"temperatures": temperatures, "wall_temperatures": [900.0, 500.0] + 4 * [700.0]}
    ours, one, paths = (radiative_network(r, **ask).heats for r in (rows, closed.rows(), truth))
    assert np.std(ours - paths) < 0.4 * np.std(one - paths)


def test_closure_and_traced_view_factors_give_one_network(bed, traced, closed):
    a, b = closed.rows(), diffuse_exchange(traced[1], EMISSIVITY).rows()
    away = (a.factors - b.factors).toarray()
    near = b.factors.toarray() > 1e-2
    # The rays' own error is 0.002 to 0.004 a pair.
    assert np.sqrt((away[near] ** 2).mean()) < 0.004
    assert abs(away[near].mean()) < 5e-4
    assert np.sqrt(((a.wall_factors - b.wall_factors) ** 2).mean()) < 0.006


def test_closures_of_other_quantities_are_refused(bed):
    for name in ("exchange_mlp_exchange", "wallfactor_mlp_wall"):
        with pytest.raises(InputError, match=r"not the view factors of pairs .* take shipped"):
            shipped(name).exchange(bed, 0.5)
