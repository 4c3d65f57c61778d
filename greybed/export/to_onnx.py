"""A closure as an ONNX graph in double precision: markers by name in, factor and error out."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed.closures import ViewFactorClosure
from greybed.closures.artifact import Closure
from greybed.closures.markers import Marker
from greybed.closures.predictors import Forest, Network
from greybed.closures.viewfactor.closure import Domain
from greybed.closures.viewfactor.visibility import ODDS_BOUND, SPREAD_BOUND
from greybed.core import InputError
from greybed.core.exact import TOUCHING, quadrature
from greybed.core.files import atomic_path
from greybed.export.metadata import QUANTITIES, describe, export_name

# Operators of 2022, so that older runtimes read a network; a forest needs TreeEnsemble of 2024,
# the first one that gives doubles.
OPSET, IR_VERSION = 17, 8
ML_OPSET, ML_IR_VERSION = 5, 10
ML_DOMAIN = "ai.onnx.ml"


class Graph:
    """Nodes and constants of a graph under construction; every value is known by its name."""

    def __init__(self) -> None:
        self.nodes: list[Any] = []
        self.constants: dict[str, Any] = {}

    def constant(self, value: Any) -> str:
        """Name of a constant; equal numbers are stored once."""
        from onnx import numpy_helper

        array = np.asarray(value)
        key = f"constant_{len(self.constants)}"
        for name, known in self.constants.items():
            same = numpy_helper.to_array(known)
            if same.dtype == array.dtype and np.array_equal(same, array) and array.ndim == 0:
                return name
        self.constants[key] = numpy_helper.from_array(array, key)
        return key

    def add(self, op: str, *inputs: str | float | NDArray, out: str = "", **attributes: Any) -> str:
        """Append a node; numbers among the inputs become constants in double precision."""
        from onnx import helper

        names = [
            value if isinstance(value, str) else self.constant(np.asarray(value))
            for value in inputs
        ]
        result = out or f"{op.lower()}_{len(self.nodes)}"
        self.nodes.append(helper.make_node(op, names, [result], name=result, **attributes))
        return result

    def column(self, value: str) -> str:
        """[N] to [N, 1]."""
        return self.add("Unsqueeze", value, np.array([1], dtype=np.int64))

    def sum_columns(self, value: str) -> str:
        """[N, k] to [N]."""
        return self.add("ReduceSum", value, np.array([1], dtype=np.int64), keepdims=0)


def _log1p(g: Graph, x: str) -> str:
    """log(1 + x) to full relative precision (Kahan), as its single-precision cut may decide."""
    u = g.add("Add", 1.0, x)
    moved = g.add("Sub", u, 1.0)
    still = g.add("Equal", moved, 0.0)
    safe = g.add("Where", still, 1.0, moved)
    return g.add("Where", still, x, g.add("Div", g.add("Mul", g.add("Log", u), x), safe))


def _pair(g: Graph) -> tuple[str, str]:
    ratio = "radius_ratio"
    reach = g.add("Mul", "radius_over_distance", g.add("Add", 1.0, g.add("Div", 1.0, ratio)))
    total = g.add("Add", 1.0, ratio)
    return reach, g.add("Div", g.add("Mul", 4.0, ratio), g.add("Mul", total, total))


@dataclass(frozen=True)
class Parts:
    """Names of what a marker set computes in a graph.

    Attributes
    ----------
    features : tuple of str
        A value each.
    clear, gate, baseline, exact : str
        1 - gate, gate, baseline, and the factor that they share out.
    """

    features: tuple[str, ...]
    clear: str
    gate: str
    baseline: str
    exact: str


def _published(g: Graph) -> Parts:
    n = "n_between"
    # 1 - exp(-6 n) = 2 t / (1 + t) with t = tanh(3 n): exact zero at n = 0, no cancellation.
    t = g.add("Tanh", g.add("Mul", 3.0, n))
    gate = g.add("Div", g.add("Mul", 2.0, t), g.add("Add", 1.0, t))
    clear = g.add("Exp", g.add("Mul", -6.0, n))
    baseline = g.add("Add", 0.01, g.add("Mul", 0.98, g.add("Exp", g.add("Mul", -0.25, n))))
    features = (*_pair(g), _log1p(g, n), "solid_fraction")
    return Parts(features, clear, gate, baseline, _pair_factor(g))


def _open(g: Graph) -> tuple[str, str, str, str]:
    """The free share of the lines, and 1 - gate, gate and baseline made of it."""
    free = g.add("Sub", 1.0, "blocked_fraction")
    square = g.add("Mul", free, free)
    clear = g.add("Mul", square, square)
    gate = g.add("Sub", 1.0, clear)
    cubic = g.add("Add", 1.0, free)
    for _ in range(2):
        cubic = g.add("Add", 1.0, g.add("Mul", free, cubic))
    share = g.add("Sub", 1.0, g.add("Div", 1.0, cubic))
    return free, clear, gate, g.add("Add", 0.01, g.add("Mul", 0.98, share))


def _pencil(g: Graph) -> Parts:
    _, clear, gate, baseline = _open(g)
    features = (*_pair(g), "blocked_fraction", _log1p(g, "blockers_per_line"))
    return Parts(features, clear, gate, baseline, _pair_factor(g))


def _wall(g: Graph) -> Parts:
    free, clear, gate, baseline = _open(g)
    features = (
        "blocked_fraction",
        g.add("Log", g.add("Add", 1e-3, free)),
        g.add("Div", 1.0, "distance_over_radius"),
        "wall_share",
        "solid_fraction",
    )
    return Parts(features, clear, gate, baseline, "wall_share")


def _exchange(g: Graph) -> Parts:
    near, alike = _pair(g)
    direct = g.add("Mul", g.add("Mul", "emissivity", "visible_share"), _pair_factor(g))
    ratio2 = g.add("Mul", "radius_ratio", "radius_ratio")
    loss = g.add("Mul", g.add("Sub", 1.0, "emissivity"), ratio2)
    reflected = g.add("Div", loss, g.add("Add", 1.0, ratio2))
    exact = g.add("Add", direct, reflected)
    # A black pair that is wholly hidden has nothing to share out.
    some = g.add("Greater", exact, 0.0)
    safe = g.add("Where", some, exact, 1.0)
    clear = g.add("Where", some, g.add("Div", direct, safe), 1.0)
    baseline = g.add("Add", 0.002, g.add("Mul", g.add("Mul", 0.1, near), near))
    features = (near, g.add("Log", near), alike, "visible_share", "emissivity", "solid_fraction")
    return Parts(features, clear, g.add("Div", reflected, safe), baseline, exact)


FORMULAE = {"published": _published, "pencil": _pencil, "wall": _wall, "exchange": _exchange}


def _pair_factor(g: Graph) -> str:
    x = "radius_over_distance"
    other = g.add("Div", x, "radius_ratio")
    kappa = g.add("Mul", g.add("Mul", 4.0, x), other)
    both = g.add("Add", x, other)
    eps = g.add("Max", g.add("Sub", 1.0, g.add("Mul", both, both)), 0.0)
    square, weight = quadrature()
    under = g.add("Add", g.column(eps), g.add("Mul", g.column(kappa), square[None, :]))
    terms = g.add("Div", weight[None, :], g.add("Add", 1.0, g.add("Sqrt", under)))
    return g.add("Mul", g.add("Mul", x, x), g.sum_columns(terms))


def network_nodes(g: Graph, network: Network, features: str) -> str:
    """Outputs [N, n] of a network."""
    x = g.add("Div", g.add("Sub", features, network.mean), network.scale)
    for k, (weight, bias) in enumerate(zip(network.weights, network.biases, strict=True)):
        x = g.add("Add", g.add("MatMul", x, np.ascontiguousarray(weight)), bias)
        if k + 1 < len(network.weights):
            if network.bent:
                x = g.add("Div", x, g.add("Sqrt", g.add("Add", 1.0, g.add("Mul", x, x))))
            else:
                x = g.add("Tanh", x)
    return x


def forest_nodes(g: Graph, forest: Forest, features: str) -> str:
    """Outputs [N, n] of a forest."""
    from onnx import TensorProto, numpy_helper

    # Cut to single precision and back: comparing doubles then agrees with comparing singles.
    single = g.add("Cast", features, to=TensorProto.FLOAT)
    cut = g.add("Cast", single, to=TensorProto.DOUBLE)
    leaf = forest.feature < 0
    inner = np.flatnonzero(~leaf)
    n_inner, n_leaves = len(inner), int(leaf.sum())
    # Where a node went: its row among the inner nodes or among the leaves.
    row = np.where(leaf, np.cumsum(leaf), np.cumsum(~leaf)) - 1
    left, right = forest.left[inner], forest.left[inner] + 1
    roots, feature = row[forest.roots], forest.feature[inner]
    split = forest.threshold[inner].astype(np.float64)
    branches = [row[left], leaf[left], row[right], leaf[right]]
    lonely = leaf[forest.roots]
    if lonely.any():  # a tree must begin with a node: one whose branches both reach the leaf
        extra = roots[lonely]
        roots = roots.copy()
        roots[lonely] = n_inner + np.arange(len(extra))
        feature = np.concatenate([feature, np.zeros(len(extra), feature.dtype)])
        split = np.concatenate([split, np.zeros(len(extra))])
        stop = np.ones(len(extra), bool)
        more = [extra, stop, extra, stop]
        branches = [np.concatenate(pair) for pair in zip(branches, more, strict=True)]
        n_inner += len(extra)
    # A leaf has one target in this operator, so the trees stand once for every output.
    true_at, true_leaf, false_at, false_leaf = branches
    targets = forest.value.shape[1]

    def again(at: NDArray, is_leaf: NDArray) -> list[int]:
        step = np.where(is_leaf, n_leaves, n_inner)
        return np.concatenate([at + k * step for k in range(targets)]).tolist()

    total = g.add(
        "TreeEnsemble",
        cut,
        domain=ML_DOMAIN,
        aggregate_function=1,  # sum
        n_targets=targets,
        tree_roots=np.concatenate([roots + k * n_inner for k in range(targets)]).tolist(),
        nodes_featureids=np.tile(feature, targets).tolist(),
        nodes_modes=numpy_helper.from_array(np.zeros(targets * n_inner, np.uint8), "modes"),  # <=
        nodes_splits=numpy_helper.from_array(np.tile(split, targets), "splits"),
        nodes_truenodeids=again(true_at, true_leaf),
        nodes_trueleafs=np.tile(true_leaf, targets).astype(int).tolist(),
        nodes_falsenodeids=again(false_at, false_leaf),
        nodes_falseleafs=np.tile(false_leaf, targets).astype(int).tolist(),
        leaf_targetids=np.repeat(np.arange(targets), n_leaves).tolist(),
        leaf_weights=numpy_helper.from_array(forest.value[leaf].T.ravel(), "leaves"),
    )
    return g.add("Div", total, float(len(forest.roots)))


def _bounds(g: Graph, raw_value: str, raw_spread: str, baseline: str) -> tuple[str, str]:
    """A network's v in (0, 1) and its standard error."""
    odds = g.add("Exp", g.add("Mul", ODDS_BOUND, g.add("Tanh", raw_value)))
    bent = g.add("Mul", baseline, odds)
    share = g.add("Div", bent, g.add("Add", g.add("Sub", 1.0, baseline), bent))
    e = g.add("Exp", g.add("Neg", g.add("Abs", raw_spread)))
    upper = g.add("Where", g.add("GreaterOrEqual", raw_spread, 0.0), 1.0, e)
    error = g.add("Div", g.add("Mul", SPREAD_BOUND, upper), g.add("Add", 1.0, e))
    return share, error


