"""``greybed simulate --engine liggghts|lammps``: the same case and results, moved by them."""

from __future__ import annotations

import argparse
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from greybed.cli.simulate_particles import (
    CHECKPOINT,
    Frames,
    files_of,
    say,
    write_results,
)


def run_engine(options: argparse.Namespace) -> int:
    """Run the case that ``options`` names; returns 0."""
    from greybed.core.errors import InputError
    from greybed.core.folder_lock import locked_folder
    from greybed.core.progress import progress
    from greybed.core.readers import read_packing
    from greybed.core.writers.history import write_history
    from greybed.dem.case import load_particle_case
    from greybed.dem.liggghts.run import LiggghtsRun, loops

    if options.threads is not None:
        raise InputError("--threads is for --engine greybed only; take --ranks, or leave it out.")
    if options.fix and options.plugin is None:
        raise InputError("--fix needs the plugin that has it; give --plugin FILE, or leave it out.")
    case = load_particle_case(options.case)
    files, inputs = files_of(case, options.case)
    ranks = 1 if options.ranks is None else options.ranks
    with locked_folder(options.out) as folder, _ended_by_signal():
        packings = {k: read_packing(path) for k, path in files.items()}
        try:
            work = folder / options.engine
            engine: type[LiggghtsRun] = LiggghtsRun
            if options.engine == "lammps":
                from greybed.dem.lammps import LammpsRun as engine
            run = engine(
                case, packings, work, ranks=ranks, plugin=options.plugin,
                fixes=tuple(options.fix),
            )  # fmt: skip
            # A checkpoint of our own engine in this folder is of other results.
            (folder / CHECKPOINT).unlink(missing_ok=True)
            frames = Frames(run, folder, options.movie)
            frames.clear()
            begin, moved, count = time.perf_counter(), 0, len(run.simulation.rows)
            with progress(run.steps, "time steps", show=not options.quiet) as advance:
                for done in run.go_on(advance):
                    moved += done * count
                    count = len(run.simulation.rows)
                    step = run.simulation.steps
                    if step == 0 or frames.due(step, done):
                        frames.write()
                    write_history(folder / "history.csv", run.tally.history)
        except InputError as error:
            raise InputError(f"{options.case}: {error}") from None
        seconds = time.perf_counter() - begin
        results = _results(run, moved, seconds, loops(work / run.log_name))
        summary = write_results(folder, run, frames, results, inputs)
    say(results, folder)
    print(f"wrote {summary}")
    return 0


def _results(run: Any, moved: int, seconds: float, in_loops: float) -> dict[str, Any]:
    from greybed.dem.results import results_of

    return {
        **results_of(run),
        "engine": run.engine.lower(),
        "engine_version": run.version,
        "ranks": run.ranks,
        "seconds": seconds,
        "seconds_in_loops": in_loops,
        "particle_steps_per_second": moved / seconds if moved else None,
    }


@contextmanager
def _ended_by_signal() -> Iterator[None]:
    """Let SIGTERM end us in order, so that the engine does not stay behind."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, lambda number, _: sys.exit(128 + number))
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
