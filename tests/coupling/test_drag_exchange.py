"""Drag of particles, lift, added mass and Nusselt numbers: limits, hooks, refusals."""

from __future__ import annotations

import math

import numpy as np
import pytest

from greybed.cfd.grid import Grid
from greybed.closures.drag import LAWS
from greybed.core.errors import InputError
from greybed.coupling.drag_exchange import Settings, drag_terms
from greybed.coupling.forces import added_mass, shear_lift, vorticity_of
from greybed.coupling.gas_particles import GasParticles
from greybed.coupling.nusselt import NUSSELT, nusselt_law
from greybed.dem import Contact, Material, Simulation
from tests.coupling.plain_gas import PlainGas

RHO, MU = 1.2, 1.8e-5
SLIP = np.array([[0.3, 0.0, 0.4], [0.0, 0.0, 0.01], [0.0, 0.0, 0.0]])
VOID, D = np.array([0.45, 0.8, 0.999]), np.array([1e-3, 0.5e-3, 0.1e-3])


def terms(**settings):
    return drag_terms(Settings(**settings), SLIP, VOID, D, RHO, MU, 3e-3)


def test_coefficient_and_slope_are_those_of_the_law():
    found = terms(drag="bvk")
    re = VOID * RHO * D * np.linalg.norm(SLIP, axis=1) / MU
    f, slope = LAWS["bvk"].with_slope(1 - VOID, re)
    np.testing.assert_allclose(found.coefficient, 3 * math.pi * MU * D * VOID * f, rtol=1e-14)
    np.testing.assert_allclose(found.steepness, 1 + slope / f, rtol=1e-14)
    np.testing.assert_allclose(found.over(VOID).coefficient * VOID, found.coefficient, rtol=1e-14)


def test_one_slow_sphere_has_stokes_drag():
    found = drag_terms(Settings(drag="stokes"), SLIP, np.ones(3), D, RHO, MU, 1.0)
    np.testing.assert_allclose(found.coefficient, 3 * math.pi * MU * D, rtol=1e-15)


def test_a_function_is_as_good_as_a_name():
    named = terms(drag="di-felice")
    given = terms(drag=lambda phi, re: LAWS["di-felice"](phi, re))
    np.testing.assert_allclose(given.coefficient, named.coefficient, rtol=1e-14)
    # its slope is a difference
    np.testing.assert_allclose(given.steepness, named.steepness, rtol=2e-3)


def test_a_correction_keeps_its_share_of_drag():
    def kept(phi, slip, size):
        assert slip.shape == (3, 3)
        assert size == 3e-3
        return 1.0 - phi

    whole, part = terms(drag="bvk"), terms(drag="bvk", correction=kept)
    np.testing.assert_allclose(part.coefficient, VOID * whole.coefficient, rtol=1e-14)
    with pytest.raises(InputError, match="one finite number >= 0"):
        terms(correction=lambda phi, slip, size: phi - 1.0)


def test_a_mixture_of_one_size_is_that_size():
    d = np.full(3, 1e-3)
    for mixture, factor in (("yin-sundaresan", 1.0), ("bvk", 1.064)):
        one = drag_terms(Settings(drag="bvk"), SLIP, VOID, d, RHO, MU, 1.0)
        mixed = drag_terms(Settings(drag="bvk", mixture=mixture), SLIP, VOID, d, RHO, MU, 1.0)
        np.testing.assert_allclose(mixed.coefficient, factor * one.coefficient, rtol=1e-13)


@pytest.mark.parametrize(
    ("settings", "message"),
    [({"drag": "bvkk"}, "did you mean 'bvk'"), ({"treatment": "fully"}, "known are explicit"),
     ({"width": -1.0}, "width = -1"), ({"void": "divided"}, "known are exact, centre"),
     ({"lift": "magnus"}, "known are none"), ({"least_void": 0.0}, "least_void = 0")],
)  # fmt: skip
def test_settings_are_checked(settings, message):
    with pytest.raises(InputError, match=message):
        Settings(**settings)


def test_a_law_that_fails_is_refused():
    with pytest.raises(InputError, match=r"F = nan at a solid fraction of 0\.55"):
        terms(drag=lambda phi, re: re * np.nan)


