"""Time integration of a heat network: TR-BDF2 with an error estimate and an energy account."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from greybed.coupling.network import EPSILON, HeatNetwork, State, Storage, newton
from greybed.coupling.results import Status

Array = NDArray[np.float64]

# TR-BDF2 as a diagonally implicit Runge-Kutta method with stages at 0, GAMMA, 1 and weights
# (W, W, D); E are the weights of the third-order embedded method. Source: Hosea & Shampine,
# Analysis and implementation of TR-BDF2, Appl. Numer. Math. 20 (1996) 21.
GAMMA = 2.0 - math.sqrt(2.0)
D = GAMMA / 2.0
W = math.sqrt(2.0) / 4.0
E = ((1.0 - W) / 3.0, (3.0 * W + 1.0) / 3.0, D / 3.0)

MAX_NEWTON = 25


class _Account:
    """Heat into the bed, integrated with the weights of the method, and what each step showed."""

    def __init__(self, network: HeatNetwork, capacity: Array, start: Array) -> None:
        self.network, self.capacity, self.start = network, capacity, start
        self.supplied = 0.0
        self.gross = 0.0
        self.rows: list[tuple[float, ...]] = []
        self.walls: list[Array] = []

    def add(self, time: float, dt: float, state: State, heats: list[Array]) -> None:
        """Book a step with the boundary heats of its three stages [W]."""
        sources = self.network.sources
        heat = W * heats[0] + W * heats[1] + D * heats[2]
        self.supplied += dt * float(heat.sum() + sources.sum())
        self.gross += dt * float(np.abs(heat).sum() + np.abs(sources).sum())
        t = state.temperatures
        row = (time, t.mean(), t.min(), t.max(), heats[2][-1], self.stored(t), self.supplied)
        self.rows.append(tuple(float(v) for v in row))
        self.walls.append(heats[2][:-1])

    def stored(self, t: Array) -> float:
        """Heat stored since the start [J]."""
        return float(self.capacity @ (t - self.start))

    def error(self, t: Array) -> float:
        """Heat that does not balance, over the heat exchanged or moved between spheres [-]."""
        moved = float(self.capacity @ np.abs(t - self.start))
        scale = max(self.gross, moved)
        # A bed in equilibrium exchanges round-off: a ratio of two of those means nothing.
        floor = 1e3 * EPSILON * float(self.capacity @ t)
        return abs(self.stored(t) - self.supplied) / scale if scale > floor else 0.0

    def history(self) -> dict[str, Array]:
        """Columns, one row per step."""
        names = ("time", "mean", "lowest", "highest", "opening_heat", "stored", "supplied")
        table = np.array(self.rows).reshape(-1, len(names))
        n_walls = len(self.network.bounds) - 1
        walls = np.array(self.walls).reshape(len(self.walls), n_walls)
        return dict(zip(names, table.T, strict=True)) | {"wall_heat": walls}


def _boundary(network: HeatNetwork, state: State) -> Array:
    conduction, radiation = network.boundary_heat(state)
    return np.append(conduction + radiation[:-1], radiation[-1])


def integrate(
    network: HeatNetwork,
    capacity: Array,
    initial: Array,
    duration: float,
    *,
    dt: float | None,
    temperature_tolerance: float,
    tolerance: float,
    max_steps: int,
    on_progress: Callable[[float], object] | None,
) -> tuple[State, float, Status, dict[str, Array]]:
    """Advance ``network`` from ``initial`` over ``duration``.

    Parameters
    ----------
    network : HeatNetwork
        The bed.
    capacity : (n,) array
        Heat capacity of every sphere [J/K].
    initial : (n,) array
        Temperatures at the start [K].
    duration : float
        [s].
    dt : float or None
        Fixed step, shortened to divide the duration [s]; None adapts it.
    temperature_tolerance : float
        Error of an adaptive step in any sphere [K].
    tolerance : float
        Residual of a stage over the heat exchanged [-].
    max_steps : int
        Bound on the steps, refused ones included [-].
    on_progress : callable or None
        Called after every step with the fraction of the duration that it covered [-].

    Returns
    -------
    state : State
        At the end, or after the last good step.
    energy_error : float
        Stored less supplied heat over the heat exchanged [-].
    status : Status
        Whether and why it ended; never raises.
    history : dict of arrays
        See ``ThermalResult``.
    """
    state = network.settle(initial)
    account = _Account(network, capacity, initial)
    slope = network.residual(state, None)[0] / capacity  # [K/s]
    heat = _boundary(network, state)
    steps = 0 if dt is None else math.ceil(duration / dt * (1.0 - 1e-12))
    fastest = float(np.abs(slope).max())
    if steps:
        step = duration / steps
    else:
        # A first step that changes no sphere by more than a few tolerances.
        step = min(duration, 5.0 * temperature_tolerance / fastest if fastest > 0.0 else duration)
    time, iterations, worst = 0.0, 0, 0.0
    done = 0
    for _ in range(max_steps):
        end = duration if (done + 1 == steps or time + 1.001 * step >= duration) else time + step
        h = end - time
        stages, status, slopes = _stages(network, capacity, state, slope, h, tolerance)
        iterations += status.iterations
        error = 0.0
        if status.converged and not steps:
            error = _error(network, capacity, stages[-1], slopes, h) / temperature_tolerance
        if not status.converged or error > 1.0:
            # A refused step of adaptive size is tried again; a fixed one has failed.
            step = h * (max(0.2, 0.9 * error ** (-1 / 3)) if status.converged else 0.25)
            if steps or step < 1e-12 * duration:
                failed = f"at {time:g} s, step {h:.3g} s: {status.reason}"
                remedy = status.remedy if not steps else "use a smaller or adaptive dt"
                bad = Status(False, failed, remedy, iterations, status.residual)
                return state, account.error(state.temperatures), bad, account.history()
            continue
        state, slope, time = stages[-1], slopes[-1], end
        worst = max(worst, status.residual)
        heats = [heat, *(_boundary(network, s) for s in stages)]
        heat = heats[-1]
        account.add(time, h, state, heats)
        done += 1
        if on_progress is not None:
            on_progress(h / duration)
        if time >= duration:
            reason = f"reached {duration:g} s in {done} steps"
            good = Status(True, reason, "", iterations, worst)
            return state, account.error(state.temperatures), good, account.history()
        if not steps:
            step = h * min(5.0, 0.9 * max(error, 1e-6) ** (-1 / 3))
    reason = f"{max_steps} steps reached only {time:g} of {duration:g} s"
    bad = Status(False, reason, "raise max_steps or temperature_tolerance", iterations, worst)
    return state, account.error(state.temperatures), bad, account.history()


def _stages(
    network: HeatNetwork, capacity: Array, state: State, slope: Array, h: float, tolerance: float
) -> tuple[list[State], Status, list[Array]]:
    """The two implicit stages of one step, with the slopes (K/s) of all three."""
    t = state.temperatures
    # Heat is balanced by the slope taken from the difference, which Newton's residual bounds.
    base = t + h * D * slope
    rate = capacity / (D * h)

    def stage(guess: State) -> tuple[State, Status, list[float]]:
        storage = Storage(rate, base)
        return newton(network, guess, storage, tolerance=tolerance, max_iterations=MAX_NEWTON)

    middle, first, _ = stage(state)
    slope_1 = (middle.temperatures - base) / (D * h)
    if not first.converged:
        return [middle], first, [slope, slope_1]
    base = t + h * W * (slope + slope_1)
    last, second, _ = stage(middle)
    slope_2 = (last.temperatures - base) / (D * h)
    residual = max(first.residual, second.residual)
    count = first.iterations + second.iterations
    status = Status(second.converged, second.reason, second.remedy, count, residual)
    return [middle, last], status, [slope, slope_1, slope_2]


def _error(
    network: HeatNetwork, capacity: Array, last: State, slopes: list[Array], h: float
) -> float:
    """Largest error estimate of a step, filtered so that stiff spheres do not spoil it [K]."""
    weights = (W - E[0], W - E[1], D - E[2])
    raw = h * sum(w * k for w, k in zip(weights, slopes, strict=True))
    rate = capacity / (D * h)
    zero = np.zeros(network.n)
    filtered, _, ok = network.solve(last.temperatures, rate, rate * raw, zero, rtol=1e-2)
    return float(np.abs(filtered if ok else raw).max())
