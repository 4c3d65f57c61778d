"""Forces contact by contact, and stress: they add up to the loads, and to Hertz's lattice."""

from __future__ import annotations

import numpy as np
import pytest
from impacts import GLASS

from greybed.core import InputError, box_walls
from greybed.dem import Contact, ContactLaw, Simulation, SolidWall
from greybed.dem.stress import pair_forces, stress

R = 1e-3
MODULUS = 0.5 * GLASS.youngs_modulus / (1.0 - GLASS.poissons_ratio**2)


def test_a_compressed_lattice_has_hertz_pressure_along_its_axes():
    n, edge = 4, 2.0 * R * 0.99
    at = (np.stack(np.meshgrid(*[np.arange(n)] * 3, indexing="ij"), -1).reshape(-1, 3) + 0.5) * edge
    sim = Simulation(
        at, R, GLASS, Contact(0.5, 0.3), box=[[0] * 3, [n * edge] * 3], periodic=(True,) * 3,
        gravity=(0, 0, 0),
    )  # fmt: skip
    pairs, forces, branches = pair_forces(sim)
    assert len(pairs) == 3 * n**3
    np.testing.assert_allclose(np.linalg.norm(branches, axis=1), edge)
    force = 4.0 / 3.0 * MODULUS * np.sqrt(0.5 * R) * (2.0 * R - edge) ** 1.5
    np.testing.assert_allclose(np.linalg.norm(forces, axis=1), force, rtol=1e-6)
    found = stress(sim, (n * edge) ** 3)
    np.testing.assert_allclose(found, force / edge**2 * np.eye(3), rtol=1e-6, atol=1e-9 * force)
    assert not sim.forces.any() or abs(sim.forces).max() < 1e-9 * force


def test_they_add_up_to_the_loads_and_change_nothing():
    n = 5
    at = (np.stack(np.meshgrid(*[np.arange(n)] * 3, indexing="ij"), -1).reshape(-1, 3) + 0.5) * 2.2
    walls = [SolidWall(w) for w in box_walls((0, 0, 0), (11 * R, 11 * R, 1.0))[:5]]
    sim = Simulation(
        at * R, R, GLASS, Contact(0.4, 0.5, rolling_friction=0.1), walls=walls,
        law=ContactLaw(rolling="epsd-modified"),
    )  # fmt: skip
    sim.run(6_000)
    before = sim.centres, sim.forces
    pairs, forces, _ = pair_forces(sim)
    assert {frozenset(p) for p in pairs.tolist()} == {frozenset(p) for p in sim.contacts.tolist()}
    total = np.zeros((n**3, 3))
    np.add.at(total, pairs[:, 0], forces)
    np.add.at(total, pairs[:, 1], -forces)
    # Those that no wall touches: at rest, dashpots say next to nothing.
    x = sim.centres
    free = ((x[:, :2] > 1.2 * R) & (x[:, :2] < 9.8 * R)).all(axis=1) & (x[:, 2] > 1.2 * R)
    weight = 9.81 * sim.masses[0]
    assert free.sum() > 10
    np.testing.assert_allclose(total[free], sim.forces[free], rtol=0, atol=0.01 * weight)
    sim.run(1)
    again = Simulation(before[0], R, GLASS, Contact(0.4, 0.5), walls=walls)
    assert len(again.contacts) == len(pairs)
    with pytest.raises(InputError, match="volume = 0"):
        stress(sim, 0.0)
