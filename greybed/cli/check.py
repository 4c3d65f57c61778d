"""Check a closure: limiting cases, golden rows, hash, and the ranges it was trained for.

Examples:
  greybed check shipped:viewfactor_mlp_pencil
  greybed check bed.closure
  greybed check bed.closure --exported cpp,onnx --out runs/check
  greybed check drag.closure                       # filtered drag: fraction kept

--exported runs the same limiting cases on the compiled C++ header and on the ONNX graph. The exit
code is 0 if all hold, 1 if one fails, 2 if the file cannot be used.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pathlib import Path

    from greybed.closures.artifact import Closure
    from greybed.closures.viewfactor.limits import LimitCase


def targets(text: str) -> tuple[str, ...]:
    """Read a list of the exported forms that are checked."""
    words = tuple(dict.fromkeys(word.strip() for word in text.split(",")))
    if not words or not set(words) <= {"cpp", "onnx"}:
        raise argparse.ArgumentTypeError(
            f"{text!r} must be one or more of cpp, onnx, with commas between"
        )
    return words


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of ``greybed check``."""
    parser.add_argument("model", metavar="MODEL", help="a .closure file, or shipped:NAME")
    parser.add_argument(
        "--exported",
        type=targets,
        default=(),
        metavar="LIST",
        help="also check its exported forms: cpp, onnx, or cpp,onnx",
    )
    parser.add_argument("--out", metavar="DIR", help="also write DIR/summary.json")


def _table(cases: list[LimitCase]) -> str:
    lines = [f"  {'limiting case':<52}{'deviation':>11}{'bound':>11}"]
    lines += [
        f"  {case.name:<52}{case.error:>11.2e}{case.bound:>11.2e}"
        f"  {'pass' if case.passed else 'FAIL'}"
        for case in cases
    ]
    return "\n".join(lines)


def _plain(cases: list[LimitCase]) -> list[dict[str, Any]]:
    return [
        {"name": c.name, "deviation": c.error, "bound": c.bound, "passed": c.passed} for c in cases
    ]


def _ranges(closure: Closure) -> str:
    from numpy import isfinite

    from greybed.export.metadata import allowed

    lines = ["  markers"]
    lines += [
        f"    {marker.name:<28}{allowed(marker):<16} {marker.meaning}"
        for marker in closure.markers.markers
    ]
    low, high = closure.domain.low, closure.domain.high
    if not (isfinite(low).any() or isfinite(high).any()):
        return "\n".join([*lines, "  features of the training data: no bounds (untrained)"])
    lines.append("  features of the training data")
    bounds = zip(closure.markers.feature_names, low, high, strict=True)
    lines += [f"    {name:<28}{lower:.4g} to {upper:.4g}" for name, lower, upper in bounds]
    return "\n".join(lines)


def _exported(closure: Closure, target: str, folder: Path) -> dict[str, Any]:
    """Limiting cases and golden rows of one exported form."""
    from greybed.closures import FilteredDragClosure
    from greybed.closures.drag.filtered import limits as drag_limits
    from greybed.closures.viewfactor.limits import check_limits
    from greybed.export import CompiledClosure, OnnxClosure, compile_cpp, export_cpp, export_onnx
    from greybed.export.replay import CPP_TOLERANCE, ONNX_TOLERANCE, replay

    form: CompiledClosure | OnnxClosure
    if target == "cpp":
        form = CompiledClosure(compile_cpp(export_cpp(closure, folder), folder))
    else:
        form = OnnxClosure(export_onnx(closure, folder / "closure.onnx"))
    rows = replay(closure, form, CPP_TOLERANCE if target == "cpp" else ONNX_TOLERANCE)
    if isinstance(closure, FilteredDragClosure):
        return {"cases": drag_limits.check_limits(closure, form.predict), "rows": rows}
    return {"cases": check_limits(closure, evaluate=form.evaluate), "rows": rows}


def run(options: argparse.Namespace) -> int:
    """Print the table and, with ``--out``, write it; 1 where something fails."""
    import sys
    import tempfile
    from pathlib import Path

    from greybed.closures import FilteredDragClosure, content_hash, load_any, model_path
    from greybed.closures.artifact import GOLDEN_ROWS, GOLDEN_TOLERANCE
    from greybed.closures.drag.filtered import limits as drag_limits
    from greybed.closures.viewfactor.limits import check_limits
    from greybed.core import VerificationError
    from greybed.core.files import output_folder, write_summary
    from greybed.core.folder_lock import locked_folder

    out = output_folder(options.out) if options.out else None
    file = model_path(options.model)
    try:
        closure = load_any(file)  # replays the golden rows
    except VerificationError as error:
        print(f"greybed check: {error}", file=sys.stderr)
        return 1
    hash_ = content_hash(closure)
    if isinstance(closure, FilteredDragClosure):
        cases = drag_limits.check_limits(closure, n=1_000_000)
    else:
        cases = check_limits(closure)
    print(f"{options.model}: {closure.quantity}, {closure.kind}, markers {closure.markers.name}")
    print(f"  hash {hash_}\n{_ranges(closure)}\n{_table(cases)}")
    print(f"  golden rows: {GOLDEN_ROWS} of {GOLDEN_ROWS} to {GOLDEN_TOLERANCE:g}")
    passed = all(case.passed for case in cases)
    results: dict[str, Any] = {
        "quantity": closure.quantity,
        "kind": closure.kind,
        "markers": closure.markers.name,
        "hash": hash_,
        "limiting_cases": _plain(cases),
        "golden_rows": GOLDEN_ROWS,
        "exported": {},
    }
    for target in options.exported:
        with tempfile.TemporaryDirectory() as folder:
            found = _exported(closure, target, Path(folder))
        rows = found["rows"]
        print(f"exported to {target}\n{_table(found['cases'])}")
        print(
            f"  golden rows: {rows['rows'] - rows['failing_rows']} of {rows['rows']} to "
            f"{rows['tolerance']:g}, largest relative error {rows['max_relative_error']:.1e}"
        )
        passed = passed and rows["passed"] and all(case.passed for case in found["cases"])
        results["exported"][target] = {"limiting_cases": _plain(found["cases"]), **rows}
    results["passed"] = passed
    if out is not None:
        with locked_folder(out):
            print(f"wrote {write_summary(out, 'check', results, file)}")
    print("all hold" if passed else "a check FAILED")
    return 0 if passed else 1
