"""Effects on the drag of spheres: one sphere in a fluid, and the pressure drop of beds."""

from __future__ import annotations

import numpy as np

from greybed.residual.effect import Array, Columns, Effect

COLD = 293.15  # K, where a viscosity is stated at unless the study says otherwise


def _inertia(c: Columns, amplitude: float) -> Array:
    return 1.0 + amplitude * c["reynolds"] ** 0.687


def _tube(c: Columns, amplitude: float) -> Array:
    return 1.0 + amplitude * c["diameter"] / c["tube_diameter"]


def _rarefaction(c: Columns, amplitude: float) -> Array:
    return 1.0 / (1.0 + amplitude * 2.0 * c["mean_free_path"] / c["diameter"])


def _shape(c: Columns, amplitude: float) -> Array:
    return ((1.0 + 2.0 / np.sqrt(c["sphericity"])) / 3.0) ** amplitude


def _turbulence(c: Columns, amplitude: float) -> Array:
    return 1.0 + amplitude * c["turbulence_intensity"]


def _viscosity(c: Columns, amplitude: float) -> Columns:
    reference = c.get("reference_temperature", COLD)
    return {"viscosity": c["viscosity"] * (c["temperature"] / reference) ** amplitude}


VISCOSITY_GAS = Effect(
    name="viscosity-temperature",
    law="viscosity = stated * (T / T_ref)^A",
    source="power law of gases, exponent 0.7 for air (White, Viscous Fluid Flow, table 1-2)",
    group="T / T_ref",
    theory=0.7,
    spread=0.15,
    low=0.2,
    high=1.5,
    columns=("temperature",),
    stage="property",
    change=_viscosity,
)
VISCOSITY_LIQUID = Effect(
    name="viscosity-temperature",
    law="viscosity = stated * (T / T_ref)^A",
    source="liquids thin out when warmed: A is about -7 for water, -25 for glycerol at 20 degC",
    group="T / T_ref",
    theory=None,
    low=-60.0,
    high=-0.5,
    columns=("temperature",),
    stage="property",
    change=_viscosity,
)

SPHERE = (
    Effect(
        name="inertia",
        law="drag * (1 + A Re^0.687)",
        source="Schiller & Naumann (1935), A = 0.15; within 5 % of the standard drag curve to 800",
        group="Re",
        theory=0.15,
        spread=0.18,
        low=0.03,
        high=0.75,
        stage="factor",
        change=_inertia,
        switch='drag = "schiller-naumann"',
    ),
    Effect(
        name="wall",
        law="drag * (1 + A d / D)",
        source="Ladenburg (1907) A = 2.1; Faxen's exact first order is 2.104, higher orders add "
        "30 % at d / D = 0.12 (Happel & Brenner, Low Reynolds Number Hydrodynamics, 7-3)",
        group="d / D",
        theory=2.1,
        spread=0.18,
        low=0.5,
        high=8.0,
        columns=("tube_diameter",),
        stage="factor",
        change=_tube,
    ),
    Effect(
        name="rarefaction",
        law="drag / (1 + A Kn), Kn = mean free path / radius",
        source="Cunningham (1910); A = 1.257 at small Kn (Davies, Proc. Phys. Soc. 57 (1945) 259)",
        group="Kn",
        theory=1.257,
        spread=0.2,
        low=0.3,
        high=4.0,
        columns=("mean_free_path",),
        stage="factor",
        change=_rarefaction,
    ),
    Effect(
        name="shape",
        law="drag * ((1 + 2 / sqrt(sphericity)) / 3)^A",
        source="Stokes shape factor of Pettyjohn & Christiansen and Leith, as in Ganser, Powder "
        "Technol. 77 (1993) 143",
        group="sphericity",
        theory=1.0,
        spread=0.3,
        low=0.2,
        high=5.0,
        columns=("sphericity",),
        stage="factor",
        change=_shape,
    ),
    Effect(
        name="turbulence",
        law="drag * (1 + A u' / u)",
        source="linear in the intensity after Uhlherr & Sinclair (1970), as in Clift, Grace & "
        "Weber, Bubbles, Drops and Particles, chapter 10 (from memory, source not reached); the "
        "size depends on the scales",
        group="turbulence intensity",
        theory=None,
        low=0.05,
        high=10.0,
        columns=("turbulence_intensity",),
        stage="factor",
        change=_turbulence,
    ),
    VISCOSITY_LIQUID,
)


