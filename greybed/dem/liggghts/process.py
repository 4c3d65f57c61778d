"""LIGGGHTS as a process: found, started through MPI, listened to, ended with us."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from greybed.core.errors import InputError
from greybed.core.processes import ending_with_parent


def command(ranks: int, deck: str, log: str, program: str = "liggghts") -> list[str]:
    """Words that run a deck on so many ranks.

    Raises
    ------
    InputError
        If LIGGGHTS or, for more than one rank, ``mpirun`` is not installed.
    """
    if ranks < 1:
        raise InputError(f"--ranks = {ranks} [-] must be at least 1.")
    words = [program, "-in", deck, "-log", log, "-echo", "none"]
    if shutil.which(program) is None and program != "liggghts":
        raise InputError(
            f"--plugin {program} is no program; make it with greybed host liggghts MODEL --build."
        )
    if shutil.which(program) is None:
        raise InputError(
            "--engine liggghts needs the program liggghts, which is not installed; install "
            "Debian's package liggghts (apt-get install liggghts), or take --engine greybed."
        )
    if ranks == 1:
        return words
    if shutil.which("mpirun") is None:
        raise InputError(
            f"--ranks = {ranks} needs the program mpirun, which is not installed; install Debian's "
            "package openmpi-bin (apt-get install openmpi-bin), or take --ranks 1."
        )
    return ["mpirun", "--bind-to", "none", "-np", str(ranks), *words]


@contextmanager
def started(
    words: list[str], folder: Path, more: Mapping[str, str] | None = None
) -> Iterator[subprocess.Popen[str]]:
    """Run a command in a folder; whatever happens, none of its processes outlives the block."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1", **(more or {})}
    if os.geteuid() == 0:  # in containers; Open MPI asks for both
        environment |= {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    child = subprocess.Popen(
        words, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        errors="replace", env=environment, start_new_session=True,
        preexec_fn=ending_with_parent(signal.SIGTERM),
    )  # fmt: skip
    try:
        yield child
    finally:
        if child.poll() is None:
            with suppress(ProcessLookupError):
                os.killpg(child.pid, signal.SIGTERM)
            try:
                child.wait(5.0)
            except subprocess.TimeoutExpired:
                with suppress(ProcessLookupError):
                    os.killpg(child.pid, signal.SIGKILL)
                child.wait()
        assert child.stdout is not None
        child.stdout.close()
