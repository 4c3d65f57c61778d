"""Two fluids against theory: slip, stability, sedimentation, weight of a bed, order of accuracy."""

import numpy as np
import pytest
from linear import waves

from greybed.cfd.grid import Grid
from greybed.cfd.kinetic import Granular
from greybed.cfd.rims import Inflow, Outlet, Wall
from greybed.cfd.twofluid import TwoFluid
from greybed.closures.drag.laws import drag_law

FCC = {"particle_density": 1500.0, "diameter": 75e-6, "gas_density": 1.2, "gas_viscosity": 1.8e-5}
WARM = Granular(temperature=2e-3)


def column(n, height, periodic=True):
    width = height / n
    return Grid(cells=(1, n, 1), upper=(width, height, width), periodic=(False, periodic, False))


@pytest.mark.parametrize("name", ["wen-yu", "gidaspow", "bvk", "tenneti"])
@pytest.mark.parametrize("phi", [0.02, 0.3])
def test_homogeneous_slip_is_where_the_law_carries_the_weight(name, phi):
    law = drag_law(name)
    sim = TwoFluid(column(4, 0.02), phi, drag=law, longest_step=5e-3, **FCC)
    sim.run(0.4)
    slip = sim.means.slip[1]
    re = (1.0 - phi) * 1.2 * 75e-6 * slip / 1.8e-5
    gamma = 18.0 * 1.8e-5 / 75e-6**2 * float(law(np.array([phi]), np.array([re]))[0])
    assert gamma * slip == pytest.approx((1500.0 - 1.2) * 9.81, rel=1e-6)


def wave(n, length, phi, mode, amplitude, dt, granular=WARM):
    """A column that starts as one mode of the linear theory; its growth rate, vector, and slip."""
    law = drag_law("wen-yu")
    k = 2.0 * np.pi * mode / length
    rates, vectors, slip = waves(k, phi, law, granular, **FCC)
    vector = vectors[:, 0] / vectors[0, 0] * amplitude
    grid = column(n, length)
    y, faces = grid.centres(1), grid.faces(1)
    part = [np.real(x * np.exp(1j * k * faces))[None, :, None] for x in vector[1:3]]
    # Means over cells, not values at centres.
    h = grid.spacing[1]
    mean = np.sinc(0.5 * k * h / np.pi)
    start = phi + mean * np.real(vector[0] * np.exp(1j * k * y))[None, :, None]
    sim = TwoFluid(
        grid, start, drag=law, granular=granular, time_step=dt, tolerance=1e-9,
        solids_velocity=(0, part[0], 0), gas_velocity=(0, slip + part[1], 0), **FCC,
    )  # fmt: skip
    return sim, k, rates[0], vector[0]


@pytest.mark.parametrize(
    ("temperature", "length", "dt", "unstable"),
    [(3e-4, 0.005, 2e-5, True), (2e-3, 0.0025, 2e-6, False)],
)
def test_waves_grow_and_decay_as_the_linear_theory_has_it(temperature, length, dt, unstable):
    granular = Granular(temperature=temperature)
    sim, k, rate, _ = wave(64, length, 0.2, 1, 1e-5, dt, granular)
    assert (rate.real > 0.0) == unstable
    y = sim.grid.centres(1)
    times, modes = [], []
    for _ in range(200):
        sim.step()
        times.append(sim.time)
        modes.append((sim.solid_fraction[0, :, 0] * np.exp(-1j * k * y)).mean())
    growth = np.polyfit(times, np.log(np.abs(modes)), 1)[0]
    phase = np.polyfit(times, np.unwrap(np.angle(modes)), 1)[0]
    # Euler steps let an oscillation grow by its frequency squared times dt / 2: 0.3 % of it here.
    assert growth == pytest.approx(rate.real, rel=0.02)
    assert phase == pytest.approx(rate.imag, rel=0.005)


def test_smooth_waves_are_of_second_order_in_space():
    """Against the linear solution; steps shrink with the square of the cells."""
    errors = []
    for n in (16, 32, 64):
        sim, k, rate, vector = wave(n, 0.01, 0.2, 1, 1e-6, 0.064 / n**2)
        sim.run(0.004)
        y = sim.grid.centres(1)
        exact = np.real(vector * np.exp(1j * k * y + rate * sim.time))
        errors.append(np.abs(sim.solid_fraction[0, :, 0] - 0.2 - exact).mean())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders.min() > 1.8


