"""Simulations as a whole: conservation, order, the same bits, lists, walls, what stops a run."""

from __future__ import annotations

from threading import Thread

import numpy as np
import pytest
from impacts import GLASS, on_floor, pair

from greybed.core import Cone, Cylinder, Disc, InputError, Mesh, Plane, box_walls
from greybed.dem import Contact, ContactLaw, Material, Simulation, SolidWall, crew, lists
from greybed.dem.checkpoint import restore, save

R = 1e-3


def gas(n=6, seed=0, contact=None, law=None, periodic=True, **more):
    """Spheres with random velocities on a loose lattice that fills its box."""
    rng = np.random.default_rng(seed)
    at = np.stack(np.meshgrid(*[np.arange(n)] * 3, indexing="ij"), -1).reshape(-1, 3)
    edge = 2.6 * R
    return Simulation(
        (at + 0.5) * edge, R, GLASS, contact or Contact(1.0, 0.0), law=law,
        box=[[0, 0, 0], [n * edge] * 3], periodic=(periodic,) * 3, gravity=(0, 0, 0),
        velocities=0.2 * rng.normal(size=at.shape), most_overlap=0.9,
        walls=[] if periodic else [SolidWall(w) for w in box_walls((0, 0, 0), (n * edge,) * 3)],
        **more,
    )  # fmt: skip


def test_an_elastic_gas_keeps_energy_and_momentum():
    sim = gas(time_step=2e-6, threads=1)
    energy, momentum = sim.energies.total, sim.masses @ sim.velocities
    met = 0
    for _ in range(20):
        sim.run(1_000)
        met += len(sim.contacts)
    assert met > 100
    assert len(sim.contacts) < 100
    elastic = 0.03 * energy  # what collisions store for the moment
    assert abs(sim.energies.total - energy) < elastic
    scale = float((sim.masses[:, None] * abs(sim.velocities)).sum())
    assert abs(sim.masses @ sim.velocities - momentum).max() < 1e-13 * scale


def test_a_million_steps_of_an_elastic_gas_keep_its_energy():
    sim = gas(4, time_step=1e-6, threads=1)
    edge, modulus = 4 * 2.6 * R, 0.5 * 5e6 / (1 - 0.3**2)

    def energy():
        """Of motion, and what Hertz's springs store: 8/15 E* sqrt(R*) d^(5/2)."""
        i, j = sim.contacts.T
        apart = sim.centres[i] - sim.centres[j]
        apart -= edge * np.round(apart / edge)
        overlap = 2 * R - np.linalg.norm(apart, axis=1)
        return sim.energies.kinetic + (8 / 15 * modulus * np.sqrt(R / 2) * overlap**2.5).sum()

    before, momentum = energy(), sim.masses @ sim.velocities
    met, touching, off = 0, set(), []
    for look in range(10_000):
        sim.run(100)
        now = set(map(tuple, sim.contacts.tolist()))
        met += len(now - touching)
        touching = now
        if look % 100 == 99:
            off.append(energy() / before - 1.0)
    assert sim.steps == 1_000_000
    assert met > 10_000
    assert sim.energies.rotational == 0.0
    assert np.abs(off).max() < 1e-4
    scale = float((sim.masses[:, None] * abs(sim.velocities)).sum())
    assert abs(sim.masses @ sim.velocities - momentum).max() < 1e-13 * scale


def test_energy_comes_back_after_each_elastic_collision():
    sim = pair(contact=Contact(1.0, 0.0), speed=0.4, time_step=1e-6)
    before = sim.energies.total
    sim.run(2_000)
    assert len(sim.contacts) == 0
    assert sim.velocities[0, 0] < 0.0
    assert sim.energies.total == pytest.approx(before, rel=1e-6)


def test_the_order_of_the_integrator():
    """Second order without damping: the error falls fourfold with half the step."""
    where = {}
    for steps in (50, 100, 200, 6400):
        contact = Contact(1.0, 0.0, stiffness=2e3)
        sim = pair(ContactLaw("linear"), contact, gap=-1e-9, speed=0.1, time_step=1e-4 / steps)
        sim.run(steps)
        where[steps] = sim.centres[0, 0]
    errors = [abs(where[k] - where[6400]) for k in (50, 100, 200)]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.1)


