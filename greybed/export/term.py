"""A grey-box term as a C++11 header with its own test, and as an ONNX graph."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from greybed.closures.term import GOLDEN, TOLERANCE, GreyBoxTerm
from greybed.core.errors import InputError
from greybed.core.files import atomic_path
from greybed.export.metadata import LICENCE

HEADER = """\
// {name}: factor on {response}, a function of {covariate} [{unit}].
// Grey-box term, hash {hash}. {licence}
// It describes a residual and names no cause; fitted from {low:.6g} to {high:.6g} [{unit}].
// The factor is exactly 1 where {limit}.
#ifndef GREYBED_TERM_{upper}_HPP
#define GREYBED_TERM_{upper}_HPP
#include <cmath>

namespace {name} {{

inline const char* hash() {{ return "{hash}"; }}

// Added share [-] at {covariate} >= 0 [{unit}].
inline double gate({double} {covariate}) {{
    return {amplitude} * std::pow({covariate} / {reference}, {exponent});
}}

// Factor on {response} [-].
inline double eval({double} {covariate}) {{
    return {formula};
}}

inline bool in_domain({double} {covariate}) {{
    return {covariate} >= {low!r} && {covariate} <= {high!r};
}}

// Number of golden rows that fail, 0 is good; the largest relative error goes to worst.
inline int self_test(double* worst = nullptr) {{
    static const double values[{rows}] = {{{values}}};
    static const double factors[{rows}] = {{{factors}}};
    int failed = 0;
    double largest = 0.0;
    for (int i = 0; i < {rows}; ++i) {{
        const double off = std::fabs(eval(values[i]) - factors[i]) / factors[i];
        if (!(off <= {tolerance})) ++failed;
        if (off > largest) largest = off;
    }}
    if (worst) *worst = largest;
    return failed;
}}

}}  // namespace {name}
#endif
"""
PROGRAM = """\
#include "{name}.hpp"
#include <cstdio>
int main() {{
    double worst = 0.0;
    const int failed = {name}::self_test(&worst);
    std::printf("%d %.3g\\n", failed, worst);
    return failed ? 1 : 0;
}}
"""


def _word(term: GreyBoxTerm, name: str | None) -> str:
    word = name or re.sub(r"\W+", "_", term.name)
    if not re.fullmatch(r"[A-Za-z]\w*", word):
        raise InputError(
            f"--name {word!r} must be letters, digits and underscores, a letter first; change it."
        )
    return word


def export_term_cpp(term: GreyBoxTerm, folder: Path, name: str | None = None) -> Path:
    """Write NAME.hpp and NAME_test.cpp.

    Returns
    -------
    header : Path
        C++11, needs nothing but <cmath>; ``eval``, ``gate``, ``in_domain``, ``self_test``.
    """
    word = _word(term, name)
    covariate = re.sub(r"\W+", "_", term.covariate)
    values, factors = term.golden_rows()
    text = HEADER.format(
        name=word,
        upper=word.upper(),
        response=term.response,
        covariate=covariate,
        unit=term.unit or "-",
        hash=term.content_hash(),
        licence=LICENCE,
        limit=f"{covariate} is 0" if term.exponent > 0.0 else f"{covariate} grows without bound",
        double="double",
        amplitude=repr(float(term.amplitude)),
        reference=repr(float(term.reference)),
        exponent=repr(float(term.exponent)),
        formula=f"1.0 + gate({covariate})" if term.side > 0 else f"1.0 / (1.0 + gate({covariate}))",
        low=float(term.window[0]),
        high=float(term.window[1]),
        rows=len(values),
        values=", ".join(repr(float(v)) for v in values),
        factors=", ".join(repr(float(v)) for v in factors),
        tolerance=repr(TOLERANCE),
    )
    for path, content in (
        (folder / f"{word}.hpp", text),
        (folder / f"{word}_test.cpp", PROGRAM.format(name=word)),
    ):
        with atomic_path(path) as temporary:
            temporary.write_text(content)
    return folder / f"{word}.hpp"


def export_term_onnx(term: GreyBoxTerm, path: Path, name: str | None = None) -> Path:
    """Write the term as an ONNX graph: input the covariate [N], output ``factor`` [N], float64."""
    import onnx
    from onnx import TensorProto, helper

    from greybed.export.to_onnx import IR_VERSION, OPSET, Graph

    g = Graph()
    covariate = re.sub(r"\W+", "_", term.covariate)
    group = g.add("Div", covariate, float(term.reference))
    gate = g.add("Mul", g.add("Pow", group, float(term.exponent)), float(term.amplitude))
    whole = g.add("Add", gate, 1.0, out="factor" if term.side > 0 else "")
    if term.side < 0:
        g.add("Div", 1.0, whole, out="factor")
    graph = helper.make_graph(
        g.nodes,
        _word(term, name),
        [helper.make_tensor_value_info(covariate, TensorProto.DOUBLE, ["N"])],
        [helper.make_tensor_value_info("factor", TensorProto.DOUBLE, ["N"])],
        list(g.constants.values()),
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)])
    model.ir_version = IR_VERSION
    helper.set_model_props(model, {"hash": term.content_hash(), "response": term.response})
    onnx.checker.check_model(model, full_check=True)
    with atomic_path(path) as temporary:
        temporary.write_bytes(model.SerializeToString())
    return path


def replay_term_onnx(term: GreyBoxTerm, path: Path) -> dict[str, Any]:
    """Golden rows through ONNX Runtime."""
    import onnxruntime

    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    values, factors = term.golden_rows()
    (answer,) = session.run(["factor"], {session.get_inputs()[0].name: values})
    error = np.abs(answer - factors) / factors
    failing = int((~(error <= TOLERANCE)).sum())
    return {
        "passed": failing == 0,
        "rows": len(values),
        "failing_rows": failing,
        "max_relative_error": float(error.max()),
        "tolerance": TOLERANCE,
    }


def replay_term_cpp(header: Path, folder: Path) -> dict[str, Any]:
    """Golden rows through the compiled test; ``passed`` is None without a compiler."""
    import subprocess

    from greybed.export.replay import compile_cpp, find_compiler

    if find_compiler() is None:
        return {"passed": None, "reason": "no C++ compiler found: install one or set CXX"}
    program = compile_cpp(header, folder, ("-std=c++11", "-O2", "-Wall", "-Wextra", "-Werror"))
    ran = subprocess.run([str(program)], capture_output=True, text=True)
    failing, worst = ran.stdout.split()
    return {
        "passed": ran.returncode == 0,
        "rows": GOLDEN,
        "failing_rows": int(failing),
        "max_relative_error": float(worst),
        "tolerance": TOLERANCE,
    }