def _in_range(g: Graph, closure: ViewFactorClosure, nearest: str) -> str:
    """Whether all markers lie where the closure is defined; false for NaN."""
    valid = ""
    if closure.quantity != "wallfactor":
        valid = g.add("LessOrEqual", nearest, 1.0 / (1.0 - TOUCHING))
    sound = range_nodes(g, closure.markers.markers)
    return g.add("And", valid, sound) if valid else sound


def range_nodes(g: Graph, markers: Sequence[Marker]) -> str:
    """Whether all markers lie in their ranges; false for NaN."""
    valid = ""
    for marker in markers:
        lower = g.add("Greater" if marker.low_open else "GreaterOrEqual", marker.name, marker.low)
        high = min(marker.high, float(np.finfo(np.float64).max))
        upper = g.add("LessOrEqual", marker.name, high)
        sound = g.add("And", lower, upper)
        valid = g.add("And", valid, sound) if valid else sound
    return valid


def outside_nodes(g: Graph, domain: Domain, features: str) -> str:
    """Whether features lie outside the training data."""
    beyond = g.add(
        "Or", g.add("Less", features, domain.low), g.add("Greater", features, domain.high)
    )
    count = g.sum_columns(g.add("Cast", beyond, to=11))
    away = g.add("Sub", features, domain.centre)
    distance2 = g.sum_columns(g.add("Mul", g.add("MatMul", away, domain.precision), away))
    far = g.add("Greater", distance2, float(domain.limit) ** 2)
    return g.add("Or", g.add("Greater", count, 0.0), far)