def test_saffman_s_lift_of_slow_flow():
    # 1.615 mu d |s| sqrt(Re_shear), towards the faster side where the sphere lags
    d, s, g = np.array([1e-4]), 1e-4, 100.0
    slip, curl = np.array([[0.0, 0.0, s]]), np.array([[0.0, -g, 0.0]])
    force = shear_lift(slip, curl, d, RHO, MU)[0]
    shear = RHO * d[0] ** 2 * g / MU
    alpha = 0.5 * d[0] * g / s
    re = RHO * d[0] * s / MU
    mei = (1 - 0.3314 * alpha**0.5) * math.exp(-0.1 * re) + 0.3314 * alpha**0.5
    assert force[0] == pytest.approx(1.615 * MU * d[0] * s * math.sqrt(shear) * mei, rel=1e-12)
    assert force[1] == force[2] == 0.0
    assert not shear_lift(0 * slip, curl, d, RHO, MU).any()
    assert not shear_lift(slip, 0 * curl, d, RHO, MU).any()


def test_vorticity_of_a_turning_gas():
    z, y, x = np.meshgrid(np.arange(4.0), np.arange(5.0), np.arange(6.0), indexing="ij")
    turn = np.array([0.3, -0.2, 0.5])
    flow = np.cross(turn, np.stack([x, 2.0 * y, 0.5 * z], axis=-1))
    curl = vorticity_of(flow, (1.0, 2.0, 0.5))
    np.testing.assert_allclose(curl, np.broadcast_to(2 * turn, curl.shape), rtol=1e-12)


def test_added_mass_of_a_bubble_and_of_a_stone():
    # a body without mass in a fluid at rest rises at twice g: buoyancy over half the fluid's mass
    displaced, g = np.array([1e-6]), np.array([[0.0, 0.0, 9.81]])
    lift = displaced[:, None] * g
    force = added_mass(0.5, displaced, np.array([0.0]), lift, np.zeros((1, 3)))
    np.testing.assert_allclose(lift + force, 0.0, atol=1e-20)
    # one that moves with the fluid feels none
    heavy = np.array([2e-6])
    force = added_mass(0.5, displaced, heavy, heavy[:, None] * g, g)
    np.testing.assert_allclose(force, 0.0, atol=1e-20)


@pytest.mark.parametrize("name", ["gunn", "ranz-marshall", "whitaker", "sun"])
def test_one_sphere_in_still_gas_has_a_nusselt_number_of_two(name):
    assert float(NUSSELT[name](np.array(1.0), np.array(0.0), 0.7)) == pytest.approx(2.0, rel=1e-12)


@pytest.mark.parametrize("name", NUSSELT)
def test_heat_transfer_grows_with_reynolds(name):
    nu = NUSSELT[name](np.full(50, 0.6), np.geomspace(1e-3, 1e3, 50), 0.7)
    assert (np.diff(nu) > 0.0).all()


def test_laws_of_beds_agree_at_moderate_reynolds():
    # Sun's fit is to direct simulations; Gunn's was to experiments: some 20 % apart
    one, two = (float(NUSSELT[n](np.array(0.6), np.array(50.0), 0.7)) for n in ("gunn", "sun"))
    assert abs(one / two - 1.0) < 0.3
    with pytest.raises(InputError, match="known are gunn"):
        nusselt_law("gun")


def bed(size, periodic, **more):
    return Simulation(
        [[0.003] * 3], 0.5e-3, Material(2500.0, 5e6, 0.3, "glass"), Contact(0.9, 0.3),
        box=[[0, 0, 0], size], periodic=periodic, **more,
    )  # fmt: skip


def test_boxes_of_gas_and_particles_must_agree():
    grid = Grid(cells=(2, 2, 2), upper=(0.006,) * 3, periodic=(True, True, False))
    gas = PlainGas(grid, RHO, MU)
    with pytest.raises(InputError, match="axis z repeats in the gas or in the particles only"):
        GasParticles(gas, bed((0.006,) * 3, (True,) * 3))
    with pytest.raises(InputError, match=r"the gas repeats from 0 to 0\.006"):
        GasParticles(gas, bed((0.006, 0.007, 0.006), (True, True, False)))
    low = Grid(cells=(2, 2, 2), upper=(0.006, 0.006, 0.002), periodic=(True, True, False))
    with pytest.raises(InputError, match="lies outside the gas's grid"):
        GasParticles(PlainGas(low, RHO, MU), bed((0.006,) * 3, (True, True, False)))
