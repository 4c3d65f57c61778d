"""Viscous materials: rolling friction and restitution that depend on the speed."""

from __future__ import annotations

import math

import numpy as np
import pytest
from impacts import GLASS, apart, on_floor, pair
from scipy.integrate import quad

from greybed.core import InputError
from greybed.dem import Contact, ContactLaw, Material
from greybed.dem.damping import relaxation

VISCO = ContactLaw("viscoelastic")


def viscous(e, speed=0.5, **more):
    """Contact of spheres of 1 mm that return ``e`` at ``speed``."""
    more = {"reference_speed": speed, "reference_radius": 1e-3, **more}
    return Contact(e, more.pop("friction", 0.3), **more)


def returned(law, contact, speed, **more):
    sim = apart(pair(law, contact, speed=speed, time_step=2e-6, **more))
    return (sim.velocities[1, 0] - sim.velocities[0, 0]) / speed


def test_viscous_rolling_slows_a_sphere_exponentially():
    """Torque tau m g v on 7/5 m R2 about the contact: dv/dt = -(5/7) tau g v / R."""
    tau, r = 1e-3, 1e-3
    sim = on_floor(
        ContactLaw(rolling="viscous"), Contact(0.5, 0.5, rolling_time=tau), height=-4.3e-7,
        velocities=[[0.01, 0, 0]], spins=[[0, 10.0, 0]], time_step=4e-6,
    )  # fmt: skip
    sim.run(5_000)
    speeds = [sim.velocities[0, 0]]
    for _ in range(4):
        sim.run(12_500)
        speeds.append(sim.velocities[0, 0])
    rates = -np.diff(np.log(speeds)) / (12_500 * sim.time_step)
    np.testing.assert_allclose(rates, 5 / 7 * tau * 9.81 / r, rtol=2e-3)
    assert sim.spins[0, 1] * r == pytest.approx(sim.velocities[0, 0], rel=2e-3)


def test_viscous_torque_of_a_pair_and_its_end():
    """tau F R* |w1 - w2| against both; no more than F times the radius of the contact."""
    tau, radii, depth = 2e-5, (1e-3, 3e-3), 2e-6
    r_eff = 1e-3 * 3e-3 / 4e-3
    spins = np.array([[5.0, 20.0, -10.0], [-3.0, -40.0, 8.0]])
    for time, limited in ((tau, False), (1.0, True)):
        sim = pair(
            ContactLaw(rolling="viscous", tangential_damping=False),
            Contact(0.5, 0.0, rolling_time=time), gap=-depth, speed=0.0, radii=radii, spins=spins,
        )  # fmt: skip
        force = 4 / 3 * (0.5 * 5e6 / (1 - 0.3**2)) * math.sqrt(r_eff) * depth**1.5
        rolling = np.array([0.0, 60.0, -18.0])  # without the spin about the normal
        size = force * time * r_eff * np.linalg.norm(rolling)
        most = force * math.sqrt(r_eff * depth)
        assert (size > most) == limited
        along = rolling / np.linalg.norm(rolling)
        np.testing.assert_allclose(sim.torques[0], -min(size, most) * along, rtol=1e-6, atol=1e-18)
        np.testing.assert_allclose(sim.torques[1], -sim.torques[0], rtol=1e-12)


@pytest.mark.parametrize("e", [0.1, 0.3, 0.5, 0.7, 0.9])
@pytest.mark.parametrize("limit", [False, True])
def test_the_restitution_at_the_reference_comes_back(limit, e):
    law = ContactLaw("viscoelastic", limit_force=limit)
    assert returned(law, viscous(e), 0.5) == pytest.approx(e, abs=0.005)
    slow = viscous(0.9 * e, slow_restitution=e)
    assert returned(law, slow, 0.5) == pytest.approx(0.9 * e, abs=0.005)


def test_the_reference_holds_for_two_materials_and_for_a_wall():
    steel = Material(7800.0, 2e7, 0.28, "steel")
    contacts = {
        ("glass", "glass"): viscous(0.9),
        ("glass", "steel"): viscous(0.6, speed=0.4),
        ("steel", "steel"): viscous(0.9),
    }
    law = VISCO
    sim = pair(law, contacts, materials=[GLASS, steel], kinds=[0, 1], speed=0.4, time_step=1e-6)
    v = apart(sim).velocities[:, 0]
    assert (v[1] - v[0]) / 0.4 == pytest.approx(0.6, abs=0.005)
    wall = on_floor(
        law, contacts, materials=[GLASS, steel], wall="steel", height=1e-5, time_step=1e-6,
        velocities=[[0, 0, -0.4]], gravity=(0, 0, 0),
    )  # fmt: skip
    assert apart(wall, 200).velocities[0, 2] / 0.4 == pytest.approx(0.6, abs=0.005)


