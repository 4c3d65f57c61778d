"""Temperature of the gas: closed forms, bounds, heat that is accounted for, ideal gas."""

import numpy as np
import pytest

from greybed.cfd.gas import Fluid, GasSolver, Grid, Inflow, Outlet, Wall
from greybed.core.errors import InputError

AIR = Fluid(density=1.2, viscosity=1.8e-5, heat_capacity=1000.0, conductivity=0.03)
SLIP = Wall(slip=True)


def column(n, sides, fluid=AIR, void=1.0, temperature=300.0, **other):
    grid = Grid(cells=(1, 1, n), upper=(0.1 / n, 0.1 / n, 0.1))
    return GasSolver(
        grid, sides, fluid, void_fraction=void, temperature=temperature, tolerance=1e-11, **other
    )


def content(solver):
    """Heat in the gas [J]."""
    heat = solver.state.mass * solver.fluid.heat_capacity * solver.temperature
    return solver.grid.cell_volume * float(heat.sum())


def test_conduction_between_plates_is_linear():
    solver = column(8, {"z-": Wall(temperature=300.0), "z+": Wall(temperature=400.0)})
    # 0.1 m take 0.1^2 / (pi^2 2.5e-5) = 40 s to become steady; steps are cut inside.
    for _ in range(8):
        solver.step(100.0)
    z = solver.grid.centres(2)
    assert solver.temperature.ravel() == pytest.approx(300.0 + 1000.0 * z, rel=1e-8)


def test_a_wave_of_heat_decays_as_it_must():
    wrong = []
    for n in (16, 32):
        grid = Grid(cells=(n, 1, 1), upper=(0.1, 0.01, 0.01), periodic=(True, False, False))
        k = 2.0 * np.pi / 0.1
        wave = np.cos(k * grid.centres(0))
        solver = GasSolver(grid, {}, AIR, void_fraction=0.6, temperature=(300 + 10 * wave))
        for _ in range(10):
            solver.step(1.0)
        exact = 300 + 10 * wave * np.exp(-2.5e-5 * k**2 * 10.0)
        wrong.append(abs(solver.temperature - exact).max())
    assert np.log2(wrong[0] / wrong[1]) > 1.9


def test_gas_takes_the_temperature_of_the_particles_along_its_way():
    wrong = []
    for n in (20, 40):
        fluid = Fluid(density=1.2, viscosity=1.8e-5, heat_capacity=1000.0, conductivity=0.0)
        solver = column(n, {"z-": Inflow(0.4, 300.0), "z+": Outlet()}, fluid, void=0.5)
        for _ in range(4 * n):
            report = solver.step(0.05 / n, heat_coefficient=2e4, heat_target=500.0)
        z = solver.grid.centres(2)
        exact = 500 - 200 * np.exp(-2e4 * z / (1.2 * 1000 * 0.4))
        wrong.append(abs(solver.temperature.ravel() - exact).max())
    assert np.log2(wrong[0] / wrong[1]) > 1.7  # on the way to second order
    assert wrong[1] < 2.0
    # Steady: what particles give is what the flow carries off.
    given = report.heat.sum() * 0.1 / n
    out = 1.2 * 1000 * 0.4 * (solver.temperature[-1, 0, 0] - 300.0)
    assert given == pytest.approx(out, rel=1e-6)


def stirred(periodic):
    rng = np.random.default_rng(4)
    grid = Grid(cells=(12, 1, 16), upper=(0.12, 0.01, 0.16), periodic=(periodic, False, periodic))
    hot = np.where(rng.random(grid.shape) < 0.5, 300.0, 900.0)
    eps = 0.4 + 0.5 * rng.random(grid.shape)
    solver = GasSolver(grid, {}, AIR, void_fraction=eps, temperature=hot, tolerance=1e-12)
    solver.set_velocity(*(2.0 * rng.standard_normal(s) for s in grid.face_shapes))
    return solver, rng


