"""The stress of the solids takes energy out of the flow, whatever the flow does."""

import numpy as np
import pytest

from greybed.cfd import _kinetic
from greybed.cfd.kinetic import Granular

DENSITY, DIAMETER = 2500.0, 120e-6


def work(granular, phi, dilation, deviator, gamma, size=1.0):
    """What the stress takes from the flow [W m-3] over density, of cells with given strains.

    ``deviator`` is 2 D:D of the strain D without its trace.
    """
    theta, shear, second, friction = (np.zeros_like(phi) for _ in range(4))
    square = deviator + 2.0 / 3.0 * dilation**2
    _kinetic.closures(
        phi, square, dilation, gamma, DENSITY, DIAMETER, *granular.pressure_numbers, 0.0, -1.0,
        True, granular.highest_temperature, size, theta, shear, second, friction,
    )  # fmt: skip
    pressure = np.zeros_like(phi)
    _kinetic.solids_pressure(phi, theta, DENSITY, *granular.pressure_numbers, pressure)
    viscous = phi * (shear * square + second * dilation**2)
    return viscous, viscous - pressure * dilation, theta


@pytest.mark.parametrize("restitution", [0.3, 0.9, 1.0])
def test_stress_feeds_no_flow(restitution):
    # Friction's pressure is a function of the solid fraction alone: it stores what it takes.
    granular = Granular(restitution=restitution, friction_scale=0.0)
    rng = np.random.default_rng(1)
    n = 20_000
    # Below, second viscosity + 2/3 of the first cancels to less than the tolerance here.
    phi = 10.0 ** rng.uniform(-6.0, np.log10(0.62), n)
    dilation = rng.choice([-1.0, 1.0], n) * 10.0 ** rng.uniform(-3.0, 5.0, n)
    deviator = 10.0 ** rng.uniform(-6.0, 10.0, n) * rng.integers(0, 2, n)
    gamma = 10.0 ** rng.uniform(-3.0, 6.0, n) * rng.integers(0, 2, n)
    viscous, taken, theta = work(granular, phi, dilation, deviator, gamma)
    assert np.isfinite(theta).all()
    assert (taken >= -1e-9 * viscous).all()
    # Where it is compressed the pressure resists beside the viscosity.
    assert (taken[dilation < 0.0] >= viscous[dilation < 0.0]).all()


def test_balance_of_an_expanding_flow_holds():
    # Work of the stress = dissipation in collisions and in the gas, as closed by Lun et al.
    granular = Granular(restitution=0.8, friction_scale=0.0)
    phi, gamma = np.array([0.3]), np.array([2e4])
    _, taken, theta = work(granular, phi, np.array([40.0]), np.array([900.0]), gamma)
    contacts = 1.0 / (1.0 - (phi / granular.packing) ** (1.0 / 3.0))
    collisions = (
        12.0 * (1.0 - 0.8**2) * contacts * phi**2 * theta**1.5 / (DIAMETER * np.sqrt(np.pi))
    )
    gas = 3.0 * gamma * (1.0 - phi) * phi * theta / DENSITY
    # phi + 1e-4 for phi in the dissipation, which keeps it finite without particles.
    np.testing.assert_allclose(taken, collisions + gas, rtol=1e-3)
