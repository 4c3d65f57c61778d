"""Sides of spheres: their profile against quadrature, sums that leave view factors alone."""

import numpy as np
import pytest
from scipy.sparse import csr_matrix

from greybed.core import InputError, Packing, Plane
from greybed.core.diffuse import diffuse_exchange
from greybed.core.exact import exact_view_factor
from greybed.core.rows import Rows, balanced
from greybed.core.sides import directions, element_to_sphere

FLOOR = Plane((0, 0, 0), (0, 0, 1), "floor")


@pytest.mark.parametrize(("r_k", "distance"), [(1.0, 2.0), (1.0, 2.5), (0.2, 1.3), (3.0, 4.0)])
@pytest.mark.parametrize("cosine", [1.0, 0.8, 0.4, 0.1, -0.2, -0.5, -1.0])
def test_the_profile_is_the_integral_over_the_hemisphere(cosine, r_k, distance):
    sine = np.sqrt(1.0 - cosine**2)
    place = np.array([sine, 0.0, cosine])
    # Directions from the element by a cosine law: equal shares of what leaves it.
    m = 400
    u, v = np.meshgrid((np.arange(m) + 0.5) / m, 2.0 * np.pi * (np.arange(m) + 0.5) / m)
    across = np.cross(place, [0.0, 1.0, 0.0])
    rays = (
        np.sqrt(1.0 - u)[..., None] * place
        + (np.sqrt(u) * np.cos(v))[..., None] * across
        + (np.sqrt(u) * np.sin(v))[..., None] * np.array([0.0, 1.0, 0.0])
    )
    to = np.array([0.0, 0.0, distance]) - place
    along = rays @ to
    hit = (along > 0.0) & (to @ to - along**2 < r_k**2)
    factor = element_to_sphere(np.array(cosine), 1.0, np.array(r_k), np.array(distance))
    assert factor == pytest.approx(hit.mean(), abs=2e-3)


@pytest.mark.parametrize(("r_k", "distance"), [(1.0, 2.0), (1.0, 4.0), (0.3, 1.5), (5.0, 6.0)])
def test_the_mean_profile_is_the_exact_factor_of_the_pair(r_k, distance):
    cosine = directions(20_000)[:, 2]
    mean = element_to_sphere(cosine, 1.0, np.array(r_k), np.array(distance)).mean()
    assert mean == pytest.approx(float(exact_view_factor(1.0, r_k, distance)), rel=1e-3)


@pytest.fixture
def row():
    """Three spheres in a row on a floor, the middle one hides the outer ones from each other."""
    packing = Packing([[0, 0, 1], [2, 0, 1], [4, 0, 1]], 1.0, walls=[FLOOR])
    near = float(exact_view_factor(1.0, 1.0, 2.0))
    f = csr_matrix([[0.0, near, 0.01], [near, 0.0, near], [0.01, near, 0.0]])
    walls = np.array([[0.4], [0.38], [0.4]])
    escaped = 1.0 - walls[:, 0] - np.asarray(f.sum(axis=1)).ravel()
    return packing, balanced(Rows(f, walls, escaped, packing.areas))


@pytest.mark.parametrize("sides", [2, 24, 100])
def test_black_spheres_keep_their_view_factors(sides, row):
    packing, view = row
    rows = diffuse_exchange(view, 1.0, packing=packing, sides=sides).rows()
    np.testing.assert_allclose(rows.factors.toarray(), view.factors.toarray(), rtol=1e-11)
    np.testing.assert_allclose(rows.wall_factors, view.wall_factors, rtol=1e-11)


@pytest.mark.parametrize("emissivity", [0.01, 0.5, np.array([0.2, 0.9, 0.5])])
def test_sums_reciprocity_and_heats(emissivity, row):
    packing, view = row
    bed = diffuse_exchange(view, emissivity, packing=packing, wall_emissivity=0.5)
    rows = bed.rows()
    np.testing.assert_allclose(rows.sums, 1.0, rtol=0, atol=1e-10)
    assert rows.imbalance < 1e-10
    direct = np.broadcast_to(emissivity, 3) * view.factors.toarray()
    assert (rows.factors.toarray() >= direct - 1e-12).all()
    q = bed.heats([900.0, 100.0, 400.0], 300.0, 200.0)
    seen = rows.factors @ [900.0, 100.0, 400.0] + rows.wall_factors[:, 0] * 300.0
    seen = seen + rows.escaped * 200.0
    expected = bed.emission_areas * ([900.0, 100.0, 400.0] - seen)
    np.testing.assert_allclose(q.spheres, expected, rtol=0, atol=1e-7)
    total = np.abs(q.spheres).sum() + np.abs(q.walls).sum() + abs(q.opening)
    assert abs(q.spheres.sum() + q.walls.sum() + q.opening) < 1e-12 * total


def test_light_goes_back_to_where_it_came_from(row):
    packing, view = row
    one = diffuse_exchange(view, 0.3, packing=packing, sides=1).rows().factors
    many = diffuse_exchange(view, 0.3, packing=packing, sides=96).rows().factors
    assert many[0, 0] > 1.5 * one[0, 0]
    assert many[0, 2] < one[0, 2]  # by way of the middle one


def test_what_is_refused(row):
    packing, view = row
    with pytest.raises(InputError, match=r"sides = 0 .* 1 \.\.\. 1000"):
        diffuse_exchange(view, 0.5, packing=packing, sides=0)
    other = Packing([[0, 0, 1], [2, 0, 1]], 1.0, walls=[FLOOR])
    with pytest.raises(InputError, match=r"for 3 spheres and 1 walls, but .* has 2 and 1"):
        diffuse_exchange(view, 0.5, packing=other)
