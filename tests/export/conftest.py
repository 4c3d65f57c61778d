"""Closures to export, random and fitted, and their compiled programs: each one is compiled once."""

from __future__ import annotations

import numpy as np
import pytest
from exported_closures import FLAGS, HARD, OTHERS, SHIPPED, UNTRAINED
from sklearn.ensemble import RandomForestRegressor

from greybed.closures import FilteredDragClosure, ViewFactorClosure, shipped
from greybed.closures.predictors import Forest, Network
from greybed.closures.term import GreyBoxTerm
from greybed.closures.viewfactor.closure import Domain
from greybed.closures.viewfactor.limits import random_markers
from greybed.export import (
    CompiledClosure,
    OnnxClosure,
    compile_cpp,
    export_cpp,
    export_onnx,
    find_compiler,
)


def _samples(markers):
    """Features of random pairs and an invented visibility of them."""
    closure = ViewFactorClosure.untrained("mlp", markers)
    drawn = random_markers(closure, 3000, seed=8)
    features = closure.markers.features(drawn)
    share = 0.05 + 0.9 / (1.0 + np.exp(3.0 * (features[:, 2] - features[:, 0] + features[:, 3])))
    return closure.markers, features, np.stack([share, 0.1 * share + 0.02], axis=1)


def _fitted_network(markers):
    """Random hidden layers, the last one by least squares: weights of a trained size."""
    marker_set, features, target = _samples(markers)
    start = Network.random(features.shape[1], (24, 24), seed=2)
    mean, scale = features.mean(axis=0), features.std(axis=0)
    hidden = (features - mean) / scale
    for k in range(2):
        hidden = np.tanh(hidden @ start.weights[k] + start.biases[k])
    # The cut keeps the weights small, as training does: large ones would amplify rounding.
    last = np.linalg.lstsq(hidden, np.log(target / (1.0 - target)) / 4.0, rcond=0.02)[0]
    network = Network(mean, scale, (*start.weights[:2], last), start.biases)
    return ViewFactorClosure(marker_set, network, Domain.of(features), {"data_sha256": "ab" * 32})


def _fitted_forest(markers, trees=10, depth=9):
    marker_set, features, target = _samples(markers)
    model = RandomForestRegressor(trees, max_depth=depth, random_state=0, n_jobs=1)
    model.fit(features, target)
    roots, columns = [], ([], [], [], [])
    for tree in (estimator.tree_ for estimator in model.estimators_):
        first = len(columns[0])
        roots.append(first)
        order = [0]  # breadth first, so that the children of a node stand side by side
        for node in order:
            left = tree.children_left[node]
            inner = left >= 0
            columns[0].append(tree.feature[node] if inner else -1)
            columns[1].append(tree.threshold[node] if inner else 0.0)
            columns[2].append(first + len(order) if inner else 0)
            columns[3].append(tree.value[node, :, 0])
            if inner:
                order += [left, tree.children_right[node]]
    types = (np.int32, np.float32, np.int32, np.float64)
    arrays = (np.array(c, dtype=t) for c, t in zip(columns, types, strict=True))
    forest = Forest(np.array(roots, dtype=np.int32), *arrays)
    return ViewFactorClosure(marker_set, forest, Domain.of(features))


@pytest.fixture(scope="session")
def closures():
    """Every closure of these tests, by name."""
    made = {}
    for name in [*UNTRAINED, *OTHERS, *HARD]:
        kind, markers, seed = name.split()
        made[name] = ViewFactorClosure.untrained(kind, markers, int(seed))
    for name in SHIPPED:
        made[name] = shipped(name.split()[1])
    made["drag"] = FilteredDragClosure.untrained("mlp", "full", seed=3)
    made["term"] = GreyBoxTerm(
        name="term", covariate="humidity", unit="", response="velocity", reference=10.0,
        amplitude=0.3, exponent=1.5, side=-1, window=(1.0, 10.0),
    )  # fmt: skip
    made["fitted mlp pencil"] = _fitted_network("pencil")
    made["fitted forest published"] = _fitted_forest("published")
    return made


@pytest.fixture(scope="session")
def headers(closures, tmp_path_factory):
    """Header of a closure, by the closure's name."""
    made = {}

    def header(name):
        if name not in made:
            made[name] = export_cpp(closures[name], tmp_path_factory.mktemp("header"))
        return made[name]

    return header


@pytest.fixture(scope="session")
def compiled(headers, tmp_path_factory):
    """Compiled form of a closure, by the closure's name and the name of the flags."""
    made = {}

    def program(name, flags):
        if find_compiler() is None:
            pytest.skip("no C++ compiler (CXX, g++, clang++, c++)")
        if (name, flags) not in made:
            folder = tmp_path_factory.mktemp("program")
            made[name, flags] = CompiledClosure(compile_cpp(headers(name), folder, FLAGS[flags]))
        return made[name, flags]

    return program


@pytest.fixture(scope="session")
def onnx_form(closures, tmp_path_factory):
    """ONNX form of a closure, by the closure's name."""
    made = {}

    def session(name):
        if name not in made:
            path = tmp_path_factory.mktemp("onnx") / "closure.onnx"
            made[name] = OnnxClosure(export_onnx(closures[name], path))
        return made[name]

    return session
