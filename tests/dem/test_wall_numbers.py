"""Walls have friction and cohesion of their own: what particles do to each other is apart from it.

One simulation has both: a sphere on a floor, and two spheres that touch high above it.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from impacts import GLASS

from greybed.core.walls import Plane
from greybed.dem import Contact, ContactLaw, Material, Simulation, SolidWall

R = 1e-3
STEEL = Material(7800.0, 2e7, 0.28, "steel")


def both(own, wall, law=None, depth=(1e-6, 1e-6), **more):
    """Sphere 0 on a floor of steel, spheres 1 and 2 beside each other along x."""
    high = 20 * R
    return Simulation(
        [[0, 0, R - depth[0]], [0, 0, high], [2 * R - depth[1], 0, high]], R, [GLASS, STEEL],
        {("glass", "glass"): own, ("glass", "steel"): wall}, law=law or ContactLaw(),
        walls=[SolidWall(Plane((0, 0, 0), (0, 0, 1)), "steel")], threads=1, **more,
    )  # fmt: skip


def hertz(of_wall, depth):
    """Force without damping [N]."""
    partner = STEEL if of_wall else GLASS
    modulus = 1 / sum((1 - m.poissons_ratio**2) / m.youngs_modulus for m in (GLASS, partner))
    return 4 / 3 * modulus * math.sqrt(R if of_wall else R / 2) * depth**1.5


@pytest.mark.parametrize(("own", "wall"), [(0.0, 0.3), (0.4, 0.0), (0.4, 0.15)])
def test_a_sphere_slides_on_a_wall_by_the_friction_of_the_wall(own, wall):
    weight = GLASS.density * 4 / 3 * math.pi * R**3 * 9.81
    rest = (weight / hertz(True, 1.0)) ** (2 / 3)
    sim = both(
        Contact(0.5, own), Contact(0.5, wall), depth=(rest, -R), time_step=1e-6,
        velocities=[[1.0, 0, 0], [0, 0, 0], [0, 0, 0]],
    )  # fmt: skip
    sim.run(2_000)
    before, spin = sim.velocities[0, 0], sim.spins[0, 1]
    sim.run(5_000)
    slowed = (before - sim.velocities[0, 0]) / (5_000 * sim.time_step)
    assert slowed == pytest.approx(wall * 9.81, rel=1e-3, abs=1e-9)
    spun = (sim.spins[0, 1] - spin) / (5_000 * sim.time_step)
    assert spun * 0.4 * R == pytest.approx(wall * 9.81, rel=2e-3, abs=1e-9)
    np.testing.assert_allclose(
        sim.wall_forces[0], [wall * weight, 0, -weight], rtol=1e-3, atol=1e-3 * weight
    )


@pytest.mark.parametrize(("own", "wall"), [(0.0, 0.3), (0.4, 0.0), (0.4, 0.15)])
def test_spheres_slide_on_each_other_by_their_own_friction(own, wall):
    """Sideways force of the pair over its normal force, with a wall of another friction."""
    sim = both(
        Contact(1.0, own), Contact(1.0, wall), depth=(-R, 1e-5), gravity=(0, 0, 0),
        time_step=1e-7, velocities=[[0, 0, 0], [0, 2.0, 0], [0, -2.0, 0]],
    )  # fmt: skip
    sim.run(20)
    along = sim.centres[1] - sim.centres[2]
    along /= np.linalg.norm(along)
    force = sim.forces[1]
    normal = force @ along
    assert normal == pytest.approx(hertz(False, 1e-5), rel=0.02)
    sideways = np.linalg.norm(force - normal * along)
    assert sideways == pytest.approx(own * normal, rel=1e-9, abs=1e-12 * normal)


def attraction(cohesion, number, of_wall, depth):
    """Closed forms of what holds together [N]."""
    if cohesion == "dmt":
        return 4 * math.pi * number * (R if of_wall else R / 2)
    return number * math.pi * (R**2 - (R - (depth if of_wall else depth / 2)) ** 2)


@pytest.mark.parametrize(("cohesion", "own", "wall"), [
    ("sjkr", 2e5, 0.0), ("sjkr", 0.0, 2e5), ("sjkr", 2e5, 5e4),
    ("dmt", 0.05, 0.0), ("dmt", 0.0, 0.05), ("dmt", 0.05, 0.01),
])  # fmt: skip
def test_cohesion_of_the_wall_is_apart_from_that_of_the_particles(cohesion, own, wall):
    depth = 1e-6
    sim = both(
        Contact(0.5, 0.3, cohesion=own), Contact(0.5, 0.3, cohesion=wall),
        ContactLaw(cohesion=cohesion), gravity=(0, 0, 0),
    )  # fmt: skip
    on_floor = hertz(True, depth) - attraction(cohesion, wall, True, depth)
    between = hertz(False, depth) - attraction(cohesion, own, False, depth)
    want = np.array([[0, 0, on_floor], [-between, 0, 0], [between, 0, 0]])
    np.testing.assert_allclose(sim.forces, want, rtol=1e-8, atol=1e-18)
    np.testing.assert_allclose(sim.wall_forces[0], [0, 0, -on_floor], rtol=1e-8, atol=1e-18)


def test_a_sphere_hangs_where_only_the_wall_holds_it():
    """Upside down: gravity pulls away from the floor; a pair without cohesion falls apart."""
    sim = both(
        Contact(0.3, 0.3), Contact(0.3, 0.3, cohesion=0.02), ContactLaw(cohesion="dmt"),
        gravity=(0, 0, 9.81), time_step=2e-6,
    )  # fmt: skip
    sim.run(20_000)
    assert sim.centres[0, 2] < R
    assert sim.centres[1, 2] > 20 * R + 0.9 * 0.5 * 9.81 * sim.time**2
    assert len(sim.contacts) == 0
