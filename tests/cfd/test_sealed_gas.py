"""Ideal gas that nothing lets out: its mean pressure, its mass and its internal energy."""

import numpy as np
import pytest

from greybed.cfd.gas import Fluid, GasSolver, Grid, Wall
from greybed.core.config import build
from greybed.coupling.flow_run import FlowRun
from greybed.coupling.gas_case import GasCase, GasRun

FLUID = Fluid(
    molar_mass=0.029, viscosity=1.8e-5, heat_capacity=1005.0, conductivity=0.03, temperature=300.0
)
RATIO = FLUID.heat_capacity / (FLUID.heat_capacity - FLUID.gas_constant)
FIRST = FLUID.pressure


def column(n, sides, void=1.0):
    grid = Grid(cells=(1, 1, n), upper=(0.1 / n, 0.1 / n, 0.1))
    return GasSolver(grid, sides, FLUID, void_fraction=void, temperature=300.0, tolerance=1e-11)


def uneven(n=12):
    """A column whose void fraction differs from cell to cell, and heat in its lower part."""
    solver = column(n, {}, 0.4 + 0.5 * np.random.default_rng(0).random((n, 1, 1)))
    heat = np.where(solver.grid.centres(2) < 0.035, 1e5, 0.0)[:, None, None]
    return solver, heat


def test_uniform_heat_raises_pressure_and_temperature_as_at_constant_volume():
    solver = column(6, {}, void=0.5)
    for _ in range(20):
        report = solver.step(0.01, heat_source=1e5)
    pressure = FIRST + (RATIO - 1.0) * 1e5 * 0.2 / 0.5
    assert report.mean_pressure == pytest.approx(pressure, rel=1e-13)
    assert solver.temperature == pytest.approx(300.0 * pressure / FIRST, rel=1e-13)
    assert report.heat == pytest.approx(1e5, rel=1e-10)  # without what compression gives
    assert max(np.abs(u).max() for u in solver.velocity) < 1e-12


def test_uneven_heat_keeps_mass_and_energy_to_round_off():
    wrong = []
    for steps in (20, 40):
        solver, heat = uneven()
        room, mass = solver.state.void_fraction.sum(), solver.state.mass.sum()
        for k in range(steps):
            solver.step(0.2 / steps, heat_source=heat)
            assert solver.state.mass.sum() == pytest.approx(mass, rel=1e-14)
            given = heat.sum() * 0.2 * (k + 1) / steps
            # dp0/dt = (ratio - 1) Q / V, to the round-off of each step.
            exact = FIRST + (RATIO - 1.0) * given / room
            assert solver.mean_pressure == pytest.approx(exact, rel=1e-14 * steps)
        content = solver.state.mass * solver.temperature
        held = (FLUID.heat_capacity - FLUID.gas_constant) * content.sum()
        assert held == pytest.approx(room * solver.mean_pressure / (RATIO - 1.0), rel=1e-13)
        assert np.ptp(solver.temperature) > 30.0
        local = FLUID.gas_constant * content / solver.state.void_fraction
        wrong.append(np.abs(local / solver.mean_pressure - 1.0).max())
    # The law of the ideal gas in each cell, by the lag of the density.
    assert wrong[0] < 1e-4
    assert wrong[0] / wrong[1] > 1.9


def test_between_a_cold_and_a_hot_plate():
    wrong = []
    for n in (4, 8):
        solver = column(n, {"z-": Wall(temperature=300.0), "z+": Wall(temperature=400.0)})
        mass = float(solver.state.mass.mean())
        for _ in range(5):  # 0.1 m take 40 s to become steady; steps are cut inside
            solver.step(100.0)
        z = solver.grid.centres(2)
        assert solver.temperature.ravel() == pytest.approx(300.0 + 1000.0 * z, rel=1e-6)
        # p0 = M R / integral of dV / T over a straight line of T.
        exact = mass * FLUID.gas_constant * 100.0 / np.log(4.0 / 3.0)
        wrong.append(solver.mean_pressure / exact - 1.0)
    assert abs(wrong[1]) < 2e-4
    assert np.log2(wrong[0] / wrong[1]) == pytest.approx(2.0, abs=0.05)  # the midpoint rule's


def test_particles_that_take_room_compress_the_gas_at_constant_entropy():
    wrong = []
    for steps in (20, 40):
        solver = column(4, {}, void=0.8)
        for k in range(steps):
            solver.step(0.01, void_fraction=0.8 - 0.2 * (k + 1) / steps)
        wrong.append(solver.mean_pressure / (FIRST * (0.8 / 0.6) ** RATIO) - 1.0)
    assert abs(wrong[0]) < 5e-3
    assert wrong[0] / wrong[1] == pytest.approx(2.0, abs=0.1)  # first order in time


def test_a_hot_side_drives_the_gas_around_a_box_and_keeps_it():
    grid = Grid(cells=(6, 1, 6), upper=(0.02, 0.02, 0.02))
    sides = {"x-": Wall(temperature=400.0), "x+": Wall(temperature=300.0)}
    solver = GasSolver(
        grid, sides, FLUID, temperature=300.0, gravity=(0.0, 0.0, -9.81), tolerance=1e-10
    )
    mass = solver.state.mass.sum()
    for _ in range(40):
        report = solver.step(0.02)
    assert solver.state.mass.sum() == pytest.approx(mass, rel=1e-13)
    assert FIRST < report.mean_pressure < FIRST * 4.0 / 3.0
    assert report.divergence < 1e-9
    w = solver.velocity[2][3, 0]
    assert w[0] > 1e-3  # up along the hot side, down along the cold one
    assert w[-1] < -1e-3


def test_a_case_tells_its_mean_pressure_and_goes_on_bit_by_bit(tmp_path):
    case = build(
        GasCase,
        {
            "kind": "gas", "duration": 2.0, "time_step": 0.1, "output": {"samples": 0.5},
            "grid": {"cells": [4, 1, 4], "upper": [0.02, 0.02, 0.02]},
            "gas": {"molar_mass": 0.029, "viscosity": 1.8e-5, "temperature": 300.0},
            "side": [{"name": "z-", "kind": "wall", "temperature": 400.0}],
        },
        tmp_path / "case.toml",
    )  # fmt: skip
    whole = FlowRun(case, GasRun(case))
    for _ in whole.go_on(lambda: None):
        pass
    part = FlowRun(case, GasRun(case))
    for _ in part.go_on(lambda: None):
        if part.done == 2:
            break
    part.save(tmp_path / "part.npz", "key")
    rest = FlowRun(case, GasRun(case))
    assert rest.restore(tmp_path / "part.npz", "key")
    for _ in rest.go_on(lambda: None):
        pass
    assert rest.history == whole.history
    pressure = [row["mean pressure [Pa]"] for row in whole.history]
    assert pressure[0] == FIRST
    assert (np.diff(pressure) > 0.0).all()
    assert whole.flow.results()["mean_pressure_Pa"] == pressure[-1]
    assert rest.flow.solver.mean_pressure == pressure[-1]
