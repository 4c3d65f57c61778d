"""Filtered-drag data sets are made here: case after case, kept on the way, in slices of time."""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed._version import __version__
from greybed.core.errors import InputError
from greybed.core.files import atomic_path
from greybed.core.folder_lock import sole_writer
from greybed.core.progress import progress
from greybed.datasets.drag_design import DragDesign, FlowDesign
from greybed.datasets.drag_filters import sampled
from greybed.datasets.drag_flows import GRAVITY, TwoFluidFlow, clock
from greybed.datasets.drag_particles import ParticleFlow
from greybed.datasets.filtered_drag import COLUMNS, WHOLE, DragCase, FilteredDrag

Flow = TwoFluidFlow | ParticleFlow

# Seconds between two times at which a running case is kept.
KEEP = 60.0


@dataclass(frozen=True)
class Made:
    """A finished case: its rows, the steps made, the time of the last sample [s]."""

    rows: dict[str, NDArray[np.float64]]
    steps: int
    stop: float


class OutOfTimeError(Exception):
    """The slice has ended; the case is kept."""


def _key(case: FlowDesign, design: DragDesign) -> str:
    """Hash of what decides the rows of a case."""
    text = json.dumps([asdict(case), design.filters, design.each, __version__], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def _sample(flow: Flow, case: FlowDesign, design: DragDesign, number: int) -> dict[str, Any]:
    seen = flow.look()
    parts = []
    for cells in design.filters:
        # Half of the box at most: a wider filter would see little but the mean.
        if 2 * cells <= case.narrow:
            random = np.random.default_rng([case.seed, number, cells])
            parts.append(sampled(seen, cells, design.each, random))
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _keep(
    path: Path, flow: Flow | None, samples: list[dict[str, Any]], steps: int,
    stop: float, done: bool,
) -> None:  # fmt: skip
    rows = {}
    if samples:
        rows = {f"rows_{n}": np.concatenate([s[n] for s in samples]) for n in samples[0]}
    state = {f"state_{n}": a for n, a in flow.save().items()} if flow is not None else {}
    with atomic_path(path) as part, open(part, "wb") as stream:
        np.savez(
            stream, allow_pickle=False, numbers=np.array([len(samples), steps, stop, done]),
            sizes=np.array([len(s["filter_size"]) for s in samples]), **rows, **state,
        )  # fmt: skip


def _kept(path: Path) -> dict[str, Any] | None:
    """A kept case, or None where there is none that can be read."""
    try:
        with np.load(path, allow_pickle=False) as stored:
            return {name: stored[name] for name in stored.files}
    except Exception:  # absent or cut: the case starts anew
        return None


def _samples(stored: dict[str, Any]) -> list[dict[str, Any]]:
    ends = np.cumsum(stored["sizes"])
    rows = {n.removeprefix("rows_"): a for n, a in stored.items() if n.startswith("rows_")}
    return [
        {n: a[end - size : end] for n, a in rows.items()}
        for end, size in zip(ends, stored["sizes"], strict=True)
    ]


def run_case(
    case: FlowDesign, design: DragDesign, folder: Path, *, until: float = float("inf"),
    show: bool = False,
) -> Made:  # fmt: skip
    """Run a case to its end, from where it was kept.

    Parameters
    ----------
    case, design
    folder : path
        Where it is kept.
    until : float
        ``time.monotonic()`` at which to keep it and stop.
    show : bool
        Whether to draw progress.

    Raises
    ------
    OutOfTimeError
        At ``until``; what has been done is kept.
    """
    path = folder / f"{case.name}-{_key(case, design)}.npz"
    stored = _kept(path)
    samples: list[dict[str, Any]] = [] if stored is None else _samples(stored)
    if stored is not None and stored["numbers"][3]:
        rows = {n: np.concatenate([s[n] for s in samples]) for n in samples[0]}
        return Made(rows, int(stored["numbers"][1]), float(stored["numbers"][2]))
    unit = clock(case)
    with sole_writer(folder / f".{case.name}.lock"):
        flow: Flow = TwoFluidFlow(case) if case.kind == "two-fluid" else ParticleFlow(case)
        if stored is not None:
            state = {n.removeprefix("state_"): a for n, a in stored.items() if n[:6] == "state_"}
            flow.restore(state)
        stop = float(stored["numbers"][2]) if stored is not None else 0.0
        last = time.monotonic()
        whole = unit * (case.develop + case.apart * (case.samples - 1))
        with progress(1000, case.name, show=show) as bar:
            shown = 0
            for number in range(len(samples), case.samples):
                goal = unit * (case.develop + case.apart * number)
                while goal - flow.time > 1e-12 * goal and flow.steps < case.most_steps:
                    flow.step(goal)
                    now = time.monotonic()
                    part = min(1000, int(1000 * flow.time / whole))
                    bar(part - shown)
                    shown = part
                    if now > until or now - last > KEEP:
                        _keep(path, flow, samples, flow.steps, stop, False)
                        last = now
                        if now > until:
                            raise OutOfTimeError
                if flow.steps >= case.most_steps and samples:
                    break  # the last samples are missing; times of a case say how far it went
                if flow.steps >= case.most_steps and goal - flow.time > 1e-12 * goal:
                    raise InputError(
                        f"case {case.name!r}: most_steps = {case.most_steps} end it at "
                        f"{flow.time:.3g} s, before its first sample at {goal:.3g} s; give more, "
                        "or wider cells."
                    )
                samples.append(_sample(flow, case, design, number))
                stop = flow.time
                _keep(path, flow, samples, flow.steps, stop, False)
            _keep(path, None, samples, flow.steps, stop, True)
    rows = {n: np.concatenate([s[n] for s in samples]) for n in samples[0]}
    return Made(rows, flow.steps, stop)


def generate(
    design: DragDesign, folder: str | os.PathLike[str], *, names: Sequence[str] = (),
    seconds: float = float("inf"), show: bool = False,
) -> tuple[FilteredDrag | None, list[str]]:  # fmt: skip
    """Run the cases of a design, or go on with them.

    Parameters
    ----------
    design : DragDesign
    folder : path
        Where finished and running cases are kept; others may work there on other cases.
    names : sequence of str
        Cases to run; all by default.
    seconds : float
        Stop after about so long; the next call goes on [s].
    show : bool
        Whether to draw progress.

    Returns
    -------
    (FilteredDrag or None, list of str)
        The finished cases (None if there are none), and the names of those that are not.
    """
    known = [case.name for case in design.case]
    for name in names:
        if name not in known:
            raise InputError(f"no case is called {name!r}; there are {', '.join(known)}.")
    until = time.monotonic() + seconds
    place = Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    made: list[tuple[FlowDesign, Made]] = []
    left: list[str] = []
    for case in design.case:
        stored = _kept(place / f"{case.name}-{_key(case, design)}.npz")
        finished = stored is not None and bool(stored["numbers"][3])
        if not finished and ((names and case.name not in names) or time.monotonic() > until):
            left.append(case.name)
            continue
        try:
            made.append((case, run_case(case, design, place, until=until, show=show)))
        except OutOfTimeError:
            left.append(case.name)
    return (_joined(made) if made else None), left


def _joined(made: list[tuple[FlowDesign, Made]]) -> FilteredDrag:
    columns: dict[str, Any] = {
        name: np.concatenate([part.rows[name] for _, part in made])
        for name in COLUMNS
        if name != "case"
    }
    columns["case"] = np.repeat(
        np.arange(len(made)), [len(part.rows["filter_size"]) for _, part in made]
    )
    for name in WHOLE:
        columns[name] = columns[name].astype(np.int64)
    return FilteredDrag(**columns, cases=tuple(_described(c, part) for c, part in made))


def _described(case: FlowDesign, made: Made) -> DragCase:
    edge = case.cell * case.diameter
    x, y, z = (n * edge for n in case.cells)
    return DragCase(
        name=case.name, source=case.kind, dimension=case.dimension, diameter=case.diameter,
        particle_density=case.particle_density, gas_density=case.gas_density,
        gas_viscosity=case.gas_viscosity, gravity=GRAVITY, gravity_axis=(0.0, -1.0, 0.0),
        mean_solid_fraction=case.solid_fraction, cell=edge, box=(x, y, z), law=case.law,
        packing=case.packing, restitution=case.restitution, seed=case.seed,
        start=clock(case) * case.develop, stop=made.stop,
    )  # fmt: skip
