"""Checkpoints: the whole state of a simulation in a file, from which it goes on bit by bit."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed.core.errors import InputError
from greybed.core.files import atomic_path
from greybed.core.seal import seal_of
from greybed.dem import _step
from greybed.dem._rigid import Rigid
from greybed.dem.lists import Lists
from greybed.dem.simulation import Simulation

FORMAT = "greybed-particles-5"


def save(
    simulation: Simulation,
    path: str | os.PathLike[str],
    *,
    beside: Mapping[str, NDArray[Any]] | None = None,
    **extra: Any,
) -> Path:
    """Write a checkpoint, whole or not at all.

    Parameters
    ----------
    simulation : Simulation
        Between two runs.
    path : path
        ``.npz`` file to write.
    beside : dict of arrays, optional
        Kept beside the state and given back by :func:`restore` under the key ``beside``.
    extra : JSON values
        The same, under their own keys.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    lists = simulation._lists
    arrays: dict[str, Any] = {
        f"{part}_{name}": value
        for part, group in (
            ("state", lists.state), ("near", lists.near), ("surfaces", lists.surfaces),
            ("rigid", lists.rigid),
        )
        for name, value in group._asdict().items()
    }  # fmt: skip
    arrays |= {f"beside_{name}": value for name, value in (beside or {}).items()}
    arrays |= {
        "ident": lists.ident, "body_ident": lists.body_ident, "labels": simulation.labels,
        "worst": lists.worst, "deepest": lists.deepest,
    }  # fmt: skip
    arrays = {name: np.asarray(value) for name, value in arrays.items()}
    numbers = {
        "format": FORMAT,
        "digest": _digest(simulation),
        "steps": simulation.steps,
        "next": simulation._next,
        "wall_way": lists.wall_way,
        "skin": lists.skin,
        "listed_at": lists.listed_at,
        "seal": seal_of(arrays),
        "extra": extra,
    }
    with atomic_path(path) as part, open(part, "wb") as stream:
        np.savez(stream, allow_pickle=False, numbers=np.array(json.dumps(numbers)), **arrays)
    return Path(path)


def restore(simulation: Simulation, path: str | os.PathLike[str]) -> dict[str, Any]:
    """Put a simulation into the state of a checkpoint.

    Parameters
    ----------
    simulation : Simulation
        Made with the same materials, laws, walls, box, gravity and time step; its particles do
        not matter.
    path : path
        File of :func:`save`.

    Returns
    -------
    dict
        What was kept beside the state.

    Raises
    ------
    InputError
        If the file is absent, damaged, or of a simulation that was made otherwise.
    """
    try:
        with open(path, "rb") as stream, np.load(stream, allow_pickle=False) as stored:
            numbers, arrays = _unsealed(stored)
        groups: dict[str, Any] = {
            part: kind(**{name: arrays[f"{part}_{name}"] for name in kind._fields})
            for part, kind in (
                ("state", _step.State), ("near", _step.Near), ("surfaces", _step.Surfaces),
                ("rigid", Rigid),
            )
        }  # fmt: skip
    except OSError as error:
        raise InputError(f"{path}: cannot read this checkpoint ({error.strerror}).") from None
    except Exception as error:  # what numpy and zipfile raise for a cut file is not documented
        raise InputError(
            f"{path}: this checkpoint is cut or damaged ({type(error).__name__}); take an older "
            "one, or start anew."
        ) from None
    if numbers.get("format") != FORMAT or numbers.get("digest") != _digest(simulation):
        raise InputError(
            f"{path}: this checkpoint is of a simulation with other materials, laws, walls, box, "
            "gravity or time step; give the case that wrote it, or start anew."
        )
    lists: Lists = simulation._lists
    lists.state, lists.near, lists.surfaces = groups["state"], groups["near"], groups["surfaces"]
    lists.rigid, lists.body_ident = groups["rigid"], arrays["body_ident"]
    lists.ident, lists.worst, lists.deepest = arrays["ident"], arrays["worst"], arrays["deepest"]
    lists.wall_way, lists.skin = float(numbers["wall_way"]), float(numbers["skin"])
    lists.listed_at = int(numbers["listed_at"])
    lists.wall_pace = lists.pace()
    simulation._state = lists.state
    simulation.labels = arrays["labels"]
    simulation.steps, simulation._next = int(numbers["steps"]), int(numbers["next"])
    simulation._pending = False
    kept = {n.removeprefix("beside_"): a for n, a in arrays.items() if n.startswith("beside_")}
    return {**numbers["extra"], **({"beside": kept} if kept else {})}


def kept_with(path: str | os.PathLike[str]) -> dict[str, Any] | None:
    """What was kept beside the state of a checkpoint; None where there is no whole one."""
    try:
        with open(path, "rb") as stream, np.load(stream, allow_pickle=False) as stored:
            return dict(_unsealed(stored)[0]["extra"])
    except Exception:  # absent, cut, or of another kind
        return None


def _unsealed(stored: Any) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Numbers and arrays of an open archive; ValueError where they are not what was kept."""
    numbers: dict[str, Any] = json.loads(str(stored["numbers"]))
    arrays = {name: stored[name] for name in stored.files if name != "numbers"}
    if numbers["seal"] != seal_of(arrays):
        raise ValueError("seal")
    return numbers, arrays


def _digest(simulation: Simulation) -> str:
    """SHA-256 of what decides how a state goes on, besides the state itself."""
    law, lists = simulation._law, simulation._lists
    text = [
        [int(law.normal), int(law.rolling), int(law.cohesion), bool(law.limit)],
        [wall.shape.name for wall in simulation.walls],
        [material.name for material in simulation.materials],
        lists.periodic.tolist(), lists.box.tolist(), simulation.gravity.tolist(),
        simulation.time_step, lists.reach, simulation._kinds,
    ]  # fmt: skip
    digest = hashlib.sha256(json.dumps(text).encode())
    for array in (law.row, law.table):
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()
