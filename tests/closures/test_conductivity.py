"""Zehner and Schluender's cell: limits, a removable singularity, bounds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from greybed.closures.conductivity import zehner_schluender


def test_a_bed_of_gas_is_gas():
    assert float(zehner_schluender(0.026, 0.026, 0.4)) == pytest.approx(0.026, rel=1e-12)


def test_no_spheres_leave_the_gas():
    assert float(zehner_schluender(5.0, 0.026, 1.0 - 1e-12)) == pytest.approx(0.026, rel=1e-4)


def tubes(kappa, eps):
    """Zehner and Schluender's cell by quadrature: parallel tubes of solid and gas in series."""
    b = 1.25 * ((1.0 - eps) / eps) ** (10.0 / 9.0)

    def share(z):  # of the tubes whose solid ends at height z, times their conductivity
        w = z / (b - (b - 1.0) * z)
        return 2.0 * w * b / (b - (b - 1.0) * z) ** 2 / (1.0 - z + z / kappa)

    core = quad(share, 0.0, 1.0, epsabs=0.0, epsrel=1e-12, limit=200)[0]
    return 1.0 - np.sqrt(1.0 - eps) + np.sqrt(1.0 - eps) * core


@pytest.mark.parametrize("eps", [0.26, 0.4, 0.7])
@pytest.mark.parametrize("kappa", [0.01, 0.5, 1.0, 1.9, 2.2, 10.0, 500.0, 1e4])
def test_closed_form_is_the_integral_over_the_cell(kappa, eps):
    # the quadrature is good to 1e-12, the closed form loses three digits next to the series
    assert float(zehner_schluender(kappa, 1.0, eps)) == pytest.approx(tubes(kappa, eps), rel=1e-11)


def test_a_bed_without_spheres_has_a_number():
    assert float(zehner_schluender(5.0, 0.026, 1.0)) == 0.026


def test_smooth_where_the_formula_divides_by_zero():
    singular = 0.026 * 1.25 * (0.6 / 0.4) ** (10.0 / 9.0)
    k = zehner_schluender(singular * (1.0 + np.linspace(-0.01, 0.01, 201)), 0.026, 0.4)
    # steps of 1e-4: the second difference of a smooth course is about 1e-8 of it
    assert np.abs(np.diff(k, 2)).max() < 1e-8 * k.mean()


@given(ks=st.floats(0.03, 400.0), kg=st.floats(0.005, 0.5), eps=st.floats(0.25, 0.9))
def test_between_its_two_materials(ks, kg, eps):
    k = float(zehner_schluender(ks, kg, eps))
    low, high = sorted((ks, kg))
    assert low * (1.0 - 1e-12) <= k <= high * (1.0 + 1e-12)


@given(ks=st.floats(1.0, 400.0), kg=st.floats(0.005, 0.5), eps=st.floats(0.25, 0.9))
def test_between_series_and_parallel(ks, kg, eps):
    # of materials more alike than 1 to 2 it may leave these bounds: the cell holds as much solid
    # as the bed only to within 1 % below a void fraction of 0.6, and 10 % at 0.9
    k = float(zehner_schluender(ks, kg, eps))
    series = 1.0 / (eps / kg + (1.0 - eps) / ks)
    parallel = eps * kg + (1.0 - eps) * ks
    assert series <= k <= parallel
