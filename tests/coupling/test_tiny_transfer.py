"""Eight spheres in a few cells of gas: quick also where kernels are plain Python."""

from __future__ import annotations

import numpy as np
import pytest

from greybed.cfd.grid import Grid
from greybed.coupling.drag_exchange import Settings
from greybed.coupling.gas_particles import GasParticles
from greybed.coupling.void_fraction import solid_fraction
from greybed.dem import Contact, Material, Simulation
from tests.coupling.plain_gas import PlainGas

GLASS = Material(2500.0, 5e6, 0.3, "glass")
EDGE = 2.2e-3


def cloud(settings, periodic):
    rng = np.random.default_rng(0)
    at = np.stack(np.meshgrid(*[np.arange(2)] * 3, indexing="ij"), -1).reshape(-1, 3)
    size = 2 * EDGE
    sim = Simulation(
        (at + 0.5 + 0.1 * rng.random(at.shape)) * EDGE, 5e-4 * rng.uniform(0.8, 1.2, 8), GLASS,
        Contact(0.9, 0.3), box=[[0, 0, 0], [size] * 3], periodic=periodic, gravity=(0, 0, 0),
        velocities=0.3 * rng.normal(size=at.shape), time_step=2e-6, threads=1,
    )  # fmt: skip
    gas = PlainGas(Grid(cells=(3, 2, 4), upper=(size,) * 3, periodic=periodic), 1.2, 1.8e-5)
    gas.velocity = tuple(f + v for f, v in zip(gas.velocity, (0.3, -0.2, 0.5), strict=True))
    return GasParticles(gas, sim, settings), sim


@pytest.mark.parametrize("treatment", ["explicit", "semi-implicit", "implicit"])
@pytest.mark.parametrize("void", ["exact", "centre"])
def test_particles_get_what_the_gas_loses(treatment, void):
    settings = Settings(
        treatment=treatment, void=void, width=3.0 if void == "exact" else 0.0, lubrication=True,
        lift="saffman-mei", added_mass=0.5,
    )  # fmt: skip
    both, sim = cloud(settings, (True,) * 3)
    for _ in range(2):
        before = sim.masses @ sim.velocities
        report = both.step(3)
        assert report.defect < 1e-13
        change = sim.masses @ sim.velocities - before
        np.testing.assert_allclose(change, report.given + report.pressure, rtol=1e-7, atol=1e-16)


@pytest.mark.parametrize("place", [[1e-3, 2e-3, 2e-3], [0.1e-3, 3.3e-3, 0.4e-3]])
@pytest.mark.parametrize("radius", [1e-4, 7e-4, 1.6e-3])
def test_cells_share_out_a_sphere(place, radius):
    grid = Grid(cells=(5, 4, 3), upper=(5e-3, 4e-3, 3e-3), periodic=(False, True, False))
    found = solid_fraction(grid, np.array([place]), np.array([radius]))
    volume = 4.0 / 3.0 * np.pi * radius**3
    assert found.sum() * grid.cell_volume == pytest.approx(volume, rel=1e-12)
