"""Export a closure to C++ or ONNX, and replay its golden rows there before anything is written.

Examples:
  greybed export shipped:viewfactor_mlp_pencil --to cpp,onnx --out runs/host
  greybed export bed.closure --to cpp --name bed_radiation --out runs/host
  greybed export bed.closure --to cpp,c,fortran,onnx --out runs/host

cpp: NAME.hpp (one header, C++11), NAME_test.cpp, CMakeLists.txt, README.md; c: also NAME_c.h and
NAME_c.cpp for libNAME.so; fortran: also the module NAME.f90; onnx: NAME.onnx in double precision;
onnx32: NAME_f32.onnx in single precision.
Without a C++ compiler the header is written unreplayed, and says so. summary.json holds the
errors. The exit code is 1, and nothing is written, where a golden row fails.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from greybed.closures.artifact import Closure
    from greybed.closures.term import GreyBoxTerm

TARGETS = ("cpp", "c", "fortran", "onnx", "onnx32")


def targets(text: str) -> tuple[str, ...]:
    """Read a list of targets such as ``cpp,onnx``."""
    words = tuple(dict.fromkeys(word.strip() for word in text.split(",")))
    if not words or not set(words) <= set(TARGETS):
        raise argparse.ArgumentTypeError(
            f"{text!r} must be one or more of {', '.join(TARGETS)}, with commas between"
        )
    return words


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of ``greybed export``."""
    parser.add_argument(
        "model", metavar="MODEL", help="a .closure file, shipped:NAME, or a grey-box term"
    )
    parser.add_argument(
        "--to",
        type=targets,
        required=True,
        metavar="LIST",
        help=f"one or more of {', '.join(TARGETS)}",
    )
    parser.add_argument("--out", required=True, metavar="DIR", help="folder for the files")
    parser.add_argument(
        "--name",
        metavar="NAME",
        help="name of the files and of the C++ namespace (default: from markers and kind)",
    )


def _replayed(
    subject: Closure | GreyBoxTerm, target: str, folder: Path, name: str | None
) -> dict[str, Any]:
    """Export to one target and replay the golden rows; ``passed`` is None without a compiler."""
    import tempfile

    from greybed.export import (
        CompiledClosure,
        OnnxClosure,
        compile_cpp,
        export_cpp,
        export_onnx,
        find_compiler,
    )
    from greybed.export.metadata import export_name
    from greybed.export.replay import (
        CPP_TOLERANCE,
        ONNX_TOLERANCE,
        SINGLE_TOLERANCE,
        replay,
    )

    word = export_name(subject, name)
    if target in ("onnx", "onnx32"):
        single = target == "onnx32"
        file = folder / f"{word}{'_f32' if single else ''}.onnx"
        graph = export_onnx(subject, file, word, single=single)
        return replay(subject, OnnxClosure(graph), SINGLE_TOLERANCE if single else ONNX_TOLERANCE)
    if target in ("c", "fortran"):
        return _library(subject, target, folder, word)
    header = export_cpp(subject, folder, word)
    compiler = find_compiler()
    if compiler is None:
        return {"passed": None, "reason": "no C++ compiler found: install one or set CXX"}
    with tempfile.TemporaryDirectory() as build:
        program = CompiledClosure(compile_cpp(header, build))
        return {**replay(subject, program, CPP_TOLERANCE), "compiler": " ".join(compiler)}


def _library(
    subject: Closure | GreyBoxTerm, target: str, folder: Path, word: str
) -> dict[str, Any]:
    """The same for the C library, or for the Fortran module that calls it."""
    import tempfile

    from greybed.export import (
        CompiledLibrary,
        FortranProgram,
        compile_c,
        export_c,
        find_compiler,
        find_fortran,
        form_of,
    )
    from greybed.export.replay import CPP_TOLERANCE, replay

    header = export_c(subject, folder, word, fortran=target == "fortran")
    if find_compiler() is None:
        return {"passed": None, "reason": "no C++ compiler found: install one or set CXX"}
    if target == "fortran" and find_fortran() is None:
        return {"passed": None, "reason": "no Fortran compiler found: install gfortran or set FC"}
    form = form_of(subject, word)
    with tempfile.TemporaryDirectory() as build:
        library = compile_c(header, build)
        if target == "c":
            return replay(subject, CompiledLibrary(library, form), CPP_TOLERANCE)
        return replay(subject, FortranProgram(header, library, form), CPP_TOLERANCE)


def run(options: argparse.Namespace) -> int:
    """Export, replay, move the files to their place."""
    import os
    import tempfile

    from greybed.closures import content_hash, load_any, model_path
    from greybed.closures.term import GreyBoxTerm, is_term, load_term
    from greybed.core.files import atomic_path, write_summary
    from greybed.core.folder_lock import locked_folder

    model = model_path(options.model)
    subject: Closure | GreyBoxTerm = load_term(model) if is_term(model) else load_any(model)
    with locked_folder(options.out) as folder:
        results: dict[str, Any] = {}
        # Files reach their place only after the replay: what computes wrongly is never seen.
        with tempfile.TemporaryDirectory(dir=folder, prefix=".export-") as name:
            workplace = Path(name)
            for target in options.to:
                result = _replayed(subject, target, workplace, options.name)
                results[target] = result
                if result["passed"] is None:
                    print(f"{target}: golden rows not replayed ({result['reason']})")
                    continue
                print(
                    f"{target}: {result['rows'] - result['failing_rows']} of {result['rows']} "
                    f"golden rows replayed, largest relative error "
                    f"{result['max_relative_error']:.1e} (at most {result['tolerance']:g})"
                )
                if not result["passed"]:
                    print(
                        f"{target}: refused, nothing written: {result['failing_rows']} rows and "
                        f"{result.get('self_test', 0)} of the header's own checks fail; try "
                        "another compiler in CXX, or train the closure again."
                    )
                    return 1
            files = sorted(path.name for path in workplace.iterdir())
            for file in files:
                with atomic_path(folder / file) as temporary:
                    os.replace(workplace / file, temporary)
        sealed = (
            subject.content_hash() if isinstance(subject, GreyBoxTerm) else content_hash(subject)
        )
        summary = write_summary(
            folder,
            "export",
            {"hash": sealed, "files": files, "targets": results},
            model,
        )
        for file in files:
            print(f"wrote {folder / file}")
        print(f"wrote {summary}")
        return 0
