"""Effects on the conductivity of beds: radiation, temperature, gas pressure, stress, walls."""

from __future__ import annotations

import numpy as np

from greybed.closures.conductivity import STEFAN_BOLTZMANN
from greybed.residual.effect import Array, Columns, Effect

WARM = 300.0  # K, where conductivities are stated at unless the study says otherwise


def _reference(c: Columns) -> Array | float:
    return c.get("reference_temperature", WARM)


def _radiation(c: Columns, amplitude: float) -> Array:
    path = 4.0 * amplitude * STEFAN_BOLTZMANN * c["particle_diameter"] * c["temperature"] ** 3
    return path * c["exchange"]


def _emissivity(c: Columns, amplitude: float) -> Columns:
    return {"exchange": c["exchange"] * (2.0 / c["emissivity"] - 1.0) ** -amplitude}


def _solid(c: Columns, amplitude: float) -> Columns:
    return {
        "solid_conductivity": c["solid_conductivity"]
        * (_reference(c) / c["temperature"]) ** amplitude
    }


def _gas(c: Columns, amplitude: float) -> Columns:
    return {
        "gas_conductivity": c["gas_conductivity"] * (c["temperature"] / _reference(c)) ** amplitude
    }


def _smoluchowski(c: Columns, amplitude: float) -> Columns:
    jump = amplitude * c["temperature"] / (c["gas_pressure"] * c["particle_diameter"])
    return {"gas_conductivity": c["gas_conductivity"] / (1.0 + jump)}


def _stress(c: Columns, amplitude: float) -> Array:
    return amplitude * np.cbrt(c["stress"])


def _wall(c: Columns, amplitude: float) -> Columns:
    rise = amplitude * np.exp(-c["wall_distance"] / c["particle_diameter"])
    return {"void_fraction": c["void_fraction"] + (1.0 - c["void_fraction"]) * rise}


BED = (
    Effect(
        name="radiation",
        law="+ 4 A sigma d T^3; over 2 / emissivity - 1 where an emissivity is recorded",
        source="Damkoehler (1937); the factor A lies near 1 for black, well conducting spheres "
        "(Tausch & Goldberg in Kaviany, Principles of Heat Transfer in Porous Media, 5.11)",
        group="sigma d T^3 / k",
        theory=1.0,
        spread=0.5,
        low=0.1,
        high=4.0,
        stage="path",
        change=_radiation,
        switch="[radiation] of a thermal-bed case",
    ),
    Effect(
        name="emissivity",
        law="radiation / (2 / emissivity - 1)^A",
        source="two parallel grey surfaces (Zehner & Schluender, 1972)",
        group="emissivity",
        theory=1.0,
        spread=0.3,
        low=0.2,
        high=3.0,
        columns=("emissivity",),
        stage="property",
        change=_emissivity,
        switch="material.emissivity of a thermal-bed case",
    ),
    Effect(
        name="solid-conductivity-temperature",
        law="solid conductivity = stated * (T_ref / T)^A",
        source="phonon scattering: 1 / T above the Debye temperature (Eucken, 1911)",
        group="T / T_ref",
        theory=1.0,
        spread=0.3,
        low=0.15,
        high=3.0,
        columns=(),
        stage="property",
        change=_solid,
    ),
    Effect(
        name="gas-conductivity-temperature",
        law="gas conductivity = stated * (T / T_ref)^A",
        source="power law of gases: 0.7 for helium, 0.8 for air (VDI Heat Atlas, D2.2, D3.1)",
        group="T / T_ref",
        theory=0.8,
        spread=0.2,
        low=0.3,
        high=2.0,
        columns=(),
        stage="property",
        change=_gas,
    ),
    Effect(
        name="smoluchowski",
        law="gas conductivity = stated / (1 + A T / (p d)), A in Pa m/K",
        source="temperature jump at the walls of a gap (Smoluchowski, 1898; Kaganer, 1969); air in "
        "gaps as wide as a sphere has A = 8e-5",
        group="mean free path / gap",
        theory=None,
        low=1e-6,
        high=1e-1,
        columns=("gas_pressure",),
        stage="property",
        change=_smoluchowski,
    ),
    Effect(
        name="contact-stress",
        law="+ A stress^(1/3), A in W/m/K/Pa^(1/3)",
        source="Hertz contacts of regular beds: radius of contact ~ load^(1/3) (Chan & Tien, J. "
        "Heat Transfer 95 (1973) 302)",
        group="stress / elastic modulus",
        theory=None,
        low=1e-6,
        high=1.0,
        columns=("stress",),
        stage="path",
        change=_stress,
        switch="material.stiffness_ratio of a thermal-bed case",
    ),
    Effect(
        name="wall-voidage",
        law="void fraction + (1 - void fraction) A exp(-y / d)",
        source="void fraction 1 at a wall, decaying over about a diameter (Vortmeyer & Schuster, "
        "Chem. Eng. Sci. 38 (1983) 1691, in its simplest form)",
        group="y / d",
        theory=None,
        low=0.05,
        high=1.0,
        columns=("wall_distance",),
        stage="property",
        change=_wall,
    ),
)
