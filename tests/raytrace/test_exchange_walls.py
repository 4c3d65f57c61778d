"""What walls emit and who absorbs it: closed rows, reciprocity, the closed form of two plates."""

from __future__ import annotations

import numpy as np
import pytest

from greybed.core import InputError, Packing, Plane, box_walls
from greybed.coupling import radiative_network
from greybed.raytrace import exchange_factors, patch_factors

SIGMA = 5.670374419e-8  # [W/m2/K4]
CENTRES = [[0.3, 0.3, 0.3], [0.7, 0.6, 0.4], [0.4, 0.7, 0.75]]
RADII = [0.15, 0.2, 0.12]
WALLS = [0.4, 0.9, 0.0, 0.7, 0.5, 0.3]


@pytest.fixture(scope="module")
def box():
    return Packing(CENTRES, RADII, walls=box_walls((0, 0, 0), (1, 1, 1)))


@pytest.fixture(scope="module")
def traced(box):
    return exchange_factors(
        box, [0.6, 1.0], wall_emissivity=[WALLS, [1.0] * 6], wall_specular=0.3, rays=30_000,
        wall_rays=30_000, seed=3,
    )  # fmt: skip


def test_rows_are_closed_and_reciprocal(traced):
    rows = traced[0]
    walls = rows.patches
    total = walls.factors.sum(axis=1) + walls.wall_factors.sum(axis=1) + walls.escaped
    np.testing.assert_allclose(total, 1.0, atol=1e-12)
    power = walls.areas * walls.emissivity
    forth, error = power[:, None] * walls.factors, power[:, None] * walls.stderr
    back = (rows.emission_areas[:, None] * rows.wall_factors).T
    back_error = (rows.emission_areas[:, None] * rows.wall_stderr).T
    lit = power > 0.0
    off = (forth - back)[lit] / np.hypot(error.toarray(), back_error)[lit]
    assert np.abs(off).max() < 4.5
    # A wall that absorbs nothing: no share ends there.
    assert (walls.wall_factors[:, 2] == 0.0).all()
    between, spread = power[:, None] * walls.wall_factors, power[:, None] * walls.wall_stderr
    both = np.outer(lit, lit)
    off = (between - between.T)[both] / np.hypot(spread, spread.T)[both]
    assert np.abs(off).max() < 4.5
    np.testing.assert_allclose(rows.wall_exchange, 0.5 * (between + between.T))


def test_black_walls_have_view_factors(traced, box):
    black, view = traced[1].patches, patch_factors(box, rays=30_000)
    error = np.hypot(black.wall_stderr, view.to_walls_stderr)
    assert (np.abs(black.wall_factors - view.to_walls) < 4.5 * error).all()
    error = np.hypot(black.stderr.toarray(), view.to_spheres_stderr.toarray())
    assert (np.abs((black.factors - view.to_spheres).toarray()) < 4.5 * error).all()


def test_two_plates_through_the_network():
    """Wide grey plates, sides that re-radiate as mirrors: sigma dT4 / (1/e1 + 1/e2 - 1)."""
    tiny = Packing([[0.5, 0.5, 0.05]], 1e-4, walls=box_walls((0, 0, 0), (1, 1, 0.1)))
    (rows,) = exchange_factors(
        tiny, [0.5], wall_emissivity=[0.0, 0.0, 0.0, 0.0, 0.8, 0.3],
        wall_specular=[1.0] * 4 + [0.0] * 2, rays=1_000, wall_rays=100_000,
    )  # fmt: skip
    result = radiative_network(
        rows, temperatures=400.0, wall_temperatures=[None] * 4 + [600.0, 400.0]
    )
    exact = SIGMA * (600.0**4 - 400.0**4) / (1.0 / 0.8 + 1.0 / 0.3 - 1.0)
    error = rows.patches.wall_stderr[4, 5] / rows.patches.wall_factors[4, 5]
    assert error < 4e-3
    assert result.wall_heats[4] == pytest.approx(exact, rel=4.0 * error)


def test_the_seed_is_all_that_matters(box):
    def run(threads, seed):
        return exchange_factors(
            box, 0.5, wall_emissivity=0.5, rays=100, wall_rays=2_000, threads=threads, seed=seed
        )[0].patches

    one, two, other = run(1, 7), run(2, 7), run(1, 8)
    np.testing.assert_array_equal(one.wall_factors, two.wall_factors)
    np.testing.assert_array_equal(one.factors.toarray(), two.factors.toarray())
    assert (one.wall_factors != other.wall_factors).any()


def test_walls_without_end_have_no_row():
    floor = Plane((0, 0, 0), (0, 0, 1))
    lid = box_walls((-1, -1, 0), (1, 1, 2))[5]
    mixed = Packing([[0, 0, 1.0]], 0.3, walls=[floor, lid])
    (rows,) = exchange_factors(mixed, 0.5, wall_emissivity=0.5, rays=100, wall_rays=20_000)
    assert np.isnan(rows.patches.wall_factors[0]).all()
    sent = 0.5 * rows.patches.areas[1] * rows.patches.wall_factors[1, 0]
    assert rows.wall_exchange[0, 1] == rows.wall_exchange[1, 0] == sent > 0.0
    endless = Packing([[0, 0, 1.0]], 0.3, walls=[floor])
    with pytest.raises(InputError, match="no wall has an end"):
        exchange_factors(endless, 0.5, rays=10, wall_rays=10)
    with pytest.raises(InputError, match="wall_rays"):
        exchange_factors(mixed, 0.5, rays=10, wall_rays=-1)
