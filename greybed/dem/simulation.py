"""Simulation of particles in contact: state, time steps, what comes out."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.core.errors import InputError
from greybed.core.processors import available_threads
from greybed.dem import _cohesion, _columns, _step
from greybed.dem.bodies import Clumps, bodies_of, joined_states
from greybed.dem.crew import run_steps
from greybed.dem.laws import COHESION, NORMAL, ROLLING, ContactLaw
from greybed.dem.lists import Lists
from greybed.dem.materials import Contact, Material, pair_tables
from greybed.dem.particles import particle_arrays, rayleigh_time
from greybed.dem.population import MOST_OF_RAYLEIGH, Population
from greybed.dem.skin import LOOK, TOO_WIDE
from greybed.dem.walls import SolidWall, surfaces_of

Array = NDArray[np.float64]
Index = NDArray[np.int64]

GRAVITY = (0.0, 0.0, -9.81)


class Simulation(Population):
    """Spheres that collide, roll and stick, between walls, under gravity.

    Parameters
    ----------
    centres : array_like, shape (n, 3)
        Centres [m].
    radii : array_like, shape (n,) or number
        Radii, above 0 [m].
    materials : sequence of Material, or Material
        Of particles and walls, with different names.
    contacts : mapping or Contact
        By pairs of names, ``{("glass", "steel"): Contact(0.9, 0.3)}``; one for all.
    kinds : array_like of int, shape (n,), optional
        Number of each particle's material; the first by default.
    kinds_to_come : int
        Materials up to this number may be those of particles inserted later.
    law : ContactLaw
        Contact laws.
    walls : sequence of SolidWall
        Walls.
    box : array_like, shape (2, 3), optional
        Lower and upper corner, for the periodic directions [m].
    periodic : three bools
        Directions that repeat; the box must hold three cells of a diameter and the skin there.
    gravity : three floats
        Acceleration [m/s2].
    time_step : float, optional
        At most 40 % of Rayleigh's time, a tenth of it by default; linear laws must state one [s].
    velocities, spins : array_like, shape (n, 3), optional
        At the start, 0 by default [m/s], [1/s].
    clumps : sequence of Clumps
        Rigid bodies. Their spheres are numbered after the others, of which there may be none then.
    skin : float, optional
        Pairs nearer than it are listed [m]; by default it follows the speed of the particles.
    most_overlap : float
        Overlap over the smaller radius at which a run stops [-].
    threads : int, optional
        Threads; all available ones by default. They change no bit.

    Raises
    ------
    InputError
        For numbers out of range, a pair of materials without contact, a time step too large, or
        particles that overlap deeply.

    Notes
    -----
    Velocity Verlet of second order; spins likewise. Forces see velocities half a step on, as in
    LAMMPS and LIGGGHTS: with damping the order is one.
    """

    def __init__(
        self,
        centres: ArrayLike,
        radii: ArrayLike,
        materials: Sequence[Material] | Material,
        contacts: Mapping[tuple[str, str], Contact] | Contact,
        *,
        kinds: ArrayLike | None = None,
        kinds_to_come: int = 1,
        law: ContactLaw | None = None,
        walls: Sequence[SolidWall] = (),
        box: ArrayLike | None = None,
        periodic: tuple[bool, bool, bool] = (False, False, False),
        gravity: Sequence[float] = GRAVITY,
        time_step: float | None = None,
        velocities: ArrayLike | None = None,
        spins: ArrayLike | None = None,
        clumps: Sequence[Clumps] = (),
        skin: float | None = None,
        most_overlap: float = 0.3,
        threads: int | None = None,
    ) -> None:
        place, motion, kind, known = particle_arrays(
            centres, radii, materials, kinds, velocities, spins, least=0 if clumps else 1
        )
        n = len(place)
        more, rigid = bodies_of(clumps, known, n, 0)
        state = joined_states([
            _step.State(
                place, motion, np.zeros((n, 8)), kind, place[:, :3].copy(), np.zeros(n, bool),
                np.full(n, -1),
            ),
            more,
        ])  # fmt: skip
        place, kind, n = state.place, state.kind, len(state.place)
        self.law = law or ContactLaw()
        self.most_overlap = most_overlap
        self.walls = tuple(walls)
        self.materials = known
        names = [material.name for material in known]
        of_walls = []
        for wall in walls:
            name = names[0] if wall.material is None else wall.material
            if name not in names:
                raise InputError(
                    f"wall {wall.shape.name!r}: no material is called {name!r}; there are "
                    f"{', '.join(names)}."
                )
            of_walls.append(names.index(name))
        self._kinds = max(int(kind.max()) + 1, int(kinds_to_come))
        self._law = self._tables(contacts, self._kinds, of_walls)
        self._rayleigh = rayleigh_time(place, kind, known)
        self.time_step = self._checked_step(time_step)
        self.gravity = np.array(gravity, dtype=np.float64)
        if self.gravity.shape != (3,) or not np.isfinite(self.gravity).all():
            raise InputError(f"gravity = {gravity} must be three finite numbers [m/s2].")
        self._state = state
        reach = self._reach(float(place[:, 3].max()))
        self._lists = Lists(
            self._state,
            rigid,
            surfaces_of(walls),
            np.array(of_walls, np.int64),
            self.law.columns,
            box,
            periodic,
            None if skin is None else float(skin),
            reach,
        )
        most = int(numba.config.NUMBA_NUM_THREADS)
        self.threads = min(available_threads(), most) if threads is None else int(threads)
        if not 1 <= self.threads <= most:
            raise InputError(f"threads = {self.threads} must lie in 1 ... {most}.")
        self._lists.threads = self.threads
        self.steps = 0
        self.labels = np.arange(n)
        self._next = n
        self._pending = False
        self._lists.renew(0)
        self._state = self._lists.state
        # No time has passed yet: a spring stretched now would count its first step twice.
        self._forces(0.0)
        self._check_overlaps()
        # Loads with what came across blocks, so that the first kick of a run finds them whole.
        self._gather()

    # -- time -------------------------------------------------------------------------------

    def run(self, steps: int) -> None:
        """Go on by so many steps.

        Raises
        ------
        InputError
            If a particle is lost, or two overlap too deeply: with the particle, the place, the
            cause and the remedy. The state is then that of the last good look.
        """
        left = int(steps)
        if left < 0:
            raise InputError(f"steps = {steps} must be at least 0.")
        lists = self._lists
        while left:
            # At steps that a run in two parts meets, too: when lists are made decides the order of
            # the sums.
            before_look = LOOK - self.steps % LOOK
            done, why, who, lists.wall_way = self._work(_step.STEPS, min(left, before_look))
            self.steps += done
            left -= done
            self._pending = self._pending or done > 0
            if why == _step.LOST:
                self._raise_lost(who)
            if why == _step.RENEW:
                # In the middle of a step: the way is done, the forces are not.
                self._check_speeds()
                lists.skin = lists.fitting_skin(self.steps + 1)
                lists.renew(self.steps + 1)
                self._state = lists.state
                self._forces(self.time_step)
                self.steps += 1
                left -= 1
                self._pending = True
                self._check_overlaps()
            elif done == before_look:
                self._thin_skin()
        if self._pending:
            self._work(_step.FINISH, 1)
            self._pending = False
        self._check_overlaps()

    def _thin_skin(self) -> None:
        """Lists of nearer pairs, where particles have become slow enough for that."""
        lists = self._lists
        skin = lists.fitting_skin(self.steps)
        if skin > TOO_WIDE * lists.skin:
            return
        self._check_overlaps()  # it names a pair by its place in the list
        self._gather()
        lists.skin = skin
        lists.renew(self.steps)
        self._state = lists.state

    def push(self, forces: ArrayLike, torques: ArrayLike | None = None) -> None:
        """Push the particles from without, until the next call, besides contacts and gravity.

        Over a run of N steps a push gives N time steps times its force, whatever the contacts do.

        Parameters
        ----------
        forces : array_like, shape (n, 3)
            Forces through the centres, in the order of the input [N].
        torques : array_like, shape (n, 3), optional
            Torques about the centres, 0 by default [N m].

        Raises
        ------
        InputError
            If they are not finite, or not one for each particle.
        """
        n = len(self._state.place)
        given = {}
        for name, values in (("forces", forces), ("torques", torques)):
            given[name] = np.ascontiguousarray(
                np.zeros((0, 3)) if values is None else values, np.float64
            )
            shape = given[name].shape
            if values is not None and (shape != (n, 3) or not np.isfinite(given[name]).all()):
                raise InputError(f"{name} of shape {shape} must be ({n}, 3), all finite.")
        self._push(given["forces"], given["torques"], self._lists.ident)

    def _push_in_place(self, forces: NDArray[np.float64]) -> None:
        """The same with finite forces (n, 3) in the order of the particles' places."""
        self._push(forces, np.zeros((0, 3)), np.arange(len(forces)))

    def _push(
        self, forces: NDArray[np.float64], torques: NDArray[np.float64], rows: NDArray[np.int64]
    ) -> None:
        outer = np.empty((len(rows), 6))
        # The next half kick is with the loads of now.
        _step.push(forces, torques, rows, self._state.outer, outer, self._state.load)
        self._state = self._lists.state = self._state._replace(outer=outer)

    # -- inside -----------------------------------------------------------------------------

    def _tables(
        self,
        contacts: Mapping[tuple[str, str], Contact] | Contact,
        particles: int,
        of_walls: list[int],
    ) -> _step.Law:
        law = self.law
        row, table = pair_tables(self.materials, contacts, law, particles, set(of_walls))
        return _step.Law(
            NORMAL[law.normal], ROLLING[law.rolling], COHESION[law.cohesion], law.limit_force,
            row, table,
        )  # fmt: skip

    def _reach(self, largest: float) -> float:
        """Gap across which two particles may pull at each other [m]."""
        table = self._law.table
        if self.law.cohesion in ("van-der-waals", "liquid-bridge"):
            return float(table[:, _columns.REACH].max())
        if self.law.cohesion == "jkr":  # the widest neck is that of the largest one on a wall
            return max(_cohesion.neck(largest, table, p) for p in range(len(table)))
        return 0.0

    def _checked_step(self, time_step: float | None) -> float:
        if time_step is None:
            if not self.law.from_moduli:
                raise InputError(
                    f"the {self.law.normal} law needs time_step [s]: a thirtieth of "
                    "pi sqrt(m / stiffness) of the lightest pair."
                )
            return 0.1 * self._rayleigh
        if not (time_step > 0.0 and math.isfinite(time_step)):
            raise InputError(f"time_step = {time_step:g} [s] must be finite and above 0.")
        if self.law.from_moduli and time_step > MOST_OF_RAYLEIGH * self._rayleigh:
            raise InputError(
                f"time_step = {time_step:g} [s] exceeds {MOST_OF_RAYLEIGH:g} of Rayleigh's time "
                f"{self._rayleigh:.3g} [s]; take at most {MOST_OF_RAYLEIGH * self._rayleigh:.3g}, "
                "or softer particles."
            )
        return float(time_step)

    def _work(
        self, order: int, steps: int, time_step: float | None = None
    ) -> tuple[int, int, int, float]:
        lists = self._lists
        return run_steps(
            self.threads, order, steps, self._state, lists.near, lists.rigid, lists.surfaces,
            self._law, lists.edge, lists.wraps, self.gravity,
            self.time_step if time_step is None else time_step,
            lists.skin - lists.reach, lists.wall_pace, lists.wall_way, self._pending,
            lists.worst, lists.deepest,
        )  # fmt: skip

    def _forces(self, passed: float) -> None:
        """Forces; springs stretch by what has moved in the time that has passed [s]."""
        self._work(_step.FORCES, 1, passed)

    def _gather(self) -> None:
        _step.gather(self._state, self._lists.near)

    def _check_overlaps(self) -> None:
        deepest = self._lists.deepest
        b = int(deepest[:, 0].argmax())
        if deepest[b, 0] <= self.most_overlap:
            return
        near, ident = self._lists.near, self._lists.ident
        k = int(deepest[b, 1])
        low = int(near.owner[k])
        i, j = int(ident[low]), int(ident[near.partner[k]])
        place = ", ".join(f"{c:.4g}" for c in self._state.place[low, :3])
        raise InputError(
            f"step {self.steps}: particles {i} and {j} at ({place}) [m] overlap by "
            f"{deepest[b, 0]:.2g} of a radius, more than {self.most_overlap:g}; part them at the "
            "start, or take a smaller time step, stiffer particles or a larger most_overlap."
        )

    def _check_speeds(self) -> None:
        """No particle may pass another one or a wall within a step."""
        v, r = self._state.motion[:, :3], self._state.place[:, 3]
        speed = np.sqrt((v * v).sum(axis=1))
        who = int((speed / r).argmax())
        if speed[who] * self.time_step <= r[who]:
            return
        place = ", ".join(f"{c:.4g}" for c in self._state.place[who, :3])
        raise InputError(
            f"step {self.steps}: particle {int(self._lists.ident[who])} at ({place}) [m] moves at "
            f"{speed[who]:.3g} m/s, more than its radius {r[who]:.3g} m in a step, and could pass "
            "through others; take a smaller time step, and check its velocity and overlaps."
        )

    def _raise_lost(self, who: int) -> None:
        place = ", ".join(f"{c:.4g}" for c in self._state.place[who, :3])
        raise InputError(
            f"step {self.steps}: particle {int(self._lists.ident[who])} is at ({place}) [m], which "
            "is no place: a force is infinite or no number; take a smaller time step, and check "
            "that no two particles start in the same place."
        )
