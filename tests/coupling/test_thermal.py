"""Thermal bed: analytic steady states, conservation, order in time, failures as values."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_matrix

from greybed.core import InputError, Packing
from greybed.coupling import Rows, SolverError, ThermalBed
from greybed.coupling.radiation import STEFAN_BOLTZMANN as SIGMA


def single(steel, emissivity=1.0, **options):
    """One sphere that sees nothing but the opening."""
    packing = Packing([[0, 0, 0]], 1e-3)
    rows = Rows(csr_matrix((1, 1)), np.zeros((1, 0)), np.ones(1), packing.areas)
    material = replace(steel, emissivity=emissivity)
    return ThermalBed(packing, rows, material=material, **options)


def test_chain_has_the_profile_of_resistors_in_series(chain, steel):
    result = ThermalBed(chain, None, material=steel, wall_temperatures=(400.0, 300.0)).steady()
    a = np.sqrt(0.5e-3 * 2e-6)
    a_wall = np.sqrt(1e-3 * 1e-6)
    resistance = 7 / (2 * 15.0 * a) + 2 / (4 * 15.0 * a_wall)
    heat = 100.0 / resistance
    drop = heat / (4 * 15.0 * a_wall)
    # Overlaps of 2e-6 m come from coordinates of 1e-2 m: relative 1e-12.
    profile = 400.0 - drop - heat / (2 * 15.0 * a) * np.arange(8)
    np.testing.assert_allclose(result.temperatures, profile, atol=1e-8)
    np.testing.assert_allclose(result.wall_heat, [heat, -heat], rtol=1e-9)
    assert result.energy_error < 1e-10
    assert result.status.converged
    assert result.status.iterations <= 3


@pytest.mark.parametrize("emissivity", [1.0, 0.3])
def test_heated_sphere_in_an_enclosure(steel, emissivity):
    bed = single(steel, emissivity, environment_temperature=300.0, sources=0.5)
    expected = (0.5 / (emissivity * SIGMA * bed.packing.areas[0]) + 300.0**4) ** 0.25
    result = bed.steady()
    assert result.temperatures[0] == pytest.approx(expected, rel=1e-10)
    assert result.opening_heat == pytest.approx(-0.5, rel=1e-10)


def test_two_black_spheres_between_a_wall_and_the_opening(chain, steel, rows_of):
    """Without conduction black radiation is linear in T^4: a dense solve is the reference."""
    rows = rows_of(chain)
    bed = ThermalBed(
        chain,
        rows,
        material=steel,
        wall_temperatures=(1000.0, None),
        environment_temperature=300.0,
        conduction=False,
    )
    result = bed.steady()
    f = rows.factors.toarray() + np.diag(rows.wall_factors[:, 1])
    outside = SIGMA * (rows.wall_factors[:, 0] * 1000.0**4 + rows.escaped * 300.0**4)
    emission = np.linalg.solve(np.eye(8) - f, outside)
    np.testing.assert_allclose(result.temperatures, (emission / SIGMA) ** 0.25, rtol=1e-9)


@pytest.mark.parametrize("emissivity", [1.0, 0.5])
def test_one_temperature_everywhere_stays(chain, steel, rows_of, emissivity):
    material = replace(steel, emissivity=emissivity)
    options = {"wall_temperatures": (700.0, None), "environment_temperature": 700.0}
    bed = ThermalBed(chain, rows_of(chain), material=material, **options)
    result = bed.steady()
    np.testing.assert_array_equal(result.temperatures, 700.0)
    run = bed.run(100.0, initial_temperature=700.0)
    np.testing.assert_array_equal(run.temperatures, 700.0)
    assert np.abs(run.wall_heat).max() == run.opening_heat == run.energy_error == 0.0


@pytest.mark.parametrize("emissivity", [1.0, 0.4])
def test_steady_is_the_limit_of_time(chain, steel, rows_of, emissivity):
    bed = ThermalBed(
        chain,
        rows_of(chain),
        material=replace(steel, emissivity=emissivity),
        wall_temperatures=(1073.15, None),
        environment_temperature=300.0,
    )
    steady = bed.steady()
    late = bed.run(3600.0, initial_temperature=300.0)
    np.testing.assert_allclose(late.temperatures, steady.temperatures, atol=0.01)
    assert steady.energy_error < 1e-10
    assert late.energy_error < 1e-10
    balance = steady.wall_heat.sum() + steady.opening_heat
    assert abs(balance) < 1e-10 * np.abs(steady.wall_heat).sum()
    assert steady.wall_heat[1] == 0.0  # adiabatic


@pytest.mark.parametrize("emissivity", [1.0, 0.6])
def test_adiabatic_bed_keeps_its_energy(chain, steel, rows_of, emissivity):
    start = np.linspace(300.0, 1300.0, 8)
    material = replace(steel, emissivity=emissivity)
    bed = ThermalBed(chain, rows_of(chain), material=material, wall_temperatures=(None, None))
    result = bed.run(300.0, initial_temperature=start)
    assert result.energy_error < 1e-10
    # Equal spheres: all end at the mean.
    np.testing.assert_allclose(result.temperatures, start.mean(), atol=1e-3)


@pytest.mark.parametrize("emissivity", [1.0, 0.5])
def test_time_integrator_is_of_second_order(chain, steel, rows_of, emissivity):
    bed = ThermalBed(
        chain,
        rows_of(chain),
        material=replace(steel, emissivity=emissivity),
        wall_temperatures=(1000.0, None),
        environment_temperature=300.0,
    )
    ends = [
        bed.run(2.0, initial_temperature=500.0, dt=2.0 / n).temperatures for n in (20, 40, 80, 640)
    ]
    errors = [np.abs(t - ends[-1]).max() for t in ends[:-1]]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (np.abs(orders - 2.0) < 0.15).all(), orders
    adaptive = bed.run(2.0, initial_temperature=500.0, temperature_tolerance=1e-3)
    assert np.abs(adaptive.temperatures - ends[-1]).max() < 0.02


def test_cooling_sphere_follows_the_closed_form(steel):
    """Black sphere to a background at 1 K: T^-3 grows linearly in time."""
    bed = single(steel, environment_temperature=1.0)
    rate = 3 * SIGMA * bed.packing.areas[0] / bed.capacity[0]
    expected = (1200.0**-3 + rate * 50.0) ** (-1 / 3)
    result = bed.run(50.0, initial_temperature=1200.0, temperature_tolerance=1e-3)
    assert result.temperatures[0] == pytest.approx(expected, rel=1e-4)  # 200 steps of 1e-3 K
    history = result.history
    assert history["time"][-1] == 50.0
    assert np.all(np.diff(history["mean"]) < 0.0)
    np.testing.assert_allclose(history["stored"][-1], history["supplied"][-1], rtol=1e-10)


def test_progress_adds_up_to_one(steel):
    parts = []
    bed = single(steel, environment_temperature=300.0)
    bed.run(10.0, initial_temperature=600.0, dt=3.0, on_progress=parts.append)
    assert len(parts) == 4
    assert sum(parts) == pytest.approx(1.0)


def test_isolated_spheres_keep_their_mean_and_are_reported(chain, steel):
    centres = np.vstack([chain.centres, [[0.1, 0, 4e-3], [0.1, 0, 5.998e-3]]])
    packing = Packing(centres, 1e-3, walls=chain.walls)
    bed = ThermalBed(packing, None, material=steel, wall_temperatures=(400.0, 300.0))
    start = np.full(10, 350.0)
    start[-2:] = 500.0, 600.0
    result = bed.steady(initial_temperature=start)
    np.testing.assert_array_equal(result.isolated, [8, 9])
    np.testing.assert_allclose(result.temperatures[-2:], 550.0)
    assert result.energy_error < 1e-10


def test_grey_and_direct_solves_agree(chain, steel, rows_of):
    bed = ThermalBed(
        chain,
        rows_of(chain),
        material=replace(steel, emissivity=np.linspace(0.2, 1.0, 8)),
        wall_temperatures=(1000.0, None),
    )
    rng = np.random.default_rng(5)
    t, rate = np.full(8, 800.0), np.full(8, 1e-3)
    rest = rng.random(8), rng.random(8)
    krylov = bed.network.solve(t, rate, *rest, rtol=1e-12)
    direct = bed.network.solve_direct(t, rate, *rest)
    np.testing.assert_allclose(krylov[0], direct[0], rtol=1e-8)
    np.testing.assert_allclose(krylov[1], direct[1], rtol=1e-8)


def test_failure_is_an_error_or_a_value(chain, steel, rows_of):
    options = {"wall_temperatures": (1500.0, None), "environment_temperature": 300.0}
    bed = ThermalBed(chain, rows_of(chain), material=steel, **options)
    with pytest.raises(SolverError, match=r"after 1 iterations; raise max_iterations") as caught:
        bed.steady(max_iterations=1)
    assert not caught.value.status.converged
    result = bed.steady(max_iterations=1, raise_on_failure=False)
    assert not result.status.converged
    assert "max_iterations" in result.status.remedy
    with pytest.raises(SolverError, match=r"2 steps reached only .* raise max_steps"):
        bed.run(1e4, initial_temperature=300.0, max_steps=2)
    partial = bed.run(1e4, initial_temperature=300.0, max_steps=2, raise_on_failure=False)
    assert 0.0 < partial.time < 1e4
    assert partial.energy_error < 1e-10


def test_refusals(chain, steel, rows_of):
    with pytest.raises(InputError, match="no sphere has a path"):
        ThermalBed(chain, None, material=steel, wall_temperatures=(None, None)).steady(
            initial_temperature=300.0
        )
    with pytest.raises(InputError, match="initial_temperature is missing"):
        ThermalBed(chain, None, material=steel, wall_temperatures=(None, None)).steady()
    with pytest.raises(InputError, match="1 wall temperatures for 2 walls"):
        ThermalBed(chain, None, material=steel, wall_temperatures=(300.0,))
    with pytest.raises(InputError, match=r"sources .* \[W\]"):
        ThermalBed(chain, None, material=steel, wall_temperatures=(1.0, 1.0), sources=[1.0])
    bad = replace(steel, density=-1.0)
    with pytest.raises(InputError, match=r"density = -1 \[kg/m3\]"):
        ThermalBed(chain, None, material=bad, wall_temperatures=(1.0, 1.0))
    bed = ThermalBed(chain, rows_of(chain), material=steel, wall_temperatures=(300.0, 300.0))
    with pytest.raises(InputError, match=r"duration = 0 \[s\]"):
        bed.run(0.0, initial_temperature=300.0)
    with pytest.raises(InputError, match=r"temperature_tolerance = 0 \[K\]"):
        bed.run(1.0, initial_temperature=300.0, temperature_tolerance=0.0)
    with pytest.raises(InputError, match=r"initial_temperature = -5 \[K\]"):
        bed.run(1.0, initial_temperature=-5.0)
