"""Beds that nobody plans for: one sphere, far apart, far off, tiny, huge, given twice."""

import numpy as np
import pytest

from greybed.closures import ViewFactorClosure
from greybed.closures.viewfactor.bed import inner_fraction
from greybed.core import GreybedError, InputError, Packing
from greybed.core.packing import RESOLUTION
from greybed.core.sizes import parse_sizes
from greybed.datasets.generate import random_packing
from greybed.raytrace import view_factors


@pytest.fixture(scope="module")
def closures():
    return [ViewFactorClosure.untrained(kind, "pencil", 2) for kind in ("mlp", "forest")]


def of_bed(closures, packing):
    beds = [closure.bed_factors(packing) for closure in closures]
    return [(bed.factors.toarray(), bed.escaped, bed.wall_factors) for bed in beds]


BED = random_packing(60, 0.4, parse_sizes("lognormal:1mm,1.3"), seed=1)


# nm and km; and lengths whose powers leave the range of doubles if squared once too often.
@pytest.mark.parametrize("scale", [1e-6, 1e6, 1e-25, 1e25])
@pytest.mark.parametrize("periodic", [True, False])
def test_scale_changes_nothing(closures, scale, periodic):
    wraps = (periodic,) * 3
    one = Packing(BED.centres, BED.radii, BED.box if periodic else None, wraps)
    box = BED.box * scale if periodic else None
    scaled = Packing(BED.centres * scale, BED.radii * scale, box, wraps)
    for before, after in zip(of_bed(closures, one), of_bed(closures, scaled), strict=True):
        for a, b in zip(before, after, strict=True):
            np.testing.assert_allclose(b, a, rtol=1e-9, atol=1e-13)
    first, second = (view_factors(p, rays=2000, seed=1) for p in (one, scaled))
    # Rounding may turn a ray that grazes.
    assert abs(first.factors - second.factors).max() <= 2 / 2000


def test_an_offset_of_a_million_radii_changes_nothing(closures):
    one = Packing(BED.centres, BED.radii)
    moved = Packing(BED.centres + 1e3 * np.array([1.0, 0.3, -0.7]), BED.radii)
    for before, after in zip(of_bed(closures, one), of_bed(closures, moved), strict=True):
        for a, b in zip(before, after, strict=True):
            np.testing.assert_allclose(b, a, rtol=1e-6, atol=1e-9)
    first, second = (view_factors(p, rays=2000, seed=1) for p in (one, moved))
    assert abs(first.factors - second.factors).max() <= 2 / 2000


def test_an_offset_that_blurs_the_spheres_is_refused():
    with pytest.raises(InputError, match=r"sphere 0: coordinates up to 1e\+14 .* origin"):
        Packing([[1e14, 0, 0]], 1.0)
    x = 2.0**52 * RESOLUTION / 4
    Packing([[x, 0, 0]], 1.0)


def test_one_sphere_sees_only_the_outside(closures):
    one = Packing([[0, 0, 0]], 1.0)
    traced = view_factors(one, rays=100)
    assert traced.escaped.tolist() == [1.0]
    assert traced.factors.nnz == 0
    for factors, escaped, _ in of_bed(closures, one):
        assert factors.tolist() == [[0.0]]
        assert escaped.tolist() == [1.0]


def test_two_spheres_have_the_exact_factor(closures):
    pair = Packing([[0, 0, 0], [2, 0, 0]], 1.0)
    for factors, escaped, _ in of_bed(closures, pair):
        np.testing.assert_allclose(factors[[0, 1], [1, 0]], 0.0755868184216, rtol=1e-12)
        np.testing.assert_allclose(escaped, 1.0 - 0.0756, atol=0.05)


def test_two_spheres_a_million_radii_apart(closures):
    pair = Packing([[0, 0, 0], [1e6, 0, 0]], 1.0)
    assert view_factors(pair, rays=1000).escaped.tolist() == [1.0, 1.0]
    for factors, escaped, _ in of_bed(closures, pair):
        assert factors.max() == 0.0
        np.testing.assert_allclose(escaped, 1.0, atol=0.01)
    for closure in closures:  # and where they are asked for
        factors = closure.bed_factors(pair, reach=2e6, solid_fraction=0.1).factors
        np.testing.assert_allclose(factors[0, 1], 2.5e-13, rtol=1e-6)


def test_a_sphere_given_twice_is_named(closures):
    twice = Packing([[0, 0, 0], [5, 0, 0], [0, 0, 0]], 1.0, source="bed.csv")
    with pytest.raises(InputError, match=r"bed\.csv: spheres 0 and 2 are the same sphere twice"):
        view_factors(twice, rays=10)
    with pytest.raises(GreybedError, match=r"bed\.csv: spheres 0 and 2 have one centre"):
        closures[0].bed_factors(twice)


@pytest.mark.parametrize("reach", [0.0, -1.0, np.nan, np.inf])
def test_a_reach_that_is_none(closures, reach):
    with pytest.raises(GreybedError, match=r"reach = .* must be finite and above 0"):
        closures[0].bed_factors(BED, reach=reach)


def test_a_ball_inside_one_great_sphere_is_solid():
    """Many small spheres on a great one, which holds the whole ball where they are densest."""
    rng = np.random.default_rng(0)
    centres = np.concatenate([[[0, 0, 0]], 40.0 + 30.0 * rng.random((200, 3))])
    fraction = inner_fraction(Packing(centres, np.concatenate([[30.0], np.full(200, 0.1)])))
    assert 0.0 < fraction <= 1.0
    alone = Packing([[0, 0, 0], [0.5, 0, 0]], [30.0, 1e-3])
    assert 0.0 < inner_fraction(alone) <= 1.0


def test_nothing_is_met_where_no_ray_may_go_far():
    result = view_factors(Packing([[0, 0, 0], [2.1, 0, 0]], 1.0), rays=500, max_distance=0.05)
    assert (result.escaped + result.environment).tolist() == [1.0, 1.0]
