"""Heat between particles: closed forms of two spheres and a wall, conservation, arrivals."""

from __future__ import annotations

import math

import numpy as np
import pytest
from impacts import GLASS

from greybed.core import InputError, Plane, box_walls
from greybed.dem import Contact, Heat, Simulation, SolidWall

R = 1e-3
K, CP = 2.0, 800.0


def held(centres, **more):
    sim = Simulation(
        centres, R, GLASS, Contact(0.5, 0.3), gravity=(0, 0, 0), most_overlap=0.9, **more
    )
    sim._state.fixed[:] = True
    return sim


@pytest.mark.parametrize("steps", [1, 50])
def test_two_spheres_come_to_one_temperature(steps):
    deep = 2e-6
    sim = held([[0, 0, 0], [2 * R - deep, 0, 0]])
    heat = Heat(sim, K, CP, [400.0, 300.0])
    conductance = 2.0 * K * math.sqrt(0.5 * R * deep)
    np.testing.assert_allclose(heat.conductances()[1], conductance, rtol=1e-9)
    capacity = heat.capacities[0]
    time = 0.5 * capacity / conductance
    for _ in range(steps):
        heat.advance(time / steps)
    # The difference falls by exp(-2 H t / C); steps of second order.
    first, second = heat.temperatures
    assert first + second == pytest.approx(700.0, rel=1e-14)
    assert first - second == pytest.approx(100.0 * math.exp(-1.0), rel=0.01 if steps == 1 else 1e-4)


def test_a_warm_wall_gives_what_a_sphere_gains():
    deep = 1e-6
    plate, far = Plane((0, 0, 0), (0, 0, 1), "plate"), Plane((0, 0, 9), (0, 0, -1), "far")
    walls = [SolidWall(plate), SolidWall(far)]
    sim = held([[0, 0, R - deep]], walls=walls)
    heat = Heat(sim, K, CP, 300.0, wall_temperatures={"plate": 500.0}, stiffness_ratio=8.0)
    conductance = 2.0 * K * math.sqrt(R * deep) / 2.0
    np.testing.assert_allclose(heat.conductances()[3], conductance, rtol=1e-9)
    for _ in range(100):
        heat.advance(0.01 * heat.capacities[0] / conductance)
    t = heat.temperatures[0]
    assert t == pytest.approx(500.0 - 200.0 * math.exp(-1.0), rel=2e-3)
    assert heat.from_walls[0] == pytest.approx(heat.capacities[0] * (t - 300.0), rel=1e-12)
    assert heat.from_walls[1] == 0.0


def test_a_bed_that_moves_keeps_its_heat():
    rng = np.random.default_rng(1)
    at = np.stack(np.meshgrid(*[np.arange(5)] * 3, indexing="ij"), -1).reshape(-1, 3)
    at = (at + 0.5) * 2.2 * R
    walls = [SolidWall(w) for w in box_walls((0, 0, 0), (11 * R, 11 * R, 1.0))[:5]]
    sim = Simulation(at, R, GLASS, Contact(0.5, 0.3), walls=walls)
    start = rng.uniform(300.0, 500.0, len(at))
    heat = Heat(sim, K, CP, start, arriving=350.0)
    whole = float(heat.capacities @ start)
    for _ in range(10):
        sim.run(300)
        heat.advance(20.0)
    assert float(heat.capacities @ heat.temperatures) == pytest.approx(whole, rel=1e-13)
    assert heat.temperatures.std() < 0.5 * start.std()
    assert start.min() < heat.temperatures.min()
    sim.insert([[5 * R, 5 * R, 0.5]], R)
    assert heat.temperatures[-1] == 350.0
    kept = heat.temperatures
    sim.remove(np.arange(len(kept)) % 2 == 0)
    np.testing.assert_array_equal(heat.temperatures, kept[1::2])


def test_across_a_periodic_face():
    sim = held(
        [[0.2 * R, 5 * R, 5 * R], [10 * R - 1.799 * R, 5 * R, 5 * R]],
        box=[[0, 0, 0], [10 * R] * 3], periodic=(True,) * 3,
    )  # fmt: skip
    heat = Heat(sim, K, CP, [400.0, 300.0])
    conductance = 2.0 * K * math.sqrt(0.5 * R * 1e-3 * R)
    np.testing.assert_allclose(heat.conductances()[1], conductance, rtol=1e-6)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"conductivity": -1.0}, r"conductivity \[W/m/K\] must be finite and above 0"),
        ({"temperature": [300.0, 300.0]}, "temperature has shape"),
        ({"wall_temperatures": {"lid": 300.0}}, "no wall is called 'lid'"),
        ({"heat_capacity": np.nan}, r"heat_capacity \[J/kg/K\]"),
    ],
)
def test_refusals(change, says):
    sim = held([[0, 0, 0]])
    given = {"conductivity": K, "heat_capacity": CP, "temperature": 300.0, **change}
    with pytest.raises(InputError, match=says):
        Heat(sim, **given)
    with pytest.raises(InputError, match="time = -1"):
        Heat(sim, K, CP, 300.0).advance(-1.0)
