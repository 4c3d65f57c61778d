"""The eight tests of Chung and Ooi (Granular Matter 13 (2011) 643, doi 10.1007/s10035-011-0277-0).

Judged by Hertz's closed forms and their quadrature, by rigid-body impulses where surfaces slide
throughout, and elsewhere by the equations of one contact in two numbers (overlap and stretch),
integrated here in steps of their own.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad

from greybed.core.walls import Plane
from greybed.dem import Contact, ContactLaw, Material, Simulation, SolidWall

RIGID = Material(1.0, 1e30, 0.3, "rigid")
PLAIN = ContactLaw(tangential_damping=False)


def reduced(a, b):
    """E* and G* of two materials."""
    modulus = 1.0 / sum((1.0 - m.poissons_ratio**2) / m.youngs_modulus for m in (a, b))
    return modulus, 1.0 / sum((2.0 - m.poissons_ratio) / m.shear_modulus for m in (a, b))


def mass(material, radius):
    return material.density * 4.0 / 3.0 * math.pi * radius**3


def deepest(speed, m, r, modulus):
    """Largest overlap of an elastic impact (Hertz 1882)."""
    return (15.0 * m * speed**2 / (16.0 * modulus * math.sqrt(r))) ** 0.4


# 2 * integral of dx / sqrt(1 - x^2.5) from 0 to 1: duration times speed over deepest overlap.
DURATION = 2.0 * math.sqrt(math.pi) * math.gamma(1.4) / math.gamma(0.9)


def reference(slip, speed, m, r, moduli, e, mu, steps=10_000):
    """Speeds of the surfaces along each other and apart after an impact, each (n,).

    Overlap d and stretch x: m d'' = -F, m s' = -3.5 T, F = 4/3 E* sqrt(r) d^1.5 + damping, T = 8 G*
    sqrt(r d) x, where x follows the slip s until T reaches mu |F|. 1 / m + r^2 / I is 3.5 / m.
    """
    modulus, shear = moduli
    log = math.log(e)
    zeta = -math.sqrt(5.0 / 6.0) * log / math.hypot(math.pi, log)
    s = np.array(slip, dtype=float)
    v = np.broadcast_to(np.asarray(speed, dtype=float), s.shape).copy()
    d, x, apart = np.zeros_like(s), np.zeros_like(s), np.zeros(s.shape, bool)
    dt = 2.0 * DURATION * deepest(v, m, r, modulus) / v / steps
    while not apart.all():
        d = np.where(apart, d, d + 0.5 * dt * v)
        inside = np.maximum(d, 0.0)
        width = np.sqrt(r * inside)
        force = 4.0 / 3.0 * modulus * width * inside
        force = force + 2.0 * zeta * np.sqrt(2.0 * modulus * width * m) * v
        most = mu * np.abs(force)
        # The slip in the middle of the step, so that the stretch is right to second order.
        tried = 8.0 * shear * width * (x + 0.5 * dt * s)
        held = np.clip(tried, -most, most)
        with np.errstate(invalid="ignore", divide="ignore"):
            kept = np.where(width > 0.0, held / (8.0 * shear * width), 0.0)
        moving = ~apart
        s_new = s - 3.5 * held / m * dt
        x = np.where(moving, kept + 0.5 * dt * s_new, x)
        v = np.where(moving, v - force / m * dt, v)
        s = np.where(moving, s_new, s)
        d = np.where(apart, d, d + 0.5 * dt * v)
        apart |= (d <= 0.0) & (v < 0.0)
    return s, -v


def flock(materials, radius, normal, contact, law, across=0.0, spin=0.0):
    """Spheres side by side that hit a floor of the last material; spins about y, motion along x.

    Returns velocities along x and z and spins about y after the impact.
    """
    normal, across, spin = np.broadcast_arrays(
        np.asarray(normal, dtype=float), np.asarray(across, dtype=float), np.asarray(spin, float)
    )
    n = len(normal)
    modulus, _ = reduced(materials[0], materials[-1])
    m = mass(materials[0], radius)
    after = np.zeros((n, 3))
    # One simulation of each speed: all its spheres have the same time step.
    for speed in np.unique(normal):
        who = normal == speed
        k = int(who.sum())
        duration = DURATION * deepest(speed, m, radius, modulus) / speed
        zero = np.zeros(k)
        sim = Simulation(
            np.stack([10.0 * radius * np.arange(k), zero, zero + radius], axis=1),
            radius,
            materials,
            contact,
            law=law,
            walls=[SolidWall(Plane((0, 0, 0), (0, 0, 1), "floor"), materials[-1].name)],
            gravity=(0, 0, 0),
            time_step=duration / 4000,
            velocities=np.stack([across[who], zero, zero - speed], axis=1),
            spins=np.stack([zero, spin[who], zero], axis=1),
            threads=1,
        )
        sim.run(12_000)  # with little restitution impacts take longer
        assert not sim.forces.any()
        after[who] = np.stack([sim.velocities[:, 0], sim.velocities[:, 2], sim.spins[:, 1]], axis=1)
    return after.T


ELASTIC = {  # radius, speed of approach, material; two spheres or one and a rigid plane
    "1 glass": (0.01, 20.0, Material(2800.0, 48e9, 0.20), True),
    "1 limestone": (0.01, 20.0, Material(2500.0, 20e9, 0.25), True),
    "2 aluminium": (0.1, 0.2, Material(2699.0, 70e9, 0.30), False),
    "2 magnesium": (0.1, 0.2, Material(1800.0, 40e9, 0.35), False),
}


@pytest.mark.parametrize("name", ELASTIC)
def test_1_and_2_force_overlap_and_time_of_elastic_impacts(name):
    radius, speed, material, two = ELASTIC[name]
    modulus, _ = reduced(material, material if two else RIGID)
    m, r = mass(material, radius), radius
    if two:
        m, r = m / 2, r / 2
    deep = deepest(speed, m, r, modulus)
    step = DURATION * deep / speed / 5000
    common = {"gravity": (0, 0, 0), "time_step": step, "threads": 1}
    if two:
        sim = Simulation(
            [[-radius, 0, 0], [radius, 0, 0]], radius, material, Contact(1.0, 0.35),
            velocities=[[speed / 2, 0, 0], [-speed / 2, 0, 0]], **common,
        )  # fmt: skip
    else:
        floor = SolidWall(Plane((0, 0, 0), (0, 0, 1)), "rigid")
        sim = Simulation(
            [[0, 0, radius]], radius, [material, RIGID], Contact(1.0, 0.35), walls=[floor],
            velocities=[[0, 0, -speed]], **common,
        )  # fmt: skip
    for part in range(1, 20):
        sim.run(250)
        c = sim.centres
        d = 2 * radius - (c[1, 0] - c[0, 0]) if two else radius - c[0, 2]
        force = np.abs(sim.forces).max()
        assert force == pytest.approx(4 / 3 * modulus * math.sqrt(r) * d**1.5, rel=1e-6)
        # The time at this overlap: energy, then a quadrature; x = u^2 takes the root away.
        way = quad(lambda u: math.sqrt(1.0 / (1.0 - u**2.5)), 0.0, min(d / deep, 1.0))[0]
        time = way * deep / speed
        time = time if part <= 10 else DURATION * deep / speed - time
        # At the turn the overlap says little about the time.
        assert sim.time == pytest.approx(time, abs=(30 if part == 10 else 3) * step)
        if part == 10:
            assert d == pytest.approx(deep, rel=1e-6)


@pytest.mark.parametrize("limit", [False, True])
@pytest.mark.parametrize(
    "material", [Material(4000.0, 380e9, 0.23, "oxide"), Material(7000.0, 100e9, 0.25, "iron")]
)
def test_3_restitution_returns(material, limit):
    for e in (0.2, 0.4, 0.6, 0.8, 1.0):
        _, up, _ = flock([material], 2.5e-3, [3.9], Contact(e, 0.0), ContactLaw(limit_force=limit))
        assert up[0] / 3.9 == pytest.approx(e, abs=5e-4)


def test_4_oblique_impact_at_constant_speed():
    oxide, radius, e, mu = Material(4000.0, 380e9, 0.23), 2.5e-3, 0.98, 0.092
    angle = np.radians([2, 5, 10, 15, 20, 25, 30, 40, 50, 60, 70, 80])
    normal, across = 3.9 * np.cos(angle), 3.9 * np.sin(angle)
    vx, vz, wy = flock([oxide], radius, normal, Contact(e, mu), PLAIN, across)
    np.testing.assert_allclose(vz / normal, e, rtol=0, atol=5e-4)
    # About its lowest point it gains in spin 5/2 of what it loses in speed, less what the overlap
    # takes off the arm: the contact lies on the wall.
    deep = deepest(normal, mass(oxide, radius), radius, reduced(oxide, oxide)[0])
    share = radius * wy / (2.5 * (across - vx))
    assert (share < 1.0).all()
    assert (share > 1.0 - deep / radius).all()
    slip, _ = reference(across, normal, mass(oxide, radius), radius, reduced(oxide, oxide), e, mu)
    np.testing.assert_allclose(vx - radius * wy, slip, rtol=0, atol=2e-3 * 3.9)
    # Maw, Barber and Fawcett 1976: sliding throughout where tan > mu (4 chi - 1) / kappa, kappa =
    # 2 (1 - nu) / (2 - nu), chi = 7 kappa / 4; well above this angle impulses are mu times.
    kappa = 2.0 * 0.77 / 1.77
    beyond = np.tan(angle) > 1.2 * mu * (7.0 * kappa - 1.0) / kappa
    assert 4 < beyond.sum() < 9
    np.testing.assert_allclose(vx[beyond], (across - mu * (1 + e) * normal)[beyond], rtol=1e-3)
    assert (vx > across - mu * (1 + e) * normal - 1e-3).all()


@pytest.mark.parametrize(
    "material", [Material(7850.0, 208e9, 0.3, "steel"), Material(1400.0, 1e9, 0.4, "polyethylene")]
)
def test_5_oblique_impact_at_constant_normal_speed(material):
    # At the paper's 5 m/s overlaps shorten the arms; the ratios on its axes are those of any speed.
    radius, mu, normal = 1e-5, 0.3, 0.05
    across = normal * np.array([0.02, 0.06, 0.1, 0.2, 0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 10.0, 14.0])
    vx, vz, wy = flock([material], radius, normal + 0 * across, Contact(1.0, mu), PLAIN, across)
    np.testing.assert_allclose(vz, normal, rtol=1e-5)
    slip, _ = reference(
        across, normal, mass(material, radius), radius, reduced(material, material), 1.0, mu
    )
    np.testing.assert_allclose(vx - radius * wy, slip, rtol=0, atol=6e-3 * normal)
    slides = across > 7.5 * mu * normal
    assert slides.sum() >= 5
    # Of the paper's axes: recoil falls by 7, spin is 5 (e = 1).
    np.testing.assert_allclose((across - vx + radius * wy)[slides] / (mu * normal), 7.0, rtol=2e-3)
    np.testing.assert_allclose(radius * wy[slides] / (mu * normal), 5.0, rtol=2.5e-3)


ALLOY, NYLON = Material(2700.0, 70e9, 0.33, "alloy"), Material(1000.0, 2.5e9, 0.4, "nylon")
# Twice a radius over the speed is the slip; ten times as fast for impulses of friction alone, as
# the spring is stretched first: what it takes longer to slide goes with the inverse of the slip.
SPINS = np.array([0.175, 0.5, 0.9, 2.0, 3.0, 5.0, 9.0, 12.0, 22.0])
FAST = 10.0 * SPINS[SPINS > 4.0]


@pytest.mark.parametrize("material", [ALLOY, NYLON])
def test_6_a_spinning_sphere_meets_a_plane(material):
    radius, e, mu, normal = 0.1, 0.5, 0.4, 0.2
    speeds = normal + 0 * SPINS
    vx, vz, wy = flock([material], radius, speeds, Contact(e, mu), PLAIN, spin=SPINS)
    np.testing.assert_allclose(vz / normal, e, atol=5e-4)
    np.testing.assert_allclose(2.5 * vx, radius * (SPINS - wy), rtol=3e-3, atol=1e-6)
    m, moduli = mass(material, radius), reduced(material, material)
    slip, _ = reference(-radius * SPINS, normal, m, radius, moduli, e, mu)
    np.testing.assert_allclose(vx - radius * wy, slip, rtol=0, atol=4e-3 * normal)
    # Without the attraction of the damping the impulse is (1 + e) m v, and the friction's mu times.
    law = ContactLaw(limit_force=True, tangential_damping=False)
    vx, vz, wy = flock([material], radius, normal + 0 * FAST, Contact(e, mu), law, spin=FAST)
    np.testing.assert_allclose(vz / normal, e, atol=5e-4)
    np.testing.assert_allclose(vx, mu * (1 + e) * normal, rtol=1.5e-3)
    np.testing.assert_allclose(radius * (FAST - wy), 2.5 * mu * (1 + e) * normal, rtol=3e-3)


def meeting(materials, radii, law, contact, speed, rates=SPINS):
    """Pairs that meet along x, both spheres of each turning alike about z, far from other pairs.

    The second sphere rests. Returns velocities (pairs, 2, 3) and spins (pairs, 2).
    """
    n = len(rates)
    modulus, _ = reduced(materials[0], materials[-1])
    a, b = (mass(m, r) for m, r in zip((materials[0], materials[-1]), radii, strict=True))
    r = radii[0] * radii[1] / sum(radii)
    duration = DURATION * deepest(speed, a * b / (a + b), r, modulus) / speed
    at = np.zeros((n, 2, 3))
    at[:, 1, 0] = sum(radii)
    at[:, :, 1] = 5.0 * sum(radii) * np.arange(n)[:, None]
    motion, spins = np.zeros_like(at), np.zeros_like(at)
    motion[:, 0, 0] = speed
    spins[:, 0, 2] = rates
    if len(materials) == 1:
        motion[:, :, 0] -= speed / 2
        spins[:, 1, 2] = rates
    sim = Simulation(
        at.reshape(-1, 3),
        np.tile(radii, n),
        materials,
        contact,
        kinds=np.tile([0, len(materials) - 1], n),
        law=law,
        gravity=(0, 0, 0),
        time_step=duration / 4000,
        velocities=motion.reshape(-1, 3),
        spins=spins.reshape(-1, 3),
        threads=1,
    )
    sim.run(12_000)
    assert not sim.forces.any()
    return sim.velocities.reshape(n, 2, 3), sim.spins.reshape(n, 2, 3)[:, :, 2]


@pytest.mark.parametrize("material", [ALLOY, NYLON])
def test_7_two_like_spheres_with_the_same_spin(material):
    radius, e, mu, speed = 0.1, 0.5, 0.4, 0.4
    v, w = meeting([material], (radius, radius), PLAIN, Contact(e, mu), speed)
    np.testing.assert_array_equal(v[:, 0], -v[:, 1])
    np.testing.assert_allclose(w[:, 0], w[:, 1], rtol=1e-12)
    np.testing.assert_allclose(-v[:, 0, 0] / (speed / 2), e, atol=5e-4)
    m, moduli = mass(material, radius) / 2, reduced(material, material)
    slip, _ = reference(2 * radius * SPINS, speed, m, radius / 2, moduli, e, mu)
    after = 2 * v[:, 0, 1] + 2 * radius * w[:, 0]
    np.testing.assert_allclose(after, slip, rtol=0, atol=4e-3 * speed)
    law = ContactLaw(limit_force=True, tangential_damping=False)
    v, w = meeting([material], (radius, radius), law, Contact(e, mu), speed, FAST)
    np.testing.assert_allclose(v[:, 0, 1], -mu * (1 + e) * speed / 2, rtol=1.5e-3)
    lost = 2.5 * mu * (1 + e) * speed / 2 / radius
    np.testing.assert_allclose(FAST - w[:, 0], lost, rtol=3e-3)


@pytest.mark.parametrize("material", [ALLOY, NYLON])
def test_8_a_small_sphere_meets_a_large_heavy_one(material):
    radius, e, mu, speed = 0.1, 0.5, 0.4, 0.2
    m = material
    heavy = Material(1000.0 * m.density, m.youngs_modulus, m.poissons_ratio, "heavy")
    v, w = meeting([m, heavy], (radius, 5 * radius), PLAIN, Contact(e, mu), speed)
    a, b = mass(m, radius), mass(heavy, 5 * radius)
    np.testing.assert_allclose(v[:, 1, 0] - v[:, 0, 0], e * speed, rtol=1e-3)
    np.testing.assert_allclose(a * v[:, 0, 1], -b * v[:, 1, 1], rtol=1e-6)
    slip, _ = reference(
        radius * SPINS, speed, a * b / (a + b), radius * 5 / 6, reduced(m, m), e, mu
    )
    after = v[:, 0, 1] - v[:, 1, 1] + radius * w[:, 0] + 5 * radius * w[:, 1]
    np.testing.assert_allclose(after, slip, rtol=0, atol=4e-3 * speed)
    law = ContactLaw(limit_force=True, tangential_damping=False)
    v, w = meeting([m, heavy], (radius, 5 * radius), law, Contact(e, mu), speed, FAST)
    # Both get the impulse mu (1 + e) m* v, and its moment about their own centres.
    impulse = mu * (1 + e) * speed * a * b / (a + b)
    np.testing.assert_allclose(v[:, 0, 1], -impulse / a, rtol=1.5e-3)
    np.testing.assert_allclose(FAST - w[:, 0], 2.5 * impulse / (a * radius), rtol=3e-3)
    np.testing.assert_allclose(-w[:, 1], 2.5 * impulse / (b * 5 * radius), rtol=3e-3)
