"""Limiting cases of filtered drag as a table that users and tests can run."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed.closures.drag.filtered.closure import DragPrediction, FilteredDragClosure
from greybed.closures.drag.filtered.force import filtered_force
from greybed.closures.drag.filtered.markers import PARCELS
from greybed.closures.drag.filtered.materials import Material
from greybed.closures.drag.laws import drag_law
from greybed.closures.viewfactor.limits import LimitCase

Array = NDArray[np.float64]
# Anything that maps markers to kept fractions: a closure, an ONNX session, a compiled header.
Predict = Callable[..., DragPrediction]

# Particles for the checks of vectors: the usual ones of fluid catalytic cracking in air.
FCC = Material(75e-6, 1500.0, 1.3, 1.8e-5)


def random_markers(
    closure: FilteredDragClosure, n: int, seed: int = 0, *, beyond: float = 0.0
) -> dict[str, Array]:
    """Markers of ``n`` random places, from the usual ranges widened by ``beyond`` of their width.

    Solid fractions stay below 1, and what must be positive stays so.
    """
    rng = np.random.default_rng(seed)
    drawn = {}
    for marker in closure.markers.markers:
        assert marker.typical is not None
        low, high = marker.typical
        if marker is PARCELS:
            low, high = 1.0, 1.0 + 10.0 * beyond
        elif marker.low_open:  # over decades
            width = beyond * np.log(high / low)
            drawn[marker.name] = np.exp(rng.uniform(np.log(low) - width, np.log(high) + width, n))
            continue
        width = beyond * (high - low)
        low, high = max(low - width, marker.low), min(high + width, marker.high)
        drawn[marker.name] = rng.uniform(low, high, n)
    return drawn


def check_limits(
    closure: FilteredDragClosure,
    predict: Predict | None = None,
    *,
    n: int = 20_000,
    seed: int = 0,
    rounding: float = 1e-12,
) -> list[LimitCase]:
    """Run every limiting case.

    Parameters
    ----------
    closure : FilteredDragClosure
        Names the markers, and is evaluated unless ``predict`` is given.
    predict : callable, optional
        Same keywords as ``closure.predict``: an exported form of it. Then the cases of the vector
        are left out.
    n : int
        Random places per case [-].
    rounding : float
        Deviation of H from 1 that counts as none [-].

    Returns
    -------
    list of LimitCase
    """
    law = closure.predict if predict is None else predict
    markers = random_markers(closure, n, seed, beyond=0.5)
    packing = closure.gate.packing
    rng = np.random.default_rng(seed + 1)
    packed = rng.uniform(packing, 0.999, n)
    packed[0] = packing
    cases = [
        LimitCase(f"{name}: H = 1, largest deviation", _off(law(**{**markers, **fixed})), rounding)
        for name, fixed in (
            ("no particles", {"solid_fraction": np.zeros(n)}),
            ("packed particles", {"solid_fraction": packed}),
            ("filter of size 0", {"filter_size": np.zeros(n)}),
        )
    ]
    for name, beyond in (("in the usual ranges", 0.0), ("50 % beyond them", 0.5)):
        p = law(**random_markers(closure, n, seed + 2, beyond=beyond))
        wrong = ~((p.kept_along > 0.0) & (p.kept_across > 0.0))
        cases.append(LimitCase(f"H > 0 {name}: share that violates it", float(wrong.mean()), 0.0))
    if closure.kind == "mlp":
        for marker, high in (("solid_fraction", 0.7), ("filter_size", 10.0)):
            cases.append(
                LimitCase(
                    f"no jump along {marker}: step ratio when halved",
                    _jump(closure, law, marker, high, seed), 0.6,
                )
            )  # fmt: skip
    if predict is None:
        cases += vector_cases(closure, n, seed)
    return cases


def vector_cases(closure: Any, n: int = 20_000, seed: int = 0) -> list[LimitCase]:
    """Turns, mirrors and work of the force, of anything that is a ``KeptDrag``."""
    rng = np.random.default_rng(seed + 3)
    u_t, size = FCC.terminal_velocity, FCC.length * rng.uniform(0.0, 20.0, n)
    phi = rng.uniform(0.0, 0.7, n)
    slip = u_t * rng.normal(0.0, 2.0, (n, 3))
    # No slip at all, none across and none along.
    slip[0], slip[1, [0, 2]], slip[2, 1] = 0.0, 0.0, 0.0
    gradient = FCC.weight * rng.normal(0.0, 0.5, (n, 3))
    down = np.array([0.0, -1.0, 0.0])

    def force(turn: Array, gravity: Array = down) -> Array:
        return filtered_force(
            closure, FCC, drag_law("wen-yu"), turn @ gravity, phi, slip @ turn.T, size,
            gradient @ turn.T,
        ).force  # fmt: skip

    here = force(np.eye(3))
    scale = float(np.abs(here).max())

    def residual(turn: Array) -> float:
        return float(np.abs(force(turn) - here @ turn.T).max()) / scale

    quarter = np.array([[0.6, 0.0, 0.8], [0.0, 1.0, 0.0], [-0.8, 0.0, 0.6]])  # about gravity
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    work = (here * slip).sum(axis=1)
    return [
        LimitCase("turned about gravity: largest residual", residual(quarter), 1e-12),
        LimitCase("mirrored across gravity", residual(np.diag([-1.0, 1.0, 1.0])), 1e-12),
        LimitCase("turned and mirrored with gravity", residual(turn), 1e-12),
        LimitCase("drag takes work: share that violates F.s >= 0", float((work < 0.0).mean()), 0.0),
    ]


def _off(p: DragPrediction) -> float:
    along, across = np.abs(p.kept_along - 1.0), np.abs(p.kept_across - 1.0)
    return float(np.max([along.max(), across.max(), np.abs(p.share).max()]))


def _jump(closure: FilteredDragClosure, law: Predict, along: str, high: float, seed: int) -> float:
    """Largest step of ln H along a marker on a grid, over that on a grid twice as coarse.

    One half for a smooth function, one for a jump; 20 lines with other markers at random.
    """
    places = random_markers(closure, 20, seed + 4)

    def largest_step(points: int) -> Array:
        grid = np.linspace(0.0, high, points)
        m = {name: np.repeat(value, points) for name, value in places.items()}
        p = law(**{**m, along: np.tile(grid, 20)})
        logs = np.log(np.stack([p.kept_along, p.kept_across])).reshape(2, 20, points)
        return np.abs(np.diff(logs, axis=2)).max(axis=2)

    coarse, fine = largest_step(4001), largest_step(8001)
    # A step at the level of rounding carries no information on jumps.
    moving = coarse > 1e-7
    return float((fine[moving] / coarse[moving]).max(initial=0.0))