def test_friction_conserves_angular_momentum():
    sim = pair(
        contact=Contact(0.5, 0.5), speed=0.5, time_step=1e-6,
        velocities=[[0.2, 0.1, 0.0], [-0.2, -0.1, 0.05]], spins=[[0, 0, 90], [30, 0, 0]],
    )  # fmt: skip

    def angular():
        inertia = 0.4 * sim.masses * sim.radii**2
        orbit = np.cross(sim.centres, sim.masses[:, None] * sim.velocities)
        return (orbit + inertia[:, None] * sim.spins).sum(axis=0)

    before, spins = angular(), sim.spins
    sim.run(3_000)
    assert abs(sim.spins - spins).max() > 10.0
    # The spheres touch in a plane between their shortened arms; what is left is the order of dt.
    np.testing.assert_allclose(angular(), before, rtol=0, atol=1e-4 * abs(before).max())


@pytest.mark.parametrize("periodic", [True, False])
def test_same_bits_on_any_threads_and_in_any_parts(periodic):
    law = ContactLaw(rolling="epsd", cohesion="sjkr")
    contact = Contact(0.6, 0.4, rolling_friction=0.1, rolling_damping=0.2, cohesion=1e3)
    ends = []
    for threads, parts in ((1, (600,)), (2, (600,)), (2, (1, 249, 350))):
        sim = gas(17, periodic=periodic, contact=contact, law=law, threads=threads)
        for steps in parts:
            sim.run(steps)
        assert len(sim._lists.near.crossing) > 0  # several blocks
        assert len(sim.contacts) > 300
        ends.append((sim.centres.tobytes(), sim.spins.tobytes(), sim.time))
    assert ends[0] == ends[1] == ends[2]


def test_blocks_of_helpers_that_never_come_are_done_all_the_same(monkeypatch):
    class Late(Thread):
        def start(self):
            pass

    monkeypatch.setattr(lists, "BLOCK", 64)
    rows = []
    for threads, helper in ((1, Thread), (2, Thread), (2, Late)):
        monkeypatch.setattr(crew, "Thread", helper)
        sim = gas(9, threads=threads)
        sim.run(60)
        rows.append(np.concatenate([sim.centres, sim.velocities, sim.spins]))
    np.testing.assert_array_equal(rows[1], rows[0])
    np.testing.assert_array_equal(rows[2], rows[0])


def test_lists_find_every_contact_and_keep_springs():
    """Against a run whose lists hold all pairs near and far."""
    contact = Contact(0.7, 0.5)
    near = gas(8, contact=contact, threads=1, skin=0.05 * R)
    far = gas(8, contact=contact, threads=1, skin=2.0 * R)
    near.run(1_500)
    far.run(1_500)
    edge = 8 * 2.6 * R
    off = near.centres - far.centres
    assert abs(off - edge * np.round(off / edge)).max() < 1e-9
    assert len(near.contacts) > 10


def test_springs_at_the_start_are_not_stretched_yet():
    sim = pair(
        ContactLaw(tangential_damping=False), gap=-1e-6, speed=0.0,
        velocities=[[0, 0.2, 0], [0, -0.2, 0]],
    )  # fmt: skip
    assert sim.forces[0, 0] < 0.0
    assert sim.forces[0, 1] == 0.0
    sim.run(1)
    assert sim.forces[0, 1] < 0.0


def test_images_across_the_box_are_met():
    edge = 10 * R
    sim = Simulation(
        [[0.5 * R, 5 * R, 5 * R], [8.55 * R, 5 * R, 5 * R]], R, GLASS, Contact(1.0, 0.0),
        box=[[0, 0, 0], [edge] * 3], periodic=(True,) * 3, gravity=(0, 0, 0),
    )  # fmt: skip
    assert sim.forces[0, 0] > 0.0
    assert sim.forces[1, 0] == -sim.forces[0, 0]


