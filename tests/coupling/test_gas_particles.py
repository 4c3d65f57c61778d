"""Gas and particles: what one gets the other loses, settling, fixed beds, restart."""

from __future__ import annotations

import math

import numpy as np
import pytest

from greybed.cfd.grid import Grid
from greybed.closures.drag import LAWS
from greybed.core import Plane
from greybed.coupling.drag_exchange import Settings
from greybed.coupling.gas_particles import GasParticles
from greybed.dem import Contact, Material, Simulation, SolidWall
from tests.coupling.plain_gas import PlainGas

GLASS = Material(2500.0, 5e6, 0.3, "glass")
AIR, MU = 1.2, 1.8e-5


def cloud(settings, *, n=5, d=1e-3, edge=2.2e-3, cells=(6, 5, 4), gravity=(0.0, 0.0, 0.0), seed=0,
          material=GLASS, time_step=2e-6):  # fmt: skip
    """Spheres on a loose lattice in a periodic box of gas, both with velocities."""
    rng = np.random.default_rng(seed)
    at = np.stack(np.meshgrid(*[np.arange(n)] * 3, indexing="ij"), -1).reshape(-1, 3)
    size = n * edge
    sim = Simulation(
        (at + 0.5 + 0.2 * rng.random(at.shape)) * edge, 0.5 * d * rng.uniform(0.8, 1.2, len(at)),
        material, Contact(0.9, 0.3), box=[[0, 0, 0], [size] * 3], periodic=(True,) * 3,
        gravity=gravity, velocities=0.3 * rng.normal(size=at.shape), time_step=time_step,
    )  # fmt: skip
    grid = Grid(cells=cells, upper=(size,) * 3, periodic=(True,) * 3)
    gas = PlainGas(grid, AIR, MU, gravity=gravity)
    gas.velocity = tuple(f + v for f, v in zip(gas.velocity, (0.3, -0.2, 0.5), strict=True))
    return GasParticles(gas, sim, settings), sim, gas


@pytest.mark.parametrize("treatment", ["explicit", "semi-implicit", "implicit"])
@pytest.mark.parametrize(("width", "extra"), [(0.0, False), (3.0, False), (3.0, True)])
def test_particles_get_what_the_gas_loses(treatment, width, extra):
    more = {"lift": "saffman-mei", "added_mass": 0.5} if extra else {}
    both, sim, gas = cloud(Settings(treatment=treatment, width=width, **more))
    moved = 0.0
    for _ in range(4):
        old, before = gas.velocity, sim.masses @ sim.velocities
        report = both.step(5)
        assert report.defect < 1e-13
        assert not report.from_rims.any()
        change = sim.masses @ sim.velocities - before
        np.testing.assert_allclose(change, report.given + report.pressure, rtol=1e-7, atol=1e-16)
        for axis in range(3):
            # the plain gas multiplies old and new velocities by the new void fraction
            eps = gas.on_faces(both.void, axis)
            gain = AIR * eps * (gas.velocity[axis] - old[axis]) * gas.grid.cell_volume
            change[axis] += np.moveaxis(gain, 2 - axis, 0)[:-1].sum()
        scale = float((sim.masses[:, None] * np.abs(sim.velocities)).sum())
        # pressure cancels too: its shares on gas and particles add up on each face
        assert np.abs(change).max() < 1e-13 * scale
        moved += np.abs(report.given).max() / scale
    assert moved > 1e-5