def _fill(g: Graph, closure: ViewFactorClosure) -> None:
    parts = FORMULAE[closure.markers.name](g)
    gate, exact = parts.gate, parts.exact
    features = g.add("Concat", *(g.column(name) for name in parts.features), axis=1)
    predictor = closure.predictor
    if isinstance(predictor, Network):
        raw = network_nodes(g, predictor, features)
    else:
        raw = forest_nodes(g, predictor, features)
    first = g.add("Gather", raw, np.array(0, dtype=np.int64), axis=1)
    second = g.add("Gather", raw, np.array(1, dtype=np.int64), axis=1)
    if closure.kind == "mlp":
        first, second = _bounds(g, first, second, parts.baseline)
    # 1 - gate (1 - v) without the cancellation where v is small
    visible = g.add("Add", parts.clear, g.add("Mul", gate, first))
    factor = g.add("Mul", exact, visible)
    error = g.add("Mul", g.add("Mul", exact, gate), second)
    valid = _in_range(g, closure, parts.features[0])
    g.add("Where", valid, factor, np.nan, out=QUANTITIES[closure.quantity].output)
    g.add("Where", valid, error, np.nan, out="stderr")
    far = g.add("And", g.add("Greater", gate, 0.0), outside_nodes(g, closure.domain, features))
    g.add("Or", far, g.add("Not", valid), out="extrapolates")


