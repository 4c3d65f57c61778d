"""View, wall and exchange factors as nodes of ONNX."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from greybed.closures import ViewFactorClosure
from greybed.closures.viewfactor.visibility import ODDS_BOUND, SPREAD_BOUND
from greybed.core.exact import TOUCHING, quadrature
from greybed.export.graph import (
    Graph,
    learnt_nodes,
    logistic_nodes,
    outside_nodes,
    range_nodes,
)
from greybed.export.metadata import QUANTITIES


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


def _bounds(g: Graph, raw_value: str, raw_spread: str, baseline: str) -> tuple[str, str]:
    """A network's v in (0, 1) and its standard error."""
    odds = g.add("Exp", g.add("Mul", ODDS_BOUND, g.add("Tanh", raw_value)))
    bent = g.add("Mul", baseline, odds)
    share = g.add("Div", bent, g.add("Add", g.add("Sub", 1.0, baseline), bent))
    return share, g.add("Mul", SPREAD_BOUND, logistic_nodes(g, raw_spread))


def _in_range(g: Graph, closure: ViewFactorClosure, nearest: str) -> str:
    """Whether all markers lie where the closure is defined; false for NaN."""
    valid = ""
    if closure.quantity != "wallfactor":
        valid = g.add("LessOrEqual", nearest, 1.0 / (1.0 - TOUCHING))
    sound = range_nodes(g, closure.markers.markers)
    return g.add("And", valid, sound) if valid else sound


def fill_factor(g: Graph, closure: ViewFactorClosure) -> None:
    """A view, wall or exchange factor of the markers."""
    parts = FORMULAE[closure.markers.name](g)
    gate, exact = parts.gate, parts.exact
    features = g.add("Concat", *(g.column(name) for name in parts.features), axis=1)
    raw = learnt_nodes(g, closure.predictor, features)
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
