r"""Coarse graining: one large particle for many small ones, with the same stresses and flows.

A particle of radius f R stands for f^3 particles of radius R in the same apparatus, under the same
gravity. What a bed does goes by stress over modulus, friction, restitution, and stress of cohesion
over that of weight. Each contact number therefore changes such that the force of a contact grows
by f^2, like the area that a contact carries, where the overlap grows by f:

==================================  =====================================================
density, moduli, friction,          the same: Hertz' force :math:`E \sqrt{R}\,\delta^{3/2}`
restitution, rolling friction       grows by f^2 by itself
stiffness [N/m]                     times f
energy density (SJKR) [J/m3]        the same: the disc of the contact grows by f^2
surface energy (DMT, JKR) [J/m2]    times f
surface tension (bridges) [N/m]     times f; volume of a bridge times f^3
Hamaker constant [J]                times f^3, with both gaps times f
times of viscous materials [s]      times f (rolling; of impacts by the reference radius)
==================================  =====================================================

A collision at the same speed is then the same in units of radius, mass and R / speed: it lasts f
times as long, so the time step is f times as long, too. What is not kept: the number of particles
across an opening or a shear band, inertia of rapid shear (its stress goes by f^2 R^2), and the
resistance of walls to heat (times f). Conductivity and heat capacity are the same.

Sources: exact scaling of Feng & Owen, Comput. Part. Mech. 1 (2014) 159, doi
10.1007/s40571-014-0010-y; cohesion of powders, Thakur, Ooi & Ahmadian, Powder Technol. 293 (2016)
130; use, Bierwisch, Kraft, Riedel & Moseler, J. Mech. Phys. Solids 57 (2009) 10.
"""

from __future__ import annotations

import math
from dataclasses import fields, replace

from greybed.core.errors import InputError
from greybed.core.sizes import (
    Discrete,
    LogNormal,
    MassQuantiles,
    Mono,
    RosinRammler,
    Uniform,
    parse_sizes,
)
from greybed.dem.case import ParticleCase
from greybed.dem.case_tables import FileTable, PackTable, StreamTable
from greybed.dem.laws import ContactLaw
from greybed.dem.materials import Contact

# Power of the factor by which the number ``cohesion`` of each law grows.
_COHESION = {"none": 0, "sjkr": 0, "dmt": 1, "jkr": 1, "liquid-bridge": 1, "van-der-waals": 3}


def coarse_grained(contact: Contact, law: ContactLaw, factor: float) -> Contact:
    """The contact of particles that are ``factor`` times as large as the real ones.

    Parameters
    ----------
    contact : Contact
        Of the real ones.
    law : ContactLaw
        Which the numbers are for.
    factor : float
        At least 1 [-].

    Returns
    -------
    Contact

    Raises
    ------
    InputError
        For a factor below 1, or a law of cohesion that no rule is known for.
    """
    _check(factor, law.cohesion)
    radius = contact.reference_radius
    return replace(
        contact,
        stiffness=None if contact.stiffness is None else factor * contact.stiffness,
        cohesion=factor ** _COHESION[law.cohesion] * contact.cohesion,
        nearest=factor * contact.nearest,
        reach=factor * contact.reach,
        bridge_volume=factor**3 * contact.bridge_volume,
        rolling_time=factor * contact.rolling_time,
        # The viscoelastic law finds its time from the impact of a sphere of this radius.
        reference_radius=None if radius is None else factor * radius,
    )


def coarse_case(case: ParticleCase) -> ParticleCase:
    """The case with its ``coarse_graining`` carried out: sizes, counts and contact numbers.

    Raises
    ------
    InputError
        For particles that cannot be made larger: those of files, bodies of several spheres, or a
        pack too small for the factor.
    """
    factor = case.coarse_graining
    if factor == 1.0:
        return case
    particles: list[PackTable | StreamTable | FileTable] = []
    for number, table in enumerate(case.particles):
        if isinstance(table, FileTable) or table.sizes is None:
            what = "a file" if isinstance(table, FileTable) else "a shape"
            raise InputError(
                f"particles[{number}]: coarse_graining = {factor:g} cannot enlarge particles of "
                f"{what}; draw them by sizes, or take coarse_graining out."
            )
        larger = replace(table, sizes=coarse_sizes(table.sizes, factor))
        if isinstance(larger, PackTable):
            count = round(larger.count / factor**3)
            if count < 1:
                raise InputError(
                    f"particles[{number}]: coarse_graining = {factor:g} leaves none of "
                    f"{larger.count} particles; take a smaller factor."
                )
            larger = replace(larger, count=count)
        particles.append(larger)
    law = ContactLaw(case.law.normal, cohesion=case.law.cohesion)
    contacts = []
    for row in case.contact:
        scaled = coarse_grained(row.contact, law, factor)
        own = {f.name: getattr(scaled, f.name) for f in fields(Contact)}
        contacts.append(replace(row, **own))
    return replace(case, particles=tuple(particles), contact=tuple(contacts), coarse_graining=1.0)


def coarse_sizes(text: str, factor: float) -> str:
    """A text of sizes with all radii times ``factor``; see :func:`parse_sizes`.

    Raises
    ------
    InputError
        If the text is not understood.
    """
    sizes = parse_sizes(text)

    def length(radius: float) -> str:
        return f"{factor * radius!r} m"

    match sizes:
        case Mono(radius):
            return f"mono:{length(radius)}"
        case Uniform(smallest, largest):
            return f"uniform:{length(smallest)},{length(largest)}"
        case LogNormal(median, sd):
            return f"lognormal:{length(median)},{sd!r}"
        case RosinRammler(scale, spread):
            return f"rosin-rammler:{length(scale)},{spread!r}"
        case MassQuantiles(d10, d50, d90):
            return f"quantiles:D10={length(d10)},D50={length(d50)},D90={length(d90)}"
        case Discrete(radii, shares):
            rows = zip(radii, shares, strict=True)
            return "discrete:" + ",".join(f"{length(r)}={s!r}" for r, s in rows)
    raise InputError(f"sizes {text!r} cannot be enlarged; give another distribution.")


def _check(factor: float, cohesion: str) -> None:
    if not (factor >= 1.0 and math.isfinite(factor)):
        raise InputError(f"factor = {factor:g} [-] must be finite and at least 1.")
    if cohesion not in _COHESION:
        raise InputError(
            f"cohesion = {cohesion!r} has no rule of coarse graining; take another law, or 1."
        )
