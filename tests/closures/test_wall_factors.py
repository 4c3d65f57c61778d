"""Spheres and walls: exact shares against quadrature and the trace, markers, balanced beds."""

import numpy as np
import pytest

from greybed.closures import ViewFactorClosure
from greybed.closures.viewfactor import neighbourhood
from greybed.closures.viewfactor.limits import check_limits
from greybed.closures.viewfactor.walls import disc_share, free_shares, rectangle_share, wall_markers
from greybed.core import Cylinder, Packing, Plane
from greybed.datasets.containers import Box, CylinderContainer
from greybed.datasets.generate import Mono, random_packing
from greybed.raytrace import view_factors

FLOOR = Plane((0, 0, 0), (0, 0, 1), "floor")


def test_rectangles():
    inf = np.inf
    plane = rectangle_share(np.array([-inf, -inf]), np.array([inf, inf]), np.array(2.0))
    assert float(plane) == pytest.approx(0.5, abs=1e-14)
    # A square of edge 2 seen from the centre of a cube of edge 2: one of six faces.
    face = rectangle_share(np.array([-1.0, -1.0]), np.array([1.0, 1.0]), np.array(1.0))
    assert float(face) == pytest.approx(1 / 6, abs=1e-15)
    # Away from its foot: the integral of cos / (4 pi l^2) by a fine midpoint rule.
    x = 1.0 + 2.0 * (np.arange(800) + 0.5) / 800
    y = -0.5 + 3.0 * (np.arange(800) + 0.5) / 800
    l2 = x[:, None] ** 2 + y**2 + 0.7**2
    rule = (0.7 / l2**1.5).sum() * (2.0 / 800) * (3.0 / 800) / (4.0 * np.pi)
    off = rectangle_share(np.array([1.0, -0.5]), np.array([3.0, 2.5]), np.array(0.7))
    assert float(off) == pytest.approx(rule, rel=1e-5)


def test_discs():
    # On the axis in closed form (Howell's catalogue, sphere to coaxial disc).
    assert float(disc_share(np.array(0.0), np.array(1.0), 1.0)) == pytest.approx(
        0.5 * (1.0 - np.sqrt(0.5)), abs=1e-15
    )
    # Off the axis: the element cos / (4 pi l^2) summed over the disc.
    rho = np.sqrt((np.arange(1000) + 0.5) / 1000)
    turn = 2.0 * np.pi * (np.arange(1000) + 0.5) / 1000
    l2 = (rho[:, None] * np.cos(turn) - 0.5) ** 2 + (rho[:, None] * np.sin(turn)) ** 2 + 0.3**2
    rule = np.pi * (0.3 / l2**1.5).mean() / (4.0 * np.pi)
    assert float(disc_share(np.array(0.5), np.array(0.3), 1.0)) == pytest.approx(rule, rel=1e-4)


CONTAINERS = {
    "plane": (FLOOR,),
    "floor and lid": (FLOOR, Plane((0, 0, 9), (0, 0, -1), "lid")),
    "corner": (FLOOR, Plane((-2, 0, 0), (1, 0, 0), "x"), Plane((0, -3, 0), (0, 1, 0), "y")),
    "tube": (Cylinder((0, 0, 0), (0, 0, 1), 4.0), FLOOR, Plane((0, 0, 7), (0, 0, -1), "lid")),
}


@pytest.mark.parametrize("name", list(CONTAINERS))
def test_free_shares_are_those_of_the_trace(name):
    one = Packing([[1.0, -0.5, 1.3]], 1.0, walls=CONTAINERS[name])
    traced = view_factors(one, rays=200_000, seed=3)
    exact = free_shares(one, np.array([0]))
    assert (np.abs(exact - traced.wall_factors) < 4.5 * traced.wall_stderr).all()


def test_oblique_walls_have_no_closed_form():
    walls = (FLOOR, Plane((-5, 0, 0), (1, 0, 1), "slope"))
    assert free_shares(Packing([[1.0, -0.5, 1.3]], 1.0, walls=walls), np.array([0])) is None


@pytest.mark.parametrize("container", [Box(), CylinderContainer()])
def test_markers_explain_the_walls(container):
    bed = random_packing(200, 0.45, Mono(1.0), container=container, seed=2)
    m = wall_markers(bed, neighbourhood(bed, 10.0), 10.0, 0.45)
    traced = view_factors(bed, rays=20_000, seed=1)
    error = m.wall_share * (1.0 - m.blocked_fraction) - traced.wall_factors
    assert np.sqrt((error**2).mean()) < 0.005
    assert (m.distance_over_radius >= 1.0).all()
    one = wall_markers(bed, neighbourhood(bed, 10.0), 10.0, 0.45, threads=1)
    np.testing.assert_array_equal(one.blocked_fraction, m.blocked_fraction)


@pytest.mark.parametrize("kind", ["mlp", "forest"])
def test_limits_hold_untrained(kind):
    closure = ViewFactorClosure.untrained(kind, "wall", seed=2)
    assert closure.quantity == "wallfactor"
    cases = check_limits(closure, n=3000)
    assert len(cases) == 5
    assert [case.name for case in cases if not case.passed] == []

    def leaky(**markers):
        return 0.999 * closure.evaluate(**markers)

    failed = [case.name for case in check_limits(closure, leaky, n=500) if not case.passed]
    assert "infinite plane, nothing between: 1/2" in failed


@pytest.mark.parametrize("with_walls", [False, True])
def test_factors_of_a_bed_are_balanced(with_walls):
    bed = random_packing(200, 0.45, Mono(1.0), container=Box(), seed=2)
    wall = ViewFactorClosure.untrained("mlp", "wall") if with_walls else None
    rows = ViewFactorClosure.untrained().factors(bed, wall_closure=wall, reach=8.0)
    assert rows.imbalance < 1e-12
    assert (rows.wall_factors >= 0.0).all()
    assert rows.wall_factors.shape == (200, 6)
