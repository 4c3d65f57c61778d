"""Markers of real packings: counts, the pencil, symmetry, continuity, and that they explain V."""

import numpy as np
import pytest
from scipy.integrate import trapezoid

from greybed.closures.viewfactor import exact_view_factor, neighbourhood, pair_markers
from greybed.closures.viewfactor.bed import bed_factors, inner_fraction
from greybed.closures.viewfactor.closure import ViewFactorClosure
from greybed.closures.viewfactor.markers import pencil_lines
from greybed.core import Packing, Plane, box_walls
from greybed.core.sizes import LogNormal
from greybed.datasets.generate import random_packing
from greybed.datasets.lattices import lattice
from greybed.raytrace import view_factors


def markers_of(packing, i, j, reach):
    hood = neighbourhood(packing, reach)
    chosen = (hood.owner == i) & (hood.sphere == j) & hood.within
    assert chosen.sum() == 1
    return pair_markers(packing, hood, chosen, solid_fraction=0.5)


def test_nothing_between_two_spheres():
    m = markers_of(Packing([[0, 0, 0], [5, 0, 0], [2.5, 2.01, 0]], 1.0), 0, 1, 6.0)
    assert m.n_between[0] == 0
    assert m.blocked_fraction[0] == 0.0
    assert m.radius_over_distance[0] == 0.2


def test_collinear_triple_is_wholly_blocked():
    m = markers_of(Packing([[0, 0, 0], [4, 0, 0], [2, 0, 0]], 1.0), 0, 1, 6.0)
    assert m.n_between[0] == 1
    assert m.blocked_fraction[0] > 0.97  # the soft rim lets the outermost lines graze by
    assert m.blockers_per_line[0] == pytest.approx(m.blocked_fraction[0])


def test_two_separate_blockers_add_up():
    near, far = [2.5, 0.9, 0.0], [5.5, -0.9, 0.0]
    both = Packing([[0, 0, 0], [8, 0, 0], near, far], [1.0, 1.0, 0.5, 0.5])
    m = markers_of(both, 0, 1, 9.0)
    assert m.whole_between[0] == 2
    # Each covers the part of the hull's section, a disc of radius 1, that a disc of radius 0.5
    # at 0.9 from its centre shares with it: an integral by hand.
    x = np.linspace(0.4, 1.0, 200_001)
    shared = 2.0 * np.minimum(np.sqrt(1.0 - x**2), np.sqrt(np.maximum(0.25 - (x - 0.9) ** 2, 0.0)))
    assert m.n_between[0] == pytest.approx(2.0 * trapezoid(shared, x) / np.pi, rel=1e-6)
    assert 0.0 < m.blocked_fraction[0] <= m.blockers_per_line[0] + 1e-12


def test_lines_spread_evenly():
    lines = pencil_lines()
    assert lines.shape == (128, 5)
    np.testing.assert_allclose(lines[:, 3] ** 2 + lines[:, 4] ** 2, 1.0, rtol=1e-14)
    np.testing.assert_allclose(lines[:, :3].mean(axis=0), [0.5, 0.5, 0.0], atol=0.05)


def test_markers_do_not_depend_on_who_asks():
    packing = random_packing(120, 0.4, LogNormal(1.0, 1.4), seed=2)
    hood = neighbourhood(packing, 6.0)
    m = pair_markers(packing, hood)
    there = {}
    for k, at in enumerate(np.flatnonzero(hood.within)):
        there[(int(hood.owner[at]), int(hood.sphere[at]), *hood.image[at])] = k
    for (i, j, x, y, z), k in list(there.items())[:3000]:
        back = there[(j, i, -x, -y, -z)]
        assert m.whole_between[k] == m.whole_between[back]
        # Sums run over the blockers in another order: rounding only.
        assert m.n_between[k] == pytest.approx(m.n_between[back], rel=1e-10)
        assert m.blocked_fraction[k] == pytest.approx(m.blocked_fraction[back], abs=1e-12)
        assert m.blockers_per_line[k] == pytest.approx(m.blockers_per_line[back], abs=1e-12)


def test_blocked_fraction_follows_a_moving_blocker_without_jumps():
    heights = np.linspace(0.0, 2.2, 1101)
    values = []
    for h in heights:
        values.append(
            markers_of(Packing([[0, 0, 0], [6, 0, 0], [3, h, 0]], 1.0), 0, 1, 7.0).blocked_fraction[
                0
            ]
        )
    steps = np.abs(np.diff(values))
    # With hard rims a line of the mean weight, 1/128 = 0.008, would go at once, and neighbours
    # with it.
    assert steps.max() < 0.01
    assert values[-1] == 0.0
    assert values[0] > 0.9


