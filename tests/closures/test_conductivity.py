"""Zehner and Schluender's cell: limits, a removable singularity, bounds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from greybed.closures.conductivity import zehner_schluender


def test_a_bed_of_gas_is_gas():
    assert float(zehner_schluender(0.026, 0.026, 0.4)) == pytest.approx(0.026, rel=1e-12)


def test_no_spheres_leave_the_gas():
    assert float(zehner_schluender(5.0, 0.026, 1.0 - 1e-12)) == pytest.approx(0.026, rel=1e-4)


def test_smooth_where_the_formula_divides_by_zero():
    singular = 0.026 * 1.25 * (0.6 / 0.4) ** (10.0 / 9.0)
    k = zehner_schluender(singular * (1.0 + np.linspace(-0.01, 0.01, 201)), 0.026, 0.4)
    assert np.abs(np.diff(k, 2)).max() < 2e-6 * k.mean()


@given(
    ks=st.floats(0.03, 400.0), kg=st.floats(0.005, 0.5), eps=st.floats(0.25, 0.9),
)  # fmt: skip
def test_between_series_and_parallel(ks, kg, eps):
    k = float(zehner_schluender(ks, kg, eps))
    series = 1.0 / (eps / kg + (1.0 - eps) / ks)
    parallel = eps * kg + (1.0 - eps) * ks
    low, high = sorted((series, parallel))
    assert low * (1.0 - 1e-6) <= k <= high * (1.0 + 1e-6)
