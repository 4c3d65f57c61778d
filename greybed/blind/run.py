"""Runs a blind test: sets out, answers in; killed and continued it gives the same answers."""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from greybed.blind.generate import make, plan
from greybed.blind.sealed import seal, unseal, write_set
from greybed.core.errors import GreybedError
from greybed.core.files import write_json
from greybed.core.processes import processes
from greybed.core.progress import progress

Answer = dict[str, Any]


def analyse(folder: Path) -> Answer:
    """The diagnosis of a set, from its folder alone."""
    from threadpoolctl import threadpool_limits

    from greybed.residual import diagnose, read_study

    with threadpool_limits(1):
        return diagnose(read_study(folder / "study.toml")).to_json()


def _answer(job: tuple[str, bool, Callable[[Path], Answer] | None]) -> Answer:
    source, compete, judge = job
    with tempfile.TemporaryDirectory() as folder:
        # the analysis sees a copy, away from all other files of the test
        copy = Path(folder) / "set"
        shutil.copytree(source, copy)
        try:
            found = (judge or analyse)(copy)
        except GreybedError as error:
            found = {"refused": str(error)}
        others: Answer = {}
        if compete and "refused" not in found:
            from greybed.blind.competitors import compete as competitors

            others = competitors(copy)
    return {"found": found, "competitors": others}


def blind_test(
    folder: Path,
    count: int,
    seed: int,
    kinds: tuple[str, ...],
    *,
    jobs: int = 1,
    competitors: bool = False,
    show: bool = False,
    judge: Callable[[Path], Answer] | None = None,
) -> list[dict[str, Any]]:
    """Generate, analyse and open the answers.

    Parameters
    ----------
    folder : Path
        Existing folder: ``sets/``, ``answers.bin``, ``found/``.
    count, seed : int
        How many sets, of which seed.
    kinds : tuple of str
        Kinds to deal.
    jobs : int
        Processes; no answer depends on it.
    competitors : bool
        Whether others answer too.
    show : bool
        Progress.
    judge : callable or None
        Something else than the analysis, for tests of this module.

    Returns
    -------
    rows : list of dict
        ``truth``, ``found``, ``competitors``, ``set`` of every set that was not refused.
    """
    strata = plan(count, seed, kinds)
    answers, todo = [], []
    (folder / "found").mkdir(exist_ok=True)
    for i, stratum in enumerate(strata):
        made = make(stratum, seed, i)
        answers.append(made.answer)
        place = folder / "sets" / f"set_{i:04d}"
        if not (place / "study.toml").exists():
            write_set(place, made, seed, i)
        if not _result(folder, i).exists():
            todo.append(i)
    seal(folder / "answers.bin", answers, seed)
    with progress(count, "blind test", show=show) as advance:
        advance(count - len(todo))
        work = [(str(folder / "sets" / f"set_{i:04d}"), competitors, judge) for i in todo]
        if jobs == 1:
            for i, job in zip(todo, work, strict=True):
                write_json(_result(folder, i), _answer(job))
                advance(1)
        else:
            with processes(jobs) as pool:
                for i, answer in zip(todo, pool.map(_answer, work), strict=True):
                    write_json(_result(folder, i), answer)
                    advance(1)
    rows = []
    for i, truth in enumerate(unseal(folder / "answers.bin", seed)):
        answer = json.loads(_result(folder, i).read_text())
        rows.append({"set": f"set_{i:04d}", "truth": truth, **answer})
    return rows


def _result(folder: Path, i: int) -> Path:
    return folder / "found" / f"set_{i:04d}.json"
