"""Graphs of ONNX under construction, and the nodes that all of them share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed.closures.markers import Marker
from greybed.closures.predictors import Forest, Network, Predictor
from greybed.closures.viewfactor.closure import Domain

ML_DOMAIN = "ai.onnx.ml"


class Graph:
    """Nodes and constants of a graph under construction; every value is known by its name.

    Parameters
    ----------
    single : bool
        Whether it computes in single precision.
    """

    def __init__(self, single: bool = False) -> None:
        self.single = single
        self.nodes: list[Any] = []
        self.constants: dict[str, Any] = {}

    @property
    def dtype(self) -> type[np.floating]:
        """Its numbers."""
        return np.float32 if self.single else np.float64

    def constant(self, value: Any) -> str:
        """Name of a constant; equal numbers are stored once."""
        from onnx import numpy_helper

        array = np.asarray(value)
        if self.single and array.dtype == np.float64:
            with np.errstate(over="ignore"):  # bounds of nothing
                array = array.astype(np.float32)
        key = f"constant_{len(self.constants)}"
        for name, known in self.constants.items():
            same = numpy_helper.to_array(known)
            if same.dtype == array.dtype and np.array_equal(same, array) and array.ndim == 0:
                return name
        self.constants[key] = numpy_helper.from_array(array, key)
        return key

    def add(self, op: str, *inputs: str | float | NDArray, out: str = "", **attributes: Any) -> str:
        """Append a node; numbers among the inputs become constants."""
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

    cut = features
    if not g.single:
        # Cut to single precision and back: comparing doubles then agrees with comparing singles.
        cut = g.add("Cast", g.add("Cast", features, to=TensorProto.FLOAT), to=TensorProto.DOUBLE)
    leaf = forest.feature < 0
    inner = np.flatnonzero(~leaf)
    n_inner, n_leaves = len(inner), int(leaf.sum())
    # Where a node went: its row among the inner nodes or among the leaves.
    row = np.where(leaf, np.cumsum(leaf), np.cumsum(~leaf)) - 1
    left, right = forest.left[inner], forest.left[inner] + 1
    roots, feature = row[forest.roots], forest.feature[inner]
    split = forest.threshold[inner].astype(g.dtype)
    branches = [row[left], leaf[left], row[right], leaf[right]]
    lonely = leaf[forest.roots]
    if lonely.any():  # a tree must begin with a node: one whose branches both reach the leaf
        extra = roots[lonely]
        roots = roots.copy()
        roots[lonely] = n_inner + np.arange(len(extra))
        feature = np.concatenate([feature, np.zeros(len(extra), feature.dtype)])
        split = np.concatenate([split, np.zeros(len(extra), g.dtype)])
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
        leaf_weights=numpy_helper.from_array(
            forest.value[leaf].T.ravel().astype(g.dtype), "leaves"
        ),
    )
    return g.add("Div", total, float(len(forest.roots)))


def learnt_nodes(g: Graph, predictor: Predictor, features: str) -> str:
    """Outputs [N, n] of the learnt part."""
    if isinstance(predictor, Network):
        return network_nodes(g, predictor, features)
    return forest_nodes(g, predictor, features)


def logistic_nodes(g: Graph, x: str) -> str:
    """1 / (1 + e^-x) without overflow."""
    e = g.add("Exp", g.add("Neg", g.add("Abs", x)))
    upper = g.add("Where", g.add("GreaterOrEqual", x, 0.0), 1.0, e)
    return g.add("Div", upper, g.add("Add", 1.0, e))


def range_nodes(g: Graph, markers: Sequence[Marker]) -> str:
    """Whether all markers lie in their ranges; false for NaN."""
    valid = ""
    for marker in markers:
        lower = g.add("Greater" if marker.low_open else "GreaterOrEqual", marker.name, marker.low)
        high = min(marker.high, float(np.finfo(g.dtype).max))
        upper = g.add("LessOrEqual", marker.name, high)
        sound = g.add("And", lower, upper)
        valid = g.add("And", valid, sound) if valid else sound
    return valid


def outside_nodes(g: Graph, domain: Domain, features: str) -> str:
    """Whether features lie outside the training data."""
    beyond = g.add(
        "Or", g.add("Less", features, domain.low), g.add("Greater", features, domain.high)
    )
    count = g.sum_columns(g.add("Cast", beyond, to=1 if g.single else 11))
    away = g.add("Sub", features, domain.centre)
    distance2 = g.sum_columns(g.add("Mul", g.add("MatMul", away, domain.precision), away))
    far = g.add("Greater", distance2, float(domain.limit) ** 2)
    return g.add("Or", g.add("Greater", count, 0.0), far)
