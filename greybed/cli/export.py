"""Export a closure to C++ or ONNX, and replay its golden rows there before anything is written.

Examples:
  greybed export bed.closure --to cpp --out runs/host
  greybed export bed.closure --to cpp,onnx --name bed_radiation --out runs/host

C++: NAME.hpp (one header, C++11), NAME_test.cpp, CMakeLists.txt, README.md; ONNX: NAME.onnx.
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

TARGETS = ("cpp", "onnx")


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
        "--to", type=targets, required=True, metavar="LIST", help="cpp, onnx, or cpp,onnx"
    )
    parser.add_argument("--out", required=True, metavar="DIR", help="folder for the files")
    parser.add_argument(
        "--name",
        metavar="NAME",
        help="name of the files and of the C++ namespace (default: from markers and kind)",
    )


def _replayed(closure: Closure, target: str, folder: Path, name: str | None) -> dict[str, Any]:
    """Export to one target and replay the golden rows; ``passed`` is None without a compiler."""
    import tempfile

    from greybed.closures import FilteredDragClosure
    from greybed.export import (
        CompiledClosure,
        CompiledDrag,
        OnnxClosure,
        OnnxDrag,
        compile_cpp,
        export_cpp,
        export_drag_cpp,
        export_drag_onnx,
        export_onnx,
        find_compiler,
    )
    from greybed.export.metadata import export_name
    from greybed.export.replay import CPP_TOLERANCE, ONNX_TOLERANCE, replay

    word = export_name(closure, name)
    if target == "onnx":
        file = folder / f"{word}.onnx"
        if isinstance(closure, FilteredDragClosure):
            return replay(closure, OnnxDrag(export_drag_onnx(closure, file, word)), ONNX_TOLERANCE)
        return replay(closure, OnnxClosure(export_onnx(closure, file, word)), ONNX_TOLERANCE)
    drag = isinstance(closure, FilteredDragClosure)
    if isinstance(closure, FilteredDragClosure):
        header = export_drag_cpp(closure, folder, word)
    else:
        header = export_cpp(closure, folder, word)
    compiler = find_compiler()
    if compiler is None:
        return {"passed": None, "reason": "no C++ compiler found: install one or set CXX"}
    with tempfile.TemporaryDirectory() as build:
        built = compile_cpp(header, build)
        program = CompiledDrag(built) if drag else CompiledClosure(built)
        return {**replay(closure, program, CPP_TOLERANCE), "compiler": " ".join(compiler)}


def _replayed_term(
    term: GreyBoxTerm, target: str, folder: Path, name: str | None
) -> dict[str, Any]:
    """The same for a grey-box term."""
    import tempfile

    from greybed.export import term as exports

    word = name or term.name
    if target == "onnx":
        path = exports.export_term_onnx(term, folder / f"{word}.onnx", name)
        return exports.replay_term_onnx(term, path)
    header = exports.export_term_cpp(term, folder, name)
    with tempfile.TemporaryDirectory() as build:
        return exports.replay_term_cpp(header, Path(build))


def run(options: argparse.Namespace) -> int:
    """Export, replay, move the files to their place."""
    import os
    import tempfile

    from greybed.closures import content_hash, load_any, model_path
    from greybed.closures.term import is_term, load_term
    from greybed.core.files import atomic_path, output_folder, write_summary

    model = model_path(options.model)
    term = load_term(model) if is_term(model) else None
    closure = None if term is not None else load_any(model)
    folder = output_folder(options.out)
    results: dict[str, Any] = {}
    # Files reach their place only after the replay: a header that computes wrongly is never seen.
    with tempfile.TemporaryDirectory(dir=folder, prefix=".export-") as name:
        workplace = Path(name)
        for target in options.to:
            if closure is not None:
                result = _replayed(closure, target, workplace, options.name)
            else:
                assert term is not None
                result = _replayed_term(term, target, workplace, options.name)
            results[target] = result
            if result["passed"] is None:
                print(f"{target}: golden rows not replayed ({result['reason']})")
                continue
            print(
                f"{target}: {result['rows'] - result['failing_rows']} of {result['rows']} golden "
                f"rows replayed, largest relative error {result['max_relative_error']:.1e} "
                f"(at most {result['tolerance']:g})"
            )
            if not result["passed"]:
                print(
                    f"{target}: refused, nothing written: {result['failing_rows']} rows and "
                    f"{result.get('self_test', 0)} of the header's own checks fail; try another "
                    "compiler in CXX, or train the closure again."
                )
                return 1
        files = sorted(path.name for path in workplace.iterdir())
        for file in files:
            with atomic_path(folder / file) as temporary:
                os.replace(workplace / file, temporary)
    sealed = term.content_hash() if term is not None else content_hash(load_any(model))
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
