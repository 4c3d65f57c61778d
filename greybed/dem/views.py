"""What a simulation shows: places, speeds, forces, contacts and energies, in the input's order."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed.dem import _columns, _step
from greybed.dem.lists import Lists
from greybed.dem.particles import Energies

Array = NDArray[np.float64]
Index = NDArray[np.int64]


class Views:
    """Arrays of the present state, each a copy in the order of the input."""

    _state: _step.State
    _lists: Lists
    gravity: Array
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
        """Masses, shape (n,) [kg]."""
        return self._in_order(self._state.motion[:, 6])

    @property
    def forces(self) -> Array:
        """Contact forces without gravity, shape (n, 3) [N]."""
        return self._in_order(self._state.load[:, :3])

    @property
    def torques(self) -> Array:
        """Contact torques, shape (n, 3) [N m]."""
        return self._in_order(self._state.load[:, 3:6])

    @property
    def wall_forces(self) -> Array:
        """Forces on the walls, shape (walls, 3) [N]."""
        return self._lists.surfaces.force[:, :, :3].sum(axis=0)

    @property
    def energies(self) -> Energies:
        """Energies of motion, spin and height."""
        m = self._state.motion
        height = self._state.place[:, :3] @ self.gravity
        return Energies(
            float(0.5 * (m[:, 6] * (m[:, :3] ** 2).sum(axis=1)).sum()),
            float(0.5 * (m[:, 7] * (m[:, 3:6] ** 2).sum(axis=1)).sum()),
            float(-(m[:, 6] * height).sum()),
        )

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
        return 2.0 * len(self.contacts) / len(self._state.place)

    @property
    def bytes_per_particle(self) -> float:
        """Memory of state and lists over the number of particles [B]."""
        return self._lists.bytes / len(self._state.place)
