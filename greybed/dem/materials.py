"""Materials of particles and walls, and what two of them do in contact."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from greybed.core.errors import InputError
from greybed.dem import _columns
from greybed.dem.damping import damping, relaxation
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
        Speed after over speed before a collision along the normal, above 0, at most 1 [-]. Where
        it depends on the speed (``viscoelastic``): of the reference impact.
    friction, sliding_friction : float
        Static and dynamic, at least 0 [-]; the dynamic one is the static one by default.
    rolling_friction : float
        At least 0 [-].
    rolling_damping : float
        Share of critical damping while the rolling spring holds (EPSD), 0 to 1 [-].
    rolling_time : float
        Of viscous rolling, at least 0 [s]: torque over normal force and rolling velocity. Theory
        has the relaxation time of the material; it holds while the sphere rolls by much less than
        the radius of the contact in that time.
    cohesion : float
        At least 0: energy density [J/m3] (SJKR), surface energy [J/m2] (DMT, JKR), Hamaker
        constant [J] (van der Waals) or surface tension [N/m] (liquid bridges).
    nearest, reach : float
        Gaps at which van der Waals forces stop to grow and end [m].
    bridge_volume, contact_angle : float
        Of liquid bridges: volume of each [m3], and angle of liquid and solid, 0 to pi/2 [rad].
    stiffness, tangential_ratio : float
        Of linear and hysteretic laws: normal stiffness [N/m], and tangential over normal [-].
    reference_speed, reference_radius : float
        Of the viscoelastic law: approach speed [m/s] of two spheres of this radius [m] that return
        ``restitution``; where one of the materials is of walls only, of such a sphere and a wall.
    slow_restitution : float
        What the slowest impacts return by the viscoelastic law, from ``restitution`` to 1 [-]; 1,
        the default, is a body that loses by its viscosity alone.
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
    rolling_time: float = 0.0
    reference_speed: float | None = None
    reference_radius: float | None = None
    slow_restitution: float = 1.0

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
        if not law.from_moduli and not self.stiffness:
            raise InputError(f"{who}: the {law.normal} law needs stiffness [N/m] above 0; give it.")
        if law.normal == "viscoelastic":
            if not (self.reference_speed and self.reference_radius):
                raise InputError(
                    f"{who}: the viscoelastic law needs reference_speed [m/s] and reference_radius "
                    "[m] above 0, at which restitution was measured; give both."
                )
            if not self.restitution <= self.slow_restitution <= 1.0:
                raise InputError(
                    f"{who}: slow_restitution = {self.slow_restitution:g} [-] must lie between "
                    f"restitution = {self.restitution:g} and 1: faster impacts lose more."
                )
        if law.rolling == "viscous" and self.rolling_friction > 0.0 == self.rolling_time:
            raise InputError(
                f"{who}: viscous rolling takes rolling_time [s], not rolling_friction = "
                f"{self.rolling_friction:g} [-]; give the time."
            )
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
            checked = contact.checked(law, f"{a.name!r} and {b.name!r}")
            rows.append(_row(a, b, checked, law, of_wall=j >= particles))
    return row, np.array(rows)


def _row(a: Material, b: Material, contact: Contact, law: ContactLaw, *, of_wall: bool) -> Array:
    row = np.zeros(_columns.COLUMNS)
    if law.from_moduli:
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
        shape = "hertz" if law.from_moduli else "linear"
        row[_columns.DAMPING] = damping(e, shape, limit_force=law.limit_force)
        if law.tangential_damping:
            # Of Hertz's laws over the normal root of stiffness and mass, which they have already.
            roots = math.sqrt(4.0 * row[_columns.SHEAR] / row[_columns.MODULUS])
            row[_columns.TANGENTIAL_DAMPING] = row[_columns.DAMPING]
            row[_columns.TANGENTIAL_DAMPING] *= roots if law.from_moduli else 1.0
    row[_columns.UNLOADING] = 1.0 / e**2
    if law.normal == "viscoelastic":
        slow = contact.slow_restitution
        row[_columns.DAMPING] = damping(slow, "hertz", limit_force=law.limit_force)
        modulus = float(row[_columns.MODULUS])
        row[_columns.UNLOADING] = _relaxation_time(a, b, contact, law, modulus, of_wall)
    sliding = contact.sliding_friction
    row[_columns.FRICTION] = contact.friction
    row[_columns.SLIDING] = contact.friction if sliding is None else sliding
    row[_columns.ROLLING] = contact.rolling_friction
    if law.rolling == "viscous":
        row[_columns.ROLLING] = contact.rolling_time
    row[_columns.ROLLING_DAMPING] = contact.rolling_damping
    row[_columns.COHESION] = contact.cohesion
    row[_columns.NEAREST] = contact.nearest
    row[_columns.REACH] = contact.reach
    if law.cohesion == "liquid-bridge":
        row[_columns.COHESION] = contact.cohesion * math.cos(contact.contact_angle)
        row[_columns.NEAREST] = max(contact.bridge_volume, 1e-300)
        row[_columns.REACH] = (1.0 + 0.5 * contact.contact_angle) * math.cbrt(contact.bridge_volume)
    return row


def _relaxation_time(
    a: Material, b: Material, contact: Contact, law: ContactLaw, modulus: float, of_wall: bool
) -> float:
    """Time by which the material lags, from the reference impact [s]."""
    speed, radius = contact.reference_speed, contact.reference_radius
    assert speed is not None
    assert radius is not None
    first, second = (4.0 / 3.0 * math.pi * radius**3 * m.density for m in (a, b))
    mass = first if of_wall else first * second / (first + second)
    stiff = 4.0 / 3.0 * modulus * math.sqrt(radius if of_wall else 0.5 * radius)
    number = relaxation(contact.restitution, contact.slow_restitution, limit_force=law.limit_force)
    # In units of the time that the speed takes for the length of the impact.
    return number * float((mass * speed**2 / stiff) ** 0.4) / speed
