"""LIGGGHTS as a host: a driver that registers one fix with the unmodified library, and its run."""

from __future__ import annotations

import shutil
from pathlib import Path

from greybed.core.errors import InputError
from greybed.hosts.lammps import DECK, generate_fix
from greybed.hosts.model import HostModel
from greybed.hosts.shell import as_root, run_command, told_by_greybed

HEADERS = Path("/usr/include/liggghts")
PROGRAM, LOG, BUILD_LOG, SCREEN = "greybed_liggghts", "log.liggghts", "build.log", "run.log"
FLAGS = ("-std=c++11", "-O3", "-march=native", "-fno-math-errno", "-w")


def missing_liggghts() -> str:
    """What LIGGGHTS as a host lacks here, in words; empty where all is there."""
    if not (HEADERS / "lammps.h").is_file():
        return "the headers of LIGGGHTS (apt-get install libliggghts-dev)"
    if shutil.which("mpicxx") is None:
        return "mpicxx (apt-get install libopenmpi-dev)"
    return ""


def generate(model: HostModel, folder: Path) -> list[str]:
    """Write the driver's files and an input that runs it."""
    return generate_fix(model, "liggghts", folder, {"driver.cpp": "liggghts/driver.cpp"})


def build(folder: Path, flags: tuple[str, ...] = FLAGS) -> float:
    """Compile the driver; returns seconds.

    Raises
    ------
    InputError
        If headers or compiler are missing, or the compiler fails.
    """
    if lacking := missing_liggghts():
        raise InputError(f"the host liggghts needs {lacking}.")
    words: list[str | Path] = [
        "mpicxx", *flags, "-I.", f"-I{HEADERS}", "driver.cpp", "-lliggghts", "-o", PROGRAM,
    ]  # fmt: skip
    return run_command(words, folder, BUILD_LOG, "the build of the driver")


def command(folder: Path, ranks: int, *words: str) -> list[str]:
    """Words that run the driver on so many ranks.

    Raises
    ------
    InputError
        For ranks below 1, or above 1 where ``mpirun`` is missing.
    """
    if ranks < 1:
        raise InputError(f"--ranks = {ranks} [-] must be at least 1.")
    alone = [str((folder / PROGRAM).resolve()), *words]
    if ranks == 1:
        return alone
    if shutil.which("mpirun") is None:
        raise InputError(f"--ranks = {ranks} needs mpirun (apt-get install openmpi-bin).")
    return ["mpirun", "--bind-to", "none", "-np", str(ranks), *alone]


def run(folder: Path, ranks: int = 1, *more: str) -> float:
    """Run the input beside the driver; returns seconds.

    Raises
    ------
    InputError
        If it cannot start or fails.
    """
    words = command(folder, ranks, "-in", DECK, "-log", LOG, *more)
    environment = {"OMP_NUM_THREADS": "1", **as_root()}
    return run_command(words, folder, SCREEN, "LIGGGHTS", environment)


def said(folder: Path) -> list[str]:
    """What the fix said at the end of each run of the example."""
    return told_by_greybed(folder / SCREEN)