def export_onnx(
    closure: ViewFactorClosure, path: str | os.PathLike[str], name: str | None = None
) -> Path:
    """Write a closure as an ONNX graph.

    Parameters
    ----------
    closure : ViewFactorClosure
        What to export.
    path : path
        File to write.
    name : str, optional
        Name of the graph; made from the closure by default.

    Returns
    -------
    file : Path
        Inputs: the markers by name, each float64 [N]. Outputs: ``view_factor``, ``wall_factor``
        or ``exchange_factor``, and ``stderr``, float64 [N], NaN where a marker is out of range;
        ``extrapolates``, bool [N].

    Raises
    ------
    InputError
        If the closure has no form in ONNX.
    OutputError
        If the file cannot be written.

    Notes
    -----
    The graph is checked in full before it is written. Everything is computed in double precision,
    a forest's branches in single precision as in Python.
    """
    word = export_name(closure, name)
    if closure.markers.name not in FORMULAE:
        raise InputError(
            f"the marker set {closure.markers.name!r} has no form in ONNX; "
            f"known are {', '.join(FORMULAE)}."
        )
    g = Graph()
    _fill(g, closure)
    outputs = (QUANTITIES[closure.quantity].output, "stderr")
    return write_model(g, closure, closure.markers.markers, outputs, path, word)


def write_model(
    g: Graph,
    closure: Closure,
    markers: Sequence[Marker],
    outputs: Sequence[str],
    path: str | os.PathLike[str],
    word: str,
) -> Path:
    """Write a graph that has been filled: markers in, doubles and ``extrapolates`` out."""
    import onnx
    from onnx import TensorProto, helper

    # A name as length, since a runtime must take any number of rows.
    inputs = [
        helper.make_tensor_value_info(marker.name, TensorProto.DOUBLE, ["N"], marker.meaning)
        for marker in markers
    ]
    given = [helper.make_tensor_value_info(n, TensorProto.DOUBLE, ["N"]) for n in outputs]
    given.append(helper.make_tensor_value_info("extrapolates", TensorProto.BOOL, ["N"]))
    graph = helper.make_graph(g.nodes, word, inputs, given, list(g.constants.values()))
    opsets = [helper.make_opsetid("", OPSET)]
    if closure.kind == "forest":
        opsets.append(helper.make_opsetid(ML_DOMAIN, ML_OPSET))
    facts = describe(closure, word)
    model = helper.make_model(
        graph,
        opset_imports=opsets,
        ir_version=ML_IR_VERSION if closure.kind == "forest" else IR_VERSION,
        producer_name="greybed",
        producer_version=facts["greybed_version"],
        doc_string=" ".join(QUANTITIES[closure.quantity].law),
    )
    helper.set_model_props(model, facts)
    onnx.checker.check_model(model, full_check=True)
    target = Path(path)
    with atomic_path(target) as temporary:
        temporary.write_bytes(model.SerializeToString(deterministic=True))
    return target
