"""Experiments that are cases of particles: how parameters get in, and measures out."""

from __future__ import annotations

import copy
import json
import math
from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from greybed._version import __version__
from greybed.calibration.experiment import COST, Experiment, Measure, RunFailed, Value
from greybed.core.config import build, read_toml
from greybed.core.errors import InputError
from greybed.core.files import sha256_of
from greybed.core.readers import read_packing

History = Sequence[Mapping[str, float]]


class ParticleExperiment(Experiment):
    """A case of particles that is built from parameters.

    Attributes
    ----------
    place : Path
        From which relative paths in the case start; named in messages.
    """

    place: Path = Path("experiment")

    @abstractmethod
    def case(self, values: Mapping[str, float]) -> dict[str, Any]:
        """The case with these parameters, as the tables of its TOML file."""

    @abstractmethod
    def read(self, results: Mapping[str, Any], history: History) -> dict[str, Value]:
        """Measures from the results of a run (as in ``summary.json``) and its samples.

        Raises
        ------
        RunFailed
            Where one has no value.
        """

    def run(self, values: Mapping[str, float], seed: int) -> dict[str, Value]:
        """See :meth:`Experiment.run`; the work is that of time steps times particles."""
        results, history = run_case({**self.case(values), "seed": seed}, self.place, self.watch)
        measures = self.read(results, history)
        measures[COST] = float(results["steps"]) * max(sum(results["inserted"]), 1)
        return measures

    def watch(self, simulation: Any) -> dict[str, float]:
        """What a sample holds besides the columns of ``history.csv``."""
        return {}


def run_case(
    content: dict[str, Any], place: Path, watch: Callable[[Any], dict[str, float]]
) -> tuple[dict[str, Any], History]:
    """Run a case of particles on one thread; its results and its samples.

    Parameters
    ----------
    content : dict
        Tables of the case.
    place : Path
        From which relative paths start.
    watch : callable
        Gives more columns for a sample, from the simulation at that moment.

    Raises
    ------
    GreybedError
        What the engine refuses: a run that explodes, particles that get lost.
    """
    # Compiled loops take a while to load: only processes that run particles do.
    from greybed.dem.case import ParticleCase
    from greybed.dem.case_tables import FileTable
    from greybed.dem.results import results_of
    from greybed.dem.runner import ParticleRun

    case = build(ParticleCase, content, place)
    files = {k: t.file for k, t in enumerate(case.particles) if isinstance(t, FileTable)}
    run = ParticleRun(case, {k: read_packing(path) for k, path in files.items()}, threads=1)
    rows = run.tally.history
    known, seen = 1, []  # the first sample is of the start, before anything was looked at
    for _ in run.go_on():
        if len(rows) > known:
            rows[-1].update(watch(run.simulation))
            seen.append(rows[-1])
            known = len(rows)
    plain: dict[str, Any] = json.loads(json.dumps(results_of(run), default=float))
    return plain, seen


def number_at(results: Mapping[str, Any], key: str) -> float:
    """A number in the results by its dotted name, whose parts may hold spaces.

    Raises
    ------
    RunFailed
        If there is none.
    """
    here: Any = results
    for part in key.split("."):
        here = here.get(part) if isinstance(here, Mapping) else None
    if isinstance(here, bool) or not isinstance(here, (int, float)) or not math.isfinite(here):
        raise RunFailed(f"{key} has no value")
    return float(here)


def column(history: History, name: str) -> np.ndarray:
    """A column of the samples.

    Raises
    ------
    RunFailed
        If there is none.
    """
    if not history or name not in history[0]:
        raise RunFailed(f"no sample has {name!r}")
    return np.array([row[name] for row in history])


def put(content: dict[str, Any], key: str, value: float, place: str) -> None:
    """Set a number at a dotted key; entries of lists are found by name, pair, or number.

    Raises
    ------
    InputError
        If the way there does not exist.
    """
    *front, last = key.split(".")
    here: Any = content
    for part in front:
        if isinstance(here, list):
            named = [item for item in here if isinstance(item, Mapping) and _is(item, part)]
            at = int(part) if part.isdigit() and int(part) < len(here) else None
            here = named[0] if named else None if at is None else here[at]
        elif isinstance(here, Mapping):
            here = here.get(part)
        if here is None:
            raise InputError(f"{place}: there is no {key} (stops at {part!r}); mend the key.")
    if isinstance(here, list):
        if not last.isdigit() or int(last) >= len(here):
            raise InputError(f"{place}: there is no {key} (stops at {last!r}); mend the key.")
        here[int(last)] = value
    else:
        here[last] = value


def _is(item: Mapping[str, Any], part: str) -> bool:
    pair = item.get("between")
    return item.get("name") == part or (isinstance(pair, list) and "-".join(pair) == part)


class CaseExperiment(ParticleExperiment):
    """A case file of one's own, ``kind = "case"``.

    Parameters
    ----------
    name : str
        Of the experiment.
    file : Path
        A case with ``kind = "particles"``.
    inputs : mapping of str to list of str
        Parameter -> dotted keys of the case; a contact may be named by its pair, ``glass-steel``.
    measures : mapping of str to Measure
        What it gives.
    sources : mapping of str to str
        Measure -> ``results.KEY`` for a number of ``summary.json``, or ``history.COLUMN`` for the
        time signal of a column of ``history.csv``.

    Raises
    ------
    InputError
        For a file that is no such case, or a key that it does not have.
    """

    def __init__(
        self, name: str, file: Path, inputs: Mapping[str, Sequence[str]],
        measures: Mapping[str, Measure], sources: Mapping[str, str],
    ) -> None:  # fmt: skip
        self.name, self.place, self.measures = name, file, dict(measures)
        self.inputs = {k: tuple(v) for k, v in inputs.items()}
        self.sources, self.takes = dict(sources), tuple(inputs)
        self._content = read_toml(file)
        if self._content.get("kind") != "particles":
            raise InputError(
                f"{file}: kind = {self._content.get('kind')!r} is not 'particles', the kind of "
                "cases that can be calibrated; another simulation can be a command or a function."
            )
        for key, source in self.sources.items():
            if not source.startswith(("results.", "history.")):
                raise InputError(
                    f"experiment {name!r}: measures.{key} = {source!r} must begin with 'results.' "
                    "or 'history.'."
                )
        probe = copy.deepcopy(self._content)
        for keys in self.inputs.values():
            for key in keys:
                put(probe, key, 0.5, str(file))

    def identity(self) -> Any:
        """See :meth:`Experiment.identity`: the file, what goes in and comes out, the version."""
        return ["case", __version__, sha256_of(self.place), self.inputs, self.sources]

    def case(self, values: Mapping[str, float]) -> dict[str, Any]:
        """See :meth:`ParticleExperiment.case`."""
        content = copy.deepcopy(self._content)
        for name, keys in self.inputs.items():
            if name in values:
                for key in keys:
                    put(content, key, values[name], str(self.place))
        return content

    def read(self, results: Mapping[str, Any], history: History) -> dict[str, Value]:
        """See :meth:`ParticleExperiment.read`."""
        found: dict[str, Value] = {}
        for name, source in self.sources.items():
            where, key = source.split(".", 1)
            if where == "results":
                found[name] = number_at(results, key)
            else:
                time = column(history, "time [s]")
                found[name] = [time.tolist(), column(history, key).tolist()]
        return found
