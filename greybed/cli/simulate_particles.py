"""``greybed simulate`` of particles: progress, frames, checkpoints, history and summary."""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from greybed.core.packing import Packing
    from greybed.dem.case import ParticleCase
    from greybed.dem.samples import Run

CHECKPOINT = "checkpoint.npz"


def run_particles(options: argparse.Namespace, *, gas: bool = False) -> int:
    """Run the case that ``options`` names, from its checkpoint if there is one; returns 0.

    With ``gas`` it is one of particles in a gas.
    """
    from greybed.core.errors import InputError
    from greybed.core.files import sha256_of
    from greybed.core.folder_lock import locked_folder
    from greybed.core.progress import progress
    from greybed.core.readers import read_packing
    from greybed.core.writers.history import write_history
    from greybed.dem.case import load_particle_case
    from greybed.dem.checkpoint import kept_with
    from greybed.dem.results import results_of
    from greybed.dem.runner import ParticleRun

    case: Any
    kind: Any
    if gas:
        from greybed.cli.gas_frames import GasFrames
        from greybed.coupling.gas_particles_case import load_gas_particles_case
        from greybed.coupling.gas_particles_run import GasParticlesRun

        case, kind = load_gas_particles_case(options.case), GasParticlesRun
        shown: type[Frames] = GasFrames
    else:
        case, kind, shown = load_particle_case(options.case), ParticleRun, Frames
    files, inputs = files_of(case, options.case)
    key = "".join(sha256_of(path) for path in inputs)
    with locked_folder(options.out) as folder:
        checkpoint = folder / CHECKPOINT
        packings = {k: read_packing(path) for k, path in files.items()}
        try:
            run = kind(case, packings, threads=options.threads)
        except InputError as error:
            raise InputError(f"{options.case}: {error}") from None
        found = 0
        kept = kept_with(checkpoint)
        if kept is not None and kept.get("key") == key:
            run.restore(checkpoint)
            found = run.simulation.steps
        frames = shown(run, folder, options.movie)
        every = case.output.checkpoints or 0.1 * case.duration
        apart = max(1, round(every / run.simulation.time_step))
        begin, moved = time.perf_counter(), 0
        gas_steps = run.totals["gas steps"] if gas else 0
        with progress(run.steps, "time steps", show=not options.quiet) as advance:
            advance(found)
            if not found:
                frames.clear()
                frames.write()
                # A run that fails at once leaves a state, too.
                run.save(checkpoint, key=key)
            try:
                for done in run.go_on():
                    moved += done * len(run.simulation.radii)
                    step = run.simulation.steps
                    if frames.due(step, done):
                        frames.write()
                    if step // apart > (step - done) // apart or step == run.steps:
                        run.save(checkpoint, key=key)
                        write_history(folder / "history.csv", run.tally.history)
                    advance(done)
            except KeyboardInterrupt:
                if not run.simulation._pending:
                    run.save(checkpoint, key=key)
                raise
            except InputError as error:
                said = str(error).removesuffix(".")
                raise InputError(
                    f"{options.case}: {said}; the last good state is in {checkpoint}."
                ) from None
        seconds = time.perf_counter() - begin
        results: dict[str, Any] = {
            **results_of(run),
            **(run.gas_results() if gas else {}),
            "steps_found_from_stopped_run": found,
            "seconds": seconds,
            "particle_steps_per_second": moved / seconds if moved else None,
            "threads": run.simulation.threads,
        }
        if gas:
            rate = results["gas"]["cells"] * (run.totals["gas steps"] - gas_steps) / seconds
            results["cell_steps_per_second"] = rate or None
        summary = write_results(folder, run, frames, results, inputs)
    if found:
        print(f"went on from a stopped run at step {found}")
    say(results, folder)
    print(f"wrote {summary}")
    return 0


def files_of(case: ParticleCase, path: Path) -> tuple[dict[int, Path], list[Path]]:
    """Files of particles by the numbers of their tables, and all files that a case reads."""
    from greybed.dem.case_tables import FileTable

    files = {k: t.file for k, t in enumerate(case.particles) if isinstance(t, FileTable)}
    parts = [part.file for part in (*case.wall, *case.shape) if hasattr(part, "file")]
    return files, [path, *files.values(), *parts]


def write_results(
    folder: Path, run: Run, frames: Frames, results: dict[str, Any], inputs: list[Path]
) -> Path:
    """Write history, end, collection of frames, pictures, film and summary of any engine."""
    from greybed.core.files import write_summary
    from greybed.core.writers import write_packing
    from greybed.core.writers.history import write_history

    write_history(folder / "history.csv", run.tally.history)
    final = frames.packing()
    write_packing(final, folder / "final.h5")
    write_packing(final, folder / "final.vtu", fields=frames.fields())
    frames.finish()
    _draw(folder, run, frames)
    return write_summary(folder, "simulate", results, *inputs, seed=run.case.seed)


