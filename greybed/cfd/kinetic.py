"""Stress of the solids: collisions with an algebraic granular temperature, and lasting contacts."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.cfd import _kinetic
from greybed.core.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Granular:
    """What particles do to each other, as a continuum.

    Parameters
    ----------
    restitution : float
        Of collisions [-], above 0 to 1.
    packing : float
        Solid fraction that is never exceeded [-].
    temperature : float, optional
        A granular temperature that is the same everywhere [m2 s-2]; by default it follows from
        production = dissipation.
    drag_dissipation : bool
        Whether the gas takes ``3 beta theta`` out of the fluctuations too.
    highest_temperature : float
        Bound of the algebraic temperature [m2 s-2].
    friction_onset : float
        Solid fraction from which contacts last [-].
    friction_scale : float
        Scale of their pressure [Pa]; 0 switches friction off.
    friction_growth, friction_power : float
        Exponents of ``(phi - onset)`` and of ``(packing - phi)`` [-].
    friction_angle : float
        Angle of internal friction [degree].

    Raises
    ------
    InputError
        For a number out of its range.

    Notes
    -----
    With ``g = 1 / (1 - (phi / packing)^(1/3))`` (Sinclair & Jackson, AIChE J. 35 (1989) 1473):

    - pressure ``rho phi theta (1 + 2 (1 + e) phi g)`` (Lun, Savage, Jeffrey & Chepurniy, J. Fluid
      Mech. 140 (1984) 223),
    - shear viscosity ``rho d sqrt(theta) (sqrt(pi) phi / (6 (3 - e)) (1 + 0.4 (1 + e) (3 e - 1)
      phi g) + 0.8 phi^2 g (1 + e) / sqrt(pi))`` (Syamlal, Rogers & O'Brien, MFIX documentation,
      1993), which vanishes with phi,
    - bulk viscosity ``4/3 rho phi^2 d g (1 + e) sqrt(theta / pi)`` (Lun et al.),
    - dissipation ``12 (1 - e^2) g rho phi^2 theta^1.5 / (d sqrt(pi))`` (Lun et al.),
    - frictional pressure ``scale (phi - onset)^growth / (packing - phi)^power`` (Johnson &
      Jackson, J. Fluid Mech. 176 (1987) 67), along its tangent from 98 % of the packing, with
      the shear viscosity ``pressure sin(angle) / (2 sqrt(I2))`` (Schaeffer, J. Differ. Equ. 66
      (1987) 19).
    """

    restitution: float = 0.9
    packing: float = 0.63
    temperature: float | None = None
    drag_dissipation: bool = True
    highest_temperature: float = 100.0
    friction_onset: float = 0.5
    friction_scale: float = 0.05
    friction_growth: float = 2.0
    friction_power: float = 5.0
    friction_angle: float = 28.5

    def __post_init__(self) -> None:
        for name, value, low, high, unit in (
            ("restitution", self.restitution, 1e-6, 1.0, "-"),
            ("packing", self.packing, 0.1, 0.99, "-"),
            ("friction_onset", self.friction_onset, 0.0, 0.98 * self.packing, "-"),
            ("friction_scale", self.friction_scale, 0.0, math.inf, "Pa"),
            ("friction_growth", self.friction_growth, 1.0, 10.0, "-"),
            ("friction_power", self.friction_power, 0.0, 10.0, "-"),
            ("friction_angle", self.friction_angle, 0.0, 89.0, "degree"),
            ("highest_temperature", self.highest_temperature, 1e-12, math.inf, "m2 s-2"),
            ("temperature", self.temperature or 0.0, 0.0, math.inf, "m2 s-2"),
        ):
            if not low <= value <= high:
                raise InputError(
                    f"granular: {name} = {value:g} [{unit}] must be from {low:g} to {high:g}."
                )

    @property
    def pressure_numbers(self) -> tuple[float, float, float, float, float, float]:
        """What kernels of the pressure take: e, packing, onset, scale, growth, power."""
        return (
            self.restitution, self.packing, self.friction_onset, self.friction_scale,
            self.friction_growth, self.friction_power,
        )  # fmt: skip

    def pressure(self, solid_fraction: ArrayLike, temperature: ArrayLike, density: float) -> Array:
        """Pressure of the solids [Pa].

        Parameters
        ----------
        solid_fraction : array_like
            From 0 to the packing [-].
        temperature : array_like
            Granular temperature [m2 s-2], broadcast with it.
        density : float
            Of a particle [kg m-3].
        """
        phi, theta = np.broadcast_arrays(
            np.asarray(solid_fraction, dtype=np.float64), np.asarray(temperature, dtype=np.float64)
        )
        out = np.empty(phi.shape)
        _kinetic.solids_pressure(
            np.ravel(phi), np.ravel(theta), density, *self.pressure_numbers, out.reshape(-1)
        )
        return density * out

    def viscosities(
        self, solid_fraction: float, temperature: float, density: float, diameter: float
    ) -> tuple[float, float]:
        """Shear and bulk viscosity of collisions [Pa s] at one solid fraction and temperature."""
        phi = float(solid_fraction)
        contacts = _kinetic.radial(phi, self.packing)
        shear, bulk, _ = _kinetic.factors(phi, contacts, self.restitution)
        scale = solid_fraction * density * diameter * math.sqrt(temperature)
        return scale * shear, scale * bulk
