"""A distance limit of the trace: what lies beyond has the local mean, so no heat is lost."""

import numpy as np
import pytest

from greybed.core import InputError, Packing
from greybed.core.rows import localised
from greybed.core.sizes import Uniform
from greybed.coupling import Rows, radiative_network
from greybed.datasets.generate import random_packing
from greybed.raytrace import smoothed, view_factors

DIAMETER = 3e-3


@pytest.fixture(scope="module")
def bed():
    return random_packing(150, 0.35, Uniform(1e-3, 2e-3), seed=4)


@pytest.fixture(scope="module")
def near(bed):
    return view_factors(bed, rays=4_000, max_distance=DIAMETER)


def test_a_bed_at_one_temperature_stays_so(bed, near):
    assert near.environment.min() > 0.05
    result = radiative_network(near, temperatures=1000.0, emissivity=1.0)
    emitted = 5.670374419e-8 * 1000.0**4 * bed.areas
    assert abs(result.heats / emitted).max() < 1e-12


def test_heats_add_up_and_are_those_of_the_whole_trace(bed, near):
    t = 1000.0 + 100.0 * np.sin(2.0 * np.pi * bed.centres[:, 0] / bed.edges[0])
    emitted = 5.670374419e-8 * t**4 * bed.areas
    full = radiative_network(view_factors(bed, rays=4_000), temperatures=t, emissivity=1.0).heats
    # What lies beyond is further off the sphere's temperature than the local mean: an error in
    # proportion to its share, here of a wave that is only six diameters long.
    for reach, share in ((6.0 * DIAMETER, 0.01), (4.0 * DIAMETER, 0.06), (2.0 * DIAMETER, 0.22)):
        rows = view_factors(bed, rays=4_000, max_distance=reach)
        assert 0.5 * share < rows.environment.mean() < 1.5 * share
        cut = radiative_network(rows, temperatures=t, emissivity=1.0)
        assert cut.defect < 1e-12
        assert np.std((cut.heats - full) / emitted) < 0.3 * share


def test_smoothing_keeps_the_share(near):
    result = smoothed(near)
    sums = result.factors.sum(axis=1) + result.environment
    assert abs(sums - 1.0).max() < 1e-12
    assert (result.environment > 0.0).all()
    assert abs(Rows.taken(result).sums - 1.0).max() < 1e-12


def test_a_sphere_that_sees_no_other_has_no_local_mean():
    pair = Packing([[0, 0, 0], [4, 4, 4]], 1.0, box=[[-1, -1, -1], [7, 7, 7]], periodic=(True,) * 3)
    result = view_factors(pair, rays=100, max_distance=0.1)
    with pytest.raises(InputError, match="sphere 0 sees no other sphere within max_distance"):
        localised(result.factors, result.environment)
    with pytest.raises(InputError, match="longer reach"):
        Rows.of(result, pair)
