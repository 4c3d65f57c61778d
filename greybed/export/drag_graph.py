"""Filtered drag as nodes of ONNX: markers in, kept fractions and error out."""

from __future__ import annotations

import numpy as np

from greybed.closures import FilteredDragClosure
from greybed.closures.drag.filtered import features as shape
from greybed.closures.drag.filtered.closure import (
    LOG_BOUND,
    PARCEL_RATE,
    SHARE_BOUND,
    SPREAD_BOUND,
)
from greybed.closures.drag.filtered.gate import Gate
from greybed.closures.predictors import Network
from greybed.export.drag_form import OUTPUTS
from greybed.export.graph import (
    Graph,
    learnt_nodes,
    logistic_nodes,
    outside_nodes,
    range_nodes,
)


def _gate(g: Graph, gate: Gate) -> str:
    square = g.add("Mul", "filter_size", "filter_size")
    size = g.add("Div", square, g.add("Add", square, gate.filter_scale * gate.filter_scale))
    phi = "solid_fraction"
    dilute = g.add("Div", phi, g.add("Add", phi, gate.dilute_scale))
    ratio = g.add("Div", phi, gate.packing)
    power = ratio
    for _ in range(gate.power - 1):
        power = g.add("Mul", power, ratio)
    dense = g.add("Max", 0.0, g.add("Sub", 1.0, power))
    return g.add("Mul", g.add("Mul", size, dilute), g.add("Mul", dense, dense))


def _bend(g: Graph, x: str, bound: float) -> str:
    y = g.add("Div", x, bound)
    return g.add("Div", x, g.add("Sqrt", g.add("Add", 1.0, g.add("Mul", y, y))))


def _log_positive(g: Graph, q: str) -> str:
    small = shape.SMALL_RATIO * shape.SMALL_RATIO
    size = g.add("Add", g.add("Sqrt", g.add("Add", g.add("Mul", q, q), small)), g.add("Abs", q))
    positive = g.add("GreaterOrEqual", q, 0.0)
    low = g.add("Div", 0.5 * small, size)
    return g.add("Log", g.add("Where", positive, g.add("Mul", 0.5, size), low))


def _features(g: Graph, closure: FilteredDragClosure) -> str:
    phi, up = "solid_fraction", "slip_up"
    across2 = g.add("Mul", "slip_across", "slip_across")
    columns = [
        phi,
        g.add("Log", g.add("Add", phi, shape.DILUTE)),
        g.add("Log", g.add("Add", "filter_size", shape.SMALL_FILTER)),
        g.add("Log", "terminal_reynolds"),
        _bend(g, up, shape.SLIP_BEND),
        g.add("Log", g.add("Add", across2, shape.SMALL_ACROSS)),
    ]
    if closure.markers.marked:
        scale = g.add("Mul", g.add("Add", phi, shape.SMALL_FRACTION), "drag_ratio")
        up2 = g.add("Add", g.add("Mul", up, up), shape.SMALL_SLIP2)
        wide = g.add("Add", across2, shape.SMALL_SLIP2)
        q_up = g.add("Div", g.add("Mul", "gradient_up", up), g.add("Mul", scale, up2))
        q_across = g.add("Div", "gradient_work", g.add("Mul", scale, wide))
        columns += [
            _log_positive(g, q_up),
            _log_positive(g, q_across),
            _bend(g, "gradient_up", shape.GRADIENT_BEND),
        ]
    return g.add("Concat", *(g.column(name) for name in columns), axis=1)


def fill_drag(g: Graph, closure: FilteredDragClosure) -> None:
    """Kept fractions of the markers."""
    features = _features(g, closure)
    gate = _gate(g, closure.gate)
    learnt = isinstance(closure.predictor, Network)
    raw = learnt_nodes(g, closure.predictor, features)
    columns = [
        g.add("Gather", raw, np.array(k, dtype=np.int64), axis=1)
        for k in range(closure.markers.outputs)
    ]
    parcels = g.add("Mul", PARCEL_RATE, g.add("Sub", "parcels", 1.0))
    kept = []
    for column in columns[:2]:
        log = _bend(g, column, LOG_BOUND) if learnt else column
        kept.append(g.add("Exp", g.add("Mul", gate, g.add("Sub", log, parcels))))
    share = g.add("Mul", 0.0, gate)
    if closure.markers.linear:
        share = g.add("Mul", g.add("Mul", gate, SHARE_BOUND), logistic_nodes(g, columns[2]))
    spread = columns[-1]
    if learnt:
        spread = g.add("Mul", SPREAD_BOUND, logistic_nodes(g, spread))
    stderr = g.add("Mul", kept[0], g.add("Mul", gate, spread))
    valid = range_nodes(g, closure.markers.markers)
    for name, value in zip(OUTPUTS, (*kept, share, stderr), strict=True):
        g.add("Where", valid, value, np.nan, out=name)
    far = g.add("And", g.add("Greater", gate, 0.0), outside_nodes(g, closure.domain, features))
    g.add("Or", far, g.add("Not", valid), out="extrapolates")
