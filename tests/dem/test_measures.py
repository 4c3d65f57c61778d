"""Heights, angles, solid fractions and segregation of beds whose answers are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from greybed.core import InputError
from greybed.dem import measures

BALL = 4.0 / 3.0 * math.pi


def test_the_angle_of_a_cone_and_of_a_wedge():
    rng = np.random.default_rng(0)
    x = np.column_stack([rng.uniform(-1.0, 1.0, (200_000, 2)), rng.uniform(0.0, 1.0, 200_000)])
    cone = x[x[:, 2] < 0.6 * (1.0 - np.hypot(x[:, 0], x[:, 1]))]
    angle, error = measures.pile_profile(cone, 1e-3, 0.05).slope()
    assert angle == pytest.approx(math.degrees(math.atan(0.6)), abs=max(0.3, 3.0 * error))
    wedge = x[x[:, 2] < 0.4 * (1.0 - x[:, 0])]
    profile = measures.pile_profile(wedge, 1e-3, 0.05, axis=0)
    assert np.allclose(np.diff(profile.position), 0.05)
    assert abs(profile.position[0] + 1.0) < 0.05
    assert profile.slope()[0] == pytest.approx(math.degrees(math.atan(0.4)), abs=0.3)
    # A gap has no height, and two bins make no line.
    gap = measures.pile_profile([[0, 0, 0], [1, 0, 0]], 0.01, 0.1, axis=0)
    assert np.isnan(gap.height[4])
    with pytest.raises(InputError, match=r"the flank has . bins.*narrower bins"):
        gap.slope()


def test_solid_volume_is_counted_exactly():
    x, r = np.array([[0.5, 0.5, 0.5], [0.2, 0.2, 0.9]]), np.array([0.25, 0.1])
    layers = measures.solid_profile(x, r, [0.0, 0.5, 0.8, 1.0], 2.0)
    volume = layers * 2.0 * np.array([0.5, 0.3, 0.2])
    assert volume[0] == pytest.approx(0.5 * BALL * 0.25**3, rel=1e-12)
    assert volume.sum() == pytest.approx(BALL * (0.25**3 + 0.1**3), rel=1e-12)
    assert volume[2] == pytest.approx(BALL * 0.1**3, rel=1e-12)
    field = measures.solid_field(x[:1], 0.25, (0, 0, 0), (1, 1, 1), (2, 2, 2))
    np.testing.assert_allclose(field, BALL * 0.25**3, rtol=0.04)
    assert field.sum() / 8.0 == pytest.approx(BALL * 0.25**3, rel=1e-12)
    beside = measures.solid_field(x[:1], 0.25, (0.5, 0, 0), (1, 1, 1), (1, 1, 1))
    assert beside[0, 0, 0] * 0.5 == pytest.approx(0.5 * BALL * 0.25**3, rel=0.02)


def test_the_height_of_a_bed_ignores_a_flying_particle():
    x = np.zeros((101, 3))
    x[:100, 2] = np.linspace(0.0, 0.99, 100)
    x[100, 2] = 50.0
    assert measures.bed_height(x, 0.01) == pytest.approx(0.99, abs=0.02)
    assert measures.bed_height(x, 0.01, 1.0) == pytest.approx(50.01)


def test_segregation_of_sorted_and_mixed_kinds():
    x = np.zeros((40, 3))
    x[:, 0] = np.arange(40)
    mass, edges = np.full(40, 2.0), np.linspace(0.0, 40.0, 5)
    shares, sorted_ = measures.segregation(x, mass, np.arange(40) // 20, edges)
    np.testing.assert_array_equal(shares, [[1, 0], [1, 0], [0, 1], [0, 1]])
    assert sorted_ == pytest.approx(1.0)
    assert measures.segregation(x, mass, np.arange(40) % 2, edges)[1] == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: measures.pile_profile([[0, 0, 0]], 1.0, 0.0), "width = 0"),
        (lambda: measures.pile_profile([[0, 0, 0]], 1.0, 1.0, axis=2), "axis = 2"),
        (lambda: measures.bed_height([[0, 0, 0]], 1.0, 0.0), "share = 0"),
        (lambda: measures.bed_height(np.empty((0, 3)), 1.0), "n at least 1"),
        (lambda: measures.solid_profile([[0, 0, 0]], 1.0, [1, 0], 1.0), "growing"),
        (lambda: measures.solid_field([[0, 0, 0]], 1.0, [0] * 3, [1] * 3, [0, 1, 1]), "shape ="),
    ],
)
def test_refusals(call, says):
    with pytest.raises(InputError, match=says):
        call()
