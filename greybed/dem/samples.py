"""Samples of a run, whichever engine moves the particles: a state, a row of the history."""

# ruff: noqa: D102 -- the parts of a state are described in greybed.dem.views

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from greybed.dem.bulk_tests import measured
from greybed.dem.measures import bed_height
from greybed.dem.particles import Energies
from greybed.dem.slopes import slopes

if TYPE_CHECKING:
    from greybed.dem.case import ParticleCase
    from greybed.dem.clump import Clump
    from greybed.dem.materials import Material

Array = NDArray[np.float64]
Index = NDArray[np.int64]


class State(Protocol):
    """Particles at one moment; see :class:`greybed.dem.views.Views` for what each part is."""

    @property
    def steps(self) -> int: ...
    @property
    def time_step(self) -> float: ...
    @property
    def time(self) -> float: ...
    @property
    def gravity(self) -> Array: ...
    @property
    def materials(self) -> Sequence[Material]: ...
    @property
    def centres(self) -> Array: ...
    @property
    def radii(self) -> Array: ...
    @property
    def velocities(self) -> Array: ...
    @property
    def spins(self) -> Array: ...
    @property
    def masses(self) -> Array: ...
    @property
    def kinds(self) -> Index: ...
    @property
    def labels(self) -> Index: ...
    @property
    def body_of(self) -> Index: ...
    @property
    def wall_forces(self) -> Array: ...
    @property
    def energies(self) -> Energies: ...
    @property
    def coordination(self) -> float: ...
    @property
    def bytes_per_particle(self) -> float | None: ...
    def count_of(self) -> int: ...
    def plane_of(self, name: str) -> tuple[Array, Array]: ...


@dataclass
class Tally:
    """What has come and gone, kept with each checkpoint.

    Attributes
    ----------
    streamed : list of float
        Mass that each table of particles has put in [kg].
    inserted : list of int
        Particles of each table.
    batches : list of int
        Batches of each table, for the random numbers of the next one.
    sunk : list of float
        Mass that each sink has taken [kg].
    taken : list of int
        Particles of each sink.
    servo : list of float
        Present share of its velocity of each wall with a servo.
    history : list of dict
        Samples.
    """

    streamed: list[float]
    inserted: list[int]
    batches: list[int]
    sunk: list[float]
    taken: list[int]
    servo: list[float]
    history: list[dict[str, float]] = field(default_factory=list)


class Run(Protocol):
    """A case that runs or has run; see :class:`greybed.dem.runner.ParticleRun`."""

    @property
    def case(self) -> ParticleCase: ...
    @property
    def simulation(self) -> State: ...
    @property
    def tally(self) -> Tally: ...
    @property
    def emptied(self) -> bool: ...
    @property
    def heat(self) -> Any: ...
    @property
    def shapes(self) -> Mapping[str, Clump]: ...


def sample(case: ParticleCase, state: State, tally: Tally) -> dict[str, float]:
    """A row of the history: masses, energies, height, sinks, forces on walls, measures."""
    e = state.energies
    row = {
        "time [s]": state.time,
        "particles [-]": float(state.count_of()),
        "mass [kg]": float(state.masses.sum()),
        "kinetic energy [J]": e.kinetic,
        "rotational energy [J]": e.rotational,
        "potential energy [J]": e.potential,
        "height [m]": bed_height(state.centres, state.radii),
        "coordination [-]": state.coordination,
    }
    for sink, mass, count in zip(case.sink, tally.sunk, tally.taken, strict=True):
        row[f"mass in {sink.name} [kg]"] = mass
        row[f"particles in {sink.name} [-]"] = float(count)
    for wall, force in zip(case.wall, state.wall_forces, strict=True):
        for axis, value in zip("xyz", force, strict=True):
            row[f"force {axis} on {wall.name} [N]"] = float(value)
    row |= slopes(case, state)
    row |= measured(case, state)
    return row
