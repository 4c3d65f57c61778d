"""Binary dumps of LIGGGHTS, and the particles of one moment in them."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from greybed.core.errors import InputError
from greybed.dem.materials import Material
from greybed.dem.particles import Energies

Array = NDArray[np.float64]
Index = NDArray[np.int64]

FIELDS = "id type x y z vx vy vz omegax omegay omegaz radius mass c_touch"
_WIDTH = len(FIELDS.split())
# Step, particles, triclinic, six boundaries, the box, columns, blocks.
_HEAD = struct.Struct("=qqi6i6dii")


def read_dump(path: Path) -> tuple[int, Array]:
    """Step and rows of a binary dump, in the order of the numbers of particles.

    Raises
    ------
    InputError
        If it is no whole dump of these columns.
    """
    data = path.read_bytes()
    if len(data) < _HEAD.size:
        raise InputError(f"{path}: this dump of LIGGGHTS is cut short; free space and run again.")
    step, count, *_, width, blocks = _HEAD.unpack_from(data)
    at, parts = _HEAD.size, [np.empty(0)]
    for _ in range(blocks):
        n = struct.unpack_from("=i", data, at)[0] if at + 4 <= len(data) else -1
        if n < 0 or at + 4 + 8 * n > len(data):
            raise InputError(
                f"{path}: this dump of LIGGGHTS is cut short; free space and run again."
            )
        parts.append(np.frombuffer(data, np.float64, n, at + 4))
        at += 4 + 8 * n
    rows = np.concatenate(parts)
    rows = rows.reshape(-1, _WIDTH) if rows.size % _WIDTH == 0 else rows[:, None]
    if width != _WIDTH or len(rows) != count:
        raise InputError(
            f"{path}: this dump of LIGGGHTS has {len(rows)} rows of {width} columns, not "
            f"{count} of {_WIDTH}; run again."
        )
    return step, rows[np.argsort(rows[:, 0], kind="stable")]


@dataclass(frozen=True)
class Snapshot:
    """Particles at one moment, by the names of :class:`greybed.dem.views.Views`.

    Attributes
    ----------
    steps : int
    time_step : float
        [s]
    rows : ndarray, shape (n, 14)
        Columns as in ``FIELDS``.
    gravity : ndarray, shape (3,)
        [m/s2]
    materials : sequence of Material
        By number.
    wall_forces : ndarray, shape (walls, 3)
        On the walls [N].
    planes : dict
        Normal and motion of the planes of the case, by name.
    """

    steps: int
    time_step: float
    rows: Array
    gravity: Array
    materials: Sequence[Material]
    wall_forces: Array
    planes: dict[str, tuple[Array, Array]]
    bytes_per_particle: None = None

    @property
    def time(self) -> float:
        """Since the start [s]."""
        return self.steps * self.time_step

    @property
    def centres(self) -> Array:
        """Shape (n, 3) [m]."""
        return self.rows[:, 2:5].copy()

    @property
    def velocities(self) -> Array:
        """Shape (n, 3) [m/s]."""
        return self.rows[:, 5:8].copy()

    @property
    def spins(self) -> Array:
        """Shape (n, 3) [1/s]."""
        return self.rows[:, 8:11].copy()

    @property
    def radii(self) -> Array:
        """Shape (n,) [m]."""
        return self.rows[:, 11].copy()

    @property
    def masses(self) -> Array:
        """Shape (n,) [kg]."""
        return self.rows[:, 12].copy()

    @property
    def kinds(self) -> Index:
        """Numbers of the materials, shape (n,)."""
        return self.rows[:, 1].astype(np.int64) - 1

    @property
    def labels(self) -> Index:
        """Numbers that particles keep, shape (n,)."""
        return self.rows[:, 0].astype(np.int64) - 1

    @property
    def body_of(self) -> Index:
        """-1: there are no bodies, shape (n,)."""
        return np.full(len(self.rows), -1)

    @property
    def coordination(self) -> float:
        """Contacts between particles, per particle [-]."""
        return float(self.rows[:, 13].mean())

    @property
    def energies(self) -> Energies:
        """Of motion, spin and height."""
        mass, v, w = self.rows[:, 12], self.rows[:, 5:8], self.rows[:, 8:11]
        inertia = 0.4 * mass * self.rows[:, 11] ** 2
        return Energies(
            float(0.5 * (mass * (v**2).sum(axis=1)).sum()),
            float(0.5 * (inertia * (w**2).sum(axis=1)).sum()),
            float(-(mass * (self.rows[:, 2:5] @ self.gravity)).sum()),
        )

    def count_of(self) -> int:
        """Particles."""
        return len(self.rows)

    def plane_of(self, name: str) -> tuple[Array, Array]:
        """Normal of a plane, shape (3,), and its velocity, spin and centre, shape (9,)."""
        return self.planes[name]