def test_the_pencil_alone_explains_the_trace():
    packing = random_packing(250, 0.45, LogNormal(1.0, 1.3), seed=4, shake=20)
    hood = neighbourhood(packing, 5.0)
    m = pair_markers(packing, hood)
    i, j = hood.owner[hood.within], hood.sphere[hood.within]
    exact = exact_view_factor(packing.radii[i], packing.radii[j], hood.distance[hood.within])
    traced = view_factors(packing, rays=20_000).factors.toarray()
    # In this box a pair within five radii is its own nearest image.
    factor = traced[i, j]
    predicted = exact * (1.0 - m.blocked_fraction)
    spread = ((factor - factor.mean()) ** 2).sum()
    assert 1.0 - ((factor - predicted) ** 2).sum() / spread > 0.99


def test_neighbourhood_sees_periodic_images():
    packing = lattice("sc", 3, 1.0)
    hood = neighbourhood(packing, 2.0 * np.sqrt(3) + 1e-9)
    counts = np.bincount(hood.owner[hood.within])
    assert (counts == 6 + 12 + 8).all()
    near = hood.distance < 2.0 + 1e-9
    assert near.sum() == 6 * len(packing)


def test_bed_rows_are_reciprocal_and_near_one():
    packing = random_packing(400, 0.5, LogNormal(1.0, 1.2), seed=1)
    rows = bed_factors(ViewFactorClosure.untrained("mlp", "pencil", 1), packing, reach=5.0)
    exchange = rows.factors.toarray() * rows.areas[:, None]
    np.testing.assert_allclose(exchange, exchange.T, rtol=1e-13)
    assert (rows.escaped == 0.0).all()


def test_walls_take_what_the_rows_leave():
    packing = random_packing(300, 0.5, LogNormal(1.0, 1.2), seed=1)
    open_bed = Packing(packing.centres, packing.radii)
    low = float((packing.centres[:, 2] - packing.radii).min())
    floored = Packing(packing.centres, packing.radii, walls=[Plane((0, 0, low), (0, 0, 1))])
    closure = ViewFactorClosure.untrained()
    a, b = bed_factors(closure, open_bed), bed_factors(closure, floored)
    lowest = int(packing.centres[:, 2].argmin())
    highest = int(packing.centres[:, 2].argmax())
    assert b.wall_factors[lowest, 0] > 0.2
    # A sphere on top sees the unbounded floor past the bed's sides, but less than the lowest.
    assert b.wall_factors[highest, 0] < 0.5 * b.wall_factors[lowest, 0]
    # What the floor takes would have escaped without it; its free share is exact, one half, and
    # not counted, so that half a line of 4096 stays.
    assert a.escaped[lowest] == pytest.approx(
        b.escaped[lowest] + b.wall_factors[lowest, 0], abs=1e-3
    )


def test_bounded_walls_take_as_much_as_unbounded_ones():
    packing = random_packing(200, 0.5, LogNormal(1.0, 1.2), seed=1)
    # Some spheres stick a little way through the walls.
    room = 0.9 * packing.radii.max()
    low, high = packing.centres.min() - room, packing.centres.max() + room
    sides = [Plane((low,) * 3, axis) for axis in np.eye(3)]
    sides += [Plane((high,) * 3, -axis) for axis in np.eye(3)]
    box = box_walls((low,) * 3, (high,) * 3)
    closure = ViewFactorClosure.untrained()
    a, b = (
        bed_factors(closure, Packing(packing.centres, packing.radii, walls=walls))
        for walls in (sides, box)
    )
    assert b.escaped.max() < 1e-12
    np.testing.assert_allclose(b.wall_factors, a.wall_factors[:, [0, 3, 1, 4, 2, 5]], atol=1e-12)


def test_inner_fraction_of_a_known_bed():
    packing = random_packing(2000, 0.55, LogNormal(1.0, 1.1), seed=3)
    assert inner_fraction(packing) == pytest.approx(0.55)
    # The same bed without its periodicity must be measured in its interior.
    assert inner_fraction(Packing(packing.centres, packing.radii)) == pytest.approx(0.55, abs=0.02)
