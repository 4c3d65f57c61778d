"""Campaigns: many tasks, each known by a hash of its inputs, each with a result file of its own.

What has a result file is never done again, whoever was killed and however often the campaign is
started. Workers write the files, so a folder that all of them see is best; where they do not see
it, the results come back and are written here.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from greybed._version import __version__
from greybed.core.errors import GreybedError
from greybed.core.files import atomic_path, output_folder
from greybed.datasets.executors import Executor, Job

Task = Callable[[dict[str, Any], Path], Mapping[str, Any]]
RESULT = ".json"
# Of the inputs: where files are, whose content is told beside it. Not of the key, so that a folder
# may be moved.
PLACE = "place"


@dataclass(frozen=True)
class Campaign:
    """What a campaign has done.

    Attributes
    ----------
    keys : list of str
        Of all tasks, in their order.
    found : int
        Tasks that were finished before.
    failed : dict of str
        Errors of tasks, by key; they are done again the next time.
    folder : Path
        Where the result files are.
    """

    keys: list[str]
    found: int
    failed: dict[str, str]
    folder: Path

    def result(self, key: str) -> dict[str, Any] | None:
        """Result of a task, or None where it failed."""
        path = self.folder / f"{key}{RESULT}"
        return json.loads(path.read_text())["result"] if path.exists() else None


def key_of(task: Task, inputs: Mapping[str, Any]) -> str:
    """Hash of a task: the function's name, the version of greybed, the inputs but ``place``."""
    name = f"{task.__module__}.{task.__qualname__}"
    known = {word: value for word, value in inputs.items() if word != PLACE}
    text = json.dumps([__version__, name, known], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def run_campaign(
    task: Task,
    inputs: Iterable[Mapping[str, Any]],
    folder: str | Path,
    executor: Executor,
    on_done: Callable[[int], object] | None = None,
) -> Campaign:
    """Do all tasks that have no result file yet.

    Parameters
    ----------
    task : callable
        A function of a module: takes inputs and a folder for its own files, returns what JSON can
        hold.
    inputs : iterable of mapping
        What JSON can hold; equal inputs are one task.
    folder : path
        For result files and the tasks' own folders.
    executor : Executor
        Who runs them.
    on_done : callable, optional
        Called with the number of tasks that are finished since the last call.

    Returns
    -------
    Campaign
    """
    place = output_folder(folder).resolve()
    tasks = {key_of(task, given): dict(given) for given in inputs}
    keys = list(tasks)
    todo = [key for key in keys if not (place / f"{key}{RESULT}").exists()]
    found, failed = len(keys) - len(todo), dict[str, str]()
    if on_done is not None:
        on_done(found)
    jobs: Iterable[Job] = ((key, (task, key, tasks[key], str(place))) for key in todo)
    for key, answer in executor.run(done_once, jobs):
        if isinstance(answer, Exception):
            failed[key] = _said(answer)
        elif not (place / f"{key}{RESULT}").exists():
            _write(place / f"{key}{RESULT}", tasks[key], answer)
        if on_done is not None:
            on_done(1)
    return Campaign(keys, found, failed, place)


def done_once(task: Task, key: str, inputs: dict[str, Any], folder: str) -> dict[str, Any]:
    """Do a task unless its result file is there; what workers run."""
    path = Path(folder) / f"{key}{RESULT}"
    if path.exists():
        result: dict[str, Any] = json.loads(path.read_text())["result"]
        return result
    result = dict(task(inputs, Path(folder) / key))
    if path.parent.is_dir():
        _write(path, inputs, result)
    return result


def _write(path: Path, inputs: Mapping[str, Any], result: Mapping[str, Any]) -> None:
    with atomic_path(path) as part:
        part.write_text(json.dumps({"inputs": inputs, "result": result}))


def _said(error: Exception) -> str:
    return str(error) if isinstance(error, GreybedError) else f"{type(error).__name__}: {error}"
