"""Exchange factors: conservation, reciprocity, limits, published lattice values, honest errors."""

import numpy as np
import pytest

from greybed.core import Cylinder, InputError, Packing, Plane
from greybed.datasets.lattices import lattice
from greybed.raytrace import (
    _paths,
    _streams,
    breitbach_barthels,
    exchange_factors,
    exchange_of_rays,
    first_hits,
    radiative_exchange_factor,
    view_factors,
)


def box(low, high):
    """Six planes around a box, names by axis and side."""
    walls = []
    for axis in range(3):
        for point, sign in ((low, 1.0), (high, -1.0)):
            normal = [0.0, 0.0, 0.0]
            normal[axis] = sign
            walls.append(Plane(tuple(point), tuple(normal), f"{'xyz'[axis]}{sign:+.0f}"))
    return walls


@pytest.fixture(scope="module")
def crowd():
    """Twelve spheres of two sizes between grey walls, one of them a cylinder."""
    rng = np.random.default_rng(5)
    cells = np.stack(np.meshgrid(*[np.arange(3)] * 3, indexing="ij"), -1).reshape(-1, 3)
    centres = 2.2 * (cells[rng.permutation(27)[:12]] - 1.0)
    walls = [
        Plane((0, 0, -3.3), (0, 0, 1), "floor"),
        Plane((0, 0, 3.3), (0, 0, -1), "lid"),
        Cylinder((0, 0, 0), (0, 0, 1), 4.5, "shell"),
    ]
    return Packing(centres, rng.choice([0.7, 1.05], 12), walls=walls)


@pytest.fixture(scope="module")
def fcc():
    bed = lattice("fcc", 2, 1.0)
    return bed, exchange_factors(
        bed, [0.3, 0.65, 0.8, 0.9, 1.0], rays=300_000, emitters=[0], images=True
    )


def test_rows_sum_to_one_and_are_reciprocal(crowd):
    rng = np.random.default_rng(1)
    sets = [rng.uniform(0.2, 1.0, 12), 0.4]
    results = exchange_factors(
        crowd, sets, rays=20_000, wall_emissivity=[[0.3, 0.8, 0.0], [1.0, 0.5, 0.6]],
        specular=rng.uniform(0.0, 1.0, 12), wall_specular=[0.2, 0.0, 0.7],
    )  # fmt: skip
    for result in results:
        total = result.factors.sum(axis=1) + result.wall_factors.sum(axis=1) + result.escaped
        assert abs(total - 1.0).max() < 1e-12
        assert result.cut == 0.0
        assert result.escaped.max() == 0.0
        sent = result.emission_areas[:, None] * result.factors.toarray()
        error = result.emission_areas[:, None] * result.stderr.toarray()
        sigma = (sent - sent.T) / np.sqrt(error**2 + error.T**2 + 1e-30)
        upper = sigma[np.triu_indices(12, 1)]
        assert 0.7 < np.sqrt((upper**2).mean()) < 1.3  # 66 pairs: the spread of unit normals
    assert results[0].wall_factors[:, 2].max() == 0.0  # it absorbs nothing


def _starts(sphere, rays, seed, centre, radius):
    """Origins and directions of the rays that a trace sends from a sphere."""
    golden, first, whole = int(_streams.GOLDEN), int(_streams.MIX_1), 2**64
    turn = int(_streams.mix(np.uint64((sphere + golden) % whole)))
    stream = int(_streams.mix(np.uint64((seed * first + turn) % whole)))
    origins, directions = np.empty((rays, 3)), np.empty((rays, 3))
    for ray in range(rays):
        state = _streams.mix(np.uint64((stream + ray * golden) % whole))
        *directions[ray], px, py, pz, _ = _streams.emit(np.uint64(state))
        origins[ray] = centre + radius * np.array([px, py, pz])
    return origins, directions


def test_black_surfaces_absorb_what_they_meet_first(crowd):
    rays, sphere, seed = 5_000, 3, 7
    (black,) = exchange_factors(crowd, 1.0, rays=rays, seed=seed, emitters=[sphere])
    # The same rays, one flight each.
    origins, directions = _starts(sphere, rays, seed, crowd.centres[sphere], crowd.radii[sphere])
    _, hit = first_hits(crowd, origins, directions)
    count = np.bincount(hit[hit >= 0], minlength=12)
    np.testing.assert_array_equal(black.factors[[sphere]].toarray()[0] * rays, count)
    walls = np.bincount(-1 - hit[hit < 0], minlength=3)
    np.testing.assert_allclose(black.wall_factors[sphere] * rays, walls, rtol=1e-14)


