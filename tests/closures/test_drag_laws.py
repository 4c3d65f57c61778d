"""Drag laws: limits, Ergun's equation, values from an independent library, refusals."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from greybed.closures.drag import LAWS, drag_law, mixture_factor, sauter_mean
from greybed.core.errors import InputError, RangeError

DILUTE = ["stokes", "schiller-naumann", "clift-gauvin", "haider-levenspiel", "wen-yu", "bvk",
          "koch-hill", "koch-hill-benyahia", "tang", "tenneti", "gidaspow"]  # fmt: skip


@pytest.mark.parametrize("name", DILUTE)
def test_slow_free_sphere_has_stokes_drag(name):
    assert float(LAWS[name](0.0, 0.0)) == 1.0


@pytest.mark.parametrize("name", ["di-felice", "rong"])
def test_laws_that_miss_the_stokes_limit_miss_it_by_four_percent(name):
    assert float(LAWS[name](0.0, 0.0)) == pytest.approx(0.96, abs=1e-4)


@pytest.mark.parametrize(
    ("name", "reynolds", "value"),
    # CdRe/24 of fluids 1.3.1, drag_sphere(Re, Method="Haider_Levenspiel")
    [
        ("haider-levenspiel", 0.1, 1.040814832625869),
        ("haider-levenspiel", 10.0, 1.799387612717096),
        ("haider-levenspiel", 1e4, 175.1596993813664),
    ],
)
def test_against_another_library(name, reynolds, value):
    assert float(LAWS[name](0.0, reynolds)) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize("name", ["carman-kozeny", "bvk", "koch-hill", "ergun", "tenneti"])
def test_laws_of_slow_flow_in_dense_beds_agree(name):
    # Carman's 180 is exact for BVK and Koch & Hill; Ergun's 150 and Tenneti's fit lie 9 to 17 % low
    low = {"ergun": 0.16, "tenneti": 0.16}.get(name, 0.02)
    ratio = float(LAWS[name](0.6, 1e-9)) / (10.0 * 0.6 / 0.4**2)
    assert 1.0 - 1.1 * low < ratio < 1.02


@pytest.mark.parametrize("phi", [0.1, 0.2, 0.3, 0.4, 0.5])
def test_direct_simulations_of_slow_flow_agree(phi):
    # Tenneti's and BVK's are fits to two sets of simulations, each good to some 5 %; without the
    # conversion between their definitions of drag they would differ by the solid fraction
    ratio = float(LAWS["tenneti"](phi, 1e-9) / LAWS["bvk"](phi, 1e-9))
    assert abs(ratio - 1.0) < 0.1


@pytest.mark.parametrize(
    ("name", "value"),
    # worked by hand from the published formulas at phi = 0.5, Re = 10 (di-felice: log10 Re = 1)
    [
        ("wen-yu", 2.0**3.65 * (1.0 + 0.15 * 10.0**0.687)),
        ("ergun", (75.0 + 17.5) / (18.0 * 0.25)),
        ("bvk", 20.0 + 0.25 * (1.0 + 1.5 * 0.5**0.5)
         + 4.13 / 6.0 * (2.0 + 0.75 + 8.4 * 10.0**-0.343) / (1.0 + 10.0**1.5 * 10.0**-1.5)),
        ("koch-hill", 0.5 * (40.0 + 5.0 * (0.0673 + 0.106 + 0.7424))),
        ("tenneti", 0.5 * (8.0 * (1.0 + 0.15 * 10.0**0.687) + 23.24 + 7.68 * 0.5 ** (1.0 / 3.0)
                           + 1.25 * (0.95 + 0.305))),
        ("di-felice", (0.63 * 10.0**0.5 + 4.8) ** 2 / 24.0
         * 2.0 ** (3.7 - 0.65 * np.exp(-0.125))),
        ("rong", (0.63 * 10.0**0.5 + 4.8) ** 2 / 24.0 * 2.0 ** (3.975 - 0.8875 * np.exp(-0.125))),
    ],
)  # fmt: skip
def test_against_the_formulas_by_hand(name, value):
    assert float(LAWS[name](0.5, 10.0)) == pytest.approx(value, rel=1e-12)


@given(eps=st.floats(0.3, 0.6), re=st.floats(1e-3, 1e3))
def test_ergun_gives_the_pressure_gradient_of_ergun(eps, re):
    mu, d, rho = 1.8e-5, 2e-3, 1.2
    u = re * mu / (rho * d)
    phi = 1.0 - eps
    gradient = 18.0 * mu * phi * float(LAWS["ergun"](phi, re)) * u / (eps * d**2)
    own = 150.0 * mu * u * phi**2 / (eps**3 * d**2) + 1.75 * rho * u**2 * phi / (eps**3 * d)
    assert gradient == pytest.approx(own, rel=1e-12)


@pytest.mark.parametrize(
    ("name", "other", "tolerance"),
    # fluids has Clift and Gauvin's fit with other constants: 2.1 % apart at most
    [("haider-levenspiel", "Haider_Levenspiel", 1e-12), ("clift-gauvin", "Clift_Gauvin", 0.03),
     ("stokes", "Stokes", 1e-12)],
)  # fmt: skip
def test_spheres_of_another_library(name, other, tolerance):
    fluids = pytest.importorskip("fluids", reason="the library fluids is not installed")
    for re in (1e-2, 0.3, 5.0, 80.0, 900.0, 9e3):
        if name == "stokes" and re > 0.1:
            continue
        own = 24.0 / re * float(LAWS[name](0.0, re))
        assert own == pytest.approx(fluids.drag_sphere(re, Method=other), rel=tolerance)


@pytest.mark.parametrize("eps", [0.36, 0.42, 0.5])
def test_beds_of_another_library(eps):
    fluids = pytest.importorskip("fluids", reason="the library fluids is not installed")
    d, mu, rho, u = 8e-4, 1.8e-5, 1.2, 0.3
    phi, re = 1.0 - eps, rho * u * d / mu
    gradient = 18.0 * mu * phi * float(LAWS["ergun"](phi, re)) * u / (eps * d**2)
    other = fluids.packed_bed.Ergun(dp=d, voidage=eps, vs=u, rho=rho, mu=mu, L=1.0)
    assert gradient == pytest.approx(other, rel=1e-12)


@pytest.mark.parametrize("name", LAWS)
@given(phi=st.floats(0.0, 0.62), re=st.floats(1e-3, 2e3))
def test_slope_is_that_of_the_law(name, phi, re):
    law = LAWS[name]
    if abs(re - 1000.0) < 0.1 or abs(phi - 0.01) < 1e-6:  # laws jump there
        return
    force, slope = law.with_slope(phi, re)
    h = 1e-5
    low, high = law(phi, np.array([re * (1.0 - h), re * (1.0 + h)]))
    # the branches of Benyahia's form meet at an angle
    kink = 0.01 if name == "koch-hill-benyahia" else 0.0
    assert abs((high - low) / (2.0 * h) - slope) <= (1e-8 + kink) * max(float(force), 1.0)
    # what an implicit step divides by: more slip is more force
    assert force + slope >= 0.0


@pytest.mark.parametrize(
    ("name", "phi", "most"),
    [("gidaspow-blend", 0.2, 0.01), ("bvk", 0.2, 1e-5), ("tang", 0.4, 1e-5),
     ("koch-hill", 0.4, 0.0107), ("koch-hill-benyahia", 0.4, 1e-4), ("tenneti", 0.4, 1e-5)],
)  # fmt: skip
def test_seams_are_no_wider_than_stated(name, phi, most):
    for re in (1e-3, 1.0, 30.0, 300.0):
        below, above = LAWS[name](np.array([phi - 1e-7, phi + 1e-7]), re)
        assert abs(below / above - 1.0) < most


@pytest.mark.parametrize("name", ["koch-hill-benyahia", "koch-hill"])
def test_forms_of_koch_and_hill_agree_in_dense_beds(name):
    # Benyahia's lines become Koch and Hill's short form beyond phi = 0.4 and the turn to inertia
    assert float(LAWS[name](0.5, 0.0)) == pytest.approx(0.5 * 10.0 * 0.5 / 0.125, rel=1e-12)
    both = [float(LAWS[n](0.5, 200.0)) for n in ("koch-hill", "koch-hill-benyahia")]
    assert both[0] == pytest.approx(both[1], rel=1e-12)


def test_dilute_branch_of_benyahias_form_is_that_of_a_sphere_with_inertia():
    # eps (1 + 3/8 r), with r on the radius: Oseen's correction
    assert float(LAWS["koch-hill-benyahia"](0.005, 0.1)) == pytest.approx(
        0.995 * (1 + 0.375 * 0.05)
    )


def test_sizes_of_a_mixture():
    f, phi = float(LAWS["bvk"](0.4, 10.0)), 0.4
    assert float(mixture_factor("yin-sundaresan", f, phi, 1.0)) == pytest.approx(f, rel=1e-14)
    assert float(mixture_factor("bvk", f, phi, 1.0)) == pytest.approx(1.064 * f, rel=1e-14)
    assert float(mixture_factor("none", f, phi, 2.0)) == f
    # a small sphere among large ones feels the flow through their gaps: F y^2 for y to infinity
    large = mixture_factor("yin-sundaresan", f, phi, np.array([0.5, 1.0, 2.0]))
    assert (np.diff(large) > 0.0).all()
    assert sauter_mean([1.0, 1.0, 2.0]) == pytest.approx(10.0 / 6.0)
    with pytest.raises(InputError, match="known are none"):
        mixture_factor("beetstra", f, phi, 1.0)


def test_drag_on_all_sizes_is_that_at_the_mean_size():
    # Beetstra's form without its term 0.064 y^3, which was added for the largest sizes
    d, share = np.array([1.0, 1.5, 2.5]), np.array([0.3, 0.4, 0.3])  # of the solid volume
    mean = 1.0 / (share / d).sum()
    y, number = d / mean, share / d**3
    factor = mixture_factor("bvk", 1.0, 0.4, y) - 0.064 * y**3
    assert (number * d * factor).sum() == pytest.approx(1.0 / mean**2, rel=1e-14)


def test_outside_of_the_data_is_told_apart_and_refused_where_asked():
    law = LAWS["tenneti"]
    assert law.outside([0.05, 0.3, 0.3], [1.0, 1.0, 400.0]).tolist() == [True, False, True]
    assert np.isfinite(law(0.05, 1.0))
    with pytest.raises(RangeError, match=r"'tenneti': solid fraction 0\.05 .* 0\.1 \.\.\. 0\.5"):
        law(0.05, 1.0, strict=True)
    law(0.3, 100.0, strict=True)


@pytest.mark.parametrize("name", LAWS)
@given(phi=st.floats(0.0, 0.6), re=st.floats(0.0, 900.0))
def test_positive_finite_and_growing_with_reynolds(name, phi, re):
    low, high = LAWS[name](phi, np.array([re, re * 1.05 + 1e-3]))
    assert np.isfinite([low, high]).all()
    assert low >= 0.0
    # Di Felice's and Rong's exponents dip where flow turns from viscous to inertial
    assert high >= low * (0.999 if name in ("di-felice", "rong") else 1.0 - 1e-12)


def test_gidaspow_jumps_where_it_is_known_to():
    below, above = LAWS["gidaspow"](np.array([0.2 - 1e-9, 0.2 + 1e-9]), 100.0)
    assert float(below / above) == pytest.approx(1.0 / 1.7325, rel=1e-3)


def test_laws_of_packed_beds_have_no_limit_of_one_sphere():
    for name, law in LAWS.items():
        assert law.sphere == (float(law(0.0, 0.0)) > 0.9), name
        assert law.limits
        assert law.source


def test_names_are_forgiving_and_unknown_ones_refused():
    assert drag_law("Beetstra") is LAWS["bvk"]
    assert drag_law("schiller_naumann") is LAWS["schiller-naumann"]
    with pytest.raises(InputError, match="did you mean 'stokes'"):
        drag_law("stoks")
