"""A packed bed that hot gas flows through, against Schumann's solution."""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import trapezoid
from scipy.special import ive

from greybed.cfd.boundaries import Inflow, Outlet
from greybed.cfd.fluid import Fluid
from greybed.cfd.gas import GasSolver
from greybed.cfd.grid import Grid
from greybed.coupling.drag_exchange import Settings
from greybed.coupling.gas_heat import GasHeat
from greybed.coupling.gas_particles import GasParticles
from greybed.coupling.nusselt import NUSSELT
from greybed.dem import Contact, Material, Simulation
from greybed.dem.heat import Heat

D, LAYERS, SPEED, POOR = 1e-3, 40, 0.2, 0.002


def schumann(y, z):
    """Rise of the solid's temperature (J. Franklin Inst. 208 (1929) 405), of the gas's inflow.

    y is length over that of exchange, z is time after the gas has come over that of exchange; with
    exp(-(root y - root t)^2) taken out of the integral over Bessel's function.
    """
    t = np.linspace(0.0, z, 4001)
    root = 2.0 * np.sqrt(y * t)
    integrand = np.exp(-y - t + root) * ive(0, root)
    return float(trapezoid(integrand, t))


def errors_of_a_heated_bed(wide):
    """Rise of each layer and pair of layers less Schumann's, with cells of so many diameters."""
    at = np.stack(np.meshgrid(range(4), range(4), range(LAYERS), indexing="ij"), -1).reshape(-1, 3)
    size = (4 * D, 4 * D, LAYERS * D)
    density, per_volume = 1e12, 1e4  # heavy, so that it stays; [J/m3/K]
    sim = Simulation(
        (at + 0.5) * D, 0.5 * D, Material(density, 5e6, 0.3, "heavy"), Contact(0.3, 0.0),
        box=[[0, 0, 0], size], periodic=(True, True, False), gravity=(0, 0, 0), threads=1,
        time_step=1e-4,
    )  # fmt: skip
    fluid = Fluid(density=1.2, viscosity=1.8e-5, heat_capacity=1005.0, conductivity=0.0)
    grid = Grid(
        cells=(4 // wide, 4 // wide, LAYERS // wide), upper=size, periodic=(True, True, False)
    )
    gas = GasSolver(
        grid, {"z-": Inflow(SPEED, 400.0), "z+": Outlet()}, fluid, temperature=300.0,
        gravity=(0, 0, 0),
    )  # fmt: skip
    heat = GasHeat(
        Heat(sim, 1.0, per_volume / density, 300.0), POOR, 0.7, nusselt="gunn", contacts=False
    )
    both = GasParticles(gas, sim, Settings(drag="ergun", width=0.0), heat=heat)
    stored = given = exchanged = 0.0
    while both.time < 0.5:
        both.step(20)
        report = heat.report
        stored, given = stored + report.stored, given + report.from_gas
        exchanged += report.exchanged
    assert abs(stored - given) < 1e-10 * exchanged
    phi = math.pi / 6
    re = 1.2 * SPEED * D / 1.8e-5
    h = float(NUSSELT["gunn"](np.array(1 - phi), np.array(re), 0.7)) * POOR / D
    rate = h * 6 * phi / D
    t = heat.heat.temperatures.reshape(4, 4, LAYERS).mean(axis=(0, 1))
    x = (np.arange(LAYERS) + 0.5) * D
    late = both.time - (1 - phi) * x / SPEED
    exact = [schumann(rate * a / (1.2 * 1005 * SPEED), rate * b / (per_volume * phi))
             for a, b in zip(x, late, strict=True)]  # fmt: skip
    found = (t - 300.0) / 100.0
    assert exact[0] > 0.8
    assert exact[-1] < 0.2
    # What is uneven between the layers of a cell is no matter of the exchange.
    pairs = found.reshape(-1, 2).mean(axis=1) - np.reshape(exact, (-1, 2)).mean(axis=1)
    return np.abs(pairs).max(), np.abs(found - exact).max()


def test_a_heated_bed_is_schumann_s():
    coarse, layers = errors_of_a_heated_bed(2)
    # A wide cell has one gas temperature for its two layers, which differ by up to a twentieth.
    assert layers < 0.05
    assert coarse < 0.01
    # What is left is of the cells (of second order: a quarter), not of the step.
    assert errors_of_a_heated_bed(1)[0] < 0.4 * coarse
