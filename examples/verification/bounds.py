"""What each verified figure must be: reference, source, bound. Read by run.py."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Bound:
    """A figure's reference and how far from it the figure may be.

    ``kind``: "within" (of the reference, absolute), "relative" (the same over the reference),
    "most" and "least" (the bound itself, whatever the reference).
    """

    what: str
    reference: float
    source: str
    kind: str
    bound: float

    def holds(self, value: float) -> bool:
        """Whether a figure holds; one that is not finite does not."""
        if not math.isfinite(value):
            return False
        if self.kind == "most":
            return value <= self.bound
        if self.kind == "least":
            return value >= self.bound
        off = abs(value - self.reference)
        return off <= self.bound * (abs(self.reference) if self.kind == "relative" else 1.0)

    @property
    def said(self) -> str:
        """The bound in words."""
        if self.kind == "relative":
            return f"± {100.0 * self.bound:.3g} %"
        sign = {"within": "±", "most": "≤", "least": "≥"}[self.kind]
        return f"{sign} {self.bound:.3g}"


GHIA = "Ghia, Ghia & Shin (1982), table I"
HANDS = "reflecting Monte Carlo of other hands, four digits"
LIGGGHTS = "LIGGGHTS 3.8 over the same six seeds"
# Student's t of two times six seeds passes this in one of a hundred comparisons.
T = 3.17
BOUNDS = {
    # Radiation
    "radiation.contact": Bound(
        "view factor of two equal spheres in contact [-]",
        0.0755868184,
        "closed form",
        "within",
        1e-9,
    ),
    "radiation.pairs": Bound(
        "traced factor of 16 free pairs, largest error in standard errors [-]",
        0.0,
        "exact factor",
        "most",
        4.0,
    ),
    "radiation.shells": Bound(
        "three shells of sc, bcc, fcc, largest difference [-]",
        0.0,
        "published to 1e-5; four errors of 5 million rays",
        "most",
        1.5e-4,
    ),
    "radiation.exchange": Bound(
        "fcc, absorbed share of a neighbour, four emissivities, largest relative difference [-]",
        0.0,
        HANDS,
        "most",
        0.01,
    ),
    "radiation.conductivity": Bound(
        "fcc, black, conductivity over 4 σ T³ d [-]", 0.874, HANDS, "relative", 0.01
    ),
    "closures.limits": Bound(
        "limiting cases that shipped view-factor closures fail [-]",
        0.0,
        "closures/viewfactor/limits.py",
        "most",
        0.0,
    ),
    # Particles
    "particles.hertz": Bound(
        "two glass spheres at 20 m/s, deepest overlap, relative error [-]",
        0.0,
        "Hertz; Chung & Ooi (2011), test 1",
        "within",
        1e-3,
    ),
    "particles.restitution": Bound(
        "restitution 0.1 to 0.9, four laws, largest error [-]",
        0.0,
        "what was asked for",
        "most",
        5e-3,
    ),
    "particles.oblique": Bound(
        "oblique impacts that slide throughout, largest error of the speed kept [-]",
        0.0,
        "rigid bodies; Chung & Ooi (2011), test 4",
        "most",
        5e-3,
    ),
    "particles.order_undamped": Bound(
        "order of the steps without damping [-]", 2.0, "velocity Verlet", "least", 1.9
    ),
    "particles.order_damped": Bound(
        "order of the steps with damping [-]", 1.0, "velocity Verlet", "least", 0.9
    ),
    "particles.tumbling": Bound(
        "energy of a free body that tumbles, 100,000 steps, relative [-]",
        0.0,
        "conservation",
        "most",
        1e-6,
    ),
    "particles.rolling": Bound(
        "speed of a ball that slid, over 5/7 of its first, less one [-]",
        0.0,
        "Coulomb; rolling",
        "within",
        5e-3,
    ),
    # Drag
    "drag.stokes": Bound(
        "F of one sphere at rest, six laws, largest difference to 1 [-]",
        0.0,
        "Stokes",
        "most",
        1e-6,
    ),
    "drag.ergun": Bound(
        "Ergun's pressure gradient, relative difference [-]", 0.0, "library fluids", "within", 1e-12
    ),
    "drag.sphere": Bound(
        "Haider & Levenspiel at Re = 100, relative difference [-]",
        0.0,
        "library fluids",
        "within",
        1e-12,
    ),
    # Gas
    "gas.cavity_100": Bound(
        "cavity at Re = 100, 32², largest difference of u [lid's]", 0.0, GHIA, "most", 0.01
    ),
    "gas.cavity_400": Bound(
        "cavity at Re = 400, 48², largest difference of u [lid's]", 0.0, GHIA, "most", 0.02
    ),
    "gas.order_viscosity": Bound(
        "Taylor-Green vortices, order of viscosity [-]", 2.0, "closed form", "least", 1.9
    ),
    "gas.order_rest": Bound(
        "Taylor-Green vortices, order of the rest [-]", 2.0, "closed form", "least", 1.9
    ),
    "gas.heated": Bound(
        "gas through hot particles, 40 cells, largest error over the rise [-]",
        0.0,
        "closed form",
        "most",
        5e-3,
    ),
    # Particles in a gas
    "cfddem.settling": Bound(
        "net speed of a grain that settles, four places in a cell, relative error [-]",
        0.0,
        "force balance of MFIX's DEM06",
        "most",
        1e-4,
    ),
    "cfddem.cooling": Bound(
        "4,000 spheres cool, heat that does not add up over all exchanged [-]",
        0.0,
        "conservation",
        "most",
        1e-10,
    ),
    "cfddem.ergun": Bound(
        "fixed random bed, slope of the pressure over Ergun's [-]",
        1.0,
        "Ergun (1952)",
        "within",
        0.02,
    ),
    "cfddem.plateau": Bound(
        "lifted bed, force of the gas over its weight [-]", 1.0, "balance of forces", "within", 5e-3
    ),
    "cfddem.lift": Bound(
        "speed that lifts the bed, over Ergun's [-]", 1.0, "Ergun (1952)", "within", 0.03
    ),
    "budgets.momentum": Bound(
        "momentum of the gas in a bed, change less its parts, relative [-]",
        0.0,
        "conservation",
        "most",
        1e-10,
    ),
    "budgets.exchange": Bound(
        "what the gas gives less what spheres take, relative [-]", 0.0, "Newton", "most", 1e-10
    ),
    "budgets.heat": Bound(
        "heat of each step of a bed that cools, relative [-]", 0.0, "conservation", "most", 1e-10
    ),
    # Two fluids
    "twofluid.growth": Bound(
        "growth rates of nine small waves, largest difference [1/s]",
        0.0,
        "eigenvalues of the linearised equations",
        "most",
        1.0,
    ),
    "twofluid.order": Bound("order in space of a smooth wave [-]", 2.0, "theory", "least", 1.8),
    "twofluid.front": Bound(
        "speed of the clear front of a sedimentation, over Kynch's, less one [-]",
        0.0,
        "Kynch (1952)",
        "within",
        0.02,
    ),
    "twofluid.clusters_mass": Bound(
        "mass of a box that falls into clusters, change [-]", 0.0, "conservation", "within", 1e-12
    ),
    # Residuals
    "diagnosis.effects": Bound(
        "Stokes' law on spheres in a tube: wall and inertia found, nothing else (1 is yes)",
        1.0,
        "theory of the apparatus",
        "within",
        0.0,
    ),
    "diagnosis.wall": Bound("amplitude of the wall [-]", 2.104, "Faxén (1922)", "relative", 0.15),
    "diagnosis.inertia": Bound(
        "amplitude of inertia [-]", 0.15, "Schiller & Naumann (1935)", "relative", 0.15
    ),
    "diagnosis.after": Bound(
        "error of log velocity, rows held out, with effects [-]",
        0.0,
        "0.234 by Stokes' law",
        "most",
        0.036,
    ),
    "diagnosis.again": Bound(
        "the model with both effects lacks nothing (1 is yes)", 1.0, "verdict none", "within", 0.0
    ),
    # Against another engine
    "settled_beds.height": Bound(
        "height of settled beds, difference of means in standard errors [-]",
        0.0,
        LIGGGHTS,
        "most",
        T,
    ),
    "settled_beds.contacts": Bound("contacts per sphere, the same [-]", 0.0, LIGGGHTS, "most", T),
    "settled_beds.decay": Bound("decay of the energy, the same [-]", 0.0, LIGGGHTS, "most", T),
}
