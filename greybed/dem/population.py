"""Particles and walls that come, move and go while a simulation runs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.core.errors import InputError
from greybed.dem import _step
from greybed.dem._rigid import Rigid
from greybed.dem.bodies import Clumps, bodies_of, no_bodies
from greybed.dem.laws import ContactLaw
from greybed.dem.materials import Material
from greybed.dem.particles import particle_arrays, rayleigh_time
from greybed.dem.views import Views
from greybed.dem.walls import SolidWall

Index = NDArray[np.int64]

# Share of Rayleigh's time above which contacts are no longer followed [-].
MOST_OF_RAYLEIGH = 0.4


class Population(Views):
    """Who takes part.

    Attributes
    ----------
    labels : ndarray of int, shape (n,)
        Number that each particle has had since it came.
    """

    labels: Index
    materials: list[Material]
    law: ContactLaw
    walls: tuple[SolidWall, ...]
    _kinds: int
    _next: int

    def insert(
        self,
        centres: ArrayLike,
        radii: ArrayLike,
        *,
        kinds: ArrayLike | None = None,
        velocities: ArrayLike | None = None,
        spins: ArrayLike | None = None,
    ) -> None:
        """Add particles that touch nothing; arguments as of the class, numbered after the others.

        Raises
        ------
        InputError
            For numbers out of range, a material that no particle had at the start, particles so
            small that the time step is too large for them, or particles that touch something.
        """
        place, motion, kind, _ = particle_arrays(
            centres, radii, self.materials, kinds, velocities, spins
        )
        m = len(place)
        self._take_in(
            _step.State(
                place, motion, np.zeros((m, 8)), kind, place[:, :3].copy(), np.zeros(m, bool),
                np.full(m, -1),
            ),
            no_bodies(),
        )  # fmt: skip

    def insert_clumps(self, clumps: Clumps) -> None:
        """Add clumps that touch nothing; their spheres are numbered after the others.

        Raises
        ------
        InputError
            As :meth:`insert`.
        """
        self._take_in(
            *bodies_of(
                [clumps], self.materials, len(self._state.place), len(self._lists.rigid.pose)
            )
        )

    def _take_in(self, more: _step.State, bodies: Rigid) -> None:
        place, kind = more.place, more.kind
        if not len(place):
            return
        if kind.max() >= self._kinds:
            raise InputError(
                f"kinds = {int(kind.max())}: particles of {self.materials[kind.max()].name!r} come "
                "later only if kinds_to_come said so."
            )
        shortest = rayleigh_time(place, kind, self.materials)
        if self.law.from_moduli and self.time_step > MOST_OF_RAYLEIGH * shortest:
            raise InputError(
                f"time_step = {self.time_step:g} [s] exceeds {MOST_OF_RAYLEIGH:g} of Rayleigh's "
                f"time {shortest:.3g} [s] of the particles to be inserted; take a smaller one."
            )
        n, m = len(self._state.place), len(place)
        self._lists.extend(self.steps, more, bodies)
        self._state = self._lists.state
        self.labels = np.concatenate([self.labels, self._next + np.arange(m)])
        self._next += m
        touching = self._lists.touching()
        new = touching[(touching >= n).any(axis=1)]
        if len(new):
            i, j = int(new[0].max()), int(new[0].min())
            at = ", ".join(f"{c:.4g}" for c in self.centres[i])
            self.remove(np.arange(n + m) >= n)
            raise InputError(
                f"step {self.steps}: the particle to be inserted at ({at}) [m] touches particle "
                f"{int(self.labels[j]) if j < n else 'beside it'}; insert where there is room."
            )

    def remove(self, which: ArrayLike) -> None:
        """Take particles out; the others are numbered anew, ``labels`` stay with them.

        Parameters
        ----------
        which : array_like of bool, shape (n,)
            Those that go, in the order of ``centres``; one must stay. The spheres of a body stay
            or go together.

        Raises
        ------
        InputError
            For another shape, if none would stay, or if a body would lose a part.
        """
        gone = np.asarray(which, dtype=bool)
        if gone.shape != (len(self._state.place),) or gone.all():
            raise InputError(
                f"which = {gone.sum()} of {gone.size} particles must be a choice from "
                f"{len(self._state.place)}, and one must stay."
            )
        rigid = self._lists.rigid
        lost = gone[self._lists.ident[rigid.member]]
        if len(lost):
            share = np.add.reduceat(lost, rigid.first[:-1], dtype=np.int64)
            torn = (share > 0) & (share < np.diff(rigid.first))
            if torn.any():
                raise InputError(
                    f"which takes {int(share[torn][0])} of {int(np.diff(rigid.first)[torn][0])} "
                    "spheres of a body away; the spheres of a body stay or go together."
                )
        if gone.any():
            self._lists.renew(self.steps, ~gone[self._lists.ident])
            self._state = self._lists.state
            self.labels = self.labels[~gone]

    def move_wall(
        self, name: str, velocity: Sequence[float] = (0, 0, 0), spin: Sequence[float] = (0, 0, 0)
    ) -> None:
        """From now on a wall moves so [m/s], [1/s].

        Raises
        ------
        InputError
            If no wall has this name.
        """
        motion = self._lists.surfaces.motion[self._wall(name)]
        motion[:3], motion[3:6] = velocity, spin
        self._lists.wall_pace = self._lists.pace()

    def drop_wall(self, name: str) -> None:
        """Take a wall away; its forces are zero from then on.

        Raises
        ------
        InputError
            If no wall has this name.
        """
        self._lists.drop_wall(self.steps, self._wall(name))
        self._state = self._lists.state

    def _wall(self, name: str) -> int:
        names = [wall.shape.name for wall in self.walls]
        if name not in names:
            raise InputError(f"no wall is called {name!r}; there are {', '.join(names) or 'none'}.")
        return names.index(name)
