"""Laboratories of a blind test: which conditions they can set, and which effects they can meet."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from greybed.blind.truths import bed_conductivity, bed_gradient, sphere_velocity

Array = NDArray[np.float64]


@dataclass(frozen=True)
class World:
    """One kind of experiment.

    Attributes
    ----------
    model, response, law : str, str, callable
        What the study says, and the truth.
    ranges : dict of str to (low, high)
        Conditions that vary, log-uniform, SI.
    constants : dict of str to float
        Conditions that do not.
    parameter : (str, float, float)
        Name, value and relative sd of the uncertain constant of the material.
    main : str
        The condition that alone varies in a collinear design.
    setting : str
        The condition whose setting is off by the same share for a whole group.
    effects : dict of str to (variants, low, high)
        Strengths are drawn from low to high; the first variant is the catalogue's own form.
    theory : frozenset of str
        Effects whose strength is relative to theory.
    needs : dict of str to str
        Condition that an effect acts through.
    """

    model: str
    response: str
    law: Callable[..., Array]
    ranges: dict[str, tuple[float, float]]
    constants: dict[str, float]
    parameter: tuple[str, float, float]
    main: str
    setting: str
    effects: dict[str, tuple[tuple[str, ...], float, float]]
    theory: frozenset[str]
    needs: dict[str, str]


NEAR = (0.7, 1.4)

WORLDS = {
    "spheres in a liquid": World(
        "terminal-velocity",
        "velocity",
        sphere_velocity,
        {
            "diameter": (1e-3, 8e-3),
            "particle_density": (1250.0, 2200.0),
            "tube_diameter": (0.05, 0.2),
            "sphericity": (0.55, 1.0),
            "turbulence_intensity": (0.01, 0.3),
            "temperature": (283.0, 313.0),
        },
        {"fluid_density": 1150.0},
        ("viscosity", 0.2, 0.01),
        "diameter",
        "diameter",
        {
            "inertia": (("schiller", "oseen"), *NEAR),
            "wall": (("ladenburg", "faxen"), *NEAR),
            "shape": (("leith",), *NEAR),
            "turbulence": (("linear",), 0.6, 3.0),
            "viscosity-temperature": (("power", "exponential"), -14.0, -4.0),
        },
        frozenset({"inertia", "wall", "shape"}),
        {
            "wall": "tube_diameter",
            "shape": "sphericity",
            "turbulence": "turbulence_intensity",
            "viscosity-temperature": "temperature",
        },
    ),
    "fine particles in air": World(
        "terminal-velocity",
        "velocity",
        sphere_velocity,
        {
            "diameter": (1e-6, 2e-5),
            "particle_density": (900.0, 4000.0),
            "mean_free_path": (3e-8, 6e-7),
            "sphericity": (0.5, 1.0),
            "turbulence_intensity": (0.01, 0.3),
        },
        {"fluid_density": 1.2},
        ("viscosity", 1.82e-5, 0.01),
        "diameter",
        "diameter",
        {
            "rarefaction": (("cunningham",), *NEAR),
            "shape": (("leith",), *NEAR),
            "turbulence": (("linear",), 0.6, 3.0),
        },
        frozenset({"rarefaction", "shape"}),
        {
            "rarefaction": "mean_free_path",
            "shape": "sphericity",
            "turbulence": "turbulence_intensity",
        },
    ),
    "packed bed": World(
        "packed-bed-pressure-drop",
        "pressure_gradient",
        bed_gradient,
        {
            "superficial_velocity": (0.05, 1.5),
            "particle_diameter": (1e-3, 6e-3),
            "void_fraction": (0.36, 0.46),
            "tube_diameter": (0.025, 0.15),
            "sphericity": (0.55, 1.0),
            "fines_fraction": (0.005, 0.12),
            "outlet_pressure": (2e4, 3e5),
            "temperature": (290.0, 600.0),
        },
        {"fluid_density": 1.2, "bed_length": 1.0},
        ("viscosity", 1.82e-5, 0.01),
        "superficial_velocity",
        "particle_diameter",
        {
            "wall": (("eisfeld", "mehta"), *NEAR),
            "shape": (("equal surface",), *NEAR),
            "polydispersity": (("sauter",), 1.5, 9.0),
            "gas-compressibility": (("isothermal",), 0.9, 1.1),
            "viscosity-temperature": (("power",), 0.6, 0.8),
            "channelling": (("bypass",), 0.1, 0.35),
        },
        frozenset({"wall", "shape", "gas-compressibility"}),
        {
            "wall": "tube_diameter",
            "shape": "sphericity",
            "polydispersity": "fines_fraction",
            "gas-compressibility": "outlet_pressure",
            "viscosity-temperature": "temperature",
        },
    ),
    "hot bed": World(
        "bed-conductivity",
        "conductivity",
        bed_conductivity,
        {
            "temperature": (300.0, 1300.0),
            "particle_diameter": (5e-4, 5e-3),
            "void_fraction": (0.36, 0.46),
            "gas_pressure": (1e2, 3e5),
            "stress": (1e4, 2e6),
            "wall_distance": (5e-4, 3e-2),
        },
        {"gas_conductivity": 0.03},
        ("solid_conductivity", 3.0, 0.02),
        "temperature",
        "void_fraction",
        {
            "radiation": (("cubic",), *NEAR),
            "solid-conductivity-temperature": (("eucken",), 0.6, 1.3),
            "gas-conductivity-temperature": (("power",), 0.8, 1.2),
            "smoluchowski": (("jump",), 0.5, 5.0),
            "contact-stress": (("hertz",), 5e-4, 5e-3),
            "wall-voidage": (("exponential",), 0.2, 0.6),
        },
        frozenset({"radiation", "solid-conductivity-temperature", "gas-conductivity-temperature"}),
        {
            "smoluchowski": "gas_pressure",
            "contact-stress": "stress",
            "wall-voidage": "wall_distance",
        },
    ),
}