class Frames:
    """Frames of a run as VTU files with a ParaView collection, and as pictures for a film."""

    def __init__(self, run: Run, folder: Path, movie: bool) -> None:
        self.run, self.folder, self.movie = run, folder / "frames", movie
        every = run.case.output.frames
        self.every = None if every is None else max(1, round(every / run.simulation.time_step))
        self.stage: Any = None

    def due(self, step: int, done: int) -> bool:
        """Whether a frame belongs to the stretch that has just been run."""
        return self.every is not None and step // self.every > (step - done) // self.every

    def packing(self) -> Packing:
        """The particles as a packing."""
        from greybed.core.packing import Packing

        sim = self.run.simulation
        return Packing(sim.centres, sim.radii, source=f"step {sim.steps}")

    def fields(self) -> dict[str, Any]:
        """Numbers of each particle, for a frame."""
        import numpy as np

        sim = self.run.simulation
        heat = self.run.heat
        return {
            **({} if heat is None else {"temperature [K]": heat.temperatures}),
            "velocity [m/s]": sim.velocities,
            "spin [rad/s]": sim.spins,
            "speed [m/s]": np.sqrt((sim.velocities**2).sum(axis=1)),
            "label": sim.labels.astype(np.float64),
            "material": sim.kinds.astype(np.float64),
            "body": sim.body_of.astype(np.float64),
        }

    def clear(self) -> None:
        """Take away frames of an older run in the same folder."""
        for old in self.folder.glob("frame_*"):
            old.unlink()

    def write(self) -> None:
        """Write the frame of now."""
        if self.every is None:
            return
        from greybed.core.writers import write_packing
        from greybed.core.writers.vtkhdf import write_part

        self.folder.mkdir(exist_ok=True)
        sim = self.run.simulation
        name = f"frame_{sim.steps:010d}"
        if self.run.case.output.format == "vtkhdf":
            write_part(self.folder / f"{name}.npz", self.packing(), self.fields(), sim.time)
        else:
            write_packing(self.packing(), self.folder / f"{name}.vtu", fields=self.fields())
        if self.movie:
            from greybed.report.particles import frame_picture, write_frame

            picture = frame_picture(self.packing(), self.values(), self._stage(), self.limits())
            write_frame(self.folder / f"{name}.png", picture)

    def finish(self) -> None:
        """Write the collection of all frames, and the film."""
        if self.every is None:
            return
        if self.run.case.output.format == "vtkhdf":
            self._join()
        else:
            self._collect()
        pictures = sorted(self.folder.glob("frame_*.png"))
        if self.movie and pictures:
            from greybed.report.particles import write_film

            write_film(self.folder.parent / "movie.gif", pictures, 6.0)

    def _collect(self) -> None:
        """One page that lists the VTU files."""
        from greybed.core.files import atomic_path

        dt = self.run.simulation.time_step
        frames = sorted(self.folder.glob("frame_*.vtu"))
        rows = "".join(
            f'<DataSet timestep="{int(f.stem[6:]) * dt:.9g}" file="frames/{f.name}"/>\n'
            for f in frames
        )
        with atomic_path(self.folder.parent / "frames.pvd") as part:
            part.write_text(
                '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n<Collection>\n'
                f"{rows}</Collection>\n</VTKFile>\n"
            )

    def _join(self) -> None:
        """One VTKHDF file of all parts, which go; where they have gone before, it is there."""
        from greybed.core.writers.vtkhdf import join_parts

        parts = sorted(self.folder.glob("frame_*.npz"))
        if parts:
            join_parts(self.folder.parent / "frames.vtkhdf", parts)
        for part in parts:
            part.unlink()

    def values(self) -> Any:
        """What pictures are coloured by: the temperature where there is one, or the material."""
        sim = self.run.simulation
        if self.run.heat is not None:
            return self.run.heat.temperatures
        if len(set(sim.kinds.tolist())) > 1:
            return sim.kinds
        # By the label: one sees what was where at the start.
        return sim.labels

    def limits(self) -> tuple[float, float]:
        """What the colours of pictures range over."""
        values = self.values()
        if (case := self.run.case).heat is not None:
            tables = (*case.wall, *case.particles, case.heat)
            known = [t.temperature for t in tables if t.temperature is not None]
            return min(known), max(*known, min(known) + 1.0)
        return float(min(values.min(), 0)), float(max(values.max(), 1))

    def _stage(self) -> Any:
        """The same box for all frames: what particles have filled, or will be put into."""
        import numpy as np

        from greybed.dem.case_tables import FileTable

        if self.stage is None:
            sim, case = self.run.simulation, self.run.case
            low = [(sim.centres - sim.radii[:, None]).min(axis=0)]
            high = [(sim.centres + sim.radii[:, None]).max(axis=0)]
            for table in case.particles:
                if not isinstance(table, FileTable):
                    low.append(np.array(table.lower))
                    high.append(np.array(table.upper))
            self.stage = [np.min(low, axis=0), np.max(high, axis=0)]
        return self.stage


def _draw(folder: Path, run: Run, frames: Frames) -> None:
    """A picture of the end, and plots of the history."""
    import numpy as np

    from greybed.report.particles import frame_picture, write_frame
    from greybed.report.particles import write_history as plot_history

    packing = frames.packing()
    x, r = packing.centres, packing.radii[:, None]
    stage = np.array([(x - r).min(axis=0), (x + r).max(axis=0)])
    picture = frame_picture(packing, frames.values(), stage, frames.limits())
    write_frame(folder / "final.png", picture)
    plot_history(folder / "history.png", run.tally.history)


def say(results: dict[str, Any], folder: Path) -> None:
    """Print what a run has come to."""
    rate = results["particle_steps_per_second"]
    print(
        f"{results['particles']} particles after {results['simulated_s']:.4g} s "
        f"({results['steps']} steps of {results['time_step_s']:.3g} s"
        + (f", {1e-6 * rate:.2f} million particle steps per second)" if rate else ")")
    )
    print(
        f"height {results['height_m']:.4g} m, coordination {results['coordination']:.2f}, kinetic "
        f"energy {results['kinetic_energy_J']:.3g} J"
    )
    for name, sink in results["sinks"].items():
        flow = sink["mass_kg_per_s"]
        print(
            f"{name}: {sink['mass_kg']:.4g} kg, {sink['particles']} particles"
            + (f", {flow:.4g} kg/s" if flow is not None else "")
        )
    for name, found_ in results["measures"].items():
        for key, value in found_.items():
            if isinstance(value, float):
                print(f"{name}: {key} {value:.4g}")
    print(f"results in {folder}")
