"""What a simulation shows: places, speeds, forces, contacts and energies, in the input's order."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed.dem import _columns, _step
from greybed.dem.bodies import Bodies, shown, sorted_bodies, turns
from greybed.dem.lists import Lists
from greybed.dem.particles import Energies
from greybed.dem.walls import SolidWall

Array = NDArray[np.float64]
Index = NDArray[np.int64]


class Views:
    """Arrays of the present state, each a copy in the order of the input."""

    _state: _step.State
    _lists: Lists
    gravity: Array
    walls: tuple[SolidWall, ...]
    steps: int
    time_step: float

    @property
    def time(self) -> float:
        """Time since the start [s]."""
        return self.steps * self.time_step

    def _in_order(self, values: NDArray[Any]) -> NDArray[Any]:
        result = np.empty_like(values)
        result[self._lists.ident] = values
        return result

    @property
    def centres(self) -> Array:
        """Centres, shape (n, 3), in the order of the input [m]."""
        return self._in_order(self._state.place[:, :3])

    @property
    def radii(self) -> Array:
        """Radii, shape (n,) [m]."""
        return self._in_order(self._state.place[:, 3])

    @property
    def kinds(self) -> Index:
        """Numbers of the materials, shape (n,)."""
        return self._in_order(self._state.kind)

    @property
    def velocities(self) -> Array:
        """Velocities, shape (n, 3) [m/s]."""
        return self._in_order(self._state.motion[:, :3])

    @property
    def spins(self) -> Array:
        """Angular velocities, shape (n, 3) [1/s]."""
        return self._in_order(self._state.motion[:, 3:6])

    @property
    def masses(self) -> Array:
        """Masses, shape (n,) [kg]; those of bodies are shared out by the volumes of spheres."""
        mass, rigid = self._state.motion[:, 6].copy(), self._lists.rigid
        if len(rigid.pose):
            volume = self._state.place[rigid.member, 3] ** 3
            whole = np.add.reduceat(volume, rigid.first[:-1])
            mass[rigid.member] *= volume / np.repeat(whole, np.diff(rigid.first))
        return self._in_order(mass)

    @property
    def bodies(self) -> Bodies:
        """Rigid bodies, in the order of the input."""
        rigid = self._lists.rigid
        return shown(sorted_bodies(rigid, np.argsort(self._lists.body_ident)))

    @property
    def body_of(self) -> Index:
        """Number of the body that a sphere belongs to, or -1, shape (n,)."""
        body = self._state.body
        # One more, for -1: that of spheres without a body.
        number = np.append(self._lists.body_ident, -1)
        return self._in_order(number[body])

    def count_of(self, which: NDArray[np.bool_] | None = None) -> int:
        """Particles, of all or of those spheres: a body is one, whatever spheres it has."""
        owner = self.body_of
        chosen = owner if which is None else owner[which]
        return int((chosen < 0).sum()) + len(np.unique(chosen[chosen >= 0]))

    @property
    def anchors(self) -> Array:
        """Centres of mass, shape (n, 3): of the body for spheres of one, else their own [m]."""
        return self._in_order(self._state.place[:, :3] - self._arms())

    def _arms(self) -> Array:
        """Spheres' centres less the centres of mass of their bodies, in the present order [m]."""
        rigid = self._lists.rigid
        arms = np.zeros((len(self._state.place), 3))
        if len(rigid.pose):
            turn = np.repeat(turns(rigid.pose[:, 3:]), np.diff(rigid.first), axis=0)
            arms[rigid.member] = np.einsum("mij,mj->mi", turn, rigid.offset)
        return arms

    @property
    def forces(self) -> Array:
        """Contact forces without gravity and pushes, shape (n, 3) [N]."""
        return self._in_order(self._contact_loads()[:, :3])

    @property
    def torques(self) -> Array:
        """Contact torques without pushes, shape (n, 3) [N m]."""
        return self._in_order(self._contact_loads()[:, 3:])

    def _contact_loads(self) -> Array:
        load, outer = self._state.load[:, :6], self._state.outer
        return load - outer if len(outer) else load

    @property
    def wall_forces(self) -> Array:
        """Forces on the walls, shape (walls, 3) [N]."""
        surfaces = self._lists.surfaces
        return surfaces.force[:, : len(surfaces.motion), :3].sum(axis=0)

    def plane_of(self, name: str) -> tuple[Array, Array]:
        """Normal of a plane, shape (3,), and its velocity, spin and centre, shape (9,)."""
        number = [wall.shape.name for wall in self.walls].index(name)
        surfaces = self._lists.surfaces
        at = list(surfaces.wall).index(number)
        return surfaces.data[at, 3:6].copy(), surfaces.motion[number].copy()

    @property
    def energies(self) -> Energies:
        """Energies of motion, spin and height, of spheres and bodies."""
        free = self._state.body < 0
        m = self._state.motion[free]
        height = self._state.place[free, :3] @ self.gravity
        rigid = self._lists.rigid
        mass, moments = rigid.bulk[:, 0], rigid.bulk[:, 1:]
        v, momenta = rigid.swing[:, :3], rigid.swing[:, 3:]
        kinetic = 0.5 * (m[:, 6] * (m[:, :3] ** 2).sum(axis=1)).sum()
        kinetic += 0.5 * (mass * (v**2).sum(axis=1)).sum()
        rotational = 0.5 * (m[:, 7] * (m[:, 3:6] ** 2).sum(axis=1)).sum()
        rotational += 0.5 * (momenta**2 / moments).sum()
        potential = -(m[:, 6] * height).sum() - (mass * (rigid.pose[:, :3] @ self.gravity)).sum()
        return Energies(float(kinetic), float(rotational), float(potential))

    @property
    def contacts(self) -> Index:
        """Pairs in contact, shape (m, 2), numbers of the input."""
        near = self._lists.near
        return self._lists.pairs(near.touch[: near.first[-1]] == _columns.TOUCH)

    @property
    def bridges(self) -> Index:
        """Pairs that a liquid bridge joins across a gap, shape (m, 2), numbers of the input."""
        near = self._lists.near
        return self._lists.pairs(near.touch[: near.first[-1]] == _columns.BRIDGE)

    @property
    def coordination(self) -> float:
        """Contacts between particles, per particle [-]."""
        return 2.0 * len(self.contacts) / self.count_of()

    @property
    def bytes_per_particle(self) -> float:
        """Memory of state and lists over the number of particles [B]."""
        return self._lists.bytes / len(self._state.place)
