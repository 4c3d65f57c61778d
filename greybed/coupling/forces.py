"""Forces of a fluid on spheres besides drag: shear lift and added mass."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LIFTS = ("none", "saffman-mei")


def shear_lift(slip: Array, vorticity: Array, d: Array, density: float, viscosity: float) -> Array:
    r"""Lift of spheres in shear, shape (n, 3) [N].

    :math:`1.615\, d^2 \sqrt{\rho\mu/|\omega|}\,(s \times \omega)\, c`, s the fluid's velocity less
    the particle's (Saffman, J. Fluid Mech. 22 (1965) 385, and 31 (1968) 624), with the correction c
    for Re that is not small of Mei, Int. J. Multiphase Flow 18 (1992) 145: data for Re up to 100,
    and :math:`\alpha = d |\omega| / (2 |s|)` 0.005 to 0.4.

    Parameters
    ----------
    slip, vorticity : ndarray, shape (n, 3)
        [m/s], [1/s].
    d : ndarray, shape (n,)
        Diameters [m].
    density, viscosity : float
        Of the fluid [kg/m3], [Pa s].
    """
    shear = np.sqrt((vorticity**2).sum(axis=1))
    speed = np.sqrt((slip**2).sum(axis=1))
    lifted = (shear > 0.0) & (speed > 0.0)
    # 1 where there is no lift, so that nothing is divided by 0.
    shear_below, speed_below = np.where(lifted, shear, 1.0), np.where(lifted, speed, 1.0)
    re = density * d * speed / viscosity
    alpha = 0.5 * d * shear / speed_below
    low = (1.0 - 0.3314 * np.sqrt(alpha)) * np.exp(-0.1 * re) + 0.3314 * np.sqrt(alpha)
    correction = np.where(re <= 40.0, low, 0.0524 * np.sqrt(alpha * re))
    strength = np.where(lifted, 1.615 * d**2 * np.sqrt(density * viscosity / shear_below), 0.0)
    result: Array = (strength * correction)[:, None] * np.cross(slip, vorticity)
    return result


def added_mass(
    coefficient: float, displaced: Array, mass: Array, others: Array, fluid_acceleration: Array
) -> Array:
    r"""Force of the fluid that has to be pushed away, shape (n, 3) [N].

    :math:`C m_f (Du/Dt - a)` with the particle's acceleration from its other forces,
    :math:`a = (F + C m_f Du/Dt) / (m + C m_f)`: stable for particles lighter than the fluid.

    Parameters
    ----------
    coefficient : float
        C, 1/2 for a sphere [-].
    displaced, mass : ndarray, shape (n,)
        Mass of the fluid displaced, and of the particles [kg].
    others : ndarray, shape (n, 3)
        Sum of all other forces but contacts, weight included [N].
    fluid_acceleration : ndarray, shape (n, 3)
        Du/Dt at the particles [m/s2].
    """
    extra = (coefficient * displaced)[:, None]
    acceleration = (others + extra * fluid_acceleration) / (mass[:, None] + extra)
    result: Array = extra * (fluid_acceleration - acceleration)
    return result


def vorticity_of(velocity: Array, spacing: tuple[float, float, float]) -> Array:
    """Curl of cell velocities (nz, ny, nx, 3), central inside and one-sided at rims [1/s].

    Components and ``spacing`` [m] count x, y, z, array axes z, y, x: hence ``2 - axis``.
    """

    def slope(component: int, axis: int) -> Array:
        field = velocity[..., component]
        if field.shape[2 - axis] < 2:
            return np.zeros_like(field)
        return np.asarray(np.gradient(field, spacing[axis], axis=2 - axis))

    return np.stack(
        [slope(2, 1) - slope(1, 2), slope(0, 2) - slope(2, 0), slope(1, 0) - slope(0, 1)], axis=-1
    )