def _bed_inertia(c: Columns, amplitude: float) -> Array:
    return 1.0 + amplitude * c["reynolds"] / (10.0 * (1.0 - c["void_fraction"]))


def _bed_wall(c: Columns, amplitude: float) -> Array:
    ratio = c["particle_diameter"] / c["tube_diameter"]
    surface = 1.0 + amplitude * ratio / (1.0 - c["void_fraction"])
    bypass = (1.0 + 1.15 / 0.87 * ratio**2 * amplitude * 1.5) ** 2
    return c["viscous_share"] * surface**2 + (1.0 - c["viscous_share"]) * surface / bypass


def _bed_shape(c: Columns, amplitude: float) -> Columns:
    return {"particle_diameter": c["particle_diameter"] * c["sphericity"] ** amplitude}


def _fines(c: Columns, amplitude: float) -> Columns:
    return {"particle_diameter": c["particle_diameter"] / (1.0 + amplitude * c["fines_fraction"])}


def _channels(c: Columns, amplitude: float) -> Columns:
    return {"superficial_velocity": c["superficial_velocity"] * (1.0 - amplitude)}


def _compression(c: Columns, amplitude: float) -> Array:
    drop = amplitude * c["response"] * c["bed_length"] / c["outlet_pressure"]
    # (sqrt(1 + 2 x) - 1) / x without its cancellation
    return c["response"] * 2.0 / (np.sqrt(1.0 + 2.0 * drop) + 1.0)


BED = (
    Effect(
        name="inertia",
        law="pressure gradient * (1 + A Re / (10 phi))",
        source="Ergun (1952): A = 1.75 / 18",
        group="Re / phi",
        theory=1.75 / 18.0,
        spread=0.2,
        low=0.02,
        high=0.4,
        stage="factor",
        change=_bed_inertia,
        switch='drag = "ergun"',
    ),
    Effect(
        name="wall",
        law="viscous part * a^2, inertial part * a / b, a = 1 + A d / (D phi), "
        "b = (1 + 1.32 (d / D)^2 A / (2/3))^2",
        source="Eisfeld & Schnitzlein, Chem. Eng. Sci. 56 (2001) 4321; a with A = 2/3 is Mehta & "
        "Hawley's (1969); constants as commonly quoted, source not reached",
        group="d / (D phi)",
        theory=2.0 / 3.0,
        spread=0.2,
        low=0.15,
        high=2.5,
        columns=("tube_diameter",),
        stage="factor",
        change=_bed_wall,
    ),
    Effect(
        name="shape",
        law="diameter * sphericity^A",
        source="equal specific surface: the equivalent diameter is sphericity times diameter "
        "(Ergun, 1952)",
        group="sphericity",
        theory=1.0,
        spread=0.2,
        low=0.25,
        high=4.0,
        columns=("sphericity",),
        stage="property",
        change=_bed_shape,
    ),
    Effect(
        name="polydispersity",
        law="diameter / (1 + A fines), Sauter's mean; A = d / d_fines - 1",
        source="definition of the Sauter mean diameter of two sizes",
        group="fines fraction * d / d_fines",
        theory=None,
        low=0.1,
        high=50.0,
        columns=("fines_fraction",),
        stage="property",
        change=_fines,
    ),
    Effect(
        name="gas-compressibility",
        law="gradient G: G * 2 / (sqrt(1 + 2 A x) + 1), x = G * length / outlet pressure",
        source="isothermal flow of an ideal gas: the drop follows p1^2 - p2^2 (Ergun, 1952); "
        "velocity and density are those at the outlet",
        group="pressure drop / outlet pressure",
        theory=1.0,
        spread=0.15,
        low=0.2,
        high=4.0,
        columns=("bed_length", "outlet_pressure"),
        stage="outcome",
        change=_compression,
    ),
    Effect(
        name="channelling",
        law="velocity in the bed * (1 - A): the share A bypasses it",
        source="two parallel paths, the open one without resistance",
        group="bypassed share",
        theory=None,
        low=0.02,
        high=0.6,
        stage="property",
        change=_channels,
    ),
    VISCOSITY_GAS,
)
NEEDS_GRID = {
    "clustering": "it needs a column cell_size and a coarse two-fluid or CFD-DEM case, in which "
    "the drag of unresolved clusters is missing"
}
