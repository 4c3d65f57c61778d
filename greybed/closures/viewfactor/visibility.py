r"""Visibility V in (0, 1]: gate, baseline and bounded correction for each set of markers.

.. math:: F_{ij} = F_\mathrm{exact}\,V,\qquad V = 1 - g\,(1 - v),\qquad v \in (0, 1)

The gate g is exactly zero where nothing stands between the spheres, so V = 1 there whatever the
predictor says. A network bends a baseline v0 by bounded odds, v = v0 e^c / (1 - v0 + v0 e^c) with
c = 4 tanh(z); a forest gives v itself, its leaves lie in (0, 1). Features, gate and baseline do
not change when i and j change places, so A_i F_ij = A_j F_ji.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from greybed.closures.markers import Marker
from greybed.core.exact import pair_factor

Array = NDArray[np.float64]
Markers = dict[str, Array]

# Bound on the network's log-odds correction: odds change by at most e^4 = 55.
ODDS_BOUND = 4.0
# Largest standard error of v that a network can predict.
SPREAD_BOUND = 0.5


OVER_DISTANCE = Marker("radius_over_distance", "r_j / d", 0.0, 1.05, low_open=True)
RATIO = Marker("radius_ratio", "r_j / r_i", 0.0, np.inf, low_open=True)
COUNT = Marker(
    "n_between", "spheres in the hull of i and j, by the share of its section", 0.0, np.inf,
    free=0.0, typical=(0.0, 60.0),
)  # fmt: skip
FRACTION = Marker(
    "solid_fraction", "solid fraction of the bed", 0.0, 1.0, low_open=True, typical=(0.02, 0.64)
)
BLOCKED = Marker(
    "blocked_fraction", "blocked share of the pencil between i and j", 0.0, 1.0,
    free=0.0, typical=(0.0, 1.0),
)  # fmt: skip
PER_LINE = Marker(
    "blockers_per_line", "blockers a line of the pencil meets", 0.0, np.inf,
    free=0.0, typical=(0.0, 10.0),
)  # fmt: skip
SHARE = Marker(
    "wall_share", "solid angle of the wall over 4 pi", 0.0, 1.0, low_open=True, typical=(1e-4, 0.5)
)
WALL_DISTANCE = Marker(
    "distance_over_radius", "distance from the wall over the radius", 1.0, np.inf,
    typical=(1.0, 20.0),
)  # fmt: skip
WALL_BLOCKED = Marker(
    "blocked_fraction", "blocked share of the lines to the wall", 0.0, 1.0,
    free=0.0, typical=(0.0, 1.0),
)  # fmt: skip
VISIBLE = Marker(
    "visible_share", "F_ij over the factor of the free pair", 0.0, 1.0, typical=(0.0, 1.0)
)
EMISSIVITY = Marker(
    "emissivity", "emissivity of both spheres", 0.0, 1.0, low_open=True, typical=(0.05, 1.0)
)


def _pair_exact(m: Markers) -> Array:
    """Exact factor of a free pair [-]."""
    return pair_factor(m["radius_over_distance"], m["radius_ratio"])


def _pair(m: Markers) -> tuple[Array, Array]:
    """Features that i and j share: (r_i + r_j) / d and 4 r_i r_j / (r_i + r_j)^2."""
    x, ratio = m["radius_over_distance"], m["radius_ratio"]
    return x * (1.0 + 1.0 / ratio), 4.0 * ratio / (1.0 + ratio) ** 2


def _published_features(m: Markers) -> Array:
    return np.stack([*_pair(m), np.log1p(m["n_between"]), m["solid_fraction"]], axis=-1)


def _published_gate(m: Markers) -> Array:
    # Steep, because a single sphere on the axis can hide almost everything.
    return -np.expm1(-6.0 * m["n_between"])


def _published_baseline(m: Markers) -> Array:
    return 0.01 + 0.98 * np.exp(-0.25 * m["n_between"])


def _pencil_features(m: Markers) -> Array:
    features = [*_pair(m), m["blocked_fraction"], np.log1p(m["blockers_per_line"])]
    return np.stack(features, axis=-1)


def _pencil_gate(m: Markers) -> Array:
    free = 1.0 - m["blocked_fraction"]
    # Squares instead of a power: the same bits in every exported language.
    return 1.0 - (free * free) * (free * free)


def _pencil_baseline(m: Markers) -> Array:
    # Solves V = free for v, then kept off 0 and 1.
    free = 1.0 - m["blocked_fraction"]
    return 0.01 + 0.98 * (1.0 - 1.0 / (1.0 + free * (1.0 + free * (1.0 + free))))


def _wall_features(m: Markers) -> Array:
    features = [
        m["blocked_fraction"],
        # Spheres deep in the bed differ in what little they see.
        np.log(1e-3 + (1.0 - m["blocked_fraction"])),
        1.0 / m["distance_over_radius"],
        m["wall_share"],
        m["solid_fraction"],
    ]
    return np.stack(features, axis=-1)


def _wall_exact(m: Markers) -> Array:
    return m["wall_share"]


def _reflected_bound(m: Markers) -> Array:
    """Bound of what j absorbs after reflections: symmetric after multiplication with r_i^2."""
    ratio2 = m["radius_ratio"] ** 2
    return (1.0 - m["emissivity"]) * ratio2 / (1.0 + ratio2)


def _absorbed_directly(m: Markers) -> Array:
    return m["emissivity"] * m["visible_share"] * _pair_exact(m)


def _exchange_exact(m: Markers) -> Array:
    return _absorbed_directly(m) + _reflected_bound(m)


def _exchange_gate(m: Markers) -> Array:
    exact = _exchange_exact(m)
    # A black pair that is wholly hidden exchanges nothing: there is nothing to share out.
    return np.divide(_reflected_bound(m), exact, out=np.zeros_like(exact), where=exact > 0.0)


def _exchange_clear(m: Markers) -> Array:
    exact = _exchange_exact(m)
    return np.divide(_absorbed_directly(m), exact, out=np.ones_like(exact), where=exact > 0.0)


def _exchange_baseline(m: Markers) -> Array:
    near, _ = _pair(m)
    return 0.002 + 0.1 * near * near


def _exchange_features(m: Markers) -> Array:
    near, alike = _pair(m)
    features = [near, np.log(near), alike, m["visible_share"], m["emissivity"], m["solid_fraction"]]
    return np.stack(features, axis=-1)


@dataclass(frozen=True)
class MarkerSet:
    """Inputs of a closure and what visibility makes of them.

    ``exact`` is the factor with nothing in between, ``quantity`` what the closure gives, ``clear``
    1 - gate where the subtraction would lose digits that matter.
    """

    name: str
    markers: tuple[Marker, ...]
    feature_names: tuple[str, ...]
    features: Callable[[Markers], Array]
    gate: Callable[[Markers], Array]
    baseline: Callable[[Markers], Array]
    exact: Callable[[Markers], Array] = _pair_exact
    quantity: str = "viewfactor"
    clear: Callable[[Markers], Array] | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the markers, as keywords of ``evaluate``."""
        return tuple(marker.name for marker in self.markers)


