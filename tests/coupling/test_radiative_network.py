"""Radiative network: exact enclosures, given heats and temperatures alike, balance, baselines."""

import numpy as np
import pytest
from scipy.sparse import csr_matrix

from greybed.core import InputError, Plane
from greybed.core.sizes import Discrete
from greybed.coupling import Rows, net_radiation, pairwise_network, radiative_network
from greybed.datasets.generate import random_packing
from greybed.datasets.lattices import lattice
from greybed.raytrace import exchange_factors, view_factors

SIGMA = 5.670374419e-8


def slab():
    """Twenty-seven spheres between two plates, open to the sides."""
    free = lattice("sc", 3, 0.01, 0.45, periodic=False)
    walls = [Plane((0, 0, -0.011), (0, 0, 1), "hot"), Plane((0, 0, 0.055), (0, 0, -1), "cold")]
    return type(free)(free.centres, free.radii, walls=walls)


@pytest.fixture(scope="module")
def bed():
    return slab()


@pytest.fixture(scope="module")
def traced(bed):
    return view_factors(bed, rays=3_000)


@pytest.fixture(scope="module")
def grey(bed):
    return exchange_factors(bed, [0.6, 1.0], rays=3_000, wall_emissivity=[0.8, 0.5])


def enclosed(areas):
    """One sphere inside one wall."""
    return Rows(csr_matrix((1, 1)), np.ones((1, 1)), np.zeros(1), np.array([areas]))


@pytest.mark.parametrize("eps_wall", [1.0, 0.7, 0.2])
def test_sphere_in_an_enclosure(eps_wall):
    a1, a2, eps = 2.0, 5.0, 0.6
    own = [[a2 - a1]]  # what the wall sees of itself
    result = radiative_network(
        enclosed(a1), temperatures=900.0, emissivity=eps, wall_temperatures=[400.0],
        wall_emissivity=eps_wall, wall_exchange=own,
    )  # fmt: skip
    exact = SIGMA * a1 * (900.0**4 - 400.0**4)
    exact /= 1.0 / eps + a1 / a2 * (1.0 / eps_wall - 1.0)
    assert result.heats[0] == pytest.approx(exact, rel=1e-12)
    assert result.wall_heats[0] == pytest.approx(-exact, rel=1e-12)
    # The other way round: the temperature that gives off this heat.
    back = radiative_network(
        enclosed(a1), heats=exact, emissivity=eps, wall_temperatures=[400.0],
        wall_emissivity=eps_wall, wall_exchange=own,
    )  # fmt: skip
    assert back.temperatures[0] == pytest.approx(900.0, rel=1e-12)


def test_pairwise_formula_holds_for_a_closed_pair_only():
    rows = Rows(csr_matrix([[0, 1.0], [1.0, 0]]), np.zeros((2, 0)), np.zeros(2), np.ones(2))
    ask = {"emissivity": [0.4, 0.9], "temperatures": [900.0, 500.0]}
    pair, whole = pairwise_network(rows, **ask), radiative_network(rows, **ask)
    np.testing.assert_allclose(pair.heats, whole.heats, rtol=1e-12)
    three = (np.ones((3, 3)) - np.eye(3)) / 2.0
    rows = Rows(csr_matrix(three), np.zeros((3, 0)), np.zeros(3), np.ones(3))
    ask = {"emissivity": 0.4, "temperatures": [900.0, 500.0, 500.0]}
    pair, whole = pairwise_network(rows, **ask), radiative_network(rows, **ask)
    assert pair.heats[0] > 1.2 * whole.heats[0]


