"""Run of a case of particles: streams, sinks, moving walls, samples, checkpoints, in step order."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed.core.errors import InputError
from greybed.core.packing import Packing
from greybed.dem.case import ParticleCase
from greybed.dem.case_heat import heat_of, sample_of, start_of
from greybed.dem.case_tables import BoundsTable, FileTable, PackTable, StreamTable
from greybed.dem.checkpoint import restore, save
from greybed.dem.clump import Clump
from greybed.dem.coarse import coarse_case
from greybed.dem.feeding import Feed
from greybed.dem.samples import Tally, sample
from greybed.dem.simulation import Simulation

Array = NDArray[np.float64]

# Steps between two looks at streams, sinks and servo walls, where the case does not say.
LOOK = 200
# Share of its velocity that a servo wall changes by at each look.
_SERVO = 0.2


class ParticleRun:
    """A case that runs, from its start or a checkpoint.

    Parameters
    ----------
    case : ParticleCase
        The case.
    packings : mapping of table numbers to Packing
        Contents of the files that ``[[particles]]`` of kind ``file`` name.
    threads : int, optional
        Threads; they change no bit.

    Attributes
    ----------
    emptied : bool
        Whether the sinks have taken the last particles, which ends the run.

    Raises
    ------
    InputError
        For what :class:`Simulation` refuses, or a pack that finds no room.
    """

    def __init__(
        self, case: ParticleCase, packings: dict[int, Packing], *, threads: int | None = None
    ) -> None:
        self.case = case = coarse_case(case)
        tables, walls = case.particles, case.wall
        self.tally = Tally(
            [0.0] * len(tables), [0] * len(tables), [0] * len(tables),
            [0.0] * len(case.sink), [0] * len(case.sink), [1.0] * len(walls),
        )  # fmt: skip
        # Materials of particles first: they may be those of walls, too.
        used = {table.material for table in tables}
        ordered = sorted(case.material, key=lambda m: m.name not in used)
        self._materials = [m.material for m in ordered]
        self._names = [m.name for m in ordered]
        self.feed = Feed(
            case, packings, self._materials,
            self.tally.streamed, self.tally.inserted, self.tally.batches,
        )  # fmt: skip
        step = case.time_step
        if step is None and case.contact_law.from_moduli:
            step = 0.1 * self.feed.shortest_time()
        batches = self.feed.at_start()
        spheres = [batch for batch in batches if batch.shape is None]
        x = np.concatenate([np.empty((0, 3)), *(batch.centres for batch in spheres)])
        r = np.concatenate([np.empty(0), *(batch.radii for batch in spheres)])
        kind = np.concatenate(
            [np.empty(0, np.int64), *(np.full(len(b.radii), b.kind) for b in spheres)]
        )
        v = np.concatenate(
            [np.empty((0, 3)), *(np.tile(b.velocity, (len(b.radii), 1)) for b in spheres)]
        )
        periodic = case.periodic
        self.simulation = Simulation(
            x, r, self._materials, case.contacts(used), kinds=kind, kinds_to_come=len(used),
            law=case.contact_law, walls=case.walls, gravity=case.gravity, time_step=step,
            velocities=v, clumps=[batch.clumps for batch in batches if batch.shape is not None],
            most_overlap=case.most_overlap, threads=threads, skin=case.skin,
            box=None if periodic is None else [periodic.lower, periodic.upper],
            periodic=(False,) * 3 if periodic is None
            else ("x" in periodic.axes, "y" in periodic.axes, "z" in periodic.axes),
        )  # fmt: skip
        dt = self.simulation.time_step
        self.steps = max(1, round(case.duration / dt))
        self.look = LOOK if case.look is None else max(1, round(case.look / dt))
        self._sample = max(1, round(case.output.samples / dt))
        self.emptied = False
        counts = [
            len(packings[k]) if isinstance(table, FileTable) else self.tally.inserted[k]
            for k, table in enumerate(tables)
        ]
        self.heat = heat_of(case, self.simulation, self._names, counts)
        if not self.tally.history:
            self._note()

    @property
    def shapes(self) -> dict[str, Clump]:
        """Shapes of clumps, by name."""
        return self.feed.shapes

    # -- time -------------------------------------------------------------------------------

    def go_on(self, until: int | None = None) -> Iterator[int]:
        """Run to the end, or to a step; yields after each stretch the steps done in it."""
        sim = self.simulation
        end = self.steps if until is None else min(until, self.steps)
        while sim.steps < end:
            before = sim.steps
            self._warm()
            self._events(before)
            if self.emptied:
                self._note()
                return
            stop = min(end, (before // self.look + 1) * self.look)
            stop = min(stop, (before // self._sample + 1) * self._sample)
            self._move(stop - before)
            self._warm()
            if sim.steps % self._sample == 0 or sim.steps == self.steps:
                self._note()
            yield sim.steps - before

    def _move(self, steps: int) -> None:
        """Let the particles run; what else moves with them is the affair of other runs."""
        self.simulation.run(steps)

    def _warm(self) -> None:
        """Let heat catch up, at looks and at the end only: a stop between them changes no bit."""
        steps = self.simulation.steps
        if self.heat is not None and (steps % self.look == 0 or steps == self.steps):
            self.heat.catch_up()

    def _events(self, step: int) -> None:
        """What begins, comes or goes at this step."""
        sim, case, dt = self.simulation, self.case, self.simulation.time_step

        def now(time: float) -> bool:
            # The first look at or after the time.
            return 0 <= step - math.ceil(time / dt - 1e-9) < self.look and step % self.look == 0

        for k, wall in enumerate(case.wall):
            if now(wall.removed):
                sim.drop_wall(wall.name)
            if step > 0 and now(wall.starts):
                sim.move_wall(wall.name, wall.velocity, wall.spin)
            if now(wall.stops):
                sim.move_wall(wall.name)
            elif wall.servo is not None and wall.starts <= sim.time < wall.stops:
                # At looks only, not where a run was stopped, too: that must change no bit.
                self._servo(k, step)
        if step % self.look:
            return
        self._sink()
        if case.bounds is not None:
            self._check_bounds(case.bounds)
        if step == 0:
            return
        for number, table in enumerate(case.particles):
            owes = isinstance(table, StreamTable) and self.feed.owes(number, table, sim.time)
            if owes or (isinstance(table, PackTable) and table.at > 0.0 and now(table.at)):
                assert not isinstance(table, FileTable)
                self.feed.drawn(number, table, sim.centres, sim.radii, sim.time).enter(sim)
                if self.heat is not None:
                    self.heat.arrive(start_of(case, number))

    def _servo(self, k: int, step: int) -> None:
        """Turn a wall's speed towards where its force is the wanted one."""
        wall, tally = self.case.wall[k], self.tally
        assert wall.servo is not None
        speed = np.linalg.norm(wall.velocity)
        if speed == 0.0 or step % self.look:
            return
        along = np.array(wall.velocity) / speed
        # What the particles push back with, over what is wanted.
        push = -float(self.simulation.wall_forces[k] @ along) / wall.servo
        wanted = float(np.clip(1.0 - push, -1.0, 1.0))
        tally.servo[k] += _SERVO * (wanted - tally.servo[k])
        share = tally.servo[k]
        self.simulation.move_wall(wall.name, tuple(share * v for v in wall.velocity))

    def _check_bounds(self, bounds: BoundsTable) -> None:
        sim = self.simulation
        x = sim.centres
        out = ((x < np.array(bounds.lower)) | (x > np.array(bounds.upper))).any(axis=1)
        if out.any():
            who = int(out.argmax())
            place = ", ".join(f"{c:.4g}" for c in x[who])
            raise InputError(
                f"step {sim.steps}: particle {int(sim.labels[who])} is at ({place}) [m], outside "
                "the bounds; close the walls, check that none is passed, or put a [[sink]] there."
            )

    def _sink(self) -> None:
        sim = self.simulation
        for k, sink in enumerate(self.case.sink):
            x = sim.anchors
            inside = np.all((x > np.array(sink.lower)) & (x < np.array(sink.upper)), axis=1)
            if not inside.any():
                continue
            self.tally.sunk[k] += float(sim.masses[inside].sum())
            self.tally.taken[k] += sim.count_of(inside)
            if inside.all():
                # A simulation cannot be empty: the run is over, with these as they are.
                self.emptied = True
                return
            sim.remove(inside)

    def _note(self) -> None:
        """A sample of the history."""
        row = sample(self.case, self.simulation, self.tally)
        if self.heat is not None:
            row |= sample_of(self.case, self.heat)
        self.tally.history.append(row)

    # -- files ------------------------------------------------------------------------------

    def save(self, path: str | os.PathLike[str], **extra: Any) -> Path:
        """Write a checkpoint, with the tallies and what else is given."""
        return save(self.simulation, path, beside=self._beside(), tally=vars(self.tally), **extra)

    def _beside(self) -> dict[str, NDArray[Any]]:
        """Arrays that go into a checkpoint beside the particles."""
        return {} if self.heat is None else dict(self.heat.state())

    def _take_up(self, beside: dict[str, NDArray[Any]]) -> None:
        """Take up what :meth:`_beside` has given."""
        if self.heat is not None:
            self.heat.go_back(beside)

    def restore(self, path: str | os.PathLike[str]) -> dict[str, Any]:
        """Go back to a checkpoint; returns what else was given to :meth:`save`."""
        extra = restore(self.simulation, path)
        self.tally = Tally(**extra.pop("tally"))
        self.feed.streamed, self.feed.inserted = self.tally.streamed, self.tally.inserted
        self.feed.batches = self.tally.batches
        self._take_up(extra.pop("beside", {}))
        return extra


Progress = Callable[[int], object]
