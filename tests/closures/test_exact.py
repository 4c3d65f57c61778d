"""The exact pair factor against an independent integral, tabulated values, limits, properties."""

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from greybed.closures import exact_view_factor
from greybed.core import RangeError

# Twelve-digit values from the lens integral, checked with an element-to-sphere closed form and
# with cone-sampled ray tracing when they were tabulated.
TABLE = [
    (1, 1, 2, 0.0755868184216),
    (1, 1, 2.01, 0.0745504470295),
    (1, 1, 2.1, 0.0665040436133),
    (1, 1, 2.5, 0.0441189329067),
    (1, 1, 3, 0.0295903122506),
    (1, 1, 4, 0.0161562443699),
    (1, 1, 6, 0.00704441700516),
    (1, 1, 10, 0.00251265904319),
    (1, 1, 20, 6.25783702144e-4),
    (1, 2, 3, 0.137405938769),
    (2, 1, 3, 0.0343514846922),
    (1, 3, 4, 0.179346647068),
    (1, 10, 11, 0.299295786223),
    (0.1, 0.2, 0.5, 0.0422779979638),
]


def lens_integral(r1, r2, d):
    """F12 = 1 / (2 pi r1^2) int A_lens(d sin t) sin t dt, to 20 digits: another route entirely."""
    r1, r2, d = mp.mpf(r1), mp.mpf(r2), mp.mpf(d)

    def lens(s):
        if s <= abs(r1 - r2):
            return mp.pi * min(r1, r2) ** 2
        a = mp.acos(max(-1, min(1, (s * s + r1 * r1 - r2 * r2) / (2 * s * r1))))
        b = mp.acos(max(-1, min(1, (s * s + r2 * r2 - r1 * r1) / (2 * s * r2))))
        h = (-s + r1 + r2) * (s + r1 - r2) * (s - r1 + r2) * (s + r1 + r2)
        return r1 * r1 * a + r2 * r2 * b - mp.sqrt(max(h, 0)) / 2

    low, high = mp.asin(abs(r1 - r2) / d), mp.asin(min((r1 + r2) / d, 1))
    # Nodes gathered at both ends, where the lens changes with the power 3/2.
    ends = [low + (high - low) * (1 - mp.cos(mp.pi * k / 8)) / 2 for k in range(9)]
    inner = mp.pi * min(r1, r2) ** 2 * (1 - mp.cos(low))
    outer = mp.quad(lambda t: lens(d * mp.sin(t)) * mp.sin(t), ends)
    return (inner + outer) / (2 * mp.pi * r1 * r1)


@pytest.mark.parametrize(("r1", "r2", "d", "expected"), TABLE)
def test_table(r1, r2, d, expected):
    # The table has twelve digits; the bar is 1e-10.
    assert exact_view_factor(r1, r2, d) == pytest.approx(expected, rel=1e-11)


@pytest.mark.parametrize("ratio", [0.05, 0.3, 1.0, 4.0, 30.0])
@pytest.mark.parametrize("gap", [0.0, 1e-5, 1e-3, 0.03, 0.7, 12.0])
def test_against_the_lens_integral(ratio, gap):
    with mp.workdps(30):
        d = mp.mpf(1) + mp.mpf(ratio) + mp.mpf(gap)
        expected = lens_integral(1.0, ratio, d)
    assert float(exact_view_factor(1.0, ratio, float(d)) / expected - 1) == pytest.approx(
        0.0, abs=2e-11
    )


@pytest.mark.parametrize("d", [1e2, 1e4, 1e7])
def test_far_field(d):
    # The next term of the expansion is (r_i^2 + r_j^2) / (4 d^2), relative to the first.
    assert exact_view_factor(1.0, 3.0, d) == pytest.approx(9.0 / (4 * d**2), rel=10 / d**2 + 1e-13)


def test_plane_limit():
    # A sphere touching a far larger one sees a plane: half of its surroundings.
    assert exact_view_factor(1.0, 1e7, 1e7 + 1.0) == pytest.approx(0.5, abs=1e-3)


sizes = st.floats(1e-4, 1e4)
gaps = st.floats(0.0, 1e3)


@given(sizes, sizes, gaps)
def test_reciprocity_and_bounds(r_i, r_j, gap):
    d = (r_i + r_j) * (1.0 + gap)
    there, back = exact_view_factor(r_i, r_j, d), exact_view_factor(r_j, r_i, d)
    assert r_i**2 * there == pytest.approx(r_j**2 * back, rel=1e-14)
    assert 0.0 < there <= 0.5


@given(st.floats(0.1, 10.0), st.floats(0.0, 5.0), st.floats(1e-6, 5.0))
def test_falls_with_distance(r_j, gap, step):
    d = 1.0 + r_j + gap
    assert exact_view_factor(1.0, r_j, d + step) < exact_view_factor(1.0, r_j, d)


def test_broadcasts():
    factors = exact_view_factor(1.0, [[1.0], [2.0]], [3.0, 4.0, 5.0])
    assert factors.shape == (2, 3)
    assert factors[1, 0] == exact_view_factor(1.0, 2.0, 3.0)


def test_soft_contact_counts_as_touching():
    assert exact_view_factor(1.0, 1.0, 1.98) == exact_view_factor(1.0, 1.0, 2.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((1.0, 1.0, 1.5), r"distance = 1\.5 \[m\] is below r_i \+ r_j = 2 .*separate them"),
        ((0.0, 1.0, 3.0), r"r_i = 0 \[m\] must be finite and above 0"),
        ((1.0, np.nan, 3.0), r"r_j = nan \[m\]"),
        ((1.0, 1.0, np.inf), r"distance = inf \[m\]"),
    ],
)
def test_refusals(arguments, message):
    with pytest.raises(RangeError, match=message):
        exact_view_factor(*arguments)