def test_errors_of_black_surfaces_are_those_of_view_factors(crowd):
    black, traced = exchange_factors(crowd, 1.0, rays=4_000)[0], view_factors(crowd, rays=4_000)
    off = (black.factors - traced.factors).toarray()
    error = np.hypot(black.stderr.toarray(), traced.stderr.toarray())
    assert (abs(off) <= 4.5 * error).all()


# Reflecting Monte Carlo, made independently of this code (two digits of error bar below 0.3 %).
NEAREST = {0.3: 0.0169, 0.65: 0.0409, 0.8: 0.0531, 0.9: 0.0621}
MACROSCOPIC = {0.3: 0.229, 0.65: 0.502, 0.8: 0.646, 0.9: 0.754, 1.0: 0.874}


def test_nearest_pair_of_the_fcc_lattice(fcc):
    bed, results = fcc
    for result in results:
        eps, pairs = result.emissivity[0], result.pairs
        apart = bed.centres[pairs.target] + pairs.image * bed.edges - bed.centres[pairs.emitter]
        distance = np.linalg.norm(apart, axis=1)
        near = abs(distance - 2.0) < 1e-6
        assert near.sum() == 12
        mean = eps * pairs.factor[near].mean()
        error = eps * np.sqrt((pairs.stderr[near] ** 2).sum()) / 12.0
        if eps < 1.0:  # the reference is rounded to four digits
            assert abs(mean - NEAREST[eps]) < 4.0 * error + 6e-5
            assert abs(mean / NEAREST[eps] - 1.0) < 0.01
        own = pairs.factor[distance < 1e-6].sum()
        if eps == 0.65:
            assert abs(own - 0.122) < 1e-3
        np.testing.assert_allclose(
            result.factors[[0]].toarray()[0],
            np.bincount(pairs.target, pairs.factor, len(bed)),
            rtol=1e-12,
        )


def test_macroscopic_factor_of_the_fcc_lattice(fcc):
    bed, results = fcc
    for result in results:
        value = radiative_exchange_factor(bed, result)
        known = MACROSCOPIC[result.emissivity[0]]
        assert abs(value.factor - known) < 4.0 * value.stderr + 6e-4
        # The same from pairs and their images.
        pairs = result.pairs
        apart = bed.centres[pairs.target] + pairs.image * bed.edges - bed.centres[pairs.emitter]
        total = (pairs.factor * (apart**2).sum(axis=1)).sum()
        again = bed.solid_fraction * result.emissivity[0] * total / 4.0
        assert abs(again / value.factor - 1.0) < 1e-10


def test_straight_channels_of_the_simple_cubic_lattice_carry_far():
    """1.184 is the sum over 17 x 17 x 17 spheres; light in the channels between adds 1.5 %."""
    bed = lattice("sc", 1, 1.0)
    (black,) = exchange_factors(bed, 1.0, rays=2_000_000, images=True)
    pairs = black.pairs
    share = pairs.factor * (pairs.image**2).sum(axis=1)  # in diameters
    near = abs(pairs.image).max(axis=1) <= 8
    within = bed.solid_fraction * share[near].sum()
    assert abs(within / 1.184 - 1.0) < 0.005
    value = radiative_exchange_factor(bed, black)
    assert 1.190 < value.factor < 1.212
    # The first neighbours as by exact quadrature.
    first = (pairs.image**2).sum(axis=1) == 1
    exact = 0.0755868184216
    assert abs(pairs.factor[first].mean() - exact) < 4.0 * pairs.stderr[first].mean() / 6**0.5


def test_correlation_of_pebble_beds():
    # By hand: psi = 0.39, epsilon = 0.8, B = 2.0546.
    assert breitbach_barthels(0.39, 0.8) == pytest.approx(0.859488, abs=1e-6)
    first_term = (1.0 - 0.61**0.5) * 0.39
    assert breitbach_barthels(0.39, 0.8, 1e-12) == pytest.approx(first_term, rel=1e-9)
    with pytest.raises(InputError, match="void_fraction"):
        breitbach_barthels(1.0, 0.8)


