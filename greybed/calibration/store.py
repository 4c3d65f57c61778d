"""Store of finished runs (SQLite): keyed by all that decides a run, safe against kills."""

from __future__ import annotations

import hashlib
import json
import os
import sqlite3
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from greybed.calibration.experiment import Experiment, Value
from greybed.core.errors import InputError, OutputError

FORMAT = "greybed calibration runs 1"


@dataclass(frozen=True)
class Outcome:
    """A finished run.

    Attributes
    ----------
    experiment : str
        Its name.
    values : mapping of str to float
        Parameters [SI].
    seed : int
        Of the replicate.
    results : mapping of str to Value, or None
        Measures; None where it failed.
    error : str
        Why it failed.
    seconds : float
        Time that it took [s].
    """

    experiment: str
    values: Mapping[str, float]
    seed: int
    results: Mapping[str, Value] | None
    error: str = ""
    seconds: float = 0.0


def run_key(experiment: Experiment, values: Mapping[str, float], seed: int) -> str:
    """Hash of an experiment, its parameters and a seed: the same run has the same key."""
    taken = {k: v for k, v in values.items() if experiment.takes is None or k in experiment.takes}
    text = json.dumps([FORMAT, experiment.identity(), taken, seed], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:40]


class Store:
    """Finished runs in one SQLite file; each is on the disk before the next one is asked for.

    Parameters
    ----------
    path : path
        The file; made if it is not there.

    Raises
    ------
    OutputError
        If it is no such store, or cannot be written.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        try:
            self._file = sqlite3.connect(self.path, isolation_level=None)
            self._file.execute("PRAGMA synchronous = FULL")
            self._file.execute(
                "CREATE TABLE IF NOT EXISTS runs (key TEXT PRIMARY KEY, experiment TEXT, "
                "parameters TEXT, seed INTEGER, results TEXT, error TEXT, seconds REAL, "
                "finished REAL)"
            )
        except (sqlite3.Error, UnicodeDecodeError) as error:
            raise OutputError(
                f"{self.path}: no store of runs ({error}); free space, choose another folder "
                "with --out, or remove the file."
            ) from None

    def get(self, key: str) -> Outcome | None:
        """A finished run, or None."""
        try:
            row = self._file.execute(
                "SELECT experiment, parameters, seed, results, error, seconds FROM runs "
                "WHERE key = ?",
                (key,),
            ).fetchone()
            return None if row is None else _outcome(*row)
        except (sqlite3.Error, ValueError, TypeError, RecursionError) as error:
            raise InputError(
                f"{self.path}: this store of runs is damaged ({error}); remove it, and what it "
                "holds is run again."
            ) from None

    def put(self, key: str, outcome: Outcome) -> None:
        """Keep a finished run; it is on the disk when this returns."""
        plain: Any = None if outcome.results is None else json.dumps(dict(outcome.results))
        try:
            self._file.execute(
                "INSERT OR IGNORE INTO runs VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
                (
                    key, outcome.experiment, json.dumps(dict(outcome.values)), outcome.seed, plain,
                    outcome.error, outcome.seconds, time.time(),
                ),
            )  # fmt: skip
        except sqlite3.Error as error:
            raise OutputError(
                f"{self.path}: cannot keep a run ({error}); free space or choose another folder."
            ) from None

    def __len__(self) -> int:
        return int(self._file.execute("SELECT COUNT(*) FROM runs").fetchone()[0])

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def _outcome(name: Any, values: Any, seed: Any, results: Any, error: Any, seconds: Any) -> Outcome:
    """A row as an outcome, or a ValueError or TypeError."""
    given = json.loads(values)
    found = None if results is None else json.loads(results)
    if not isinstance(given, dict) or not (found is None or isinstance(found, dict)):
        raise ValueError("a row that is no run")
    return Outcome(str(name), given, int(seed), found, str(error), float(seconds))
