"""OpenFOAM as a host: a particle force and a drag model, built against Debian's source tree."""

from __future__ import annotations

import gzip
import re
import shutil
from pathlib import Path
from typing import Any

from greybed.core.errors import InputError
from greybed.hosts.model import DRAG, HostModel
from greybed.hosts.openfoam_source import environment, missing_openfoam, prepared, running
from greybed.hosts.shell import run_command, told_by_greybed
from greybed.hosts.writing import write_adapter

FORCE, PHASE, LIBRARIES = "force", "phase", "lib"
EXAMPLES = Path("/usr/share/doc/openfoam-examples/examples")
# Case of the tutorials: its folder there, its time steps in the example.
TUTORIALS = {
    "DPMFoam": "lagrangian/DPMFoam/Goldschmidt",
    "MPPICFoam": "lagrangian/MPPICFoam/Goldschmidt",
    "twoPhaseEulerFoam": "multiphase/twoPhaseEulerFoam/laminar/fluidisedBed",
}
STEPS = 20
_OWN_FORCE = re.compile(r"\w+Drag\s*\{[^}]*\}")
_OWN_DRAG = re.compile(r"type\s+GidaspowErgunWenYu;\s*residualRe\s+[^;]*;")


def generate(model: HostModel, folder: Path) -> list[str]:
    """Write the sources of both libraries.

    Raises
    ------
    InputError
        If the model is not one of drag.
    """
    if model.kind != DRAG:
        raise InputError(
            f"the host openfoam takes models of drag only, not {model.text}; radiation between "
            "particles is for the hosts lammps and liggghts."
        )
    files = {"greybed_drag.hpp": "common/greybed_drag.hpp"}
    for name in (
        "force/GreybedDragForce.H", "force/GreybedDragForce.C", "force/makeColliding.C",
        "force/makeMPPIC.C", "force/Make/files", "force/Make/options", "phase/greybedDrag.H",
        "phase/greybedDrag.C", "phase/Make/files", "phase/Make/options",
    ):  # fmt: skip
        files[name] = f"openfoam/{name}"
    return write_adapter(model, "openfoam", folder, files)


def build(folder: Path) -> float:
    """Make the source tree where there is none yet, and both libraries; returns seconds.

    Raises
    ------
    InputError
        If something is missing, with the command that installs it, or if a step fails.
    """
    tree = prepared()
    library = folder.resolve() / LIBRARIES
    library.mkdir(exist_ok=True)
    words = environment(tree, library)
    return sum(
        run_command(
            ["wmake", "libso", part], folder, f"build_{part}.log", f"the build of {part}", words
        )
        for part in (FORCE, PHASE)
    )


def run(folder: Path, ranks: int = 1) -> float:
    """Run a tutorial case with each solver, 20 steps, its drag replaced; returns seconds.

    Raises
    ------
    InputError
        If something is missing or a step fails.
    """
    if lacking := missing_openfoam(tutorials=True):
        raise InputError(f"the host openfoam needs {lacking}.")
    seconds = 0.0
    for solver in TUTORIALS:
        case = folder / solver
        lay_out(solver, case)
        seconds += run_case(solver, case, folder / LIBRARIES, ranks)
    return seconds


def lay_out(solver: str, case: Path, steps: int = STEPS, *, own: bool = False, **more: Any) -> None:
    """Lay out the tutorial case of a solver, with the adapter in place of its own drag.

    Parameters
    ----------
    solver : str
        One of ``TUTORIALS``.
    case : Path
        Folder of the case; replaced.
    steps : int
        Time steps.
    own : bool
        Keep OpenFOAM's own drag, for comparisons.
    **more
        Entries of the drag's dictionary.
    """
    shutil.rmtree(case, ignore_errors=True)
    shutil.copytree(EXAMPLES / TUTORIALS[solver], case)
    # Debian packs the longer files, which not every tool reads.
    for packed in case.rglob("*.gz"):
        packed.with_suffix("").write_bytes(gzip.decompress(packed.read_bytes()))
        packed.unlink()
    control = case / "system" / "controlDict"
    text = control.read_text()
    step = float(re.findall(r"deltaT\s+([^;]+);", text)[0])
    text = re.sub(r"endTime\s+[^;]+;", f"endTime {steps * step:.9g};", text)
    library = "libgreybedPhaseDrag.so" if solver == "twoPhaseEulerFoam" else "libgreybedForce.so"
    control.write_text(text + ("" if own else f'\nlibs ("{library}");\n'))
    if own:
        return
    if solver == "twoPhaseEulerFoam":
        entries = {"rho": 1.2, "mu": 1.84e-5, **more}
        file, pattern = case / "constant" / "phaseProperties", _OWN_DRAG
        put = "type greybed; " + _entries(entries)
    else:
        name = re.findall(r"alphac\s+(\S+);", _properties(case).read_text())
        file, pattern = _properties(case), _OWN_FORCE
        put = "greybedDrag { " + _entries({"alphac": name[0], **more}) + " }"
    text, count = pattern.subn(put, file.read_text())
    if count != 1:
        raise InputError(f"{file}: found {count} drag entries to replace, not 1; edit it by hand.")
    file.write_text(text)


def run_case(solver: str, case: Path, library: Path, ranks: int = 1) -> float:
    """Mesh a case and run its solver, its output in ``log``; returns seconds of the solver.

    Raises
    ------
    InputError
        If a step fails.
    """
    words = running(library.resolve())
    run_command(["blockMesh"], case, "log.mesh", "blockMesh", words)
    if ranks == 1:
        return run_command([solver], case, "log", solver, words)
    decompose = case / "system" / "decomposeParDict"
    head = "FoamFile { version 2.0; format ascii; class dictionary; object decomposeParDict; }"
    decompose.write_text(
        f"{head}\nnumberOfSubdomains {ranks};\nmethod simple;\n"
        f"coeffs {{ n ({ranks} 1 1); }}\nsimpleCoeffs {{ n ({ranks} 1 1); delta 0.001; }}\n"
    )
    run_command(["decomposePar", "-force"], case, "log.decompose", "decomposePar", words)
    passed = [word for name in words if name != "PATH" for word in ("-x", name)]
    command = ["mpirun", "--bind-to", "none", "-np", str(ranks), *passed, solver, "-parallel"]
    return run_command(command, case, "log", solver, words)


def said(folder: Path) -> list[str]:
    """What the adapter said at the end of each tutorial case."""
    return [
        f"{solver}: {line}"
        for solver in TUTORIALS
        if (folder / solver / "log").exists()
        for line in told_by_greybed(folder / solver / "log")
    ]


def _properties(case: Path) -> Path:
    return case / "constant" / "kinematicCloudProperties"


def _entries(values: dict[str, Any]) -> str:
    return " ".join(f"{name} {value};" for name, value in values.items())
