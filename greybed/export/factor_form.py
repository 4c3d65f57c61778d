"""View, wall and exchange factors as forms to export: their formulae in C++, their inputs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from greybed.closures import ViewFactorClosure, golden_rows
from greybed.closures.viewfactor.visibility import ODDS_BOUND, SPREAD_BOUND
from greybed.core import InputError
from greybed.core.exact import TOUCHING, quadrature
from greybed.export.form import Field, Form
from greybed.export.metadata import QUANTITIES, describe
from greybed.export.tables import doubles, learnt_context, learnt_tables


@dataclass(frozen=True)
class Formulae:
    """What a marker set computes, in C++; T is double, or a number that knows its derivatives.

    Attributes
    ----------
    features : tuple of str
        One expression each.
    before : tuple of str
        Statements before the rest.
    clear, gate, baseline, exact : str
        1 - gate, gate, baseline, and the factor that they share out.
    """

    features: tuple[str, ...]
    before: tuple[str, ...]
    clear: str
    gate: str
    baseline: str
    exact: str


_PAIR = (
    "radius_over_distance * (1.0 + 1.0 / radius_ratio)",
    "4.0 * radius_ratio / ((1.0 + radius_ratio) * (1.0 + radius_ratio))",
)
_FREE = "pair_factor(radius_over_distance, radius_ratio)"
_OPEN = (
    ("const T open = rest_of(blocked_fraction);",),
    "(open * open) * (open * open)",
    "1.0 - clear",
    "0.01 + 0.98 * (1.0 - 1.0 / (1.0 + open * (1.0 + open * (1.0 + open))))",
)
# The same operations in the same order as in greybed.closures.viewfactor.visibility: features of
# a forest are cut to single precision, so their last bits can decide a branch. ``clear`` is
# 1 - gate without the subtraction, because -ffast-math may cancel what it can put together.
FORMULAE = {
    "published": Formulae(
        (*_PAIR, "log1p_of(n_between)", "solid_fraction"),
        (),
        "exp_of(-6.0 * n_between)",
        "-expm1_of(-6.0 * n_between)",
        "0.01 + 0.98 * exp_of(-0.25 * n_between)",
        _FREE,
    ),
    "pencil": Formulae((*_PAIR, "blocked_fraction", "log1p_of(blockers_per_line)"), *_OPEN, _FREE),
    "wall": Formulae(
        (
            "blocked_fraction",
            "log_of(1e-3 + open)",
            "1.0 / distance_over_radius",
            "wall_share",
            "solid_fraction",
        ),
        *_OPEN,
        "wall_share",
    ),
    # Neither part is the difference of the other from one, so D = F exactly at emissivity 1. A
    # black pair that is wholly hidden has nothing to share out.
    "exchange": Formulae(
        (
            _PAIR[0],
            f"log_of({_PAIR[0]})",
            _PAIR[1],
            "visible_share",
            "emissivity",
            "solid_fraction",
        ),
        (
            f"const T direct = emissivity * visible_share * {_FREE};",
            "const T ratio2 = radius_ratio * radius_ratio;",
            "const T reflected = (1.0 - emissivity) * ratio2 / (1.0 + ratio2);",
        ),
        "exact > 0.0 ? direct / exact : T(1.0)",
        "exact > 0.0 ? reflected / exact : T(0.0)",
        "0.002 + 0.1 * features[0] * features[0]",
        "direct + reflected",
    ),
}
# Physical numbers of a host, and the markers that are made of several of them.
_RADII = (
    ("radius_i_m", "radius of the sphere that sends", "m"),
    ("radius_j_m", "radius of the sphere that receives", "m"),
    ("distance_m", "distance of their centres", "m"),
)
_WALL = (
    ("radius_m", "radius of the sphere", "m"),
    ("distance_m", "distance of its centre from the plane of the wall", "m"),
)
_MADE = {
    "radius_over_distance": "in.radius_j_m / in.distance_m",
    "radius_ratio": "in.radius_j_m / in.radius_i_m",
    "distance_over_radius": "in.distance_m / in.radius_m",
}


def _inputs(closure: ViewFactorClosure) -> tuple[tuple[Field, ...], list[str]]:
    """Physical numbers, and each marker made of them, in C++."""
    at = {name: f"of[{k}]" for k, name in enumerate(closure.marker_names)}
    if "radius_ratio" in at:
        x, ratio = at["radius_over_distance"], at["radius_ratio"]
        chains = {
            "radius_i_m": f"-{ratio} * in.radius_j_m / (in.radius_i_m * in.radius_i_m)",
            "radius_j_m": f"{x} / in.distance_m + {ratio} / in.radius_i_m",
            "distance_m": f"-{x} * in.radius_j_m / (in.distance_m * in.distance_m)",
        }
        lengths: tuple[tuple[str, str, str], ...] = _RADII
    else:
        away = at["distance_over_radius"]
        chains = {
            "radius_m": f"-{away} * in.distance_m / (in.radius_m * in.radius_m)",
            "distance_m": f"{away} / in.radius_m",
        }
        lengths = _WALL
    fields = [Field(name, meaning, unit, chains[name]) for name, meaning, unit in lengths]
    fields += [
        Field(m.name, m.meaning, "-", at[m.name])
        for m in closure.markers.markers
        if m.name not in _MADE
    ]
    return tuple(fields), [_MADE.get(n, f"in.{n}") for n in closure.marker_names]


def factor_form(closure: ViewFactorClosure, name: str) -> Form:
    """The form of a closure of view, wall or exchange factors.

    Raises
    ------
    InputError
        If its markers have no form in C++, or it holds numbers that are not finite.
    """
    if closure.markers.name not in FORMULAE:
        raise InputError(
            f"the marker set {closure.markers.name!r} has no exported form; "
            f"known are {', '.join(FORMULAE)}."
        )
    formulae = FORMULAE[closure.markers.name]
    of_pairs = closure.quantity != "wallfactor"
    nodes = zip(("node_square", "node_weight"), quadrature(), strict=True)
    fields, physical = _inputs(closure)
    quantity = QUANTITIES[closure.quantity]
    context: dict[str, Any] = {
        **learnt_context(closure.predictor, closure.domain),
        "of_pairs": of_pairs,
        "at": {n: k for k, n in enumerate(closure.marker_names)},
        "reach": repr(1.0 / (1.0 - TOUCHING)),
        "features": list(zip(closure.markers.feature_names, formulae.features, strict=True)),
        "formulae": formulae,
        "physical": physical,
        "odds_bound": repr(ODDS_BOUND),
        "spread_bound": repr(SPREAD_BOUND),
    }
    return Form(
        name,
        describe(closure, name),
        quantity,
        closure.kind,
        closure.markers.markers,
        (quantity.output, "stderr"),
        fields,
        golden_rows(closure),
        [
            *(doubles(*node) for node in nodes if of_pairs),
            *learnt_tables(closure.predictor, closure.domain),
        ],
        "factor.hpp",
        context,
    )
