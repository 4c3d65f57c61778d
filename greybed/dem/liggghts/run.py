"""Run of a case of particles by LIGGGHTS: deck, process, samples as they come."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from subprocess import Popen
from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed.core.errors import InputError
from greybed.core.packing import Packing
from greybed.core.walls import Plane
from greybed.dem.case import ParticleCase
from greybed.dem.clump import Clump
from greybed.dem.liggghts.deck import DECK, LOG, TOLD, Deck, deck_of
from greybed.dem.liggghts.dump import Snapshot, read_dump
from greybed.dem.liggghts.limits import check
from greybed.dem.liggghts.process import command, started
from greybed.dem.liggghts.walls import turned
from greybed.dem.runner import ParticleRun
from greybed.dem.samples import sample

Array = NDArray[np.float64]


class LiggghtsRun:
    """A case that LIGGGHTS runs; what it shows has the names of :class:`ParticleRun`.

    Parameters
    ----------
    case : ParticleCase
        The case.
    packings : mapping of table numbers to Packing
        Contents of the files that ``[[particles]]`` of kind ``file`` name.
    folder : Path
        For deck, data, meshes, dumps and LIGGGHTS' log.
    ranks : int
        MPI ranks.
    plugin : Path, optional
        Program of ``greybed host liggghts`` in place of ``liggghts``.
    fixes : sequence of str
        Its fixes, such as ``greybed/drag gas 1.2 1.8e-5 velocity 0 0 1 cell 3e-3``.

    Attributes
    ----------
    simulation : Snapshot
        The last state that has been read.
    version : str
        What LIGGGHTS calls itself; empty before the run.

    Raises
    ------
    InputError
        For what LIGGGHTS cannot do, programs that are missing, and what our own engine refuses.
    """

    heat: Any = None
    engine, deck_name, log_name, version_head = "LIGGGHTS", DECK, LOG, "LIGGGHTS ("
    dumps = ".bin"

    def __init__(
        self,
        case: ParticleCase,
        packings: dict[int, Packing],
        folder: Path,
        *,
        ranks: int = 1,
        plugin: Path | None = None,
        fixes: tuple[str, ...] = (),
    ) -> None:
        self._plugin = None if plugin is None else plugin.resolve()
        self._fixes = tuple(f"fix host_{k} all {fix}" for k, fix in enumerate(fixes))
        self.words = self._words(ranks)
        self._check(case)
        # Our own engine finds places and time step, and refuses what neither of both can run.
        start = ParticleRun(case, packings)
        self.case, self.tally, self.steps = start.case, start.tally, start.steps
        self.shapes: dict[str, Clump] = {}
        self.look, self.ranks, self.folder = start.look, ranks, folder
        self.deck = self._deck(start)
        self._sample = start._sample
        sim = start.simulation
        self._at_start = len(sim.radii)
        rows = np.column_stack(
            [
                sim.labels + 1, sim.kinds + 1, sim.centres, sim.velocities, sim.spins, sim.radii,
                sim.masses, np.zeros(len(sim.radii)),
            ]
        )  # fmt: skip
        self.simulation = Snapshot(
            0, sim.time_step, rows, sim.gravity, sim.materials, np.zeros((len(case.wall), 3)),
            self._planes(0.0),
        )  # fmt: skip
        self.tally.history.clear()
        self.emptied = False
        self.version = ""
        self._forces: dict[int, Array] = {}
        self._seen, self._left = -1, self._at_start

    def go_on(self, on_progress: Callable[[int], object] | None = None) -> Iterator[int]:
        """Run to the end; yields after each state that has been read the steps since the last one.

        Parameters
        ----------
        on_progress : callable, optional
            Called with steps done since the last call.

        Raises
        ------
        InputError
            If LIGGGHTS fails, with the last line in which it says why; or if a particle leaves the
            bounds.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        for old in self.folder.glob(f"*{self.dumps}"):
            old.unlink()
        self.deck.write(self.folder, self.deck_name)
        wanted = self._wanted()
        told, done, said, last = 0, 0, "", ""
        with self._started() as child:
            assert child.stdout is not None
            for line in child.stdout:
                step, whole = self._heard(line)
                if "ERROR" in line:
                    said = line.strip()
                elif line.strip() and step < 0:
                    last = line.strip()
                if line.startswith(self.version_head) and not self.version:
                    self.version = line.strip().removeprefix(self.version_head).rstrip(")")
                if step > told and on_progress is not None:
                    on_progress(min(step, self.steps) - told)
                    told = min(step, self.steps)
                while wanted and step >= 0 and wanted[0] < step + whole:
                    now = wanted.pop(0)
                    if self._take(now):
                        yield now - done
                        done = now
                if whole and step >= 0:
                    self._sink(line, step)
            code = child.wait()
        if code and not self._is_empty():
            raise InputError(
                f"{self.engine} stopped with exit code {code}: "
                f"{said or last or 'it said nothing'}; its log is {self.folder / self.log_name}."
            )
        yield from self._end(done)

    # -- what differs between engines -------------------------------------------------------

    def _words(self, ranks: int) -> list[str]:
        return command(ranks, DECK, LOG, "liggghts" if self._plugin is None else str(self._plugin))

    def _check(self, case: ParticleCase) -> None:
        check(case)

    def _deck(self, start: ParticleRun) -> Deck:
        return deck_of(start, self._fixes)

    def _started(self) -> AbstractContextManager[Popen[str]]:
        return started(self.words, self.folder)

    def _read(self, path: Path) -> Array:
        return read_dump(path)[1]

    # -- what is heard ----------------------------------------------------------------------

    def _heard(self, line: str) -> tuple[int, bool]:
        """Step that a line tells of, or -1, and whether it is a whole row of numbers."""
        if line.startswith(TOLD):
            return int(line.split()[-1]), False
        words = line.split()
        if len(words) != self.deck.columns or not words[0].isdigit():
            return -1, False
        try:
            numbers = [float(word) for word in words]
        except ValueError:
            return -1, False
        step = int(words[0])
        # A stretch begins with the row that the last one ended with, where forces count twice.
        if step > self._seen:
            force = np.array(numbers[2 : 2 + 3 * len(self.case.wall)]).reshape(-1, 3)
            self._forces[step] = force * self._signs()
        return step, True

    def _signs(self) -> Array:
        """LIGGGHTS tells the force on a mesh, but that of an endless wall on the particles."""
        meshes = [f"wall_{k}.stl" in self.deck.files for k in range(len(self.case.wall))]
        return np.where(meshes, 1.0, -1.0)[:, None]

    def _sink(self, line: str, step: int) -> None:
        """Count what is taken away after this row: only at looks, and once."""
        if step <= self._seen:
            return
        self._seen = step
        words = line.split()
        self._left = int(words[1])
        if step == 0 or step % self.look:
            return
        values = [float(word) for word in words[2 + 3 * len(self.case.wall) :]]
        for k in range(len(self.case.sink)):
            self.tally.sunk[k] += values[2 * k]
            self.tally.taken[k] += round(values[2 * k + 1])
            self._left -= round(values[2 * k + 1])

    def _is_empty(self) -> bool:
        return self._seen >= 0 and self._left == 0

    # -- states -----------------------------------------------------------------------------

    def _wanted(self) -> list[int]:
        """Steps of samples and frames."""
        found = set(range(0, self.steps + 1, self._sample))
        if self.deck.frames:
            found |= set(range(0, self.steps + 1, self.deck.frames))
        return sorted(found)

    def _take(self, step: int) -> bool:
        """Read the state of a step; false where there are no particles."""
        paths = [self.folder / f"{name}.{step}{self.dumps}" for name in ("sample", "frame")]
        there = [path for path in paths if path.exists()]
        if not there:
            return False
        rows = self._read(there[0])
        for path in there:
            path.unlink()
        return self._show(step, rows, note=step % self._sample == 0)

    def _show(self, step: int, rows: Array, *, note: bool) -> bool:
        if not len(rows):
            return False
        forces = self._forces.pop(step, self.simulation.wall_forces)
        self.simulation = replace(
            self.simulation, steps=step, rows=rows, wall_forces=forces,
            planes=self._planes(step * self.simulation.time_step),
        )  # fmt: skip
        self._check_bounds()
        if note:
            self._note()
        return True

    def _note(self) -> None:
        self.tally.history.append(sample(self.case, self.simulation, self.tally))

    def _end(self, done: int) -> Iterator[int]:
        """The last state, and what came in all the time."""
        path = self.folder / f"last.{self.steps}{self.dumps}"
        if path.exists():
            rows = self._read(path)
            path.unlink()
            self._show(self.steps, rows, note=self.steps % self._sample != 0)
        else:
            self.emptied = True
            self.simulation = replace(self.simulation, steps=self._seen)
            self._note()
        came = len(self.simulation.rows) * (not self.emptied) + sum(self.tally.taken)
        later = [
            k for k, t in enumerate(self.case.particles)
            if max(getattr(t, "at", 0.0), getattr(t, "rate", 0.0)) > 0.0
        ]  # fmt: skip
        if len(later) == 1:
            self.tally.inserted[later[0]] += came - self._at_start
        if self.simulation.steps > done:
            yield self.simulation.steps - done

    def _check_bounds(self) -> None:
        bounds = self.case.bounds
        if bounds is None:
            return
        x = self.simulation.centres
        out = ((x < np.array(bounds.lower)) | (x > np.array(bounds.upper))).any(axis=1)
        if out.any():
            who = int(out.argmax())
            place = ", ".join(f"{c:.4g}" for c in x[who])
            raise InputError(
                f"step {self.simulation.steps}: particle {int(self.simulation.labels[who])} is at "
                f"({place}) [m], outside the bounds; close the walls, check that none is passed, "
                "or put a [[sink]] there."
            )

    def _planes(self, time: float) -> dict[str, tuple[Array, Array]]:
        """Normals and motions of planes at a time."""
        found = {}
        for wall in self.case.wall:
            shape = wall.wall()
            if not isinstance(shape, Plane):
                continue
            spin = np.array(wall.spin)
            speed = float(np.linalg.norm(spin))
            passed = min(time, wall.stops) - wall.starts
            normal = np.array(shape.normal)
            if speed > 0.0 and passed > 0.0:
                normal = turned(normal[None], spin / speed, speed * passed)[0]
            moves = wall.starts <= time < wall.stops
            centre = shape.point if wall.centre is None else wall.centre
            rates = np.array([*wall.velocity, *wall.spin]) * float(moves)
            found[wall.name] = (normal, np.array([*rates, *centre]))
        return found


def loops(log: Path) -> float:
    """Time of all loops of a log [s]."""
    lines = log.read_text(errors="replace").splitlines()
    found = [line.split()[3] for line in lines if line.startswith("Loop time of")]
    return math.fsum(float(word) for word in found)
