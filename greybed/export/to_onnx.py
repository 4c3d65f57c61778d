"""A closure or a term as an ONNX graph: markers by name in, answers and extrapolation out."""

from __future__ import annotations

import os
from pathlib import Path

from greybed.closures import FilteredDragClosure
from greybed.closures.artifact import Closure
from greybed.closures.term import GreyBoxTerm
from greybed.core.files import atomic_path
from greybed.export.drag_graph import fill_drag
from greybed.export.factor_graph import fill_factor
from greybed.export.form import Form
from greybed.export.graph import ML_DOMAIN, Graph, range_nodes
from greybed.export.header import form_of
from greybed.export.term import covariate

# Operators of 2022, so that older runtimes read a network; a forest needs TreeEnsemble of 2024,
# the first one that gives doubles.
OPSET, IR_VERSION = 17, 8
ML_OPSET, ML_IR_VERSION = 5, 10
MEANINGS = {
    "stderr": "standard error of the closure",
    "kept_along": "fraction of drag that is kept along gravity",
    "kept_across": "the same across gravity",
    "share": "share of the force of the pressure gradient",
}


def export_onnx(
    subject: Closure | GreyBoxTerm,
    path: str | os.PathLike[str],
    name: str | None = None,
    *,
    single: bool = False,
) -> Path:
    """Write a closure or a term as an ONNX graph.

    Parameters
    ----------
    subject : ViewFactorClosure, FilteredDragClosure or GreyBoxTerm
        What to export.
    path : path
        File to write.
    name : str, optional
        Name of the graph; made from the closure by default.
    single : bool
        Whether it computes in single precision, float32 in and out.

    Returns
    -------
    file : Path
        Inputs: the markers by name, each float64 [N]. Outputs, float64 [N] and NaN where a marker
        is out of range: ``view_factor``, ``wall_factor`` or ``exchange_factor``; of filtered drag
        ``kept_along``, ``kept_across`` and ``share``; ``stderr``; of a term ``factor`` alone. Last
        ``extrapolates``, bool [N].

    Raises
    ------
    InputError
        If the closure has no form in ONNX.
    OutputError
        If the file cannot be written.

    Notes
    -----
    The graph is checked in full before it is written. A forest's branches compare in single
    precision, as in Python.
    """
    form = form_of(subject, name)
    g = Graph(single)
    if isinstance(subject, GreyBoxTerm):
        _fill_term(g, subject)
    elif isinstance(subject, FilteredDragClosure):
        fill_drag(g, subject)
    else:
        fill_factor(g, subject)
    return _write(g, form, path)


def _fill_term(g: Graph, term: GreyBoxTerm) -> None:
    z = covariate(term)
    gate = g.add("Pow", g.add("Div", z, float(term.reference)), float(term.exponent))
    whole = g.add("Add", g.add("Mul", gate, float(term.amplitude)), 1.0)
    factor = whole if term.side > 0 else g.add("Div", 1.0, whole)
    markers = form_of(term).markers
    g.add("Where", range_nodes(g, markers), factor, float("nan"), out="factor")
    inside = g.add(
        "And",
        g.add("GreaterOrEqual", z, float(term.window[0])),
        g.add("LessOrEqual", z, float(term.window[1])),
    )
    g.add("Not", inside, out="extrapolates")


def _write(g: Graph, form: Form, path: str | os.PathLike[str]) -> Path:
    """Put a graph that has been filled into its place: markers in, answers out."""
    import onnx
    from onnx import TensorProto, helper

    real = TensorProto.FLOAT if g.single else TensorProto.DOUBLE
    # A name as length, since a runtime must take any number of rows.
    inputs = [
        helper.make_tensor_value_info(marker.name, real, ["N"], form.facts[f"marker_{marker.name}"])
        for marker in form.markers
    ]
    title = f"{form.quantity.title} [-]"
    given = [
        helper.make_tensor_value_info(n, real, ["N"], MEANINGS.get(n, title)) for n in form.outputs
    ]
    given.append(
        helper.make_tensor_value_info(
            "extrapolates", TensorProto.BOOL, ["N"], "whether the training data lie elsewhere"
        )
    )
    law = " ".join(form.quantity.law)
    graph = helper.make_graph(
        g.nodes, form.name, inputs, given, list(g.constants.values()), doc_string=law
    )
    forest = form.kind == "forest"
    opsets = [helper.make_opsetid("", OPSET)]
    if forest:
        opsets.append(helper.make_opsetid(ML_DOMAIN, ML_OPSET))
    model = helper.make_model(
        graph,
        opset_imports=opsets,
        ir_version=ML_IR_VERSION if forest else IR_VERSION,
        producer_name="greybed",
        producer_version=form.facts["greybed_version"],
        doc_string=law,
    )
    helper.set_model_props(model, {**form.facts, "precision": "single" if g.single else "double"})
    # Shapes of what lies between, for whoever looks at the graph.
    model = onnx.shape_inference.infer_shapes(model, strict_mode=True, data_prop=True)
    onnx.checker.check_model(model, full_check=True)
    target = Path(path)
    with atomic_path(target) as temporary:
        temporary.write_bytes(model.SerializeToString(deterministic=True))
    return target
