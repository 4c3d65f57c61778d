"""Limiting cases of the view-factor closure as a table that users and tests can run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from greybed.closures.viewfactor.closure import ViewFactorClosure
from greybed.core.exact import exact_view_factor, pair_factor

Array = NDArray[np.float64]
# Anything that maps markers to factors: a closure, an ONNX session, a compiled library.
Evaluate = Callable[..., Array]


@dataclass(frozen=True)
class LimitCase:
    """One limiting case and how far a closure is from it.

    Attributes
    ----------
    name : str
        What must hold.
    error : float
        Largest deviation found [-].
    bound : float
        Largest deviation allowed [-].
    passed : bool
        Whether it holds.
    """

    name: str
    error: float
    bound: float

    @property
    def passed(self) -> bool:
        """Whether the limit holds (a NaN does not)."""
        return bool(self.error <= self.bound)


def random_markers(closure: ViewFactorClosure, n: int, seed: int = 0) -> dict[str, Array]:
    """Markers of ``n`` random pairs: sizes 1:5, gaps over four decades, any obstruction."""
    rng = np.random.default_rng(seed)
    ratio = np.exp(rng.uniform(-np.log(5.0), np.log(5.0), n))
    gap = np.exp(rng.uniform(np.log(1e-4), np.log(60.0), n))
    gap[: n // 10] = 0.0
    distance = 1.0 + ratio + gap * np.minimum(1.0, ratio)
    drawn: dict[str, Array] = {
        "radius_over_distance": ratio / distance,
        "radius_ratio": ratio,
    }
    for marker in closure.markers.markers:
        if marker.typical is not None:
            drawn[marker.name] = rng.uniform(*marker.typical, n)
    return {name: drawn[name] for name in closure.marker_names}


def _free(closure: ViewFactorClosure, markers: dict[str, Array]) -> dict[str, Array]:
    free = {m.name: m.free for m in closure.markers.markers if m.free is not None}
    return {k: np.full_like(v, free[k]) if k in free else v for k, v in markers.items()}


def _swapped(markers: dict[str, Array]) -> dict[str, Array]:
    x, ratio = markers["radius_over_distance"], markers["radius_ratio"]
    return {**markers, "radius_over_distance": x / ratio, "radius_ratio": 1.0 / ratio}


def check_limits(
    closure: ViewFactorClosure,
    evaluate: Evaluate | None = None,
    *,
    n: int = 20_000,
    seed: int = 0,
    rounding: float = 1e-14,
) -> list[LimitCase]:
    """Run every limiting case.

    Parameters
    ----------
    closure : ViewFactorClosure
        Names the markers, and is evaluated unless ``evaluate`` is given.
    evaluate : callable, optional
        Same keywords as ``closure.evaluate``: an exported form of it.
    n : int
        Random pairs per case [-].
    rounding : float
        Relative rounding of the arithmetic that is checked: 1e-14 for double precision.

    Returns
    -------
    list of LimitCase
    """
    law = closure.evaluate if evaluate is None else evaluate
    markers = random_markers(closure, n, seed)
    exact = closure.markers.exact(markers)
    if closure.quantity == "exchange":
        return _exchange_cases(law, markers, rounding)
    free = _free(closure, markers)
    factor = law(**markers)
    unobstructed = law(**free)
    cases = [
        LimitCase("nothing between: F = F_exact", _largest(unobstructed / exact - 1.0), rounding),
        LimitCase("F > 0: share of pairs that violate it", _share(~(factor > 0.0)), 0.0),
        LimitCase(
            "F <= F_exact: largest excess", max(_highest(factor / exact - 1.0), 0.0), rounding
        ),
    ]
    if closure.quantity == "wallfactor":
        return [*cases, *_wall_cases(law, free, rounding)]
    back = law(**_swapped(markers))
    ratio2 = markers["radius_ratio"] ** 2  # A_j / A_i
    cases.append(
        LimitCase("reciprocity A_i F_ij = A_j F_ji", _largest(ratio2 * back / factor - 1.0),
                  4.0 * rounding)
    )  # fmt: skip
    far = {**free, "radius_over_distance": np.full(n, 1e-4), "radius_ratio": np.ones(n)}
    # The next term of the expansion is 0.5 (r / d)^2, 5e-9 here.
    cases.append(
        LimitCase("far field: F = r_j^2 / (4 d^2)", _largest(law(**far) / 2.5e-9 - 1.0),
                  1e-8 + rounding)
    )  # fmt: skip
    touch = {**free, "radius_over_distance": np.full(n, 0.5), "radius_ratio": np.ones(n)}
    contact = float(exact_view_factor(1.0, 1.0, 2.0))
    cases.append(
        LimitCase("equal spheres in free contact: 0.0755868184216",
                  _largest(law(**touch) / contact - 1.0), rounding)
    )  # fmt: skip
    if closure.kind == "mlp":
        cases.append(
            LimitCase("no jump in distance: step ratio when halved", _jump(closure, law, seed), 0.6)
        )
    return cases


def _exchange_cases(law: Evaluate, markers: dict[str, Array], rounding: float) -> list[LimitCase]:
    factor, one = law(**markers), np.ones_like(markers["emissivity"])
    black = law(**{**markers, "emissivity": one})
    free = pair_factor(markers["radius_over_distance"], markers["radius_ratio"])
    view = markers["visible_share"] * free
    back = law(**_swapped(markers)) * markers["radius_ratio"] ** 2
    return [
        LimitCase("emissivity 1: D = F", _largest(black - view), rounding),
        LimitCase("D > 0: share of pairs that violate it", _share(~(factor > 0.0)), 0.0),
        LimitCase("D < 1: share of pairs that violate it", _share(~(factor < 1.0)), 0.0),
        LimitCase("D >= e F: largest lack",
                  _highest(markers["emissivity"] * view - factor), rounding),
        LimitCase("reciprocity A_i e D_ij = A_j e D_ji", _largest(back / factor - 1.0),
                  4.0 * rounding),
    ]  # fmt: skip


def _wall_cases(law: Evaluate, free: dict[str, Array], rounding: float) -> list[LimitCase]:
    plane = law(**{**free, "wall_share": np.full_like(free["wall_share"], 0.5)})
    everything = law(**{**free, "wall_share": np.ones_like(free["wall_share"])})
    return [
        LimitCase("infinite plane, nothing between: 1/2", _largest(2.0 * plane - 1.0), rounding),
        LimitCase("wall all around, nothing between: 1", _largest(everything - 1.0), rounding),
    ]


def _largest(error: Array) -> float:
    return float(np.abs(error).max())


def _highest(value: Array) -> float:
    return float(value.max())


def _share(wrong: NDArray[np.bool_]) -> float:
    return float(wrong.mean())


def _jump(closure: ViewFactorClosure, law: Evaluate, seed: int) -> float:
    """Largest step of F along the distance on a grid, over that on a grid twice as coarse.

    One half for a smooth function, one for a jump. F is taken relative to the exact factor, from
    contact to ten radii, for 50 pairs with different obstruction.
    """
    pairs = random_markers(closure, 50, seed + 1)
    ratio = pairs["radius_ratio"][:, None]

    def largest_step(points: int) -> Array:
        distance = (1.0 + ratio) * np.linspace(1.0, 10.0, points)
        x = ratio / distance
        m = {name: np.broadcast_to(value[:, None], x.shape) for name, value in pairs.items()}
        m |= {"radius_over_distance": x}
        flat = {name: np.ascontiguousarray(value).ravel() for name, value in m.items()}
        share = law(**flat) / pair_factor(flat["radius_over_distance"], flat["radius_ratio"])
        return np.abs(np.diff(share.reshape(x.shape), axis=1)).max(axis=1)

    coarse, fine = largest_step(1001), largest_step(2001)
    # A step at the level of rounding carries no information on jumps.
    moving = coarse > 1e-6
    return float((fine[moving] / coarse[moving]).max(initial=0.0))
