"""A few spheres for a few steps: quick also where kernels are plain Python."""

from __future__ import annotations

import numpy as np
import pytest
from impacts import GLASS

from greybed.core import Cone, Cylinder, Disc, Mesh, Plane, box_walls
from greybed.dem import (
    Clumps,
    Contact,
    ContactLaw,
    Heat,
    Material,
    Simulation,
    SolidWall,
    lists,
    sphere_union,
    spherocylinder,
)
from greybed.dem.insertion import Region, random_places

R = 1e-3
LAWS = [
    ContactLaw("hertz", "epsd", "sjkr"),
    ContactLaw("hertz", "none", "jkr"),
    ContactLaw("hertz", "constant-torque", limit_force=True),
    ContactLaw("linear", "constant-torque", "dmt", limit_force=True),
    ContactLaw("linear", "epsd", "liquid-bridge", tangential_damping=False),
    ContactLaw("hysteresis", "epsd-modified", "van-der-waals"),
    ContactLaw("viscoelastic", "viscous", limit_force=True),
]


def contact(law, **more):
    """Numbers for every law, with attraction of the order of the weight."""
    strength = {"sjkr": 1e4, "jkr": 0.02, "dmt": 0.02, "van-der-waals": 1e-17}
    return Contact(
        0.6, 0.4, 0.3, rolling_friction=0.1, rolling_damping=0.2, rolling_time=1e-5,
        cohesion=strength.get(law.cohesion, 0.07), nearest=1e-8, reach=1e-5, bridge_volume=1e-12,
        contact_angle=0.3, stiffness=5e3, reference_speed=1.0, reference_radius=R, **more,
    )  # fmt: skip


@pytest.mark.parametrize("law", LAWS, ids=lambda law: f"{law.normal}-{law.rolling}-{law.cohesion}")
@pytest.mark.parametrize("materials", [1, 2])
def test_contacts_move_momentum_but_make_none(law, materials):
    """Three that meet off centre, one of them across a periodic face, with spin."""
    kinds = [GLASS, Material(1200.0, 2e6, 0.2, "wax")][:materials]
    touch = contact(law)
    contacts = touch
    if materials == 2:
        names = [("particle", "particle"), ("particle", "wax"), ("wax", "wax")]
        kinds[0] = Material(2500.0, 5e6, 0.3, "particle")
        contacts = dict.fromkeys(names, touch)
    sim = Simulation(
        [[0.9 * R, 4 * R, 4 * R], [2.895 * R, 4.1 * R, 4 * R], [8.905 * R, 4 * R, 4.1 * R]],
        [R, R, R], kinds if materials == 2 else kinds[0], contacts, law=law,
        kinds=[0, materials - 1, 0], box=[[0, 0, 0], [10 * R] * 3], periodic=(True,) * 3,
        gravity=(0, 0, 0), velocities=[[0.1, 0, 0], [-0.2, 0.05, 0], [0.3, 0, -0.05]],
        spins=[[0, 0, 60.0], [20.0, 0, 0], [0, 40.0, 0]], threads=1, time_step=1e-6,
    )  # fmt: skip
    momentum = sim.masses @ sim.velocities
    scale = sim.masses @ abs(sim.velocities)
    met = False
    for _ in range(4):
        sim.run(10)
        met = met or len(sim.contacts) > 0
    assert met
    assert abs(sim.forces).max() > 0.0
    assert abs(sim.masses @ sim.velocities - momentum).max() < 1e-12 * scale.max()


SQUARE = Mesh(
    [[-9 * R, -9 * R, 0], [9 * R, -9 * R, 0], [9 * R, 9 * R, 0], [-9 * R, 9 * R, 0]],
    [[0, 1, 2], [0, 2, 3]],
)
FLOORS = {
    "plane": Plane((0, 0, 0), (0, 0, 1)),
    "disc": Disc((0, 0, 0), (0, 0, 1), 5 * R),
    "rim of a disc": Disc((-1.0 * R, 0, 0), (0, 0, 1), 1.2 * R),
    "tube": Cylinder((0, -9 * R, 3 * R), (0, 1, 0), 3 * R, length=20 * R),
    "cone": Cone((0, 0, -4 * R), (0, 0, 1), 0.0, 8 * R, 8 * R),
    "polygon": box_walls((-R * 9, -R * 9, 0), (R * 9, R * 9, R * 9))[4],
    "mesh": SQUARE,
}


@pytest.mark.parametrize("name", FLOORS)
@pytest.mark.parametrize("law", LAWS[:1] + LAWS[4:6], ids=lambda law: law.normal)
def test_walls_are_pushed_as_much_as_they_push(name, law):
    sim = Simulation(
        [[0.3 * R, 0, 0.99 * R], [3.0 * R, 0, 0.999 * R]], R, GLASS, contact(law), law=law,
        walls=[SolidWall(FLOORS[name], velocity=(0, 0.01, 0))], threads=1, most_overlap=0.9,
        velocities=[[0.05, 0, -0.05], [0, 0.05, -0.05]], time_step=1e-6,
    )  # fmt: skip
    for _ in range(3):
        sim.run(5)
        np.testing.assert_allclose(
            sim.wall_forces.sum(axis=0), -sim.forces.sum(axis=0), rtol=1e-9, atol=1e-15
        )


