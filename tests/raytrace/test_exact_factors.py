"""Traced factors against exact ones: free pairs, discs, planes, cylinders, shadows."""

from __future__ import annotations

import numpy as np
import pytest

from greybed.core import Cylinder, Packing, Plane
from greybed.raytrace import standard_error, view_factors

# r1, r2, distance, F12 from the one-dimensional integral (exact_view_factor uses another form).
PAIRS = [
    (1, 1, 2, 0.0755868184216),
    (1, 1, 2.01, 0.0745504470295),
    (1, 1, 2.1, 0.0665040436133),
    (1, 1, 2.5, 0.0441189329067),
    (1, 1, 3, 0.0295903122506),
    (1, 1, 4, 0.0161562443699),
    (1, 1, 6, 0.00704441700516),
    (1, 1, 10, 0.00251265904319),
    (1, 1, 20, 6.25783702144e-4),
    (1, 2, 3, 0.137405938769),
    (2, 1, 3, 0.0343514846922),
    (1, 3, 4, 0.179346647068),
    (1, 10, 11, 0.299295786223),
    (0.1, 0.2, 0.5, 0.0422779979638),
]
RAYS = 200_000


@pytest.mark.parametrize("sampling", ["sobol", "random"])
@pytest.mark.parametrize(("r1", "r2", "distance", "exact"), PAIRS)
def test_free_pair(r1, r2, distance, exact, sampling):
    towards = np.array([2.0, -1.0, 2.0]) / 3.0  # no axis: cells are crossed askew
    pair = Packing([[0, 0, 0], distance * towards], [r1, r2])
    result = view_factors(pair, rays=RAYS, seed=1, sampling=sampling)
    value, error = result.factors[0, 1], result.stderr[0, 1]
    assert abs(value - exact) < 4 * error
    # Not by being vague: within a tenth of the binomial error, or below it with a sequence.
    binomial = np.sqrt(exact * (1 - exact) / RAYS)
    if sampling == "random":
        assert error == pytest.approx(binomial, rel=0.1)
    else:
        assert error < (0.65 if exact > 1e-2 else 1.05) * binomial
    back, back_error = result.factors[1, 0], result.stderr[1, 0]
    assert abs(back - exact * (r1 / r2) ** 2) < 4 * back_error
    assert result.factors[0, 0] == result.factors[1, 1] == 0.0


def test_the_middle_of_three_hides_the_third():
    result = view_factors(Packing([[0, 0, 0], [2, 0, 0], [4, 0, 0]], 1.0), rays=RAYS)
    assert result.factors[0, 2] == result.factors[2, 0] == 0.0


@pytest.mark.parametrize("height", [1.0, 1.7, 40.0])
def test_a_plane_takes_half(height):
    """Whatever the height: exactly half of the directions lead down."""
    normal = np.array([1.0, 2.0, -2.0]) / 3.0
    wall = Plane(tuple(-height * normal), tuple(normal))
    result = view_factors(Packing([[0, 0, 0]], 1.0, walls=[wall]), rays=RAYS, seed=3)
    assert result.wall_stderr[0, 0] < 1.2e-3
    assert abs(result.wall_factors[0, 0] - 0.5) < 4 * result.wall_stderr[0, 0]
    assert result.wall_factors[0, 0] + result.escaped[0] == 1.0


def test_two_planes_and_what_is_inside_a_cylinder():
    between = Packing(
        [[0, 0, 0]], 1.0, walls=[Plane((0, 0, -2), (0, 0, 1)), Plane((0, 0, 9), (0, 0, -1))]
    )
    result = view_factors(between, rays=RAYS, seed=4)
    assert abs(result.wall_factors[0, 0] - 0.5) < 4 * result.wall_stderr[0, 0]
    # A horizontal ray meets neither; the chance of one is nil.
    assert result.wall_factors[0].sum() == 1.0
    inside = Packing([[0.3, 0, 0]], 0.5, walls=[Cylinder((0, 0, 0), (1, 2, 3), 1.0)])
    result = view_factors(inside, rays=RAYS, seed=5)
    assert result.wall_factors[0, 0] == 1.0
    assert result.escaped[0] == 0.0


