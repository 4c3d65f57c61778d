"""Pair sampling: exact where nothing stands between, honest errors where something does."""

from __future__ import annotations

import numpy as np
import pytest

from greybed.core import InputError, Packing
from greybed.core.exact import exact_view_factor
from greybed.core.sizes import Uniform
from greybed.datasets.generate import random_packing
from greybed.datasets.lattices import lattice
from greybed.raytrace import pair_factors, view_factors


@pytest.fixture(scope="module")
def bed():
    return random_packing(80, 0.5, Uniform(1.0, 3.0), seed=2)


def touching_pairs(packing, gap=0.3):
    pairs, distance = packing.neighbours(gap)
    return pairs[distance >= packing.radii[pairs].sum(axis=1)]


def test_a_free_pair_is_exact():
    for radii, d in (((1.0, 1.0), 2.0), ((1.0, 3.0), 4.5), ((0.1, 0.2), 0.5)):
        packing = Packing([[0, 0, 0], [0.6 * d, 0, 0.8 * d]], radii)
        result = pair_factors(packing, [[0, 1], [1, 0]], rays=64)
        exact = [exact_view_factor(*radii, d), exact_view_factor(*radii[::-1], d)]
        np.testing.assert_allclose(result.factor, exact, rtol=1e-12)
        assert (result.stderr == 0.0).all()
        assert (result.lines == 0).all()


@pytest.mark.parametrize("radius", [0.7, 3.0])
def test_one_blocker_against_rays(radius):
    """A sphere beside the axis, of other size than the pair: lines and rays agree to 0.1 %."""
    packing = Packing([[0, 0, 0], [9, 1, 0], [4, -radius, 0.3]], [1.0, 2.0, radius])
    lines = pair_factors(packing, [[0, 1]], rays=2**20, seed=1)
    rays = view_factors(packing, rays=4_000_000, seed=2, emitters=[0])
    difference = lines.factor[0] - rays.factors[0, 1]
    assert abs(difference) < 4.0 * np.hypot(lines.stderr[0], rays.stderr[0, 1])
    assert 0.2 < lines.visibility[0] < 0.9
    assert rays.stderr[0, 1] < 3e-3 * rays.factors[0, 1]
    assert lines.stderr[0] < 1e-3 * lines.factor[0]


def test_against_rows(bed):
    bed = Packing(bed.centres, bed.radii)
    pairs = touching_pairs(bed, gap=1.5)
    lines = pair_factors(bed, pairs, rel_error=0.01, seed=3)
    rows = view_factors(bed, rays=400_000, seed=4)
    factor = np.array([rows.factors[a, b] for a, b in pairs])
    error = np.array([rows.stderr[a, b] for a, b in pairs])
    z = (lines.factor - factor) / np.hypot(lines.stderr, error)
    assert len(z) > 200
    assert np.abs(z).max() < 4.5
    assert (z**2).mean() < 1.4
    free = lines.factor / lines.visibility
    assert (lines.stderr <= 0.01 * np.maximum(lines.factor, 1e-3 * free)).all()


def test_reciprocal_by_construction(bed):
    pairs = touching_pairs(bed)[:40]
    forth = pair_factors(bed, pairs, rays=4096)
    back = pair_factors(bed, pairs[:, ::-1], rays=4096)
    area = bed.areas
    difference = area[pairs[:, 0]] * forth.factor - area[pairs[:, 1]] * back.factor
    error = np.hypot(area[pairs[:, 0]] * forth.stderr, area[pairs[:, 1]] * back.stderr)
    assert (np.abs(difference) <= 4.0 * error + 1e-12).all()


def test_hidden_pairs_and_lattice():
    hidden = Packing([[0, 0, 0], [2, 0, 0], [4, 0, 0]], 1.0)
    assert pair_factors(hidden, [[0, 2]], rays=4096).factor[0] == 0.0
    fcc = lattice("fcc", 3, 1.0)
    pairs, _ = fcc.neighbours(1e-6)
    result = pair_factors(fcc, pairs[:6], rays=2**16)
    # 0.07190 within 1e-5: ray-traced reference of the touching lattice.
    error = np.sqrt((result.stderr**2).sum()) / 6
    assert error < 3e-5
    assert abs(result.factor.mean() - 0.07190) < 3.0 * error + 1e-5


def test_same_bits(bed):
    pairs = touching_pairs(bed)
    one = pair_factors(bed, pairs, rays=256, seed=9, threads=1)
    two = pair_factors(bed, pairs, rays=256, seed=9, threads=2)
    np.testing.assert_array_equal(one.factor, two.factor)
    np.testing.assert_array_equal(one.stderr, two.stderr)
    alone = pair_factors(bed, pairs[5:6], rays=256, seed=9)
    assert alone.factor[0] == one.factor[5]


def test_refusals(bed):
    deep = Packing([[0, 0, 0], [1.5, 0, 0]], 1.0)
    with pytest.raises(InputError, match=r"overlap.*view_factors"):
        pair_factors(deep, [[0, 1]])
    with pytest.raises(InputError, match="rel_error"):
        pair_factors(bed, [[0, 1]], rel_error=0.0)
    with pytest.raises(InputError, match="pairs must number"):
        pair_factors(bed, [[0, 800]])
