"""Pushes from without: their impulse, order of the input, bodies, checkpoints, refusals."""

from __future__ import annotations

import numpy as np
import pytest
from impacts import GLASS

from greybed.core import InputError
from greybed.dem import Contact, Simulation
from greybed.dem.checkpoint import restore, save

R = 1e-3


def crowd(n=4, **more):
    """Spheres on a loose periodic lattice, with random velocities."""
    rng = np.random.default_rng(0)
    at = np.stack(np.meshgrid(*[np.arange(n)] * 3, indexing="ij"), -1).reshape(-1, 3)
    edge = 2.6 * R
    return Simulation(
        (at + 0.5) * edge, R, GLASS, Contact(0.9, 0.3), box=[[0, 0, 0], [n * edge] * 3],
        periodic=(True,) * 3, gravity=(0, 0, 0), velocities=0.2 * rng.normal(size=at.shape),
        most_overlap=0.9, time_step=2e-6, **more,
    )  # fmt: skip


def test_a_push_gives_its_impulse_whatever_the_contacts_do():
    sim = crowd()
    rng = np.random.default_rng(1)
    given = np.zeros(3)
    start = sim.masses @ sim.velocities
    for _ in range(30):
        force = 1e-4 * rng.normal(size=sim.centres.shape)
        sim.push(force)
        sim.run(100)
        given += 100 * sim.time_step * force.sum(axis=0)
    assert len(sim.contacts)
    scale = float((sim.masses[:, None] * abs(sim.velocities)).sum())
    assert abs(sim.masses @ sim.velocities - start - given).max() < 1e-13 * scale


def test_each_particle_gets_its_own_push_and_falls_as_newton_says():
    centres = [[0.03, 0, 0], [0, 0, 0], [0, 0.01, 0.02]]
    sim = Simulation(centres, R, GLASS, Contact(0.9, 0.3), gravity=(0, 0, 0), time_step=1e-6)
    force = 1e-4 * np.arange(1.0, 10.0).reshape(3, 3)
    torque = 1e-8 * np.arange(3.0, 12.0).reshape(3, 3)
    sim.push(force, torque)
    sim.run(2_000)
    t = 2_000 * 1e-6
    mass = sim.masses[:, None]
    np.testing.assert_allclose(sim.velocities, force / mass * t, rtol=1e-12)
    np.testing.assert_allclose(sim.centres - centres, 0.5 * force / mass * t**2, rtol=1e-9)
    np.testing.assert_allclose(sim.spins, torque / (0.4 * mass * R**2) * t, rtol=1e-12)
    assert not sim.forces.any()
    assert not sim.torques.any()


def test_a_checkpoint_keeps_the_push(tmp_path):
    whole, begun, again = crowd(), crowd(), crowd()
    force = np.full(whole.centres.shape, 2e-4)
    for sim in (whole, begun):
        sim.push(force)
    whole.run(400)
    begun.run(150)
    save(begun, tmp_path / "state.npz")
    restore(again, tmp_path / "state.npz")
    again.run(250)
    np.testing.assert_array_equal(again.velocities, whole.velocities)


def test_those_that_come_later_are_not_pushed_until_it_is_said():
    sim = Simulation([[0, 0, 0]], R, GLASS, Contact(0.9, 0.3), gravity=(0, 0, 0), time_step=1e-6)
    sim.push([[0, 0, 1e-3]])
    sim.insert([[0.01, 0, 0]], R)
    sim.run(100)
    assert sim.velocities[0, 2] > 0.0
    assert not sim.velocities[1].any()


@pytest.mark.parametrize("forces", [np.zeros((2, 3)), np.full((64, 3), np.nan)])
def test_other_pushes_are_refused(forces):
    with pytest.raises(InputError, match=r"must be \(64, 3\)"):
        crowd().push(forces)
