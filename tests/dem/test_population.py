"""Particles and walls that come and go, and checkpoints: nothing else changes, bit by bit."""

from __future__ import annotations

import numpy as np
import pytest
from impacts import GLASS

from greybed.core import InputError, Plane, box_walls
from greybed.dem import Contact, ContactLaw, Material, Simulation, SolidWall, restore, save
from greybed.dem.lists import Lists

R = 1e-3
LAW = ContactLaw(rolling="epsd")
CONTACT = Contact(0.5, 0.4, rolling_friction=0.1, rolling_damping=0.3)


def box(n=6, **more):
    """Spheres that fall onto a floor between walls."""
    at = (np.stack(np.meshgrid(*[np.arange(n)] * 3, indexing="ij"), -1).reshape(-1, 3) + 0.5) * 2.2
    at += np.random.default_rng(1).uniform(-0.05, 0.05, at.shape)
    walls = [SolidWall(w) for w in box_walls((0, 0, 0), (n * 2.2 * R, n * 2.2 * R, 1.0))[:5]]
    more = {"materials": GLASS, "law": LAW, "walls": walls, **more}
    return Simulation(at * R, R, contacts=CONTACT, **more)


def state(sim):
    parts = (sim.centres, sim.velocities, sim.spins, sim.forces, sim.torques, sim.wall_forces)
    return [part.tobytes() for part in parts] + [sim.steps, sim.labels.tobytes()]


def test_a_checkpoint_goes_on_with_the_same_bits(tmp_path):
    whole, first, second = box(), box(), box(n=2)
    for sim in (whole, first):
        sim.run(1_500)
        sim.insert([[3 * R, 3 * R, 50 * R]], 0.8 * R, velocities=[[0, 0, -1]])
    path = save(first, tmp_path / "a.npz", due=[1, 2.5])
    assert restore(second, path) == {"due": [1, 2.5]}
    assert state(second) == state(first)
    whole.run(1_700)
    second.run(1_700)
    assert state(second) == state(whole)
    assert len(second.contacts) > 100


def test_checkpoints_of_others_and_cut_ones_are_refused(tmp_path):
    sim = box(n=2)
    path = save(sim, tmp_path / "a.npz")
    with pytest.raises(InputError, match="other materials, laws"):
        restore(box(n=2, gravity=(0, 0, -1)), path)
    with pytest.raises(InputError, match="other materials, laws"):
        restore(box(n=2, law=ContactLaw()), path)
    path.write_bytes(path.read_bytes()[:500])
    with pytest.raises(InputError, match="cut or damaged"):
        restore(sim, path)
    with pytest.raises(InputError, match="cannot read"):
        restore(sim, tmp_path / "absent.npz")


def test_a_visitor_that_touches_nothing_changes_no_bit():
    alone, visited = box(), box()
    for sim in (alone, visited):
        sim.run(1_000)
    visited.insert([[2 * R, 2 * R, 0.5]], R)
    assert visited.labels[-1] == len(alone.labels)
    visited.run(400)
    visited.remove(visited.labels == len(alone.labels))
    alone.run(400)
    # Lists were made anew at other times, so sums run in another order: equal to round-off.
    np.testing.assert_allclose(visited.centres, alone.centres, rtol=0, atol=1e-9 * R)
    np.testing.assert_array_equal(visited.labels, alone.labels)


def test_removal_keeps_labels_and_springs():
    sim = box()
    sim.run(4_000)
    low = sim.centres[:, 2] < 4 * R
    labels, places, pairs = sim.labels[low], sim.centres[low], sim.contacts
    sim.remove(~low)
    np.testing.assert_array_equal(sim.labels, labels)
    np.testing.assert_array_equal(sim.centres, places)
    kept = pairs[low[pairs].all(axis=1)]
    number = np.cumsum(low) - 1
    found = {frozenset(pair) for pair in sim.contacts.tolist()}
    assert found == {frozenset(pair) for pair in number[kept].tolist()}
    near = sim._lists.near
    assert (np.abs(near.history[near.touch.astype(bool)]).max(axis=1) > 0).mean() > 0.9
    sim.run(100)


def test_removal_of_all_and_bad_choices_are_refused():
    sim = box(n=2)
    for which in (np.ones(8, bool), np.zeros(3, bool)):
        with pytest.raises(InputError, match="one must stay"):
            sim.remove(which)


def test_insertion_is_refused_where_it_cannot_go():
    sim = box(n=2)
    with pytest.raises(InputError, match=r"touches particle [0-7]"):
        sim.insert(sim.centres[:1] + 0.5 * R, R)
    assert len(sim.centres) == 8
    with pytest.raises(InputError, match=r"touches particle beside it"):
        sim.insert([[0, 0, 0.4], [R, 0, 0.4]], R)
    with pytest.raises(InputError, match=r"of the particles to be inserted; take a smaller one"):
        sim.insert([[0, 0, 0.4]], 0.1 * R)
    dust = Material(2500.0, 5e6, 0.3, "dust")
    two = box(n=2, materials=[GLASS, dust])
    with pytest.raises(InputError, match="'dust' come later only if"):
        two.insert([[0, 0, 0.4]], R, kinds=[1])
    box(n=2, materials=[GLASS, dust], kinds_to_come=2).insert([[0, 0, 0.4]], R, kinds=[1])


def test_a_floor_that_goes_lets_all_fall():
    sim = box(n=3)
    sim.run(4_000)
    assert sim.wall_forces[4, 2] < 0.0
    sim.drop_wall("box_z_low")
    sim.run(2_000)
    assert sim.wall_forces[4, 2] == 0.0
    free = sim.velocities[:, 2].mean() / (-9.81 * 2_000 * sim.time_step)
    assert 0.5 < free < 1.5
    with pytest.raises(InputError, match="no wall is called 'lid'"):
        sim.drop_wall("lid")


def test_a_wall_starts_and_stops_on_command():
    lift = SolidWall(Plane((0, 0, 0), (0, 0, 1), "lift"))
    sim = Simulation([[0, 0, R]], R, GLASS, Contact(0.2, 0.3), walls=[lift], time_step=2e-6)
    sim.run(5_000)
    assert abs(sim.velocities[0, 2]) < 1e-3
    sim.move_wall("lift", (0, 0, 0.05))
    sim.run(20_000)
    assert sim.velocities[0, 2] == pytest.approx(0.05, rel=0.02)
    sim.move_wall("lift")
    sim.run(20_000)
    assert abs(sim.velocities[0, 2]) < 1e-3


def test_old_lists_have_rows_for_spheres_that_come(monkeypatch):
    sim = box(n=2)
    rows = []
    original = Lists.renew

    def renew(self, step, keep=None):
        rows.append([len(part.first) for part in (self.near, self.surfaces)])
        rows.append([len(self.near.into), len(self.state.place) + 1])
        original(self, step, keep)

    monkeypatch.setattr(Lists, "renew", renew)
    sim.insert(np.arange(30).reshape(-1, 1) * [0, 0, 3 * R] + [R, R, 50 * R], R)
    assert rows == [[39, 39], [39, 39]]