def test_sedimentation_follows_kynch():
    """Spheres settle in water: the clear front falls with their speed, the sediment rises."""
    water = {"particle_density": 2500.0, "diameter": 1e-4, "gas_density": 1000.0,
             "gas_viscosity": 1e-3}  # fmt: skip
    height, phi, n = 0.1, 0.2, 200
    law = drag_law("wen-yu")
    sim = TwoFluid(
        column(n, height, False), phi, drag=law, longest_step=0.05, courant=0.4, **water,
        sides={"y-": Wall(), "y+": Wall()},
    )  # fmt: skip
    slip = 0.01
    for _ in range(200):
        re = (1 - phi) * 1000.0 * 1e-4 * slip / 1e-3
        slip = 1500.0 * 9.81 * 1e-8 / (18e-3 * float(law(np.array([phi]), np.array([re]))[0]))
    speed = (1.0 - phi) * slip
    y, h, seen = sim.grid.centres(1), height / n, []
    for time in (4.0, 8.0):
        sim.run(time - sim.time)
        found = sim.solid_fraction[0, :, 0]
        front = 0.04 + found[y > 0.04].sum() * h / phi
        last = int(np.flatnonzero(found[y < 0.04] > 0.4)[-1])
        top = y[last] + h * (found[last] - 0.4) / (found[last] - found[last + 1])
        seen.append((front, top, (found[y < 0.04] - phi).sum() * h))
    (front, low, excess), (later, high, more) = seen
    assert (front - later) / 4.0 == pytest.approx(speed, rel=0.01)
    assert (more - excess) / 4.0 == pytest.approx(phi * speed, rel=0.01)
    # The sediment that has come in between has this solid fraction; the shock is sharp.
    layer = found[(y > low) & (y < high - 2 * h)]
    shock = phi * speed / (layer.mean() - phi)
    assert (high - low) / 4.0 == pytest.approx(shock, rel=0.05)
    assert 0.5 < layer.min() < layer.max() < 0.63
    assert ((found > 0.22) & (found < 0.48)).sum() <= 4


def bed(phi, inflow):
    """A bed of 20 mm under 20 mm of gas, after 0.2 s; pressure drop over it and its weight [Pa]."""
    grid = column(40, 0.04, False)
    start = np.zeros(grid.shape)
    start[:, :20] = phi
    sim = TwoFluid(
        grid, start, drag=drag_law("gidaspow"), longest_step=1e-3,
        sides={"y-": Inflow(inflow), "y+": Outlet()}, **FCC,
    )  # fmt: skip
    sim.run(0.2)
    drops = []
    for _ in range(50):
        sim.step()
        p = sim.pressure[0, :, 0]
        drops.append(1.5 * p[0] - 0.5 * p[1] - 1.2 * 9.81 * 0.04)
    return sim, np.mean(drops), sim.solids_mass / grid.spacing[0] ** 2 * 9.81


def test_a_fluidised_bed_drops_its_weight():
    sim, drop, weight = bed(0.515, 6.5e-3)
    buoyancy = weight * 1.2 / 1500.0
    # Contacts begin at 0.5: a little rests on the floor.
    floor = float(sim.granular.pressure(sim.solid_fraction[0, 0, 0], 0.0, 1500.0))
    assert floor < 0.02 * weight
    assert drop + floor == pytest.approx(weight - buoyancy, rel=0.005)
    assert 0.48 < sim.solid_fraction[0, 4:14].min() < sim.solid_fraction[0, 4:14].max() < 0.54


def test_a_bed_that_stands_drops_what_ergun_says():
    sim, drop, weight = bed(0.56, 2e-3)
    phi = sim.solid_fraction[0, :, 0]
    eps, w = 1.0 - phi, 2e-3 / (1.0 - phi)
    re = eps * 1.2 * 75e-6 * w / 1.8e-5
    law = drag_law("gidaspow")(phi, re)
    gradient = 18.0 * 1.8e-5 / 75e-6**2 * law * phi * w
    # Solids stress carries the rest; they still sink by what their weight compresses.
    assert drop == pytest.approx(float(gradient.sum() * 1e-3), rel=0.02)
    assert drop < 0.6 * weight


def test_gas_alone_between_plates_is_a_parabola():
    nx, width, gradient = 16, 2e-3, -3.0
    grid = Grid(cells=(nx, 4, 1), upper=(width, width / 4, width), periodic=(False, True, False))
    x = grid.centres(0)
    # Linear between cells and walls: off by the same everywhere.
    exact = -gradient / (2 * 1.8e-5) * (x * (width - x) + 0.25 * (width / nx) ** 2)
    sim = TwoFluid(
        grid, 0.0, drag=drag_law("wen-yu"), gravity=(0, 0, 0), longest_step=1e-3,
        pressure_gradient=(0, gradient, 0), gas_velocity=(0, exact[None, None], 0), **FCC,
    )  # fmt: skip
    # Most of the time in which any other profile would decay, width^2 / (pi^2 nu).
    sim.run(0.02)
    np.testing.assert_allclose(sim.gas_velocity[1][0, 1], exact, rtol=1e-9)


def test_temperature_of_a_shear_flow_is_where_production_meets_dissipation():
    """A linear profile between plates that move: closed form of the balance."""
    rate, phi, e = 200.0, 0.3, 0.9
    grid = Grid(cells=(4, 6, 1), upper=(2e-3, 3e-3, 1e-3), periodic=(True, False, False))
    y = grid.centres(1)
    sim = TwoFluid(
        grid, phi, drag=drag_law("stokes"), granular=Granular(drag_dissipation=False),
        solids_velocity=(rate * y[None, :, None], 0, 0), longest_step=1e-4, **FCC,
    )  # fmt: skip
    g = 1.0 / (1.0 - (phi / 0.63) ** (1 / 3))
    root = np.sqrt(np.pi)
    shear = root * phi / (6 * (3 - e)) * (1 + 0.4 * (1 + e) * (3 * e - 1) * phi * g)
    shear += 0.8 * phi**2 * g * (1 + e) / root
    loss = 12 * (1 - e**2) * g * phi * (phi + 1e-4) / root
    exact = shear * (75e-6 * rate) ** 2 / loss
    assert sim.granular_temperature[0, 2:4] == pytest.approx(np.full((2, 4), exact), rel=1e-9)