_SHARED = ("(r_i + r_j) / d", "4 r_i r_j / (r_i + r_j)^2")

MARKER_SETS = {
    # Inputs of Tausendschoen, Stoeckl & Radl 2023, Particuology 74:119.
    "published": MarkerSet(
        "published",
        (OVER_DISTANCE, COUNT, RATIO, FRACTION),
        (*_SHARED, "log(1 + n_between)", "solid_fraction"),
        _published_features,
        _published_gate,
        _published_baseline,
    ),
    "pencil": MarkerSet(
        "pencil",
        (OVER_DISTANCE, RATIO, BLOCKED, PER_LINE),
        (*_SHARED, "blocked_fraction", "log(1 + blockers_per_line)"),
        _pencil_features,
        _pencil_gate,
        _pencil_baseline,
    ),
    "wall": MarkerSet(
        "wall",
        (SHARE, WALL_DISTANCE, WALL_BLOCKED, FRACTION),
        (
            "blocked_fraction",
            "log(0.001 + free)",
            "radius / distance",
            "wall_share",
            "solid_fraction",
        ),
        _wall_features,
        _pencil_gate,
        _pencil_baseline,
        _wall_exact,
        "wallfactor",
    ),
    # D_ij = e F_ij + (1 - e) K_ij: what j absorbs at the first hit, and after reflections. K, the
    # mean of D over the places of the first reflection, is learnt between 0 and its bound.
    "exchange": MarkerSet(
        "exchange",
        (OVER_DISTANCE, RATIO, VISIBLE, EMISSIVITY, FRACTION),
        (
            _SHARED[0],
            "log((r_i + r_j) / d)",
            _SHARED[1],
            "visible_share",
            "emissivity",
            "solid_fraction",
        ),
        _exchange_features,
        _exchange_gate,
        _exchange_baseline,
        _exchange_exact,
        "exchange",
        _exchange_clear,
    ),
}


def unblocked_share(kind: str, baseline: Array, raw: Array) -> Array:
    """v in (0, 1) from a predictor's first output [-]."""
    if kind == "forest":
        return raw
    odds = np.exp(ODDS_BOUND * np.tanh(raw))
    return baseline * odds / (1.0 - baseline + baseline * odds)


def spread(kind: str, raw: Array) -> Array:
    """Standard error of v from a predictor's second output [-]."""
    if kind == "forest":
        return raw
    # exp of the negative magnitude only, so that no input overflows
    e = np.exp(-np.abs(raw))
    return SPREAD_BOUND * np.where(raw >= 0.0, 1.0, e) / (1.0 + e)