@pytest.mark.parametrize("periodic", [True, False])
def test_temperatures_stay_between_what_there_was(periodic):
    solver, _ = stirred(periodic)
    for _ in range(20):
        solver.step(0.01)
        # Continuity is fulfilled to 1e-12.
        assert solver.temperature.min() > 300.0 - 1e-7
        assert solver.temperature.max() < 900.0 + 1e-7


def test_heat_is_accounted_for_to_round_off():
    solver, rng = stirred(periodic=False)
    before = content(solver)
    gained = 0.0
    for _ in range(8):
        eps = solver.state.void_fraction
        moved = 0.02 * rng.standard_normal(eps.shape)
        after = eps + moved - moved.mean()  # a closed box: particles only move about
        report = solver.step(
            0.005, void_fraction=np.clip(after, 0.1, 1.0) if after.max() > 1 else after,
            heat_coefficient=1e4 * rng.random(eps.shape), heat_target=700.0, heat_source=50.0,
        )  # fmt: skip
        gained += report.heat.sum() * solver.grid.cell_volume * report.dt
    assert content(solver) - before == pytest.approx(gained, rel=1e-10, abs=1e-12 * before)


def test_stiff_heat_goes_to_the_temperature_of_the_particles():
    solver, _ = stirred(periodic=True)
    report = solver.step(0.01, heat_coefficient=1e9, heat_target=650.0)
    assert solver.temperature == pytest.approx(650.0, rel=1e-4)
    assert np.isfinite(report.heat).all()


def test_heated_ideal_gas_keeps_its_mass_flux():
    fluid = Fluid(molar_mass=0.02896, viscosity=1.8e-5, heat_capacity=1005.0, temperature=300.0)
    solver = column(24, {"z-": Inflow(0.5, 300.0), "z+": Outlet()}, fluid)
    source = np.zeros(solver.grid.shape)
    source[8:16] = 1e4
    for _ in range(300):
        report = solver.step(0.002, heat_source=source)
    rho = solver.state.mass.ravel()
    np.testing.assert_allclose(rho, fluid.density_at(solver.temperature.ravel()), rtol=1e-6)
    flux = 0.5 * (rho[1:] + rho[:-1]) * solver.velocity[2].ravel()[1:-1]
    np.testing.assert_allclose(flux, fluid.density * 0.5, rtol=1e-6)
    # rho u cp dT = the heat on the way
    rise = 1e4 * 8 * 0.1 / 24 / (fluid.density * 0.5 * 1005.0)
    assert solver.temperature[-1, 0, 0] - 300.0 == pytest.approx(rise, rel=2e-3)
    assert solver.velocity[2][-1, 0, 0] == pytest.approx(0.5 * (300 + rise) / 300, rel=2e-3)
    assert report.parts == 1


def test_what_energy_needs_is_asked_for():
    with pytest.raises(InputError, match="temperature"):
        column(4, {"z-": Inflow(0.4), "z+": Outlet()})
    ideal = Fluid(molar_mass=0.029, viscosity=1.8e-5)
    with pytest.raises(InputError, match="no side holds its mean pressure"):
        column(4, {"z-": Inflow(0.4, 300.0), "z+": Inflow(-0.4, 300.0)}, ideal)
    with pytest.raises(InputError, match="constant pressure"):
        column(4, {}, Fluid(molar_mass=0.029, viscosity=1.8e-5, heat_capacity=280.0))
    for first, then in (({}, Outlet()), ({"z+": Outlet()}, Wall())):
        with pytest.raises(InputError, match="sealed or let out"):
            column(4, first, ideal).set_boundary("z+", then)
    with pytest.raises(InputError, match="temperature at the start"):
        column(4, {"z+": Outlet()}, ideal, temperature=None)
    with pytest.raises(InputError, match="above 0"):
        column(4, {}, temperature=-3.0)
    solver = column(4, {})
    with pytest.raises(InputError, match="heat_target"):
        solver.step(0.1, heat_coefficient=3.0)
    with pytest.raises(InputError, match="density"):
        Fluid(viscosity=1e-5)