def test_spheres_agree_with_net_radiation(bed, traced):
    t = np.linspace(400.0, 900.0, len(bed))
    ask = {"wall_temperatures": [1000.0, 300.0], "environment_temperature": 350.0}
    known = net_radiation(Rows.of(traced, bed), t, emissivity=0.6, **ask)
    result = radiative_network(traced, temperatures=t, emissivity=0.6, **ask)
    np.testing.assert_allclose(result.heats, -known.absorbed, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(result.wall_heats, known.boundary_heat, rtol=1e-9)


def test_heats_follow_the_exchange_factors(bed, grey):
    rows = grey[0]
    t = np.linspace(400.0, 900.0, len(bed))
    result = radiative_network(
        rows, temperatures=t, wall_temperatures=[1000.0, 300.0], environment_temperature=350.0
    )
    # Straight from the definition, rows as traced: equal within the errors of the rays.
    emitted = rows.emission_areas * SIGMA * t**4
    boundary = SIGMA * np.array([1000.0, 300.0, 350.0]) ** 4
    outside = np.column_stack([rows.wall_factors, rows.escaped])
    received = rows.factors.T @ emitted + rows.emission_areas * (outside @ boundary)
    assert abs(result.heats - (emitted - received)).max() < 0.02 * emitted.max()
    assert result.defect < 1e-13
    assert result.imbalance > 1e-4


def test_one_temperature_exchanges_nothing(grey, traced):
    ask = {
        "temperatures": 700.0,
        "wall_temperatures": [700.0, 700.0],
        "environment_temperature": 700.0,
    }
    for result in (
        radiative_network(grey[0], **ask),
        radiative_network(traced, emissivity=0.3, wall_emissivity=0.5, **ask),
        pairwise_network(traced, emissivity=0.3, **ask),
    ):
        assert abs(result.heats).max() < 1e-12 * 0.00126 * SIGMA * 700.0**4
        assert abs(result.wall_heats).max() < 1e-11 * 0.03 * SIGMA * 700.0**4


@pytest.mark.parametrize("direct", [True, False])
def test_heats_give_the_temperatures_back(bed, grey, traced, direct):
    n = len(bed)
    t = 500.0 + 300.0 * np.random.default_rng(0).uniform(size=n)
    factors = grey[0] if direct else traced
    optics = {} if direct else {"emissivity": 0.4, "wall_emissivity": [0.8, 0.5]}
    first = radiative_network(
        factors, temperatures=t, wall_temperatures=[900.0, 400.0], environment_temperature=300.0,
        **optics,
    )  # fmt: skip
    assert first.defect < 1e-12
    half = np.arange(n) % 2 == 0
    again = radiative_network(
        factors,
        temperatures=np.where(half, t, np.nan),
        heats=np.where(half, np.nan, first.heats),
        wall_temperatures=[900.0, None],
        wall_heats=[None, first.wall_heats[1]],
        environment_temperature=300.0,
        **optics,
    )
    np.testing.assert_allclose(again.temperatures, t, rtol=1e-9)
    np.testing.assert_allclose(again.heats, first.heats, atol=1e-9 * abs(first.heats).max())
    assert again.wall_temperatures[1] == pytest.approx(400.0, rel=1e-9)


def test_black_spheres_are_one_network(bed):
    """At emissivity 1 exchange factors, radiosities and the pairwise formula agree."""
    ask = {"heats": 0.0, "wall_temperatures": [1000.0, 400.0], "environment_temperature": None}
    (black,) = exchange_factors(bed, 1.0, rays=3_000)
    results = [
        radiative_network(black, **ask),
        radiative_network(black, emissivity=1.0, **ask),
        pairwise_network(black, emissivity=1.0, **ask),
    ]
    for r in results:
        np.testing.assert_allclose(r.temperatures, results[0].temperatures, rtol=1e-10)
        assert (r.temperatures < 1000.0).all()
        assert (r.temperatures > 400.0).all()
        assert abs(r.wall_heats.sum()) < 1e-9 * r.wall_heats[0]


def test_random_bed_of_two_sizes_is_balanced():
    bed = random_packing(60, 0.4, Discrete((0.001, 0.002), (0.5, 0.5), "number"), seed=1)
    (rows,) = exchange_factors(bed, [np.linspace(0.3, 1.0, 60)], rays=3_000)
    hot = bed.radii > 0.0015
    result = radiative_network(rows, temperatures=np.where(hot, 800.0, 600.0))
    assert result.heats[hot].min() > 0.0
    assert abs(result.heats.sum()) < 1e-13 * abs(result.heats).sum()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"emissivity": 0.5}, "already hold it"),
        ({"temperatures": 700.0, "heats": 0.0}, "both of temperature and heat"),
        ({"temperatures": -5.0}, "finite and above 0 [K]"),
        ({"heats": -1e6}, "negative"),
        ({"wall_temperatures": [500.0]}, "for 2 walls"),
        ({"wall_temperatures": [None, None]}, "no surface of given temperature"),
        ({"wall_exchange": [[0.0, 1.0], [2.0, 0.0]]}, "symmetric"),
        ({"heats": [0.0, 1.0]}, "one per sphere"),
    ],
)
def test_refusals(grey, traced, changes, words):
    ask = {"wall_temperatures": [900.0, 400.0]} | changes
    with pytest.raises(InputError) as refusal:
        radiative_network(grey[0], **ask)
    assert words in str(refusal.value)
    with pytest.raises(InputError, match="give one result"):
        radiative_network(grey, **ask)
    with pytest.raises(InputError, match="emissivity is missing"):
        radiative_network(traced, wall_temperatures=[900.0, 400.0])
