"""Commands that build and run adapters: one log each, one sentence where they fail."""

from __future__ import annotations

import os
import shlex
import subprocess
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from greybed.core.errors import InputError

# In a line by which compilers, LAMMPS, LIGGGHTS or OpenFOAM say why they stop.
_TELLING = ("error:", "ERROR", "FATAL")


def run_command(
    words: Sequence[str | Path],
    folder: Path,
    log: str,
    what: str,
    environment: Mapping[str, str] | None = None,
) -> float:
    """Run a command in a folder, its output in a log there; returns seconds.

    Raises
    ------
    InputError
        If it cannot be started or fails, with its last lines that tell of an error.
    """
    command = [str(word) for word in words]
    begin = time.perf_counter()
    with open(folder / log, "w") as stream:
        stream.write(f"$ {shlex.join(command)}\n")
        stream.flush()
        try:
            code = subprocess.run(
                command, cwd=folder, stdout=stream, stderr=subprocess.STDOUT,
                stdin=subprocess.DEVNULL, env={**os.environ, **(environment or {})}, check=False,
            ).returncode  # fmt: skip
        except OSError as error:
            raise InputError(f"{what}: cannot start {command[0]} ({error.strerror}).") from None
    if code != 0:
        raise InputError(f"{what} failed with exit code {code}: {said_in(folder / log)}")
    return time.perf_counter() - begin


def said_in(log: Path) -> str:
    """The last line of a log that tells of an error, or its last line, and where the log is."""
    lines = [line.strip() for line in log.read_text(errors="replace").splitlines()[1:]]
    lines = [line for line in lines if line]
    told = [line for line in lines if any(word in line for word in _TELLING)]
    last = told[0] if told else (lines or ["it said nothing"])[-1]
    return f"{last[:300]}; the log is {log}."


def as_root() -> dict[str, str]:
    """Words of the environment that let Open MPI run in containers, where all is root."""
    if hasattr(os, "geteuid") and os.geteuid() == 0:
        return {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    return {}


def told_by_greybed(log: Path) -> list[str]:
    """Lines of a log in which the adapter says what it has done."""
    lines = log.read_text(errors="replace").splitlines()
    return [line.strip() for line in lines if "outside the training data" in line]
