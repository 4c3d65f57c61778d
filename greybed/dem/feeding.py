"""Feed of a case: which particles come, when, and where they find room."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.core.errors import InputError
from greybed.core.packing import Packing
from greybed.dem.bodies import Clumps, random_orientations
from greybed.dem.case import ParticleCase
from greybed.dem.case_tables import FileTable, PackTable, StreamTable
from greybed.dem.clump import Clump
from greybed.dem.insertion import random_places
from greybed.dem.materials import Material
from greybed.dem.particles import rayleigh_time
from greybed.dem.simulation import Simulation

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Batch:
    """New particles of one table.

    Attributes
    ----------
    centres : ndarray, shape (k, 3)
        Centres of mass [m].
    radii : ndarray, shape (k,)
        Of spheres, or of balls that hold clumps [m].
    kind : int
        Number of the material.
    velocity : (3,) floats
        Of all of them [m/s].
    shape : Clump or None
        Where they are clumps.
    orientations : ndarray, shape (k, 4)
        Of clumps.
    """

    centres: Array
    radii: Array
    kind: int
    velocity: tuple[float, float, float]
    shape: Clump | None
    orientations: Array

    @property
    def clumps(self) -> Clumps:
        """The same, where they are clumps."""
        assert self.shape is not None
        return Clumps(self.shape, self.centres, self.orientations, self.kind, self.velocity)

    def enter(self, simulation: Simulation) -> None:
        """Go into a simulation that runs."""
        if not len(self.centres):
            return
        if self.shape is not None:
            simulation.insert_clumps(self.clumps)
            return
        simulation.insert(
            self.centres, self.radii, kinds=np.full(len(self.centres), self.kind),
            velocities=np.broadcast_to(np.array(self.velocity), self.centres.shape),
        )  # fmt: skip


class Feed:
    """Tables of particles of a case, and what they have put in.

    Attributes
    ----------
    shapes : dict of Clump
        By name; empty where the effect of the shape is off.
    streamed : list of float
        Mass that each table has put in [kg].
    inserted : list of int
        Particles of each table.
    batches : list of int
        Batches of each table, for the random numbers of the next one.
    """

    def __init__(
        self,
        case: ParticleCase,
        packings: dict[int, Packing],
        materials: list[Material],
        streamed: list[float],
        inserted: list[int],
        batches: list[int],
    ) -> None:
        self.case, self.packings, self.materials = case, packings, materials
        self.streamed, self.inserted, self.batches = streamed, inserted, batches
        self._names = [material.name for material in materials]
        self._all = {table.name: table.clump() for table in case.shape}
        self.shapes = self._all if case.effects.particle_shape else {}

    def shortest_time(self) -> float:
        """Rayleigh's time of the particle with the shortest one, of all that may come [s]."""
        times = []
        for number, table in enumerate(self.case.particles):
            if isinstance(table, FileTable):
                radii = self.packings[number].radii
            elif self._shape(table) is not None:
                radii = self._all[str(table.shape)].radii
            else:
                radii = self._radii(table, 1000)
            place = np.array([[0.0, 0.0, 0.0, float(radii.min())]])
            times.append(rayleigh_time(place, np.array([self._kind(table)]), self.materials))
        return min(times)

    def at_start(self) -> list[Batch]:
        """Particles that are there at time 0, table by table."""
        found: list[Batch] = []
        for number, table in enumerate(self.case.particles):
            if isinstance(table, FileTable):
                x, r = self.packings[number].centres, self.packings[number].radii
                found.append(Batch(x, r, self._kind(table), table.velocity, None, np.empty((0, 4))))
            elif getattr(table, "at", getattr(table, "starts", 0.0)) == 0.0:
                taken = np.concatenate([np.empty((0, 3)), *(b.centres for b in found)])
                sizes = np.concatenate([np.empty(0), *(b.radii for b in found)])
                found.append(self.drawn(number, table, taken, sizes, 0.0))
        return found

    def owes(self, number: int, table: StreamTable, time: float) -> bool:
        """Whether a stream is behind."""
        return time >= table.starts and self._due(table, time) > self.streamed[number]

    def drawn(
        self,
        number: int,
        table: PackTable | StreamTable,
        taken: ArrayLike,
        taken_radii: ArrayLike,
        time: float,
    ) -> Batch:
        """New particles of a table that find room now, beside spheres that are there [m]."""
        seed = [self.case.seed, number, self.batches[number]]
        self.batches[number] += 1
        shape = self._shape(table)
        density = self.materials[self._kind(table)].density

        def masses(radii: Array) -> Array:
            ball: Array = density * 4.0 / 3.0 * math.pi * radii**3
            return ball if shape is None else np.full(len(radii), density * shape.volume)

        if isinstance(table, PackTable):
            # Large ones first: small ones find room between them.
            r = self._radii(table, table.count)[::-1]
        else:
            due = self._due(table, time) - self.streamed[number]
            r = np.empty(0)
            if due > 0.0 or self.batches[number] == 1:
                mean = float(masses(self._radii(table, 1000)).mean())
                most = 1 + math.ceil(max(due, 0.0) / mean)
                if table.sizes is not None:
                    r = table.distribution.sampled(most, np.random.default_rng([*seed, 1]))
                else:
                    r = self._radii(table, most)
                r = r[: max(1, int(np.searchsorted(np.cumsum(masses(r)), due)))]
        x = random_places(table.region, r, seed, taken=taken, taken_radii=taken_radii)
        if isinstance(table, PackTable) and len(x) < len(r):
            raise InputError(
                f"particles[{number}]: only {len(x)} of {len(r)} particles find room between "
                f"{table.lower} and {table.upper} [m]; make the region larger, or insert fewer."
            )
        r = r[: len(x)]
        self.inserted[number] += len(x)
        self.streamed[number] += float(masses(r).sum())
        turned = random_orientations(len(x), [*seed, 2]) if shape else np.empty((0, 4))
        return Batch(x, r, self._kind(table), table.velocity, shape, turned)

    def _kind(self, table: PackTable | StreamTable | FileTable) -> int:
        return self._names.index(table.material)

    def _shape(self, table: PackTable | StreamTable) -> Clump | None:
        return self.shapes.get(table.shape) if table.shape is not None else None

    def _radii(self, table: PackTable | StreamTable, count: int) -> Array:
        """Radii of spheres, or of the balls that hold clumps [m]."""
        if table.shape is None:
            return table.distribution.radii(count)
        shape = self._all[table.shape]
        on = self.case.effects.particle_shape
        return np.full(count, shape.reach if on else shape.equivalent_radius)

    def _due(self, table: StreamTable, time: float) -> float:
        """Mass that a stream owes by now [kg]."""
        return min(table.rate * max(time - table.starts, 0.0), table.mass)
