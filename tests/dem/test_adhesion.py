"""Necks and liquid bridges: closed forms of force, gap and rupture, at walls and spheres."""

from __future__ import annotations

import math

import numpy as np
import pytest
from impacts import GLASS

from greybed.core import InputError, Plane
from greybed.dem import Contact, ContactLaw, Simulation, SolidWall

R = 1e-3
GAMMA = 0.5  # [J/m2]
MODULUS = 0.5 * GLASS.youngs_modulus / (1.0 - GLASS.poissons_ratio**2)
JKR = ContactLaw(cohesion="jkr")
WET = ContactLaw(cohesion="liquid-bridge")
TENSION, VOLUME, ANGLE = 0.07, 2e-11, 0.3
BRIDGE = Contact(0.5, 0.3, cohesion=TENSION, bridge_volume=VOLUME, contact_angle=ANGLE)


def pulled(law, contact, sphere=False, speed=1e-3, steps=400):
    """Gap and force [N], positive where it attracts, while a held body is drawn away slowly."""
    if sphere:
        sim = Simulation(
            [[0, 0, 0], [0, 0, 2 * R - 2e-6]], R, GLASS, contact, law=law, gravity=(0, 0, 0),
            velocities=[[0, 0, 0], [0, 0, speed]], time_step=2e-6, threads=1,
        )  # fmt: skip
    else:
        wall = SolidWall(Plane((0, 0, 0), (0, 0, 1)), velocity=(0, 0, -speed))
        sim = Simulation(
            [[0, 0, R - 2e-6]], R, GLASS, contact, law=law, gravity=(0, 0, 0), walls=[wall],
            time_step=2e-6, threads=1,
        )  # fmt: skip
    sim._state.fixed[:] = True
    gaps, forces = [], []
    for k in range(steps):
        sim.run(100)
        way = (k + 1) * 100 * 2e-6 * speed - 2e-6
        gaps.append(way)
        forces.append((1.0 if sphere else -1.0) * sim.forces[0, 2])
    return np.array(gaps), np.array(forces), sim


@pytest.mark.parametrize("sphere", [False, True])
def test_a_neck_pulls_as_johnson_kendall_and_roberts_say(sphere):
    contact = Contact(1.0, 0.0, cohesion=GAMMA)
    r = 0.5 * R if sphere else R
    gap, force, _ = pulled(JKR, contact, sphere, speed=2e-4)
    assert force.max() == pytest.approx(3.0 * math.pi * GAMMA * r, rel=1e-4)
    at_contact = np.interp(0.0, gap, force)
    assert at_contact == pytest.approx(8.0 / 3.0 * math.pi * GAMMA * r, rel=1e-3)
    # The neck breaks where it could only shrink: a^3 = pi gamma R^2 / (4 E), gap 3 a^2 / R.
    least = (math.pi * GAMMA * r**2 / (4.0 * MODULUS)) ** (1.0 / 3.0)
    breaks = gap[force > 0.0].max()
    assert breaks == pytest.approx(3.0 * least**2 / r, abs=2.0 * (gap[1] - gap[0]))
    # There the force is 5/9 of the largest; it falls steeply towards it.
    assert 5.0 / 3.0 <= force[force > 0.0][-1] / (math.pi * GAMMA * r) < 2.0


def test_without_surface_energy_a_neck_is_hertz():
    ends = []
    for law in (JKR, ContactLaw()):
        sim = Simulation(
            [[0, 0, 0], [1.9 * R, 0.1 * R, 0]], R, GLASS, Contact(0.6, 0.3), law=law,
            gravity=(0, 0, 0), time_step=1e-6,
        )  # fmt: skip
        sim.run(2_000)
        ends.append(sim.velocities)
    np.testing.assert_allclose(ends[0], ends[1], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("sphere", [False, True])
def test_a_bridge_pulls_thins_and_breaks(sphere):
    radius = R if sphere else 2.0 * R  # of Derjaguin: 2 R1 R2 / (R1 + R2)
    gap, force, sim = pulled(WET, BRIDGE, sphere, speed=5e-3, steps=500)
    breaks = (1.0 + 0.5 * ANGLE) * VOLUME ** (1.0 / 3.0)
    across = (gap > 0.0) & (gap < breaks)
    s = gap * math.sqrt(radius / VOLUME)
    exact = 2.0 * math.pi * radius * TENSION * math.cos(ANGLE) / (1.0 + 1.05 * s + 2.5 * s**2)
    assert across.sum() > 100
    np.testing.assert_allclose(force[across], exact[across], rtol=1e-6)
    assert (force[gap > breaks * 1.01] == 0.0).all()
    assert len(sim.contacts) == len(sim.bridges) == 0


def test_a_bridge_needs_contact_first():
    sim = Simulation([[0, 0, 0], [2.05 * R, 0, 0]], R, GLASS, BRIDGE, law=WET, gravity=(0, 0, 0))
    assert not sim.forces.any()
    near = Simulation(
        [[0, 0, 0], [1.999 * R, 0, 0]], R, GLASS, BRIDGE, law=WET, gravity=(0, 0, 0),
        velocities=[[-0.02, 0, 0], [0.02, 0, 0]], time_step=2e-6,
    )  # fmt: skip
    for _ in range(200):
        near.run(50)
        if len(near.bridges):
            break
    assert near.bridges.tolist() == [[0, 1]]
    assert len(near.contacts) == 0
    assert near.forces[0, 0] > 0.0


def test_friction_of_a_neck_holds_twice_the_pull_off():
    """Thornton: a neck at rest slides at mu times the force plus twice the pull-off force."""
    contact = Contact(0.3, 0.4, cohesion=GAMMA)
    wall = SolidWall(Plane((0, 0, 0), (0, 0, 1)), velocity=(0.01, 0, 0))
    sim = Simulation(
        [[0, 0, R - 1e-6]], R, GLASS, contact, law=JKR, gravity=(0, 0, 0), walls=[wall],
        time_step=2e-6,
    )  # fmt: skip
    sim._state.fixed[:] = True
    sim.run(20_000)
    normal, along = sim.forces[0, 2], sim.forces[0, 0]
    held = normal + 6.0 * math.pi * GAMMA * R
    assert along == pytest.approx(0.4 * held, rel=1e-3)


def test_refusals():
    with pytest.raises(InputError, match="'jkr' needs normal = 'hertz'"):
        ContactLaw(normal="linear", cohesion="jkr")
    with pytest.raises(InputError, match="need bridge_volume above 0"):
        Simulation([[0, 0, 0]], R, GLASS, Contact(0.5, 0.3, cohesion=0.07), law=WET)