def test_coaxial_discs_in_a_closed_can():
    """Sphere to a coaxial disc: (1 - 1 / sqrt(1 + (R/h)^2)) / 2; walls in mixed order."""
    walls = [
        Plane((0, 0, -1.0), (0, 0, 1), "near"),
        Cylinder((0, 0, 0), (0, 0, 1), 1.0, "side"),
        Plane((0, 0, 2.5), (0, 0, -1), "far"),
    ]
    result = view_factors(Packing([[0, 0, 0]], 0.7, walls=walls), rays=RAYS, seed=6)
    near, far = (0.5 * (1.0 - 1.0 / np.sqrt(1.0 + h**-2)) for h in (1.0, 2.5))
    exact = np.array([near, 1.0 - near - far, far])
    assert near == pytest.approx(0.1464466, abs=1e-7)
    assert (np.abs(result.wall_factors[0] - exact) < 4 * result.wall_stderr[0]).all()
    assert (result.wall_stderr[0] < 1.2e-3).all()
    assert result.wall_factors[0].sum() == pytest.approx(1.0, abs=1e-15)
    assert result.escaped[0] == 0.0


def test_rays_at_the_distance_limit_are_in_the_bed_or_out_of_it():
    """In the bed: between the outermost spheres, or with a wall still ahead."""
    pair = Packing([[0, 0, 0], [3, 0, 0]], 1.0, walls=[Plane((0, 0, -2), (0, 0, 1))])
    free = view_factors(pair, rays=20_000)
    assert (free.environment == 0.0).all()
    assert (free.environment_stderr == 0.0).all()
    near = view_factors(pair, rays=20_000, max_distance=0.99)
    assert near.factors.nnz == 0
    assert near.wall_factors.sum() == 0.0
    np.testing.assert_allclose(near.escaped + near.environment, 1.0, rtol=0, atol=1e-15)
    rng = np.random.default_rng(5)
    normal, turn = rng.normal(size=(2, 200_000, 3))
    normal, turn = (v / np.linalg.norm(v, axis=1)[:, None] for v in (normal, turn))
    ray = (normal + turn) / np.linalg.norm(normal + turn, axis=1)[:, None]
    end = normal + 0.99 * ray
    inside = (end[:, 0] > -1) & (end[:, 0] < 4) & (abs(end[:, 1:]) < 1).all(axis=1)
    assert near.environment[0] == pytest.approx((inside | (ray[:, 2] < 0)).mean(), abs=0.005)
    far = view_factors(pair, rays=20_000, max_distance=1e9)
    assert (far.factors != free.factors).nnz == 0


def test_overlapping_pair_against_its_exposed_caps():
    """Equal spheres at distance d bury a cap of (1 - d / 2r) / 2 of each; the rest sees less."""
    d = 1.6
    result = view_factors(Packing([[0, 0, 0], [d, 0, 0]], 1.0), rays=RAYS, seed=2)
    buried = 0.5 * (1.0 - 0.5 * d)
    error = np.sqrt(buried * (1 - buried) / RAYS)
    np.testing.assert_allclose(result.buried, buried, atol=4 * error)
    np.testing.assert_allclose(result.areas, 4 * np.pi * (1 - result.buried), rtol=1e-14)
    # The exposed surfaces see each other around the seam.
    assert 0.03 < result.factors[0, 1] < 0.12


def test_half_behind_a_wall():
    half = Packing([[0, 0, 0]], 1.0, walls=[Plane((0, 0, 0), (0, 0, 1))])
    result = view_factors(half, rays=RAYS, seed=2)
    assert result.buried[0] == pytest.approx(0.5, abs=4 * 0.5 / np.sqrt(2 * RAYS))
    # Surface tilted by t sees (1 - cos t) / 2 of the plane; the mean over the upper half is 1/4.
    assert abs(result.wall_factors[0, 0] - 0.25) < 4 * result.wall_stderr[0, 0]


def test_standard_error_of_small_counts():
    n = 10_000
    none, one = standard_error([0, 1], n)
    assert 0.5 / n < none < 2.0 / n
    assert 1.0 / n < one < 2.0 / n
    assert standard_error(2500, n) == pytest.approx(np.sqrt(0.25 * 0.75 / n), rel=1e-3)
    assert standard_error(n, n) == pytest.approx(none)
