"""Few cells and steps: quick also where kernels are plain Python."""

from __future__ import annotations

import numpy as np
import pytest

from greybed.cfd.gas import Fluid, GasSolver, Grid, Inflow, Outlet, Wall
from greybed.cfd.kinetic import Granular
from greybed.cfd.poisson import Poisson
from greybed.cfd.rims import Wall as TwoFluidWall
from greybed.cfd.twofluid import TwoFluid
from greybed.closures.drag.laws import drag_law

AIR = Fluid(density=1.2, viscosity=1.8e-5)


@pytest.mark.parametrize(
    ("shape", "periodic"),
    [((1, 8, 12), (False,) * 3), ((6, 5, 8), (True, True, False)), ((8, 8, 8), (True,) * 3)],
)
def test_pressure_takes_back_what_made_it(shape, periodic):
    """The operator applied to a known field, solved for that field."""
    rng = np.random.default_rng(0)
    nz, ny, nx = shape
    t = [np.exp(0.5 * rng.standard_normal(s))
         for s in ((nz, ny, nx + 1), (nz, ny + 1, nx), (nz + 1, ny, nx))]  # fmt: skip
    for axis, face in enumerate(t):
        ends = np.moveaxis(face, 2 - axis, 0)
        ends[-1] = ends[0] if periodic[axis] else 0.0
        ends[0] = ends[0] if periodic[axis] else 0.0
    exact = rng.standard_normal(shape)
    b = np.zeros(shape)
    for axis, face in enumerate(t):
        along = 2 - axis
        step = np.diff(exact, axis=along, prepend=exact.take([-1], axis=along))
        step = np.concatenate([step, step.take([0], axis=along)], axis=along)
        b -= np.diff(face * step, axis=along)
    found, _ = Poisson(*t, periodic).solve(b, tolerance=1e-10)
    np.testing.assert_allclose(found - found.mean(), exact - exact.mean(), atol=1e-7)


def test_momentum_of_a_gas_between_walls_is_accounted_for():
    grid = Grid(cells=(4, 3, 5), upper=(0.04, 0.03, 0.05))
    sides = {"z-": Inflow(0.4), "z+": Outlet(), "x-": Wall(velocity=(0, 0, 0.3)), "x+": Wall()}
    solver = GasSolver(grid, sides, AIR, budget=True, void_fraction=0.6, gravity=(0.3, 0, -9.81))
    rng = np.random.default_rng(1)
    drag = tuple(100.0 * rng.random(s) for s in grid.face_shapes)
    still = tuple(np.zeros(s) for s in grid.face_shapes)
    for _ in range(2):
        void = 0.5 + 0.2 * rng.random(grid.shape)
        b = solver.step(0.01, void_fraction=void, drag=drag, target=still, source=still).budget
        parts = (b.transport, b.pressure, b.drag, b.source, b.weight, b.lag)
        assert abs(b.change - sum(parts)).max() < 1e-12 * sum(abs(p) for p in parts).max()


@pytest.mark.parametrize("periodic", [True, False])
@pytest.mark.parametrize("granular", [Granular(), Granular(friction_scale=0.0, temperature=0.0)])
def test_two_fluids_keep_their_masses(periodic, granular):
    grid = Grid(cells=(5, 6, 1), upper=(1.5e-3, 1.8e-3, 3e-4), periodic=(True, periodic, False))
    phi = np.clip(0.3 + 0.25 * np.random.default_rng(2).standard_normal(grid.shape), 0.0, 0.6)
    sim = TwoFluid(
        grid, phi, drag=drag_law("gidaspow"), longest_step=2e-4, particle_density=1500.0,
        diameter=75e-6, gas_density=1.2, gas_viscosity=1.8e-5, granular=granular,
    )  # fmt: skip
    mass = sim.solids_mass
    for _ in range(3):
        sim.step()
        assert sim.solid_fraction.min() >= 0.0
        assert sim.solid_fraction.max() <= granular.packing
    assert sim.solids_mass == pytest.approx(mass, rel=1e-13)


def test_heat_in_a_closed_box_stays():
    grid = Grid(cells=(4, 3, 5), upper=(0.04, 0.03, 0.05))
    fluid = Fluid(density=1.2, viscosity=1.8e-5, heat_capacity=1000.0, conductivity=0.03)
    start = 300.0 + 50.0 * np.random.default_rng(2).random(grid.shape)
    solver = GasSolver(grid, {}, fluid, void_fraction=0.6, temperature=start)
    for _ in range(3):
        solver.step(0.5)
    assert solver.temperature.mean() == pytest.approx(start.mean(), rel=1e-12)
    assert np.ptp(solver.temperature) < np.ptp(start)


def test_two_fluids_between_rough_walls_and_in_space_keep_their_solids():
    grid = Grid(cells=(4, 5, 3), upper=(1.2e-3, 1.5e-3, 9e-4))
    phi = np.full(grid.shape, 0.3)
    phi[:, :2] = 0.5
    wall = TwoFluidWall(specularity=0.1)
    sim = TwoFluid(
        grid, phi, sides={"x-": wall, "x+": wall}, drag=drag_law("gidaspow"), longest_step=2e-4,
        particle_density=1500.0, diameter=75e-6, gas_density=1.2, gas_viscosity=1.8e-5,
    )  # fmt: skip
    mass = sim.solids_mass
    for _ in range(2):
        sim.step()
    assert sim.solids_mass == pytest.approx(mass, rel=1e-13)
