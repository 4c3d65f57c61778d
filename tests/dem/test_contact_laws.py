"""Contact laws against closed forms: restitution, friction, rolling, cohesion, Chung and Ooi."""

from __future__ import annotations

import math

import numpy as np
import pytest
from impacts import GLASS, apart, on_floor, pair

from greybed.core import InputError
from greybed.dem import Contact, ContactLaw, Material

STIFF = {"stiffness": 2e3}


@pytest.mark.parametrize("e", [0.1, 0.3, 0.5, 0.7, 0.9])
@pytest.mark.parametrize("normal", ["hertz", "linear", "hysteresis"])
@pytest.mark.parametrize("limit", [False, True])
def test_the_restitution_asked_for_comes_back(normal, limit, e):
    law = ContactLaw(normal, limit_force=limit)
    step = 2e-6 if normal == "hertz" else 2e-7
    for speed in (0.3, 0.6):
        sim = apart(pair(law, Contact(e, 0.3, **STIFF), speed=speed, time_step=step))
        after = sim.velocities[1, 0] - sim.velocities[0, 0]
        assert after / speed == pytest.approx(e, abs=0.005)


def test_restitution_of_spheres_of_two_sizes_and_materials_and_of_a_wall():
    steel = Material(7800.0, 2e7, 0.28, "steel")
    sim = apart(
        pair(time_step=1e-6, radii=(1e-3, 2.5e-3), materials=[GLASS, steel], kinds=[0, 1],
             contact={("steel", "glass"): Contact(0.6, 0.3), ("glass", "glass"): Contact(1, 0),
                      ("steel", "steel"): Contact(1, 0)})
    )  # fmt: skip
    v = sim.velocities[:, 0]
    assert v[1] - v[0] == pytest.approx(0.6, abs=0.005)
    assert sim.masses @ v == pytest.approx(0.5 * (sim.masses[0] - sim.masses[1]), rel=1e-12)
    wall = on_floor(height=1e-5, velocities=[[0, 0, -0.4]], gravity=(0, 0, 0))
    assert apart(wall, 200).velocities[0, 2] == pytest.approx(0.2, abs=0.0025)


# Hertz 1882 / Timoshenko: radius, speed, E, nu, density; deepest overlap, largest force, duration
# from the closed forms for Chung and Ooi's tests 1 and 2 (doi 10.1007/s10035-011-0277-0).
CHUNG_OOI = {
    "1 glass": (0.01, 10.0, 48e9, 0.20, 2800.0, 274.1e-6, 10.70e3, 40.3e-6),
    "1 limestone": (0.01, 10.0, 20e9, 0.25, 2500.0, 368.3e-6, 7.108e3, 54.2e-6),
    "2 aluminium": (0.1, 0.2, 70e9, 0.30, 2699.0, 49.72e-6, 11.37e3, 731.6e-6),
    "2 magnesium": (0.1, 0.2, 40e9, 0.35, 1800.0, 52.12e-6, 7.233e3, 767.0e-6),
}


@pytest.mark.parametrize("case", CHUNG_OOI)
def test_elastic_impacts_of_chung_and_ooi(case):
    radius, speed, modulus, nu, density, deepest, largest, duration = CHUNG_OOI[case]
    material = Material(density, modulus, nu)
    step = duration / 2000
    elastic = Contact(1.0, 0.0)
    if case[0] == "1":
        sim = pair(contact=elastic, materials=material, radii=(radius, radius), gap=0.0,
                   speed=2.0 * speed, time_step=step)  # fmt: skip
    else:
        rigid = Material(1.0, 1e30, 0.3, "rigid")
        sim = on_floor(
            contact=elastic, materials=[material, rigid], wall="rigid", radius=radius,
            time_step=step, velocities=[[0, 0, -speed]], gravity=(0, 0, 0),
        )  # fmt: skip
    overlap, force, touching = [], [], 0
    for _ in range(2200):
        sim.run(1)
        c = sim.centres
        gap = c[1, 0] - c[0, 0] - 2 * radius if len(c) == 2 else c[0, 2] - radius
        overlap.append(-gap)
        force.append(np.abs(sim.forces).max())
        touching += force[-1] > 0.0
    assert max(overlap) == pytest.approx(deepest, rel=2e-3)
    assert max(force) == pytest.approx(largest, rel=2e-3)
    assert touching * step == pytest.approx(duration, rel=3e-3)


@pytest.mark.parametrize("angle", [2, 5, 20, 45, 70])
def test_oblique_impact_in_gross_sliding(angle):
    """Chung and Ooi's test 4, aluminium oxide, where it slides throughout: impulse is mu times."""
    mu, e, v = 0.092, 0.98, 3.9
    oxide = Material(4000.0, 380e9, 0.23)
    a = math.radians(angle)
    normal, across = v * math.cos(a), v * math.sin(a)
    sim = on_floor(
        contact=Contact(e, mu), materials=oxide, radius=2.5e-3, height=1e-7, time_step=1e-8,
        velocities=[[across, 0, -normal]], gravity=(0, 0, 0),
    )  # fmt: skip
    apart(sim, 100)
    assert sim.velocities[0, 2] == pytest.approx(e * normal, rel=2e-3)
    sliding = across - mu * (1 + e) * normal
    spin = 2.5 * mu * (1 + e) * normal / 2.5e-3
    if sliding - spin * 2.5e-3 > 0.3 * normal:  # slides to the end by far
        assert sim.velocities[0, 0] == pytest.approx(sliding, rel=2e-3)
        assert sim.spins[0, 1] == pytest.approx(spin, rel=5e-3)
    else:
        assert sim.velocities[0, 0] > sliding