def test_many_emissivities_are_as_good_as_one(crowd):
    walls = {"wall_emissivity": 0.7, "rays": 20_000}
    together = exchange_factors(crowd, [0.2, 0.6], **walls)[1]
    alone = exchange_factors(crowd, 0.6, seed=1, **walls)[0]
    off = (together.factors - alone.factors).toarray()
    sigma = off / np.hypot(together.stderr.toarray(), alone.stderr.toarray()).clip(1e-12)
    assert 0.75 < np.sqrt((sigma**2).mean()) < 1.25


def test_errors_are_those_of_repeated_traces(crowd):
    traces = [
        exchange_factors(crowd, 0.5, rays=500, seed=s, emitters=[0], wall_emissivity=0.5)[0]
        for s in range(150)
    ]
    values = np.stack([t.factors[[0]].toarray()[0] for t in traces])
    stated = np.sqrt(np.stack([t.stderr[[0]].toarray()[0] ** 2 for t in traces]).mean(axis=0))
    common = values.mean(axis=0) > 0.02
    assert common.sum() >= 4
    # The spread of 150 traces is known to 6 %; pseudo-counts add up to a tenth.
    ratio = stated[common] / values.std(axis=0, ddof=1)[common]
    assert (ratio > 0.8).all()
    assert (ratio < 1.3).all()
    walls = np.stack([t.wall_factors[0] for t in traces])
    stated = np.sqrt(np.stack([t.wall_stderr[0] ** 2 for t in traces]).mean(axis=0))
    np.testing.assert_allclose(stated / walls.std(axis=0, ddof=1), 1.0, atol=0.2)


def test_threads_and_emitters_change_no_bit(crowd):
    ask = {"rays": 40_000, "wall_emissivity": 0.5, "specular": 0.3}
    one = exchange_factors(crowd, [0.3, 0.9], threads=1, **ask)
    two = exchange_factors(crowd, [0.3, 0.9], threads=3, **ask)
    for a, b in zip(one, two, strict=True):
        for name in ("wall_factors", "wall_stderr", "escaped", "spread", "spread_stderr"):
            np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
        np.testing.assert_array_equal(a.factors.toarray(), b.factors.toarray())
        np.testing.assert_array_equal(a.stderr.toarray(), b.stderr.toarray())
    some = exchange_factors(crowd, [0.3, 0.9], emitters=[5], **ask)[0]
    np.testing.assert_array_equal(some.factors[[5]].toarray(), one[0].factors[[5]].toarray())
    assert np.isnan(some.escaped[[0, 11]]).all()


def test_mirrors_around_a_bed_make_a_lattice():
    """Perfect mirrors around 2 x 2 x 2 spheres show the endless simple cubic lattice."""
    site = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    bed = Packing(
        2.0 * site + 1.0,
        1.0,
        walls=box((-1e-12, -1e-12, -1e-12), (4 + 1e-12, 4 + 1e-12, 4 + 1e-12)),
    )
    mirrored = exchange_factors(
        bed, [0.5, 1.0], rays=60_000, emitters=[0], wall_emissivity=0.0, wall_specular=1.0
    )
    endless = lattice("sc", 1, 1.0)
    periodic = exchange_factors(endless, [0.5, 1.0], rays=60_000, seed=1, images=True)
    for a, b in zip(mirrored, periodic, strict=True):
        folded = np.array([0, 1, 1, 0])[b.pairs.image % 4]  # 0 1 | 1 0 | 0 1 ...
        target = folded @ [4, 2, 1]
        expected = np.bincount(target, b.pairs.factor, 8)
        error = np.sqrt(np.bincount(target, b.pairs.stderr**2, 8))
        off = a.factors[[0]].toarray()[0] - expected
        assert (abs(off) < 4.0 * np.hypot(a.stderr[[0]].toarray()[0], error)).all()
        assert a.escaped[0] == 0.0


def test_an_unknown_wall_may_absorb_but_not_reflect():
    class Sail:
        pass

    black = _paths.normal_tables([Sail()], np.array([False]))
    assert np.isnan(black).all()
    with pytest.raises(InputError, match="wall 0 is a Sail"):
        _paths.normal_tables([Sail()], np.array([True]))


