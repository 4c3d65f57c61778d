"""Makes runs: from the store where they are finished, in processes or on a scheduler if not."""

from __future__ import annotations

import hashlib
import json
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import ExitStack
from dataclasses import dataclass, field
from types import TracebackType
from typing import Any

import numpy as np

from greybed.calibration.experiment import COST, Experiment, RunFailed
from greybed.calibration.store import Outcome, Store, run_key
from greybed.core.clusters import client_of
from greybed.core.processes import finished, processes

_LONGEST = 300  # characters of a reason


@dataclass(frozen=True)
class Job:
    """A run that is wanted: one replicate of an experiment at some parameters."""

    experiment: str
    values: tuple[tuple[str, float], ...]
    replicate: int = 0

    @property
    def named(self) -> dict[str, float]:
        """Parameters by name [SI]."""
        return dict(self.values)


def seed_of(study_seed: int, job: Job, attempt: int = 0) -> int:
    """Seed of a replicate: from the study's seed, the parameters and its number."""
    text = json.dumps([study_seed, job.experiment, job.values, job.replicate, attempt])
    return int(hashlib.sha256(text.encode()).hexdigest()[:7], 16)


def attempt_run(
    experiment: Experiment, values: Mapping[str, float], seed: int
) -> tuple[dict[str, Any] | None, str, float]:
    """Run once; results or None, the reason of a failure, seconds."""
    begin = time.perf_counter()
    try:
        found = experiment.run(values, seed)
        results = {name: _plain(name, found.get(name)) for name in experiment.measures}
        if COST in found:
            results[COST] = _plain(COST, found[COST])
        error = ""
    except Exception as reason:  # a run may fail in any way: it is data, not the end
        results, error = None, f"{type(reason).__name__}: {reason}"[:_LONGEST]
    return results, error, time.perf_counter() - begin


def _plain(name: str, value: Any) -> Any:
    """A number, or the two lists of a curve, all finite."""
    if value is None:
        raise RunFailed(f"it gave no {name}")
    array = np.asarray(value, dtype=float)
    if array.ndim not in (0, 2) or (array.ndim == 2 and (len(array) != 2 or array.shape[1] < 2)):
        raise RunFailed(f"{name} is neither a number nor two lists of equal length")
    if not np.isfinite(array).all():
        raise RunFailed(f"{name} is not finite")
    return array.tolist()


@dataclass
class Campaign:
    """Runs of a study, as they are finished.

    Attributes
    ----------
    experiments : mapping of str to Experiment
        By name.
    store : Store
        Where finished runs are.
    seed, attempts, workers, scheduler
        As :class:`greybed.calibration.study.Options` says.
    finished : list of (Job, list of Outcome)
        Each job with its attempts, the last of which is the one that counts.
    made, found : int
        Runs made now, and taken from the store.
    tell : callable
        Called with 1 after each job.
    """

    experiments: Mapping[str, Experiment]
    store: Store
    seed: int = 1
    attempts: int = 3
    workers: int = 0
    scheduler: str | None = None
    finished: list[tuple[Job, list[Outcome]]] = field(default_factory=list)
    made: int = 0
    found: int = 0
    seconds: float = 0.0
    tell: Callable[[int], object] = lambda steps: None
    _stack: ExitStack = field(default_factory=ExitStack)
    _pool: Executor | None = None

    def __enter__(self) -> Campaign:
        if self.scheduler is not None:
            client = self._stack.enter_context(client_of(self.scheduler, self.workers or None))
            self._pool = client.get_executor(pure=False)
        elif self.workers > 0:
            self._pool = self._stack.enter_context(processes(self.workers))
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._pool = None
        self._stack.close()

    @property
    def spent(self) -> int:
        """Jobs that are finished [-]."""
        return len(self.finished)

    def make(self, jobs: Sequence[Job]) -> list[Outcome]:
        """Finish these runs; the order in which workers end changes nothing.

        Returns
        -------
        list of Outcome
            The last attempt of each job, in the order of ``jobs``.
        """
        tried: dict[int, list[Outcome]] = {k: [] for k in range(len(jobs))}
        waiting = list(range(len(jobs)))
        for attempt in range(max(1, self.attempts)):
            todo: list[tuple[int, str, Experiment, dict[str, float], int]] = []
            for k in waiting:
                job = jobs[k]
                experiment, values = self.experiments[job.experiment], job.named
                seed = seed_of(self.seed, job, attempt)
                key = run_key(experiment, values, seed)
                kept = self.store.get(key)
                if kept is not None:
                    tried[k].append(kept)
                    self.found += 1
                    if kept.results is not None or attempt + 1 == self.attempts:
                        self.tell(1)
                    continue
                todo.append((k, key, experiment, values, seed))
            for place, answer in self._results(todo):
                k, key, experiment, values, seed = todo[place]
                results, error, seconds = answer
                outcome = Outcome(experiment.name, values, seed, results, error, seconds)
                self.store.put(key, outcome)
                self.made += 1
                self.seconds += seconds
                tried[k].append(outcome)
                if results is not None or attempt + 1 == self.attempts:
                    self.tell(1)
            waiting = [k for k in waiting if tried[k][-1].results is None]
            if not waiting:
                break
        self.finished += [(job, tried[k]) for k, job in enumerate(jobs)]
        return [tried[k][-1] for k in range(len(jobs))]

    def _results(self, todo: Sequence[tuple[Any, ...]]) -> Iterator[tuple[int, Any]]:
        """Place in ``todo`` and answer, as runs are finished."""
        if self._pool is None:
            for place, (_, _, experiment, values, seed) in enumerate(todo):
                yield place, attempt_run(experiment, values, seed)
            return
        calls = [(place, item[2], item[3], item[4]) for place, item in enumerate(todo)]
        ahead = max(self.workers, 1) if self.scheduler is None else len(calls) + 1
        for call, answer in finished(self._pool, _placed, calls, ahead):
            yield call[0], answer


def _placed(place: int, experiment: Experiment, values: Mapping[str, float], seed: int) -> Any:
    return attempt_run(experiment, values, seed)


def cost_of(outcome: Outcome) -> float:
    """Work of a run: what it says itself, or its seconds; NaN where it failed."""
    if outcome.results is None:
        return math.nan
    said = outcome.results.get(COST)
    return float(said) if isinstance(said, (int, float)) else outcome.seconds
