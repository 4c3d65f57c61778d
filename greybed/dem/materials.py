"""Materials of particles and walls, and what two of them do in contact."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from greybed.core.errors import InputError
from greybed.dem import _columns
from greybed.dem.damping import damping
from greybed.dem.laws import ContactLaw

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Material:
    """What a body is made of.

    Attributes
    ----------
    density : float
        Above 0 [kg/m3]. Of walls it is not used.
    youngs_modulus : float
        Above 0 [Pa].
    poissons_ratio : float
        From -1 to 0.5, both excluded and included [-].
    name : str
        For messages and pairs.
    """

    density: float
    youngs_modulus: float
    poissons_ratio: float
    name: str = "particle"

    def __post_init__(self) -> None:
        for part, unit in (("density", "kg/m3"), ("youngs_modulus", "Pa")):
            value = getattr(self, part)
            if not (value > 0.0 and math.isfinite(value)):
                raise InputError(
                    f"material {self.name!r}: {part} = {value:g} [{unit}] must be finite and "
                    "above 0."
                )
        if not -1.0 < self.poissons_ratio <= 0.5:
            raise InputError(
                f"material {self.name!r}: poissons_ratio = {self.poissons_ratio:g} [-] is outside "
                "(-1, 0.5]."
            )

    @property
    def shear_modulus(self) -> float:
        """G = E / (2 (1 + nu)) [Pa]."""
        return self.youngs_modulus / (2.0 * (1.0 + self.poissons_ratio))


@dataclass(frozen=True)
class Contact:
    """What two materials do in contact; numbers that the law does not use are ignored.

    Attributes
    ----------
    restitution : float
        Speed after over speed before a collision along the normal, above 0, at most 1 [-].
    friction, sliding_friction : float
        Static and dynamic, at least 0 [-]; the dynamic one is the static one by default.
    rolling_friction : float
        At least 0 [-].
    rolling_damping : float
        Share of critical damping while the rolling spring holds (EPSD), 0 to 1 [-].
    cohesion : float
        At least 0: energy density [J/m3] (SJKR), surface energy [J/m2] (DMT, JKR), Hamaker
        constant [J] (van der Waals) or surface tension [N/m] (liquid bridges).
    nearest, reach : float
        Gaps at which van der Waals forces stop to grow and end [m].
    bridge_volume, contact_angle : float
        Of liquid bridges: volume of each [m3], and angle of liquid and solid, 0 to pi/2 [rad].
    stiffness, tangential_ratio : float
        Of linear and hysteretic laws: normal stiffness [N/m], and tangential over normal [-].
    """

    restitution: float
    friction: float
    sliding_friction: float | None = None
    rolling_friction: float = 0.0
    rolling_damping: float = 0.0
    cohesion: float = 0.0
    nearest: float = 0.0
    reach: float = 0.0
    bridge_volume: float = 0.0
    contact_angle: float = 0.0
    stiffness: float | None = None
    tangential_ratio: float = 2.0 / 7.0

    def __post_init__(self) -> None:
        if not 0.0 < self.restitution <= 1.0:
            raise InputError(
                f"restitution = {self.restitution:g} [-] is outside (0, 1]; one that loses all "
                "needs infinite damping: take 0.01."
            )
        for field in fields(self):
            value = getattr(self, field.name)
            if value is not None and not (value >= 0.0 and math.isfinite(value)):
                raise InputError(f"{field.name} = {value:g} must be finite and at least 0.")

    def checked(self, law: ContactLaw, who: str) -> Contact:
        """The same, if the law has what it needs.

        Raises
        ------
        InputError
            If a number is missing.
        """
        if law.normal != "hertz" and not self.stiffness:
            raise InputError(f"{who}: the {law.normal} law needs stiffness [N/m] above 0; give it.")
        if law.cohesion == "van-der-waals" and not 0.0 < self.nearest < self.reach:
            raise InputError(
                f"{who}: van der Waals cohesion needs 0 < nearest < reach [m], not "
                f"{self.nearest:g} and {self.reach:g}; a usual nearest gap is 0.4e-9."
            )
        bridged = self.bridge_volume > 0.0 and self.contact_angle < 0.5 * math.pi
        if law.cohesion == "liquid-bridge" and self.cohesion > 0.0 and not bridged:
            raise InputError(
                f"{who}: liquid bridges need bridge_volume above 0 [m3] and contact_angle below "
                f"pi/2 [rad], not {self.bridge_volume:g} and {self.contact_angle:g}."
            )
        return self


def pair_tables(
    materials: Sequence[Material],
    contacts: Mapping[tuple[str, str], Contact] | Contact,
    law: ContactLaw,
    particles: int,
    walls: set[int],
) -> tuple[NDArray[np.int64], Array]:
    """Row of each two materials, and the table of what they do.

    Parameters
    ----------
    materials : sequence of Material
        All of them.
    contacts : mapping or Contact
        By the names of two materials, in either order; one for all where there is no mapping.
    law : ContactLaw
        The law.
    particles : int
        Materials up to this number may be those of particles.
    walls : set of int
        Those of walls. Pairs that cannot meet need no contact.

    Returns
    -------
    row : ndarray of int, shape (n, n)
    table : ndarray, shape (pairs, COLUMNS)

    Raises
    ------
    InputError
        If a pair has no contact, or a name is unknown.
    """
    names = [material.name for material in materials]
    if isinstance(contacts, Mapping):
        for key in contacts:
            for name in key:
                if name not in names:
                    raise InputError(
                        f"contact {key}: no material is called {name!r}; there are "
                        f"{', '.join(sorted(set(names)))}."
                    )
    n = len(materials)
    row = np.zeros((n, n), np.int64)
    rows: list[Array] = []
    for i in range(n):
        for j in range(i, n):
            if i >= particles or (j >= particles and j not in walls):
                continue
            a, b = materials[i], materials[j]
            if isinstance(contacts, Contact):
                contact: Contact | None = contacts
            else:
                contact = contacts.get((a.name, b.name), contacts.get((b.name, a.name)))
            if contact is None:
                raise InputError(
                    f"materials {a.name!r} and {b.name!r} have no contact; give restitution and "
                    "friction of this pair."
                )
            row[i, j] = row[j, i] = len(rows)
            rows.append(_row(a, b, contact.checked(law, f"{a.name!r} and {b.name!r}"), law))
    return row, np.array(rows)


def _row(a: Material, b: Material, contact: Contact, law: ContactLaw) -> Array:
    row = np.zeros(_columns.COLUMNS)
    if law.normal == "hertz":
        row[_columns.MODULUS] = 1.0 / sum(
            (1.0 - m.poissons_ratio**2) / m.youngs_modulus for m in (a, b)
        )
        row[_columns.SHEAR] = 1.0 / sum((2.0 - m.poissons_ratio) / m.shear_modulus for m in (a, b))
    else:
        assert contact.stiffness is not None
        row[_columns.MODULUS] = contact.stiffness
        row[_columns.SHEAR] = contact.stiffness * contact.tangential_ratio
    e = contact.restitution
    if law.normal != "hysteresis":
        row[_columns.DAMPING] = damping(e, law.normal, limit_force=law.limit_force)
        if law.tangential_damping:
            row[_columns.TANGENTIAL_DAMPING] = row[_columns.DAMPING]
    row[_columns.UNLOADING] = 1.0 / e**2
    sliding = contact.sliding_friction
    row[_columns.FRICTION] = contact.friction
    row[_columns.SLIDING] = contact.friction if sliding is None else sliding
    row[_columns.ROLLING] = contact.rolling_friction
    row[_columns.ROLLING_DAMPING] = contact.rolling_damping
    row[_columns.COHESION] = contact.cohesion
    row[_columns.NEAREST] = contact.nearest
    row[_columns.REACH] = contact.reach
    if law.cohesion == "liquid-bridge":
        row[_columns.COHESION] = contact.cohesion * math.cos(contact.contact_angle)
        row[_columns.NEAREST] = max(contact.bridge_volume, 1e-300)
        row[_columns.REACH] = (1.0 + 0.5 * contact.contact_angle) * math.cbrt(contact.bridge_volume)
    return row
