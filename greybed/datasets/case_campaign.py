"""Campaigns of simulation cases: one case file, values to vary, ``greybed simulate`` for each."""

from __future__ import annotations

import copy
import csv
import itertools
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import tomli_w

from greybed.core.config import read_toml
from greybed.core.errors import InputError
from greybed.core.files import atomic_path, sha256_of
from greybed.core.processes import ending_with_parent
from greybed.datasets.campaign import PLACE, Campaign

# More cases than this are a slip of the pen.
MOST_CASES = 1_000_000


def cases_of(path: Path) -> list[dict[str, Any]]:
    """Inputs of the tasks that a campaign file asks for: every combination of its values.

    Parameters
    ----------
    path : Path
        TOML: ``case`` names a case file beside it; ``[vary]`` has lists of values by the place of
        a number in that case, ``"contact.0.friction" = [0.2, 0.4]``; ``simulate`` may hold
        further words of the command.

    Returns
    -------
    list of dict
        ``case``, ``varied``, ``files`` (their hashes), ``words``: what decides the results; and
        ``place``, the folder of the files, which does not.

    Raises
    ------
    InputError
        If the file says something else or names a place that the case does not have.
    """
    table = read_toml(path)
    name, vary = table.pop("case", None), table.pop("vary", {})
    words = table.pop("simulate", [])
    lists = isinstance(vary, dict) and all(isinstance(v, list) and v for v in vary.values())
    if not isinstance(name, str) or not lists or table or not isinstance(words, list):
        raise InputError(
            f'{path} must hold case = "FILE", a table [vary] of lists that are not empty, and '
            "perhaps simulate = [words of greybed simulate], and nothing else."
        )
    base = path.parent / name
    case = read_toml(base)
    folder, hashes = base.resolve().parent, dict[Path, str]()
    places = list(vary)
    count = 1
    for place in places:
        count *= len(vary[place])
    if count > MOST_CASES:
        raise InputError(f"{path}: {count} cases [-] are more than {MOST_CASES}; vary less.")
    found = []
    for values in itertools.product(*vary.values()):
        one = copy.deepcopy(case)
        for place, value in zip(places, values, strict=True):
            _put(one, place, value, path)
        files: dict[str, str] = {}
        for name, file in _files(one, folder):
            if file not in hashes:
                hashes[file] = sha256_of(file)
            files[name] = hashes[file]
        found.append(
            {
                "case": one,
                "varied": dict(zip(places, values, strict=True)),
                "files": files,
                "words": [str(w) for w in words],
                PLACE: str(folder),
            }
        )
    return found


def simulate_case(inputs: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Run one case in a folder of its own; what ``summary.json`` holds.

    Raises
    ------
    RuntimeError
        If ``greybed simulate`` fails, with what it said.
    """
    folder.mkdir(parents=True, exist_ok=True)
    case = folder / "case.toml"
    with atomic_path(case) as part:
        there = _absolute(inputs["case"], Path(inputs[PLACE]))
        part.write_bytes(tomli_w.dumps(there).encode())
    words = [sys.executable, "-m", "greybed", "simulate", str(case), "--out", str(folder)]
    done = subprocess.run(
        [*words, "--quiet", *inputs["words"]], capture_output=True, text=True, check=False,
        stdin=subprocess.DEVNULL, env={**os.environ, "NUMBA_NUM_THREADS": "1"},
        preexec_fn=ending_with_parent(),
    )  # fmt: skip
    if done.returncode < 0:
        name = signal.strsignal(-done.returncode) or f"signal {-done.returncode}"
        raise RuntimeError(f"greybed simulate was ended from outside or crashed ({name})")
    if done.returncode != 0:
        said = (done.stderr.strip() or done.stdout.strip() or "it said nothing").splitlines()[-1]
        raise RuntimeError(f"greybed simulate ended with {done.returncode}: {said}")
    summary: dict[str, Any] = json.loads((folder / "summary.json").read_text())
    return summary


def write_table(campaign: Campaign, inputs: list[dict[str, Any]], path: Path) -> None:
    """One row a case: its key, what was varied, every single number of its summary."""
    rows, columns = [], dict[str, None]()
    for key, given in zip(campaign.keys, inputs, strict=True):
        result = campaign.result(key) or {}
        row = {"key": key, **given["varied"]}
        row |= {
            name: value
            for name, value in result.items()
            if isinstance(value, int | float | str) and name not in row and name != "verb"
        }
        rows.append(row)
        columns |= dict.fromkeys(row)
    with atomic_path(path) as part, open(part, "w", newline="") as stream:
        writer = csv.DictWriter(stream, list(columns), restval="")
        writer.writeheader()
        writer.writerows(rows)


def _files(value: Any, folder: Path) -> Iterator[tuple[str, Path]]:
    """Names in a case that are files below its folder, and the files."""
    if isinstance(value, dict | list):
        for part in value.values() if isinstance(value, dict) else value:
            yield from _files(part, folder)
    elif _is_file(value, folder):
        yield value, folder / value


def _absolute(value: Any, folder: Path) -> Any:
    """The case with names of such files as whole paths."""
    if isinstance(value, dict):
        return {name: _absolute(part, folder) for name, part in value.items()}
    if isinstance(value, list):
        return [_absolute(part, folder) for part in value]
    return str(folder / value) if _is_file(value, folder) else value


def _is_file(value: Any, folder: Path) -> bool:
    return isinstance(value, str) and 0 < len(value) < 255 and (folder / value).is_file()


def _put(case: Any, place: str, value: Any, path: Path) -> None:
    """Set the value at a place such as ``contact.0.friction``."""
    here, (*parents, last) = case, place.split(".")
    try:
        for word in parents:
            here = here[int(word) if isinstance(here, list) else word]
        if isinstance(here, list):
            here[int(last)] = value
        elif isinstance(here, dict):
            here[last] = value
        else:
            raise KeyError(last)
    except (KeyError, IndexError, ValueError):
        raise InputError(
            f"{path}: [vary] {place!r} is no place of the case; tables are named and lists are "
            "numbered from 0, as in contact.0.friction."
        ) from None