def test_a_sliding_sphere_ends_rolling():
    sim = on_floor(contact=Contact(0.5, 0.4), velocities=[[0.2, 0, 0]], time_step=2e-6)
    sim.run(60_000)
    assert sim.velocities[0, 0] == pytest.approx(0.2 * 5 / 7, rel=2e-3)
    assert sim.spins[0, 1] == pytest.approx(0.2 * 5 / 7 / 1e-3, rel=2e-3)


def test_gross_sliding_slows_with_friction_times_gravity():
    sim = on_floor(contact=Contact(0.5, 0.2), velocities=[[1.0, 0, 0]], time_step=2e-6)
    sim.run(2_000)
    before = sim.velocities[0, 0]
    sim.run(5_000)
    assert (before - sim.velocities[0, 0]) / 0.01 == pytest.approx(0.2 * 9.81, rel=1e-3)


def test_rolling_friction_slows_a_rolling_sphere():
    """Rolling without slip under the torque mu_r r m g: dw/dt = -(5/7) mu_r g / r."""
    mu_r, r, w0 = 0.01, 1e-3, 200.0
    sim = on_floor(
        ContactLaw(rolling="constant-torque"), Contact(0.5, 0.5, rolling_friction=mu_r),
        velocities=[[w0 * r, 0, 0]], spins=[[0, w0, 0]], time_step=2e-6,
    )  # fmt: skip
    sim.run(2_000)
    start = sim.spins[0, 1]
    sim.run(10_000)
    slowed = (start - sim.spins[0, 1]) / 0.02
    assert slowed == pytest.approx(5 / 7 * mu_r * 9.81 / r, rel=0.01)


@pytest.mark.parametrize("rolling", ["epsd", "epsd-modified"])
def test_a_rolling_spring_holds_a_sphere_on_a_slope(rolling):
    """Below tan(slope) = mu_r it stays (Ai et al. 2011), above it rolls."""
    contact = Contact(0.3, 0.8, rolling_friction=0.2, rolling_damping=0.5)
    for slope, stays in ((0.15, True), (0.25, False)):
        g = 9.81 * np.array([math.sin(math.atan(slope)), 0.0, -math.cos(math.atan(slope))])
        sim = on_floor(ContactLaw(rolling=rolling), contact, gravity=g, time_step=5e-6)
        sim.run(40_000)
        assert (abs(sim.velocities[0, 0]) < 1e-3) == stays


def test_pull_off_of_dmt_and_depth_of_sjkr():
    """DMT: force 4 pi gamma R* where the spheres just touch; SJKR: density times the disc."""
    gamma, r = 0.05, 1e-3
    sim = pair(ContactLaw(cohesion="dmt"), Contact(0.9, 0.0, cohesion=gamma), gap=-1e-12, speed=0.0)
    assert sim.forces[0, 0] == pytest.approx(4 * math.pi * gamma * r / 2, rel=1e-3)
    depth, density = 1e-6, 1e5
    contact = Contact(0.9, 0.0, cohesion=density)
    held = pair(ContactLaw(cohesion="sjkr"), contact, gap=-depth, speed=0.0)
    free = pair(ContactLaw(), contact, gap=-depth, speed=0.0)
    disc = math.pi * (r**2 - (r - depth / 2) ** 2)
    assert held.forces[0, 0] - free.forces[0, 0] == pytest.approx(density * disc, rel=1e-9)
    wall = on_floor(ContactLaw(cohesion="sjkr"), contact, height=-depth)
    bare = on_floor(ContactLaw(), contact, height=-depth)
    disc = math.pi * (r**2 - (r - depth) ** 2)
    assert bare.forces[0, 2] - wall.forces[0, 2] == pytest.approx(density * disc, rel=1e-9)


def test_van_der_waals_across_a_gap():
    hamaker, r = 1e-14, 1e-3
    contact = Contact(0.9, 0.0, cohesion=hamaker, nearest=1e-8, reach=1e-6)
    for gap, force in ((5e-7, hamaker * r / 2 / 6 / 5e-7**2), (2e-6, 0.0)):
        sim = pair(ContactLaw(cohesion="van-der-waals"), contact, gap=gap, speed=0.0)
        assert sim.forces[0, 0] == pytest.approx(force, rel=1e-6)
        assert sim.forces[1, 0] == -sim.forces[0, 0]


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: Material(0.0, 1e6, 0.3), r"density = 0 \[kg/m3\] must be finite and above 0"),
        (lambda: Material(1e3, -1e6, 0.3), r"youngs_modulus = -1e\+06 \[Pa\]"),
        (lambda: Material(1e3, 1e6, 0.6), r"poissons_ratio = 0.6 \[-\] is outside"),
        (lambda: Contact(0.0, 0.3), "restitution = 0"),
        (lambda: Contact(0.5, -0.3), "friction = -0.3 must be"),
        (lambda: Contact(0.5, math.nan), "friction = nan must be"),
        (lambda: ContactLaw("hooke"), "normal = 'hooke' is unknown; give one of linear, hertz"),
        (lambda: pair(ContactLaw("linear")), "needs stiffness"),
        (lambda: pair(ContactLaw("linear"), Contact(0.5, 0.1, **STIFF)), "needs time_step"),
        (lambda: pair(ContactLaw(cohesion="van-der-waals")), "0 < nearest < reach"),
    ],
)
def test_refusals(call, says):
    with pytest.raises(InputError, match=says):
        call()
