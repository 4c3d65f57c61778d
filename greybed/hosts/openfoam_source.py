"""The source tree that user libraries of Debian's OpenFOAM need: fetched once, kept in the cache.

Debian ships solvers and libraries, but neither headers nor ``wmake``. The source package has both;
it is fetched with lists of apt of its own, so that the system stays as it is.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

from greybed.core.errors import InputError
from greybed.hosts.shell import as_root, run_command

VARIABLE = "GREYBED_OPENFOAM"
PROJECT = Path("/usr/share/openfoam")
READY = "greybed-ready"
SOLVERS = "applications/solvers/multiphase/twoPhaseEulerFoam"
_SOURCES = (Path("/etc/apt/sources.list.d/debian.sources"), Path("/etc/apt/sources.list"))


def area() -> Path:
    """Folder of the source tree: ``GREYBED_OPENFOAM``, or one in the user's cache."""
    chosen = os.environ.get(VARIABLE)
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return Path(chosen) if chosen else cache / "greybed" / "openfoam-1912"


def missing_openfoam(*, tutorials: bool = False) -> str:
    """What is missing here, with the command that installs it; empty where all is there."""
    if shutil.which("DPMFoam") is None:
        return "OpenFOAM of Debian (apt-get install openfoam)"
    if tutorials and not Path("/usr/share/doc/openfoam-examples/examples").is_dir():
        return "its tutorials (apt-get install openfoam-examples)"
    for program, package in (("g++", "g++"), ("make", "make")):
        if shutil.which(program) is None:
            return f"{program} (apt-get install {package})"
    return ""


def tree_of(folder: Path) -> Path | None:
    """The source tree in a folder, if it is ready for wmake."""
    found = [path.parent for path in folder.glob(f"openfoam-*/{READY}")]
    return found[0] if found else None


def prepared() -> Path:
    """The source tree; made where there is none, which takes about half a minute.

    Raises
    ------
    InputError
        If something is missing, or a step fails.
    """
    if lacking := missing_openfoam():
        raise InputError(f"the host openfoam needs {lacking}.")
    folder = area()
    if (tree := tree_of(folder)) is not None:
        return tree
    for program in ("dpkg-source", "apt-get"):
        if shutil.which(program) is None:
            raise InputError(
                f"{program} is missing, which fetches OpenFOAM's source; install dpkg-dev, or set "
                f"{VARIABLE} to a folder that holds a source tree openfoam-1912."
            )
    folder.mkdir(parents=True, exist_ok=True)
    if not list(folder.glob("openfoam-*/wmake")):
        _fetch(folder)
    tree = next(iter(folder.glob("openfoam-*/wmake"))).parent
    words = environment(tree, folder / "lib")
    run_command(["./Allmake"], tree / "wmake" / "src", "greybed.log", "the build of wmake", words)
    include = tree / "wmake" / "wmakeLnIncludeAll"
    run_command([include, "src"], tree, "greybed.log", "wmakeLnIncludeAll", words)
    for part in ("interfacialModels", "twoPhaseSystem", "phaseCompressibleTurbulenceModels"):
        link = tree / "wmake" / "wmakeLnInclude"
        place = tree / SOLVERS
        run_command([link, part], place, "greybed.log", "wmakeLnInclude", words)
    (tree / READY).touch()
    return tree


def _fetch(folder: Path) -> None:
    lists = folder / "lists"
    (lists / "partial").mkdir(parents=True, exist_ok=True)
    found = [path for path in _SOURCES if path.is_file() and path.read_text().strip()]
    if not found:
        raise InputError(
            "apt has no list of Debian's sources here; fetch the source package openfoam by hand "
            f"and unpack it into {folder}."
        )
    old = found[0].read_text()
    if found[0].suffix == ".sources":
        own, text = folder / "src.sources", old.replace("Types: deb\n", "Types: deb-src\n")
    else:
        own = folder / "src.list"
        text = "".join(f"deb-src{line[3:]}\n" for line in old.splitlines() if line[:4] == "deb ")
    own.write_text(text)
    options = [
        "-o", f"Dir::Etc::sourcelist={own}", "-o", "Dir::Etc::sourceparts=-",
        "-o", f"Dir::State::lists={lists}",
    ]  # fmt: skip
    asked = ["dpkg-query", "-W", "-f", "${source:Version}", "openfoam"]
    version = subprocess.run(asked, capture_output=True, text=True, check=False).stdout.strip()
    package = f"openfoam={version}" if version else "openfoam"
    run_command(["apt-get", *options, "update"], folder, "update.log", "apt-get update")
    run_command(
        ["apt-get", *options, "source", package], folder, "fetch.log",
        "the fetch of OpenFOAM's source",
    )  # fmt: skip


def environment(tree: Path, library: Path) -> dict[str, str]:
    """Words of the environment in which wmake builds user libraries."""
    return {
        "WM_PROJECT": "OpenFOAM",
        "WM_PROJECT_VERSION": "v1912",
        "WM_PROJECT_DIR": str(tree),
        "WM_PROJECT_INST_DIR": str(tree.parent),
        "WM_DIR": str(tree / "wmake"),
        "WM_ARCH": "linux64",
        "WM_ARCH_OPTION": "64",
        "WM_COMPILER": "Gcc",
        "WM_COMPILER_TYPE": "system",
        "WM_COMPILER_LIB_ARCH": "64",
        "WM_COMPILE_OPTION": "Opt",
        "WM_PRECISION_OPTION": "DP",
        "WM_LABEL_SIZE": "32",
        "WM_LABEL_OPTION": "Int32",
        "WM_OSTYPE": "POSIX",
        "WM_LINK_LANGUAGE": "c++",
        "WM_MPLIB": "SYSTEMOPENMPI",
        "WM_OPTIONS": "linux64GccDPInt32Opt",
        "WM_CC": "gcc",
        "WM_CXX": "g++",
        "LIB_SRC": str(tree / "src"),
        "FOAM_SRC": str(tree / "src"),
        "FOAM_APP": str(tree / "applications"),
        "FOAM_SOLVERS": str(tree / "applications" / "solvers"),
        "FOAM_LIBBIN": "/usr/lib",
        "FOAM_EXT_LIBBIN": "/usr/lib",
        "FOAM_MPI": "sys-openmpi",
        "FOAM_USER_LIBBIN": str(library),
        "FOAM_USER_APPBIN": str(library),
        "PATH": f"{tree / 'wmake'}{os.pathsep}{os.environ.get('PATH', '')}",
    }


def running(library: Path) -> dict[str, str]:
    """Words of the environment in which solvers find their settings and the adapter."""
    old = os.environ.get("LD_LIBRARY_PATH", "")
    return {
        "WM_PROJECT_DIR": str(PROJECT),
        "LD_LIBRARY_PATH": os.pathsep.join(filter(None, [str(library), old])),
        "OMP_NUM_THREADS": "1",
        **as_root(),
    }
