"""Sizes by D10, D50 and D90: the three come back by mass, and the law is log-normal between."""

import math
from statistics import NormalDist

import numpy as np
import pytest

from greybed.core.errors import InputError
from greybed.core.sizes import MassQuantiles, parse_sizes

CASES = [(1.5e-3, 2e-3, 3e-3), (1e-3, 2e-3, 4e-3), (1e-3, 2.5e-3, 2.6e-3), (2e-3, 2e-3, 2e-3)]


@pytest.mark.parametrize("given", CASES)
def test_the_three_diameters_come_back_by_mass(given):
    sizes = MassQuantiles(*given)
    # Of 20,000 spheres one of the largest has up to 1e-3 of the mass.
    for share, diameter in zip((0.1, 0.5, 0.9), given, strict=True):
        assert 2.0 * sizes.by_mass(share) == pytest.approx(diameter, rel=3e-3)


def test_a_symmetric_one_is_log_normal_by_number_too():
    """Hatch & Choate: the median by number is that by mass times exp(-3 s^2)."""
    sizes = MassQuantiles(1.6e-3, 2e-3, 2.5e-3)
    s = math.log(2.5 / 2.0) / NormalDist().inv_cdf(0.9)
    found = float(sizes.quantiles(np.array([0.5]))[0])
    # The outer percents are lumped at their edges.
    assert 2.0 * found == pytest.approx(2e-3 * math.exp(-3.0 * s * s), rel=2e-3)


def test_a_few_drawn_spheres_have_the_quantiles():
    radii = np.sort(MassQuantiles(1.5e-3, 2e-3, 3e-3).radii(2000))
    mass = np.cumsum(radii**3) / (radii**3).sum()
    for share, diameter in ((0.1, 1.5e-3), (0.5, 2e-3), (0.9, 3e-3)):
        assert 2.0 * np.interp(share, mass, radii) == pytest.approx(diameter, rel=1e-2)


def test_the_text_is_of_diameters_in_any_order():
    sizes = parse_sizes("quantiles: D50=2mm, D10=1.5 mm,d90=3mm")
    assert sizes == MassQuantiles(1.5e-3, 2e-3, 3e-3)
    assert "D50 0.002" in str(sizes)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("quantiles:D10=1mm,D50=2mm", "not understood"),
        ("quantiles:D10=1mm,D50=2mm,D80=3mm", "not understood"),
        ("quantiles:1mm,2mm,3mm", "not understood"),
        ("quantiles:D10=3mm,D50=2mm,D90=4mm", "must rise"),
        ("quantiles:D10=1mm,D50=2mm,D90=40mm", "20 times"),
        ("quantiles:D10=1,D50=2mm,D90=3mm", "unit"),
    ],
)
def test_bad_ones_are_refused(text, why):
    with pytest.raises(InputError, match=why):
        parse_sizes(text)