WALLS = {
    "plane": (Plane((0, 0, 0), (0, 0, 1)), (0, 0, 1)),
    "disc": (Disc((0, 0, 0), (0, 0, 1), 5 * R), (0, 0, 1)),
    "disc from below": (Disc((0, 0, 2 * R - 2e-6), (0, 0, 1), 5 * R), (0, 0, -1)),
    "cylinder": (Cylinder((0, 0, 3 * R), (0, 1, 0), 3 * R), (0, 0, 1)),
    "tube": (Cylinder((0, -9 * R, 3 * R), (0, 1, 0), 3 * R, length=20 * R), (0, 0, 1)),
    "polygon": (box_walls((-R * 9, -R * 9, 0), (R * 9, R * 9, R * 9))[4], (0, 0, 1)),
    "mesh": (
        Mesh([[-9 * R, -9 * R, 0], [9 * R, -9 * R, 0], [9 * R, 9 * R, 0], [-9 * R, 9 * R, 0]],
             [[0, 1, 2], [0, 2, 3]]), (0, 0, 1),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", WALLS)
def test_walls_push_with_hertz_along_their_normal(name):
    shape, normal = WALLS[name]
    depth = 1e-6
    sim = Simulation(
        [[0, 0, R - depth]], R, GLASS, Contact(0.5, 0.3), walls=[SolidWall(shape)],
        gravity=(0, 0, 0),
    )  # fmt: skip
    modulus = 0.5 * 5e6 / (1 - 0.3**2)
    force = 4 / 3 * modulus * np.sqrt(R) * depth**1.5
    np.testing.assert_allclose(sim.forces[0], force * np.array(normal), rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(sim.wall_forces.sum(axis=0), -sim.forces[0], rtol=1e-12, atol=1e-18)


def test_a_cone_pushes_along_its_slope():
    cone = Cone((0, 0, 0), (0, 0, 1), 0.0, 4 * R, 4 * R)  # opens upwards at 45 degrees
    at = np.array([2 * R, 0.0, 2 * R]) + (R - 1e-6) * np.array([-1.0, 0.0, 1.0]) / np.sqrt(2.0)
    sim = Simulation([at], R, GLASS, Contact(0.5, 0.3), walls=[SolidWall(cone)], gravity=(0, 0, 0))
    force = sim.forces[0]
    assert force[0] == pytest.approx(-force[2], rel=1e-9)
    assert force[2] > 0.0


def test_rolling_over_the_seam_of_a_mesh_is_rolling_on_a_plane():
    corners = np.array([[-5, -5, 0], [5, -5, 0], [5, 5, 0], [-5, 5, 0]]) * R
    ends = []
    for shape in (Plane((0, 0, 0), (0, 0, 1)), Mesh(corners, [[0, 1, 2], [0, 2, 3]])):
        sim = Simulation(
            [[-1.5 * R, 0.2 * R, R]], R, GLASS, Contact(0.5, 0.4), walls=[SolidWall(shape)],
            velocities=[[0.1, 0, 0]], time_step=2e-6,
        )  # fmt: skip
        sim.run(20_000)
        assert sim.centres[0, 0] > 1.0 * R  # across the diagonal
        ends.append((sim.centres[0], sim.spins[0]))
    np.testing.assert_allclose(ends[1][0], ends[0][0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(ends[1][1], ends[0][1], rtol=0, atol=1e-4)


def test_moving_walls_carry_and_drive():
    lift = SolidWall(Plane((0, 0, 0), (0, 0, 1)), velocity=(0, 0, 0.1))
    sim = Simulation([[0, 0, R]], R, GLASS, Contact(0.3, 0.3), walls=[lift], time_step=2e-6)
    sim.run(40_000)
    assert sim.velocities[0, 2] == pytest.approx(0.1, rel=1e-3)
    assert sim.centres[0, 2] == pytest.approx(0.1 * sim.time + R, rel=1e-3)
    # A drum about its axis drags a sphere along, until it rolls: at rest where both touch.
    drum = SolidWall(Cylinder((0, 0, 0), (0, 1, 0), 5 * R), spin=(0, 10.0, 0))
    sim = Simulation([[0, 0, -4 * R]], R, GLASS, Contact(0.3, 0.5), walls=[drum], time_step=2e-6)
    sim.run(100_000)
    out = sim.centres[0] / np.linalg.norm(sim.centres[0])
    slip = sim.velocities[0] + np.cross(sim.spins[0], R * out) - np.cross((0, 10.0, 0), 5 * R * out)
    assert np.linalg.norm(slip) < 0.01 * 0.05
    assert 20.0 < sim.spins[0, 1] < 80.0


def test_two_kinds_of_friction_for_particles_and_wall():
    """The wall's own friction decides: on a slope of 0.3 one material slides, one does not."""
    rough, smooth = Material(1, 5e6, 0.3, "rough"), Material(1, 5e6, 0.3, "smooth")
    own = Contact(0.5, 0.0)
    contacts = {
        ("glass", "glass"): own,
        ("glass", "rough"): Contact(0.5, 0.9, rolling_friction=0.9),
        ("smooth", "glass"): Contact(0.5, 0.1),
    }
    g = 9.81 * np.array([0.3, 0, -1.0]) / np.hypot(0.3, 1.0)
    for wall, slides in (("rough", False), ("smooth", True)):
        sim = on_floor(
            ContactLaw(rolling="epsd-modified"), contacts, materials=[GLASS, rough, smooth],
            wall=wall, gravity=g, time_step=2e-6,
        )  # fmt: skip
        sim.run(20_000)
        assert (sim.velocities[0, 0] > 0.05) == slides


def test_memory_of_a_dense_bed_is_small():
    sim = gas(14, threads=1)
    assert sim.bytes_per_particle < 600


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"time_step": 1e-3}, r"time_step = 0.001 \[s\] exceeds 0.4 of Rayleigh's time"),
        ({"time_step": -1.0}, "time_step = -1"),
        ({"threads": 0}, "threads = 0"),
        ({"gravity": (0, 0)}, "gravity"),
        ({"periodic": (True, False, False)}, "needs a box"),
        ({"periodic": (True, True, True), "box": [[0, 0, 0], [5e-3] * 3]}, "three times"),
        ({"walls": [SolidWall(Plane((0, 0, -1), (0, 0, 1)), "wood")]}, "no material is called"),
        ({"skin": 0.0}, "skin = 0"),
        ({"kinds": [0, 1]}, "kinds must be 2 numbers in 0 ... 0"),
        (
            {"velocities": [[0, 0, 0], [np.nan, 0, 0]]},
            "velocities must be finite; that of particle 1",
        ),
    ],
)
def test_refusals_before_the_first_step(change, says):
    words = {"gravity": (0, 0, 0), **change}
    with pytest.raises(InputError, match=says):
        Simulation([[0, 0, 0], [3 * R, 0, 0]], R, GLASS, Contact(0.5, 0.3), **words)


def test_a_missing_pair_and_deep_overlap_are_named():
    two = [GLASS, Material(1000, 1e6, 0.3, "wood")]
    with pytest.raises(InputError, match="'glass' and 'wood' have no contact"):
        Simulation(
            [[0, 0, 0], [1, 0, 0]], R, two, {("glass", "glass"): Contact(1, 0)}, kinds=[0, 1]
        )
    with pytest.raises(InputError, match=r"particles 0 and 1 at .* overlap by 1.5 of a radius"):
        Simulation([[0, 0, 0], [0.5 * R, 0, 0]], R, GLASS, Contact(0.5, 0.3))


def test_a_lost_particle_stops_the_run():
    sim = Simulation([[0, 0, 0], [0, 0, 0]], R, GLASS, Contact(0.5, 0.3), most_overlap=9.0)
    with pytest.raises(InputError, match=r"particle [01] is at .*nan"):
        sim.run(3)


def test_lists_of_a_bed_at_rest_become_short_and_where_a_run_is_cut_changes_no_bit(tmp_path):
    def bed():
        where = 2.0 * R * np.stack(np.meshgrid(*[np.arange(3)] * 3, indexing="ij"), -1)
        floor = SolidWall(Plane([0, 0, 0], [0, 0, 1]))
        return Simulation(
            where.reshape(-1, 3) + [0, 0, R], R, GLASS, Contact(0.5, 0.5), walls=[floor], threads=1
        )

    whole, cut, other = bed(), bed(), bed()
    at_start = whole._lists.skin
    whole.run(1200)
    # Past several looks at the skin, cut at one of them, inside, and by a checkpoint.
    for steps in (256, 100, 300):
        cut.run(steps)
    save(cut, tmp_path / "state.npz")
    restore(other, tmp_path / "state.npz")
    other.run(1200 - 656)
    np.testing.assert_array_equal(whole.centres, other.centres)
    np.testing.assert_array_equal(whole.velocities, other.velocities)
    assert whole._lists.skin == other._lists.skin < 0.6 * at_start
