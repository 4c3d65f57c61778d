"""Contact laws in the words of LIGGGHTS: the model, and the numbers of each pair of types."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from greybed.core.errors import InputError
from greybed.dem.damping import damping
from greybed.dem.laws import ContactLaw
from greybed.dem.liggghts.limits import COHESION, NORMAL, ROLLING
from greybed.dem.materials import Contact, Material

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Types:
    """Atom types of a deck: materials of particles first, then those of walls.

    A material of both has two types, for the dashpot of a linear contact with a wall is another.

    Attributes
    ----------
    particles, walls : sequence of Material
        In the order of their types.
    """

    particles: Sequence[Material]
    walls: Sequence[Material]

    @property
    def all(self) -> list[Material]:
        """Material of each type."""
        return [*self.particles, *self.walls]

    def of_wall(self, name: str) -> int:
        """Type of a wall's material, from 1 on."""
        return len(self.particles) + [m.name for m in self.walls].index(name) + 1


def model(law: ContactLaw) -> str:
    """The model of pairs and walls, and its settings."""
    words = [f"model {NORMAL[law.normal]} tangential history"]
    if COHESION[law.cohesion]:
        words.append(f"cohesion {COHESION[law.cohesion]}")
    if ROLLING[law.rolling]:
        words.append(f"rolling_friction {ROLLING[law.rolling]}")
    return " ".join(words)


def settings(law: ContactLaw) -> str:
    """Settings of the model, which come last in a line."""
    words = []
    if not law.tangential_damping:
        words.append("tangential_damping off")
    if law.limit_force:
        words.append("limitForce on")
    if law.cohesion == "sjkr":
        # Otherwise friction does not feel the cohesion there.
        words.append("tangential_reduce on")
    return " ".join(words)


def properties(
    law: ContactLaw,
    types: Types,
    contacts: dict[tuple[str, str], Contact],
    masses: Sequence[float],
) -> list[str]:
    """Lines with the numbers of materials and pairs.

    Parameters
    ----------
    law : ContactLaw
        The law.
    types : Types
        Of particles and walls.
    contacts : dict
        By names.
    masses : sequence of float
        Of one particle of each type of particles, for linear laws [kg].

    Raises
    ------
    InputError
        For a restitution that LIGGGHTS' formula of damping cannot give.
    """
    materials, n = types.all, len(types.all)

    def of_pairs(name: str, value: Callable[[int, int, Contact], float]) -> str:
        table = np.zeros((n, n))
        for i in range(len(types.particles)):
            for j in range(i, n):
                a, b = materials[i].name, materials[j].name
                contact = contacts.get((a, b), contacts.get((b, a)))
                if contact is not None:
                    table[i, j] = table[j, i] = value(i, j, contact)
        if name == "coefficientRestitution":
            table[table == 0.0] = 0.5  # of pairs that never meet: 0 is refused
        return _fix(name, f"peratomtypepair {n}", table.ravel().tolist())

    moduli = [m.youngs_modulus for m in materials]
    lines = [
        _fix("youngsModulus", "peratomtype", moduli),
        _fix("poissonsRatio", "peratomtype", [m.poissons_ratio for m in materials]),
        of_pairs("coefficientRestitution", lambda i, j, c: _restitution(c, law)),
        of_pairs("coefficientFriction", lambda i, j, c: c.friction),
    ]
    if ROLLING[law.rolling]:
        lines.append(of_pairs("coefficientRollingFriction", lambda i, j, c: c.rolling_friction))
    if law.rolling == "epsd":
        damped = of_pairs("coefficientRollingViscousDamping", lambda i, j, c: c.rolling_damping)
        lines.append(damped)
    if law.cohesion == "sjkr":
        lines.append(of_pairs("cohesionEnergyDensity", lambda i, j, c: c.cohesion))
    if law.normal == "linear":
        lines += _linear(law, masses, of_pairs)
    return lines


def _linear(
    law: ContactLaw,
    masses: Sequence[float],
    of_pairs: Callable[[str, Callable[[int, int, Contact], float]], str],
) -> list[str]:
    """Springs, and the dashpots 2 zeta sqrt(k / m*) over the reduced mass m*."""

    def stiffness(c: Contact) -> float:
        assert c.stiffness is not None  # the case has been checked
        return c.stiffness

    def rate(i: int, j: int, c: Contact, k: float) -> float:
        reduced = masses[i] if j >= len(masses) else masses[i] * masses[j] / (masses[i] + masses[j])
        zeta = damping(c.restitution, "linear", limit_force=law.limit_force)
        return 2.0 * zeta * math.sqrt(k / reduced)

    return [
        of_pairs("kn", lambda i, j, c: stiffness(c)),
        of_pairs("kt", lambda i, j, c: stiffness(c) * c.tangential_ratio),
        of_pairs("gamman", lambda i, j, c: rate(i, j, c, stiffness(c))),
        of_pairs("gammat", lambda i, j, c: rate(i, j, c, stiffness(c) * c.tangential_ratio)),
    ]


def _restitution(contact: Contact, law: ContactLaw) -> float:
    """What LIGGGHTS is told: with limitForce its damping is that of a contact without."""
    e = contact.restitution
    if law.normal != "hertz" or not law.limit_force or e == 1.0:
        return e
    zeta = damping(e, "hertz", limit_force=True) * math.sqrt(6.0 / 5.0)
    told = math.exp(-math.pi * zeta / math.sqrt(1.0 - zeta**2)) if zeta < 1.0 else 0.0
    if told <= 0.05:
        raise InputError(
            f"LIGGGHTS cannot do restitution = {e:g} [-] with limit_force: its damping ends "
            "before; take a larger one, limit_force = false, or --engine greybed."
        )
    return told


def _fix(name: str, kind: str, values: Sequence[float]) -> str:
    return f"fix p_{name} all property/global {name} {kind} " + " ".join(f"{v!r}" for v in values)
