"""Films between spheres that near each other, against the closed form of two of them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from greybed.cfd.grid import Grid
from greybed.core.errors import InputError
from greybed.coupling.drag_exchange import Settings
from greybed.coupling.gas_particles import GasParticles
from greybed.coupling.lubrication import lubrication
from greybed.dem import Contact, Material, Simulation
from tests.coupling.plain_gas import PlainGas

D, MU, RHO = 1e-3, 1e-3, 2500.0
SIZE = 12e-3


def pair(gap, speed, *, place=0.5 * SIZE, second=D, step=1e-6):
    """Two spheres on a line, the first one at rest, in a periodic box."""
    x = np.array([place, place + 0.5 * (D + second) + gap]) % SIZE
    centres = np.stack([x, *2 * [np.full(2, 0.5 * SIZE)]], axis=1)
    return Simulation(
        centres, [0.5 * D, 0.5 * second], Material(RHO, 5e6, 0.3, "glass"), Contact(0.9, 0.0),
        box=[[0, 0, 0], [SIZE] * 3], periodic=(True,) * 3, gravity=(0, 0, 0), threads=1,
        velocities=[[0, 0, 0], [-speed, 0, 0]], time_step=step,
    )  # fmt: skip


def coupled(sim, viscosity=MU, **settings):
    """The same in a fluid that does nothing else."""
    gas = PlainGas(Grid(cells=(2, 2, 2), upper=(SIZE,) * 3, periodic=(True,) * 3), 1.0, viscosity)
    rule = Settings(
        drag=lambda phi, re: np.zeros_like(phi), pressure=False, buoyancy=False, **settings
    )
    return GasParticles(gas, sim, rule)


@pytest.mark.parametrize("place", [0.5 * SIZE, SIZE - 0.6 * D])
@pytest.mark.parametrize("second", [D, 3 * D])
def test_the_force_is_that_of_jeffrey_and_onishi(place, second):
    gap, speed = 0.01 * D, 0.02
    sim = pair(gap, speed, place=place, second=second)
    force, fastest = lubrication(sim, MU, 0.1 * D, 1e-3 * D, 0.0)
    radius = 0.5 * D * second / (D + second)
    wanted = 6 * math.pi * MU * radius**2 * speed * (1 / gap - 10 / D)
    by_label = np.empty_like(force)
    by_label[sim._lists.ident] = force
    np.testing.assert_allclose(by_label[0], [-wanted, 0, 0], rtol=1e-9, atol=1e-18)
    np.testing.assert_allclose(by_label[1], [wanted, 0, 0], rtol=1e-9, atol=1e-18)
    assert fastest == pytest.approx(speed / gap, rel=1e-9)


def test_beyond_its_reach_and_in_contact_there_is_none():
    for gap in (0.1 * D, 0.3 * D, -1e-4 * D):
        force, fastest = lubrication(pair(gap, 0.1), MU, 0.1 * D, 1e-3 * D, 0.0)
        assert not force.any()
        assert fastest == 0.0


def test_two_spheres_slow_down_as_the_closed_form_has_it():
    # m* dv/dt = -c v (1/h - 1/hc) with v = -dh/dt, so that v is linear in ln h and h.
    start, reach, speed = 0.05 * D, 0.1 * D, 0.01
    sim = pair(start, speed)
    both = coupled(sim, lubrication=0.1, roughness=1e-3)
    mass = 0.5 * RHO * math.pi / 6 * D**3
    rate = 6 * math.pi * MU * (0.25 * D) ** 2 / mass
    momentum = sim.masses @ sim.velocities
    gap = start
    while gap > 0.1 * start:
        both.step(min(both.steps_for(), 20))
        x = sim.centres[:, 0]
        gap = x[1] - x[0] - D
    lost = rate * (math.log(start / gap) - (start - gap) / reach)
    v = sim.velocities[:, 0]
    assert lost > 0.2 * speed
    # First order in the steps, which take a tenth of the film at most.
    assert v[0] - v[1] == pytest.approx(speed - lost, rel=5e-3)
    np.testing.assert_allclose(sim.masses @ sim.velocities, momentum, rtol=1e-12)


def test_no_film_is_too_stiff_for_a_step():
    # A film that would take the velocity within a thousandth of the step takes it, and no more.
    sim = pair(2e-3 * D, 1e-4, step=2e-6)
    both = coupled(sim, 100.0, lubrication=0.5, roughness=1e-3)
    both.step(50)
    v = sim.velocities[:, 0]
    assert abs(v[0] - v[1]) < 1e-3 * 1e-4
    assert v.mean() == pytest.approx(-0.5e-4, rel=1e-9)


def test_numbers_out_of_range_are_refused():
    for numbers in ({"lubrication": -0.1}, {"lubrication": 2.0}, {"roughness": 0.0}):
        with pytest.raises(InputError, match="must lie in"):
            Settings(**numbers)