def test_whole_beds_only_have_a_macroscopic_factor(crowd, fcc):
    with pytest.raises(InputError, match="periodic in all"):
        radiative_exchange_factor(crowd, fcc[1][0])
    with pytest.raises(InputError, match="do not belong"):
        radiative_exchange_factor(lattice("fcc", 1, 1.0), fcc[1][0])
    value, error = radiative_exchange_factor(fcc[0], fcc[1][4]).conductivity(1000.0)
    # 4 sigma T^3 d F_E with d = 2 m
    assert abs(value - 4.0 * 5.670374419e-8 * 1e9 * 2.0 * 0.874) < 4.0 * error + 0.3


def test_a_sphere_among_walls_that_absorb_nothing_gets_all_back():
    bed = Packing([[0, 0, 0]], 1.0, walls=[*box((-2, -2, -2), (2, 2, 2))])
    (result,) = exchange_factors(bed, 0.3, rays=2_000, wall_emissivity=0.0)
    assert abs(result.factors[0, 0] - 1.0) < 1e-12


def test_rays_that_leave_for_good_are_counted():
    pair = Packing([[0, 0, 0], [2.5, 0, 0]], 1.0)
    (black, grey) = exchange_factors(pair, [1.0, 0.4], rays=50_000)
    exact = 0.0441189329067  # one-dimensional quadrature of the exact law
    assert abs(black.factors[0, 1] - exact) < 4.0 * black.stderr[0, 1]
    assert abs(black.escaped[0] - 1.0 + exact) < 4.0 * black.escaped_stderr[0]
    # First order: absorbed at the first visit; the second adds less than F^2.
    assert 0.0 < grey.factors[0, 1] - 0.4 * exact + 4.0 * grey.stderr[0, 1] < 0.01
    assert grey.factors[0, 0] > 0.0
    assert 1.0 - exact < grey.escaped[0] < 1.0
    (near,) = exchange_factors(pair, 1.0, rays=1_000, max_distance=0.1)
    assert near.escaped.min() == 1.0


def test_given_rays_meet_what_free_rays_meet(crowd):
    rng = np.random.default_rng(2)
    m = 4_000
    origins = np.column_stack([rng.uniform(-2, 2, (m, 2)), np.full(m, -3.3)])
    s = rng.uniform(size=m)
    turn = rng.uniform(0, 2 * np.pi, m)
    up = np.column_stack([np.sqrt(s) * np.cos(turn), np.sqrt(s) * np.sin(turn), np.sqrt(1 - s)])
    black, grey = exchange_of_rays(crowd, origins, up, [1.0, 0.4], wall_emissivity=0.5)
    _, hit = first_hits(crowd, origins, up)
    for shares in (black, grey):
        assert abs(shares.factors.sum() + shares.wall_factors.sum() + shares.escaped - 1) < 1e-12
    all_black = exchange_of_rays(crowd, origins, up, 1.0)[0]
    np.testing.assert_allclose(
        all_black.factors * m, np.bincount(hit[hit >= 0], minlength=12), rtol=1e-12
    )


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"emissivity": [0.5, 0.0]}, "emissivity[1] = 0 [-] is outside 0.001 ... 1"),
        ({"emissivity": 1.5}, "emissivity[0] = 1.5 [-] is outside"),
        ({"emissivity": [[0.5, 0.5]]}, "one per sphere"),
        ({"emissivity": []}, "emissivity is empty"),
        ({"specular": -0.1}, "specular = -0.1 [-] is outside 0 ... 1"),
        ({"wall_emissivity": [0.5, 0.5]}, "one per wall (3,)"),
        ({"wall_emissivity": 2.0}, "wall_emissivity = 2 [-]"),
        ({"rays": 0}, "rays = 0"),
        ({"max_distance": 0.0}, "max_distance = 0 [m]"),
        ({"emitters": [True]}, "np.flatnonzero"),
        ({"emitters": [12]}, "emitters must lie in 0 ... 11"),
    ],
)
def test_refusals(crowd, changes, words):
    with pytest.raises(InputError) as refusal:
        exchange_factors(crowd, **changes)
    assert words in str(refusal.value)
