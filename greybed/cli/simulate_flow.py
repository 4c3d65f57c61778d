"""``greybed simulate`` of flows on a grid: gas alone, and gas and solids as two fluids."""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

from greybed.core.errors import InputError

CHECKPOINT = "checkpoint.npz"
TICKS = 1000  # of the progress bar


def run_flow(options: argparse.Namespace, kind: str) -> int:
    """Run the case of the kind ``two-fluid`` or ``gas`` that ``options`` name; returns 0."""
    from greybed.core.files import sha256_of, write_summary
    from greybed.core.folder_lock import locked_folder
    from greybed.core.progress import progress
    from greybed.core.writers.history import write_history
    from greybed.coupling.flow_run import FlowRun

    case, flow, names = _made(options, kind)
    key = sha256_of(options.case)
    with locked_folder(options.out) as folder:
        checkpoint = folder / CHECKPOINT
        run = FlowRun(case, flow)
        found = flow.steps if run.restore(checkpoint, key) else 0
        frames = _Frames(run, folder, options.movie, names[0])
        begin, at_start = time.perf_counter(), flow.steps
        with progress(TICKS, "time", show=not options.quiet) as advance:
            shown = 0

            def tick() -> None:
                nonlocal shown
                now = int(TICKS * flow.time / case.duration)
                advance(now - shown)
                shown = now

            tick()
            if not found:
                frames.clear()
                frames.write()
                run.save(checkpoint, key)
            try:
                for framed, due in run.go_on(tick):
                    if framed:
                        frames.write()
                    if due:
                        run.save(checkpoint, key)
                        write_history(folder / "history.csv", run.history)
            except InputError as error:
                said = str(error).removesuffix(".")
                raise InputError(
                    f"{options.case}: {said}; the last good state is in {checkpoint}."
                ) from None
        seconds, steps = time.perf_counter() - begin, flow.steps - at_start
        run.save(checkpoint, key)
        write_history(folder / "history.csv", run.history)
        cells = case.grid.grid.shape[0] * case.grid.grid.shape[1] * case.grid.grid.shape[2]
        results: dict[str, Any] = {
            "simulated_s": flow.time,
            "steps": flow.steps,
            "cells": cells,
            **flow.results(),
            "steps_found_from_stopped_run": found,
            "seconds": seconds,
            "cell_steps_per_second": cells * steps / seconds if steps else None,
        }
        frames.finish()
        _draw(folder, run, names)
        summary = write_summary(folder, "simulate", results, options.case, seed=case.seed)
    _say(results, found, folder)
    print(f"wrote {summary}")
    return 0


def _made(options: argparse.Namespace, kind: str) -> tuple[Any, Any, tuple[str, ...]]:
    """Case, its flow at the start, and the fields to draw."""
    try:
        if kind == "two-fluid":
            from greybed.coupling.two_fluid_case import TwoFluidRun, load_two_fluid_case

            case: Any = load_two_fluid_case(options.case)
            return case, TwoFluidRun(case), ("solid fraction [-]",)
        from greybed.coupling.gas_case import GasRun, load_gas_case

        case = load_gas_case(options.case)
        names = ("speed [m/s]", *(("temperature [K]",) if case.warm else ()))
        return case, GasRun(case), names
    except InputError as error:
        said = str(error)
        if said.startswith(str(options.case)):
            raise
        raise InputError(f"{options.case}: {said}") from None


class _Frames:
    """Frames of a flow as parts of one VTKHDF file, and as pictures for a film."""

    def __init__(self, run: Any, folder: Path, movie: bool, drawn: str) -> None:
        self.run, self.folder, self.movie, self.drawn = run, folder / "frames", movie, drawn

    def clear(self) -> None:
        """Take away frames of an older run in the same folder."""
        for old in self.folder.glob("frame_*"):
            old.unlink()

    def write(self) -> None:
        """Keep the frame of now."""
        if self.run.case.output.frames is None:
            return
        from greybed.core.writers.vtkhdf_grid import write_grid_part

        self.folder.mkdir(exist_ok=True)
        flow, name = self.run.flow, f"frame_{self.run.done:06d}"
        fields = flow.fields()
        write_grid_part(self.folder / f"{name}.npz", fields, flow.time)
        if self.movie:
            from greybed.report.fields import field_picture

            grid = self.run.case.grid.grid
            field_picture(
                self.folder / f"{name}.png", fields[self.drawn], grid.lower, grid.upper,
                self.drawn, flow.limits(self.drawn), f"{flow.time:.3f} s",
            )  # fmt: skip

    def finish(self) -> None:
        """Join the parts, which stay until the file is there, and the film."""
        from greybed.core.writers.vtkhdf_grid import join_grid_parts

        grid = self.run.case.grid.grid
        parts = sorted(self.folder.glob("frame_*.npz"))
        if parts:
            join_grid_parts(
                self.folder.parent / "frames.vtkhdf", parts, grid.cells, grid.lower, grid.spacing
            )
        for part in parts:
            part.unlink()
        pictures = sorted(self.folder.glob("frame_*.png"))
        if self.movie and pictures:
            from greybed.report.particles import write_film

            write_film(self.folder.parent / "movie.gif", pictures, 6.0)


def _draw(folder: Path, run: Any, names: tuple[str, ...]) -> None:
    """A picture of the end, and plots of the history."""
    from greybed.report.fields import field_picture, write_flow_history

    grid, fields = run.case.grid.grid, run.flow.fields()
    for number, name in enumerate(names):
        file = "final.png" if number == 0 else f"final_{name.split(' ')[0]}.png"
        field_picture(
            folder / file, fields[name], grid.lower, grid.upper, name, run.flow.limits(name),
            f"{run.flow.time:.3f} s",
        )  # fmt: skip
    write_flow_history(folder / "history.png", run.history)


def _say(results: dict[str, Any], found: int, folder: Path) -> None:
    if found:
        print(f"went on from a stopped run at step {found}")
    rate = results["cell_steps_per_second"]
    print(
        f"{results['cells']} cells after {results['simulated_s']:.4g} s ({results['steps']} steps"
        + (f", {1e-6 * rate:.3f} million cell steps per second)" if rate else ")")
    )
    for key, value in results.items():
        if key.startswith(("mean_", "solids_mass", "pressure_drop", "outflow")):
            shown = value if isinstance(value, list) else [value]
            print(f"{key}: " + ", ".join(f"{v:.6g}" for v in shown))
    print(f"results in {folder}")