@pytest.mark.parametrize("treatment", ["explicit", "semi-implicit"])
@pytest.mark.parametrize(("drag", "model"), [("bvk", "A"), ("gidaspow", "B")])
def test_one_pass_of_drag_is_what_the_passes_are_apart(treatment, drag, model):
    # a correction that keeps all of the drag goes the long way
    found = []
    for keep in (None, lambda phi, slip, size: np.ones_like(phi)):
        both, sim, gas = cloud(Settings(drag=drag, treatment=treatment, correction=keep))
        gas.model = model
        assert (both.settings.plain is None) == (keep is not None)
        reports = [both.step(5) for _ in range(3)]
        found.append((sim.velocities, gas.velocity, reports[-1].given, both.state()))
    (v, u, given, state), (far_v, far_u, far_given, far_state) = found
    # the same sums in the same order; what is left is how compilers contract products
    np.testing.assert_allclose(v, far_v, rtol=1e-12, atol=1e-14)
    for one, other in zip(u, far_u, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(given, far_given, rtol=1e-10)
    np.testing.assert_allclose(state["coupling_clock"], far_state["coupling_clock"], rtol=1e-12)


def test_a_bed_at_rest_in_its_own_gas_floats_by_archimedes():
    # all fall together in a box without walls: gas and particles are one body
    gravity = (0.0, 0.0, -9.81)
    both, sim, gas = cloud(Settings(), gravity=gravity)
    mass = float(sim.masses.sum())
    start = sim.masses @ sim.velocities
    held = 0.0
    for _ in range(5):
        old = gas.velocity
        report = both.step(5)
        eps = gas.on_faces(both.void, 2)
        gain = AIR * eps * (gas.velocity[2] - old[2]) * gas.grid.cell_volume
        held += float(gain[:-1].sum()) + 9.81 * AIR * float(eps[:-1].sum()) * (
            report.dt * gas.grid.cell_volume
        )
    fell = sim.masses @ sim.velocities - start
    assert fell[2] + held == pytest.approx(-9.81 * mass * both.time, rel=1e-9)


# -- one particle ---------------------------------------------------------------------------

SETTLING = {"d": 100e-6, "density": 2000.0, "gas": 0.40, "gravity": 9.80665}


def exact_slip():
    """Terminal slip of MFIX's case DEM06 by bisection."""
    d, density, g = SETTLING["d"], SETTLING["density"], SETTLING["gravity"]
    low, high = 0.0, 2.0
    for _ in range(100):
        s = 0.5 * (low + high)
        re = AIR * d * s / MU
        drag = 3.0 * math.pi * MU * d * s * (1.0 + 0.15 * re**0.687)
        low, high = (s, high) if drag < math.pi / 6 * d**3 * (density - AIR) * g else (low, s)
    return low


def settle(where, treatment, *, steps=50, time=0.5):
    """Speed of a grain that starts at rest, so many cells above the floor of a one-cell column."""
    edge, sand = 0.004, Material(SETTLING["density"], 5e3, 0.3, "sand")
    size = (edge, edge, 12 * edge)
    sim = Simulation(
        [[edge * where] * 2 + [edge * (10 + where)]], 0.5 * SETTLING["d"], sand, Contact(0.9, 0.0),
        time_step=5e-5, box=[[0, 0, 0], size], periodic=(True, True, False), threads=1,
        gravity=(0.0, 0.0, -SETTLING["gravity"]),
    )  # fmt: skip
    grid = Grid(cells=(1, 1, 12), upper=size, periodic=(True, True, False))
    gas = PlainGas(grid, AIR, MU, inflow=SETTLING["gas"])
    both = GasParticles(gas, sim, Settings(drag="schiller-naumann", treatment=treatment))
    while both.time < time:
        both.step(steps)
    return float(sim.velocities[0, 2])


@pytest.mark.parametrize("where", [0.0, 0.37, 0.93])
def test_a_particle_settles_at_its_speed_wherever_it_is_in_a_cell(where):
    # MFIX's DEM06: net -0.05739 m/s by its documents, in gas that rises at 0.40 m/s
    exact = SETTLING["gas"] - exact_slip()
    assert exact == pytest.approx(-0.05739, rel=3e-4)
    assert settle(where, "semi-implicit") == pytest.approx(exact, rel=1e-3)


@pytest.mark.parametrize(("treatment", "steps"), [("implicit", 2000), ("implicit", 50),
                                                  ("explicit", 50)])  # fmt: skip
def test_implicit_drag_settles_with_steps_longer_than_the_particle_needs(treatment, steps):
    # 0.1 s is more than twice the particle's relaxation time; explicit drag would swing up there
    exact = SETTLING["gas"] - exact_slip()
    assert settle(0.3, treatment, steps=steps) == pytest.approx(exact, rel=2e-3)


# -- beds -----------------------------------------------------------------------------------

D, ROUGH = 1e-3, {"density": 10.0, "viscosity": 1.5e-3}  # CFDEM's case of Ergun's equation


def column(settings, inflow, *, layers=8, density=2000.0, gravity=(0.0, 0.0, 0.0), heavy=False,
           cells=(2, 2, 6)):  # fmt: skip
    """Straight stacks of spheres that just touch, across the whole of a periodic column."""
    at = np.stack(np.meshgrid(range(4), range(4), range(layers), indexing="ij"), -1).reshape(-1, 3)
    size = (4 * D, 4 * D, 2 * cells[2] * D)
    base = 2 * D if heavy else 0.0
    sim = Simulation(
        (at + 0.5) * D + [0, 0, base], 0.5 * D, Material(1e12 if heavy else density, 5e6, 0.3, "a"),
        Contact(0.3, 0.0), box=[[0, 0, 0], size], periodic=(True, True, False), gravity=gravity,
        walls=[SolidWall(Plane((0, 0, 0), (0, 0, 1), "floor"))], threads=1,
        time_step=1e-3 if heavy else 1e-5,
    )  # fmt: skip
    grid = Grid(cells=cells, upper=size, periodic=(True, True, False))
    gas = PlainGas(grid, **ROUGH, inflow=inflow)
    return GasParticles(gas, sim, settings), sim, gas


@pytest.mark.parametrize("law", ["ergun", "gidaspow", "bvk", "koch-hill", "tenneti", "rong"])
@pytest.mark.parametrize("speed", [0.002, 0.2])
def test_a_fixed_bed_has_the_pressure_drop_of_its_law(law, speed):
    both, _, gas = column(Settings(drag=law, width=0.0), speed, heavy=True)
    for _ in range(5):
        report = both.step(20)
    phi = math.pi / 6
    re = ROUGH["density"] * speed * D / ROUGH["viscosity"]
    gradient = 18 * ROUGH["viscosity"] * phi * float(LAWS[law](phi, re)) * speed
    gradient /= (1 - phi) * D**2
    p = gas.pressure.mean(axis=(1, 2))
    # across the middle of the bed, where no particle sees the faster gas beyond its ends
    assert p[2] - p[3] == pytest.approx(gradient * 2 * D, rel=1e-6)
    assert report.defect < 1e-12


def test_a_fixed_bed_is_ergun_s_also_where_it_is_smoothed():
    # cells of half a diameter: raw void fractions there lie between 0 and 1
    speed = 0.1
    both, _, gas = column(
        Settings(drag="ergun", width=3.0), speed, layers=16, heavy=True, cells=(8, 8, 10)
    )
    for _ in range(5):
        both.step(20)
    gradient = ergun_gradient(speed, 1 - math.pi / 6)
    p = gas.pressure.mean(axis=(1, 2))
    assert p[4] - p[6] == pytest.approx(gradient * 4 * D, rel=0.01)


def minimum_fluidisation(eps, density):
    """Superficial velocity at which Ergun's pressure gradient bears the bed."""
    mu, rho = ROUGH["viscosity"], ROUGH["density"]
    a = 1.75 * rho / (eps**3 * D)
    b = 150 * mu * (1 - eps) / (eps**3 * D**2)
    return (-b + math.sqrt(b * b + 4 * a * (density - rho) * 9.81)) / (2 * a)


def ergun_gradient(speed, eps):
    mu, rho = ROUGH["viscosity"], ROUGH["density"]
    slow = 150 * mu * (1 - eps) ** 2 / eps**3 * speed / D**2
    return slow + 1.75 * rho * (1 - eps) / eps**3 * speed**2 / D


def test_a_bed_is_lifted_at_ergun_s_minimum_fluidisation():
    eps = 1 - math.pi / 6
    lift = minimum_fluidisation(eps, 2000.0)
    both, sim, gas = column(
        Settings(drag="ergun", width=0.0), 0.5 * lift, layers=24, cells=(2, 2, 16),
        gravity=(0.0, 0.0, -9.81),
    )  # fmt: skip
    weight = 9.81 * (sim.masses.sum() * (1 - ROUGH["density"] / 2000.0))

    def load(speed):
        """Of the floor, over the bed's weight."""
        gas.inflow, floor = speed, []
        for step in range(120):
            both.step(20)
            if step >= 80:
                floor.append(-float(sim.wall_forces[0, 2]))
        return np.mean(floor) / weight

    # the top layer sees the slower gas above it: 2 % of the bed, for cells of two diameters
    for share in (0.9,):
        expected = 1 - ergun_gradient(share * lift, eps) / ergun_gradient(lift, eps)
        assert load(share * lift) == pytest.approx(expected, abs=0.03)
    assert load(1.05 * lift) < 0.005
