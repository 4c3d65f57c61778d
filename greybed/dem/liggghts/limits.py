"""What LIGGGHTS cannot do of a case, said before it runs, with the remedy."""

from __future__ import annotations

import numpy as np

from greybed.core.errors import InputError
from greybed.core.sizes import Mono, parse_sizes
from greybed.dem.case import ParticleCase
from greybed.dem.case_tables import FileTable
from greybed.dem.measure_tables import ConductionTable, StressTable

# By the names of the case: the words of LIGGGHTS.
NORMAL = {"hertz": "hertz", "linear": "hooke/stiffness"}
ROLLING = {"none": "", "constant-torque": "cdt", "epsd": "epsd", "epsd-modified": "epsd2"}
COHESION = {"none": "", "sjkr": "sjkr"}
# LIGGGHTS itself refuses a restitution of 0.05 or less.
_LEAST_RESTITUTION = 0.05
_REMEDY = "take --engine greybed"


def check(case: ParticleCase) -> None:
    """Refuse what LIGGGHTS has not, or has under the same name with another meaning.

    Raises
    ------
    InputError
        In one sentence with the remedy.
    """
    law = case.contact_law
    for what, name, known in (
        ("normal", law.normal, NORMAL),
        ("rolling", law.rolling, ROLLING),
        ("cohesion", law.cohesion, COHESION),
    ):
        if name not in known:
            raise _cannot(f"law.{what} = {name!r}", f"{_REMEDY}, or one of {', '.join(known)}")
    if case.heat is not None:
        raise _cannot("[heat]", f"{_REMEDY}, or leave [heat] out")
    for table in case.measure:
        if isinstance(table, StressTable | ConductionTable):
            raise _cannot(f"measure {table.name!r}, which needs the force of each contact", _REMEDY)
    for number, source in enumerate(case.particles):
        shape = None if isinstance(source, FileTable) else source.shape
        if shape is not None and case.effects.particle_shape:
            raise _cannot(
                f"particles[{number}].shape = {shape!r}",
                f"{_REMEDY}, or spheres of the same volume with effects.particle_shape = false",
            )
    _check_numbers(case)
    _check_walls(case)
    if law.normal == "linear":
        _check_equal(case)


def _check_numbers(case: ParticleCase) -> None:
    for material in case.material:
        if material.poissons_ratio < 0.0:
            raise _cannot(
                f"material {material.name!r}: poissons_ratio = {material.poissons_ratio:g} [-]",
                f"{_REMEDY}, or at least 0",
            )
    for contact in case.contact:
        who = f"contact {list(contact.between)}"
        if contact.restitution <= _LEAST_RESTITUTION:
            raise _cannot(
                f"{who}: restitution = {contact.restitution:g} [-]",
                f"take more than {_LEAST_RESTITUTION:g}, or --engine greybed",
            )
        if contact.sliding_friction not in (None, contact.friction):
            raise _cannot(
                f"{who}: sliding_friction = {contact.sliding_friction:g} [-] beside friction",
                f"{_REMEDY}, or leave it out",
            )


def _check_walls(case: ParticleCase) -> None:
    for wall in case.wall:
        moves, turns = np.any(wall.velocity), np.any(wall.spin)
        if moves and turns:
            raise _cannot(
                f"wall {wall.name!r}: a velocity and a spin at once", f"{_REMEDY}, or one of them"
            )
        if wall.servo is not None and turns:
            raise _cannot(f"wall {wall.name!r}: a servo with a spin", _REMEDY)


def _check_equal(case: ParticleCase) -> None:
    """The dashpot of hooke/stiffness is per mass, so that it fits one size of each material."""
    sizes: dict[str, set[float]] = {}
    for number, table in enumerate(case.particles):
        if isinstance(table, FileTable) or table.sizes is None:
            raise _cannot(f"particles[{number}] with law.normal = 'linear'", f"{_REMEDY}, or hertz")
        drawn = parse_sizes(table.sizes)
        if isinstance(drawn, Mono):
            sizes.setdefault(table.material, set()).add(drawn.radius)
        if not isinstance(drawn, Mono) or len(sizes[table.material]) > 1:
            raise _cannot(
                f"law.normal = 'linear' with several sizes of material {table.material!r}",
                f"{_REMEDY}, hertz, or mono sizes with a material for each",
            )


def _cannot(what: str, remedy: str) -> InputError:
    return InputError(f"LIGGGHTS cannot do {what} as this case means it; {remedy}.")
