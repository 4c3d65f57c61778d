"""What is true in a blind test: three laws with their effects, written down apart from the project.

Every function takes columns in SI and a mapping of effect -> (variant, strength), where strength 1
is theory, and returns the noise-free response.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Active = Mapping[str, tuple[str, float]]

G = 9.80665
SIGMA = 5.670374419e-8


def sphere_velocity(c: Mapping[str, Array], active: Active) -> Array:
    """Terminal velocity of spheres that Stokes' law is the base of [m/s]."""
    mu = c["viscosity"].copy()
    if "viscosity-temperature" in active:
        form, a = active["viscosity-temperature"]
        ratio = c["temperature"] / 293.15
        mu = mu * (ratio**a if form == "power" else np.exp(a * (1.0 - 1.0 / ratio)))
    weight = G * np.pi / 6.0 * c["diameter"] ** 3 * (c["particle_density"] - c["fluid_density"])
    if "added-force" in active:
        weight = weight * c["added"]

    def force(v: Array) -> Array:
        re = c["fluid_density"] * v * c["diameter"] / mu
        f = 3.0 * np.pi * mu * c["diameter"] * v
        for name, (form, a) in active.items():
            if name == "inertia":
                f = f * (1.0 + (0.15 * re**0.687 if form == "schiller" else 3.0 / 16.0 * re) * a)
            elif name == "wall":
                x = c["diameter"] / c["tube_diameter"]
                if form == "ladenburg":
                    f = f * (1.0 + 2.1 * a * x)
                else:  # Faxen's series
                    f = f / (1.0 - 2.104 * x + 2.09 * x**3 - 0.95 * x**5)
            elif name == "rarefaction":
                f = f / (1.0 + 1.257 * a * c["mean_free_path"] / (0.5 * c["diameter"]))
            elif name == "shape":
                f = f * (1.0 / 3.0 + 2.0 / 3.0 * c["sphericity"] ** -0.5) ** a
            elif name == "turbulence":
                f = f * (1.0 + a * c["turbulence_intensity"])
            elif name == "outside":
                f = f * c["outside"]
        return f

    low = np.log(weight / (3.0 * np.pi * mu * c["diameter"])) - 12.0
    high = low + 14.0
    for _ in range(90):  # halving needs no derivative and cannot fail
        middle = 0.5 * (low + high)
        fast = force(np.exp(middle)) > weight
        low, high = np.where(fast, low, middle), np.where(fast, middle, high)
    return np.exp(0.5 * (low + high))


def bed_gradient(c: Mapping[str, Array], active: Active) -> Array:
    """Pressure gradient of a packed bed that Ergun's equation is the base of [Pa/m]."""
    mu, d, u = (
        c["viscosity"].copy(),
        c["particle_diameter"].copy(),
        c["superficial_velocity"].copy(),
    )
    eps, rho = c["void_fraction"], c["fluid_density"]
    if "viscosity-temperature" in active:
        mu = mu * (c["temperature"] / 293.15) ** active["viscosity-temperature"][1]
    if "shape" in active:
        d = d * c["sphericity"] ** active["shape"][1]
    if "polydispersity" in active:
        x = c["fines_fraction"]
        finer = active["polydispersity"][1] + 1.0  # coarse over fine diameter
        d = 1.0 / ((1.0 - x) / d + x * finer / d)
    if "channelling" in active:
        u = u * (1.0 - active["channelling"][1])
    viscous = 150.0 * (1.0 - eps) ** 2 / eps**3 * mu * u / d**2
    inertial = 1.75 * (1.0 - eps) / eps**3 * rho * u**2 / d
    if "wall" in active:
        form, a = active["wall"]
        x = d / c["tube_diameter"]
        aw = 1.0 + a * 2.0 / 3.0 * x / (1.0 - eps)
        if form == "eisfeld":
            inertial = inertial * aw / ((1.15 * x**2 + 0.87) / 0.87) ** 2
        else:  # Mehta and Hawley: hydraulic radius with the wall in it
            inertial = inertial * aw
        viscous = viscous * aw**2
    total = viscous + inertial
    if "outside" in active:
        total = total * c["outside"]
    if "gas-compressibility" in active:
        a = active["gas-compressibility"][1]
        p2, length = c["outlet_pressure"], c["bed_length"]
        p1 = np.sqrt(p2**2 + 2.0 * a * total * length * p2)
        total = (p1 - p2) / (a * length)
    return total


def bed_conductivity(c: Mapping[str, Array], active: Active) -> Array:
    """Conductivity of a bed that Zehner and Schluender's cell is the base of [W/m/K]."""
    ks, kg, eps = c["solid_conductivity"], c["gas_conductivity"], c["void_fraction"].copy()
    t, d = c["temperature"], c["particle_diameter"]
    if "solid-conductivity-temperature" in active:
        ks = ks * (300.0 / t) ** active["solid-conductivity-temperature"][1]
    if "gas-conductivity-temperature" in active:
        kg = kg * (t / 300.0) ** (0.8 * active["gas-conductivity-temperature"][1])
    if "smoluchowski" in active:
        kg = kg / (1.0 + active["smoluchowski"][1] * 8e-5 * t / (c["gas_pressure"] * d))
    if "wall-voidage" in active:
        a = active["wall-voidage"][1]
        eps = 1.0 - (1.0 - eps) * (1.0 - a * np.exp(-c["wall_distance"] / d))
    b = 1.25 * ((1.0 - eps) / eps) ** (10.0 / 9.0)
    m = 1.0 - b * kg / ks
    core = (
        2.0
        / m
        * (b * (1.0 - kg / ks) / m**2 * np.log(ks / (b * kg)) - (b + 1.0) / 2.0 - (b - 1.0) / m)
    )
    total = kg * (1.0 - np.sqrt(1.0 - eps) + np.sqrt(1.0 - eps) * core)
    if "radiation" in active:
        total = total + 4.0 * active["radiation"][1] * SIGMA * d * t**3
    if "contact-stress" in active:
        total = total + active["contact-stress"][1] * np.cbrt(c["stress"])
    if "outside" in active:
        total = total / c["outside"]
    return total