def test_losses_grow_with_the_fifth_root_of_the_speed():
    """1 - C1 b v^(1/5) + 3/5 C1^2 b^2 v^(2/5) (Ramirez et al. 1999), C1 by quadrature."""
    c1 = 2.0 * quad(lambda x: math.sqrt(x * max(1.0 - 0.8 * x**2.5, 0.0)), 0.0, 1.25**0.4)[0]
    assert c1 == pytest.approx(1.15344, abs=2e-5)
    for e in (0.99, 0.95):
        loss = 1.5 * c1 * relaxation(e, 1.0, limit_force=False)
        # What is left out is of third order.
        assert 1.0 - loss + 0.6 * loss**2 == pytest.approx(e, abs=0.35 * loss**3)
    contact = viscous(0.97, speed=1.0)
    for speed in (1.0, 0.1, 0.01):
        loss = 1.0 - returned(VISCO, contact, speed, gap=1e-7, gravity=(0, 0, 0))
        assert loss / (1.0 - 0.6 * loss) == pytest.approx(
            0.03 / (1.0 - 0.6 * 0.03) * speed**0.2, rel=0.01
        )


def test_restitution_over_speeds_with_the_cut_is_the_published_one():
    """Mueller & Poeschel, Phys. Rev. E 84 (2011) 021302: quotient in v* = (b^5 v)^(1/10)."""

    def published(v):
        below = 1 + 0.501086 * v + 1.15345 * v**2 + 0.577977 * v**3 + 0.532178 * v**4
        return (1 + 0.501086 * v) / below

    law = ContactLaw("viscoelastic", limit_force=True)
    lag = 1.5 * relaxation(0.7, 1.0, limit_force=True)
    assert published(math.sqrt(lag)) == pytest.approx(0.7, abs=1e-3)
    for speed in (0.05, 2.0):
        star = math.sqrt(lag * (speed / 0.5) ** 0.2)
        assert returned(law, viscous(0.7), speed, gap=1e-7) == pytest.approx(
            published(star), abs=4e-3
        )


def test_slow_impacts_return_what_was_said():
    speeds = (0.5, 0.05, 0.005)
    pure = [returned(VISCO, viscous(0.8), s, gap=1e-7) for s in speeds]
    assert pure[0] < pure[1] < pure[2] < 1.0
    assert pure[2] > 0.91
    damped = [returned(VISCO, viscous(0.6, slow_restitution=0.7), s, gap=1e-7) for s in speeds]
    assert damped[0] < damped[1] < damped[2] < 0.7
    same = viscous(0.7, slow_restitution=0.7)
    assert returned(VISCO, same, 0.5) == returned(ContactLaw(), Contact(0.7, 0.3), 0.5)


def test_the_cut_leaves_no_attraction():
    for limit in (False, True):
        sim = pair(
            ContactLaw("viscoelastic", limit_force=limit), viscous(0.2), speed=0.5, time_step=1e-6
        )
        least = 0.0
        for _ in range(1500):
            sim.run(1)
            least = min(least, -sim.forces[0, 0])
        assert (least < 0.0) == (not limit)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: pair(VISCO), "needs reference_speed .* and reference_radius"),
        (lambda: pair(VISCO, viscous(0.8, slow_restitution=0.7)), "slow_restitution = 0.7 "),
        (
            lambda: pair(ContactLaw("viscoelastic", limit_force=True), viscous(1e-6)),
            "restitution = 1e-06 .* take 0.01",
        ),
        (lambda: pair(VISCO, viscous(0.8), time_step=1.0), "exceeds 0.4 of Rayleigh"),
        (
            lambda: pair(ContactLaw(rolling="viscous"), Contact(0.5, 0.3, rolling_friction=0.1)),
            "takes rolling_time",
        ),
        (lambda: ContactLaw("viscoelastic", cohesion="jkr"), "'jkr' needs normal = 'hertz'"),
    ],
)
def test_refusals_of_viscous_laws(call, says):
    with pytest.raises(InputError, match=says):
        call()