def test_a_body_and_spheres_fall_onto_a_floor_in_blocks_of_any_size(monkeypatch):
    """In one block and in many, but for the order in which forces are added."""
    places = np.stack(np.meshgrid(*[np.arange(2)] * 3, indexing="ij"), -1).reshape(-1, 3)
    found = []
    for _ in range(2):
        sim = Simulation(
            (places * 2.02 + 2.0) * R, R, GLASS, contact(LAWS[0]), law=LAWS[0], threads=1,
            walls=[SolidWall(w) for w in box_walls((0, 0, 0), (9 * R, 9 * R, 20 * R))],
            velocities=np.full(places.shape, [0.05, 0.0, -0.4]),
            clumps=[Clumps(spherocylinder(2 * R, 5 * R), [[4 * R, 4 * R, 9 * R]],
                           velocities=[[0, 0, -2.0]], spins=[[5.0, 1.0, 0.0]])],
        )  # fmt: skip
        body = sim.bodies.momenta.copy()
        for _ in range(4):
            sim.run(15)
        assert abs(sim.bodies.momenta - body).max() > 0.0
        found.append([sim.centres, sim.velocities])
        monkeypatch.setattr(lists, "BLOCK", 4)
    for one, many in zip(*found, strict=True):
        np.testing.assert_allclose(many, one, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("law", [LAWS[1], LAWS[4], LAWS[5]], ids=lambda law: law.cohesion)
def test_what_attracts_across_a_gap_keeps_momentum(law):
    """Two that are drawn apart from contact, and one from which a wall goes away."""
    sim = Simulation(
        [[0, 0, 0], [2 * R - 1e-6, 0, 0], [0, 9 * R, 0]], R, GLASS, contact(law), law=law,
        walls=[SolidWall(Disc((0, 9 * R, -R + 1e-6), (0, 0, 1), R), velocity=(0, 0, -0.2))],
        gravity=(0, 0, 0), velocities=[[-0.1, 0, 0], [0.1, 0, 0], [0, 0, 0]], threads=1,
        time_step=1e-6,
    )  # fmt: skip
    drawn = False
    for steps in [1] * 20 + [20] * 4:
        sim.run(steps)
        drawn = drawn or sim.forces[0, 0] > 0.0
        np.testing.assert_allclose(sim.forces[0], -sim.forces[1], rtol=1e-9, atol=1e-15)
        np.testing.assert_allclose(sim.forces[2], -sim.wall_forces.sum(axis=0), atol=1e-15)
    assert drawn
    # Only a bridge reaches so far.
    assert (np.abs(sim.forces).max() == 0.0) == (law.cohesion != "liquid-bridge")


def test_a_wall_that_goes_leaves_its_spheres_alone():
    sim = Simulation(
        [[0, 0, R - 1e-6], [3 * R, 0, 5 * R]], R, GLASS, contact(LAWS[0]), law=LAWS[0], threads=1,
        walls=[SolidWall(Plane((0, 0, 0), (0, 0, 1), "floor")), SolidWall(SQUARE)],
    )  # fmt: skip
    sim.run(10)
    assert sim.wall_forces[0, 2] < 0.0
    sim.drop_wall("floor")
    sim.insert([[0, 3 * R, 5 * R]], R)
    sim.remove([False, True, False])
    sim.run(10)
    assert sim.wall_forces[0, 2] == 0.0
    assert len(sim.centres) == 2


def test_heat_goes_from_the_wall_through_one_sphere_into_the_next():
    sim = Simulation(
        [[0, 0, R - 1e-6], [0, 0, 3 * R - 3e-6]], R, GLASS, Contact(0.5, 0.3), gravity=(0, 0, 0),
        walls=[SolidWall(Plane((0, 0, 0), (0, 0, 1), "plate"))], threads=1,
    )  # fmt: skip
    heat = Heat(sim, 2.0, 800.0, 300.0, wall_temperatures={"plate": 500.0}, stiffness_ratio=8.0)
    for _ in range(3):
        heat.advance(1e-3)
    low, high = heat.temperatures
    assert 500.0 > low > high > 300.0
    gained = heat.capacities @ (heat.temperatures - 300.0)
    assert heat.from_walls[0] == pytest.approx(gained, rel=1e-12)


def test_a_union_of_two_spheres_has_the_volume_of_both_less_the_lens():
    # Two equal spheres whose centres are one radius apart share 5/12 pi R^3.
    clump = sphere_union([[0, 0, 0], [R, 0, 0]], [R, R], columns=60)
    assert clump.volume == pytest.approx((8 / 3 - 5 / 12) * np.pi * R**3, rel=5e-3)


@pytest.mark.parametrize("round_", [False, True])
def test_random_places_touch_nothing(round_):
    region = Region((0.0, 0.0, 0.0), (8 * R, 8 * R, 8 * R), round_)
    there = np.array([[4 * R, 4 * R, 4 * R]])
    found = random_places(region, np.full(5, R), 1, taken=there, taken_radii=[R])
    assert len(found) == 5
    every = np.concatenate([found, there])
    apart = np.linalg.norm(every[:, None] - every, axis=2)[np.triu_indices(6, 1)]
    assert apart.min() >= 2 * R
    assert found.min() >= R
    assert found.max() <= 7 * R
