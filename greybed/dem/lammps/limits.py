"""What LAMMPS cannot do of a case, said before it runs, with the remedy."""

from __future__ import annotations

import math

import numpy as np

from greybed.core.errors import InputError
from greybed.core.walls import Cone, Cylinder, Disc, Plane
from greybed.dem.case import ParticleCase
from greybed.dem.case_tables import FileTable, PackTable, StreamTable
from greybed.dem.measure_tables import ConductionTable, StressTable

NORMAL = ("hertz", "linear")
_REMEDY = "take --engine greybed or liggghts"
_OWN = "take --engine greybed"


def check(case: ParticleCase) -> None:
    """Refuse what the deck of LAMMPS does not carry.

    Raises
    ------
    InputError
        In one sentence with the remedy.
    """
    law = case.contact_law
    if law.normal not in NORMAL:
        raise _cannot(f"law.normal = {law.normal!r}", f"{_OWN}, or one of {', '.join(NORMAL)}")
    for what, name in (("rolling", law.rolling), ("cohesion", law.cohesion)):
        if name != "none":
            raise _cannot(f"law.{what} = {name!r}", f"{_REMEDY}, or none")
    if case.heat is not None:
        _check_heat(case)
    for table in case.measure:
        if isinstance(table, StressTable | ConductionTable):
            raise _cannot(f"measure {table.name!r}, which needs the force of each contact", _OWN)
    for number, source in enumerate(case.particles):
        if isinstance(source, FileTable):
            continue
        if source.shape is not None and case.effects.particle_shape:
            raise _cannot(f"particles[{number}].shape = {source.shape!r}", _OWN)
        if isinstance(source, StreamTable):
            raise _cannot(f"particles[{number}] of kind stream", _REMEDY)
        if isinstance(source, PackTable) and source.at > 0.0:
            raise _cannot(f"particles[{number}].at = {source.at:g} [s]", _REMEDY)
    for contact in case.contact:
        if contact.sliding_friction not in (None, contact.friction):
            raise _cannot(
                f"contact {list(contact.between)}: sliding_friction beside friction",
                f"{_OWN}, or leave it out",
            )
    _check_walls(case)


def _check_heat(case: ParticleCase) -> None:
    """LAMMPS does not tell what each wall gives: it is found from what the particles have."""
    warm = [wall.name for wall in case.wall if wall.temperature is not None]
    if len(warm) > 1:
        raise _cannot(
            f"[heat] with several warm walls, {', '.join(warm)}", f"{_OWN}, or one warm wall"
        )
    if warm and case.sink:
        raise _cannot(f"[heat] from wall {warm[0]!r} beside a [[sink]]", _OWN)


def _check_walls(case: ParticleCase) -> None:
    for wall in case.wall:
        shape = wall.wall()
        moves = math.isfinite(wall.starts) and (np.any(wall.velocity) or np.any(wall.spin))
        if moves:
            raise _cannot(f"wall {wall.name!r}, which moves", _REMEDY)
        along = isinstance(shape, Cylinder | Cone) and max(np.abs(shape.axis)) == 1.0
        flat = isinstance(shape, Disc) and max(np.abs(shape.normal)) == 1.0
        if not (isinstance(shape, Plane) or along or flat):
            raise _cannot(
                f"wall {wall.name!r} (only planes, and cylinders, cones and discs along an axis)",
                _REMEDY,
            )


def _cannot(what: str, remedy: str) -> InputError:
    return InputError(f"LAMMPS cannot do {what} as this case means it; {remedy}.")
