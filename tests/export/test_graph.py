"""The ONNX graph: valid, double precision throughout, metadata, any number of pairs."""

from __future__ import annotations

import onnx
import pytest
from exported_closures import FITTED, UNTRAINED
from onnx import TensorProto
from onnx.reference import ReferenceEvaluator

from greybed.closures import content_hash, golden_rows
from greybed.closures.viewfactor.limits import check_limits
from greybed.core import InputError, RangeError
from greybed.export import OnnxClosure, export_onnx
from greybed.export.replay import SINGLE_TOLERANCE, relative_error, replay

NAMES = UNTRAINED + FITTED


@pytest.fixture
def graph(closures, tmp_path):
    def make(name):
        return onnx.load(export_onnx(closures[name], tmp_path / "closure.onnx"))

    return make


@pytest.mark.parametrize("name", NAMES)
def test_checker_and_shapes(name, graph, closures):
    model = graph(name)
    onnx.checker.check_model(model, full_check=True)
    inferred = onnx.shape_inference.infer_shapes(model, strict_mode=True, data_prop=True).graph
    types = {value.name: value.type.tensor_type for value in [*inferred.input, *inferred.output]}
    assert [value.name for value in inferred.input] == list(closures[name].marker_names)
    assert [value.name for value in inferred.output] == ["view_factor", "stderr", "extrapolates"]
    for value, kind in types.items():
        expected = TensorProto.BOOL if value == "extrapolates" else TensorProto.DOUBLE
        assert kind.elem_type == expected
        assert [d.dim_param for d in kind.shape.dim] == ["N"]


@pytest.mark.parametrize("name", NAMES)
def test_single_precision_only_where_a_forest_compares(name, graph):
    inferred = onnx.shape_inference.infer_shapes(graph(name), strict_mode=True).graph
    single = [
        value.name
        for value in inferred.value_info
        if value.type.tensor_type.elem_type == TensorProto.FLOAT
    ]
    assert len(single) == ("forest" in name)
    assert not [t for t in inferred.initializer if t.data_type == TensorProto.FLOAT]


@pytest.mark.parametrize("name", NAMES)
def test_reference_evaluator_gives_the_golden_rows(name, graph, closures):
    inputs, expected = golden_rows(closures[name])
    feed = dict(zip(closures[name].marker_names, inputs[:12].T.copy(), strict=True))
    factor, error, _ = ReferenceEvaluator(graph(name)).run(None, feed)
    assert relative_error(factor, expected[:12, 0]).max() <= 1e-12
    assert relative_error(error, expected[:12, 1]).max() <= 1e-12


@pytest.mark.parametrize("name", ["fitted mlp pencil", "fitted forest published", "drag", "term"])
def test_single_precision_has_the_same_limits_and_digits(name, closures, tmp_path):
    closure = closures[name]
    path = export_onnx(closure, tmp_path / "single.onnx", single=True)
    model = onnx.load(path)
    kinds = {v.type.tensor_type.elem_type for v in [*model.graph.input, *model.graph.output]}
    assert kinds == {TensorProto.FLOAT, TensorProto.BOOL}
    assert not [t for t in model.graph.initializer if t.data_type == TensorProto.DOUBLE]
    form = OnnxClosure(path)
    result = replay(closure, form, SINGLE_TOLERANCE)
    assert result["passed"], result
    assert result["max_relative_error"] > 1e-10  # or it would be double after all
    if getattr(closure, "quantity", "") == "viewfactor":
        cases = check_limits(closure, evaluate=form.evaluate, n=3000, rounding=2e-6)
        assert [case for case in cases if not case.passed] == []


def test_names_shapes_and_meanings_come_back(closures, tmp_path):
    # What a viewer of graphs shows: Netron reads nothing else.
    for name in ("fitted mlp pencil", "drag", "term"):
        model = onnx.load(export_onnx(closures[name], tmp_path / "a.onnx"))
        graph = model.graph
        assert graph.name == model.metadata_props[0].value
        assert graph.doc_string
        assert model.doc_string == graph.doc_string
        for value in [*graph.input, *graph.output]:
            assert value.doc_string
        # Every value between has a type and a shape, every node a name of its own.
        known = {v.name: v.type.tensor_type for v in [*graph.value_info, *graph.output]}
        assert {n.output[0] for n in graph.node} == set(known)
        assert all(t.HasField("shape") and t.elem_type for t in known.values())
        assert len({n.name for n in graph.node}) == len(graph.node)


def test_metadata(graph, closures):
    facts = {p.key: p.value for p in graph("fitted mlp pencil").metadata_props}
    assert facts["hash"] == content_hash(closures["fitted mlp pencil"])
    assert facts["dataset_hash"] == "ab" * 32
    assert facts["licence"] == "BSD-3-Clause"
    assert facts["marker_radius_over_distance"] == "r_j / d [-], in (0, 1.05]"
    assert facts["marker_radius_ratio"] == "r_j / r_i [-], in (0, inf)"


def test_the_same_closure_gives_the_same_bytes(closures, tmp_path):
    for name in ("mlp pencil 3", "forest published 3"):
        first = export_onnx(closures[name], tmp_path / "a.onnx").read_bytes()
        assert export_onnx(closures[name], tmp_path / "b.onnx").read_bytes() == first


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("n", [0, 1, 7])
def test_any_number_of_pairs(n, name, closures, onnx_form):
    inputs, expected = golden_rows(closures[name])
    feed = dict(zip(closures[name].marker_names, inputs[:n].T, strict=True))
    answer = onnx_form(name).evaluate(**feed)
    assert answer.shape == (n,)
    assert (relative_error(answer, expected[:n, 0]) <= 1e-12).all()


def test_refusals(onnx_form, tmp_path):
    with pytest.raises(RangeError, match="name each of them once"):
        onnx_form("mlp pencil 3").evaluate(radius_ratio=1.0)
    broken = tmp_path / "broken.onnx"
    broken.write_bytes(b"no graph")
    with pytest.raises(InputError, match=r"broken\.onnx: onnxruntime cannot open this graph"):
        OnnxClosure(broken)
