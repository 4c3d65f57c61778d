"""Heat network of a bed: residual, Newton iteration and Krylov solve, steady or in time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bmat, csr_matrix, diags
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import LinearOperator, gmres, splu

from greybed.coupling.radiation import STEFAN_BOLTZMANN, Exchange
from greybed.coupling.results import Status

Array = NDArray[np.float64]

EPSILON = float(np.finfo(np.float64).eps)


@dataclass(frozen=True, eq=False)
class State:
    """Temperatures of the spheres and, for radiation, their irradiation above the reference.

    Attributes
    ----------
    temperatures : array, shape (n,)
        [K].
    irradiation : array, shape (n,)
        Less sigma T_ref^4; zeros without radiation [W/m2].
    """

    temperatures: Array
    irradiation: Array


@dataclass(frozen=True, eq=False)
class Storage:
    """What a time integrator adds: ``rate * (T - base)`` is stored.

    Attributes
    ----------
    rate : array, shape (n,)
        Heat capacity over (d dt) [W/K].
    base : array, shape (n,)
        [K].
    """

    rate: Array
    base: Array


class HeatNetwork:
    """Spheres joined by contacts and by radiation, and tied to walls and opening.

    Parameters
    ----------
    contacts : csr matrix, shape (n, n)
        Conductances between spheres, symmetric [W/K].
    wall_contacts : array, shape (n, n_walls)
        Conductances to the walls [W/K]; those of adiabatic walls are ignored.
    exchange : Exchange or None
        Radiation, or none.
    temperatures : array, shape (n_walls + 1,)
        Of walls and opening, NaN where adiabatic [K].
    sources : array, shape (n,)
        Heat made inside each sphere [W].

    Notes
    -----
    Temperatures enter as differences from a reference, so a bed at one temperature exchanges
    exactly nothing. Unknowns are T and, unless all spheres are black, the irradiation G: so the
    equations hold at emissivity 1 and the Jacobian is as sparse as the view factors.
    """

    def __init__(
        self,
        contacts: csr_matrix,
        wall_contacts: Array,
        exchange: Exchange | None,
        temperatures: Array,
        sources: Array,
    ) -> None:
        self.n = len(sources)
        self.sources = sources
        self.exchange = exchange
        self.bounds = temperatures
        fixed = ~np.isnan(temperatures)
        self.wall_contacts = np.where(fixed[:-1], wall_contacts, 0.0)
        self.contacts = contacts
        self.contact_sum = np.asarray(contacts.sum(axis=1)).ravel()
        self.conduction_diagonal = self.contact_sum + self.wall_contacts.sum(axis=1)
        self.pin = np.zeros(self.n)  # [W/K], ties isolated spheres to pin_temperatures
        self.pin_temperatures = np.zeros(self.n)
        self.reference = float(np.nanmin(temperatures)) if fixed.any() else 300.0
        self.outer = np.where(fixed, temperatures - self.reference, 0.0)
        self.outer_emission = self.emission(self.reference + self.outer)
        hottest = float(np.nanmax(temperatures)) if fixed.any() else 300.0
        self.scale = 4.0 * STEFAN_BOLTZMANN * hottest**3  # turns irradiation into kelvin [W/m2/K]

    @property
    def is_grey(self) -> bool:
        """Whether the irradiation is an unknown of its own."""
        return self.exchange is not None and not self.exchange.is_black

    def emission(self, temperatures: Array) -> Array:
        """Black emission above that at the reference, free of cancellation, (n,) [W/m2]."""
        t, r = temperatures, self.reference
        return STEFAN_BOLTZMANN * (t - r) * (t + r) * (t * t + r * r)

    def settle(self, temperatures: Array) -> State:
        """State with the irradiation that belongs to ``temperatures`` (n,) [K]."""
        if self.exchange is None:
            return State(temperatures, np.zeros(self.n))
        emission = self.emission(temperatures)
        return State(temperatures, self.exchange.irradiation(emission, self.outer_emission))

    def isolated(self) -> NDArray[np.int64]:
        """Label of the connected group of each sphere without a path to a boundary, else -1."""
        graph = self.contacts
        tied = self.wall_contacts.sum(axis=1)
        if self.exchange is not None:
            graph = graph + self.exchange.matrix
            tied = tied + self.exchange.boundary.sum(axis=1)
        _, label = connected_components(graph, directed=False)
        reached = np.unique(label[tied > 0.0])
        return np.where(np.isin(label, reached), -1, label).astype(np.int64)

    def boundary_heat(self, state: State) -> tuple[Array, Array]:
        """Heat into the bed, by conduction (n_walls,) and by radiation (n_walls + 1,) [W]."""
        theta = state.temperatures - self.reference
        conduction = (self.wall_contacts * (self.outer[:-1] - theta[:, None])).sum(axis=0)
        if self.exchange is None:
            return conduction, np.zeros(len(self.outer))
        j = self.exchange.radiosity(self.emission(state.temperatures), state.irradiation)
        difference = self.outer_emission - j[:, None]
        return conduction, (self.exchange.boundary * difference).sum(axis=0)

    def residual(self, state: State, storage: Storage | None) -> tuple[Array, Array, float, float]:
        """Heat not accounted for.

        Returns
        -------
        heat : (n,) array
            Of each sphere: conduction + absorption + source - storage [W].
        light : (n,) array
            Defect of the irradiation [W].
        exchanged : float
            Heat exchanged with boundaries, sources and storage [W].
        floor : float
            What round-off alone may leave [W].
        """
        t = state.temperatures
        theta = t - self.reference
        heat = self.contacts @ theta - self.conduction_diagonal * theta + self.sources
        heat += self.wall_contacts @ self.outer[:-1]
        heat -= self.pin * (t - self.pin_temperatures)
        light = np.zeros(self.n)
        gross = np.abs(self.conduction_diagonal * theta).sum()
        if self.exchange is not None:
            ex, emission = self.exchange, self.emission(t)
            heat += ex.areas * ex.emissivity * (state.irradiation - emission)
            light = ex.defect(emission, state.irradiation, self.outer_emission)
            gross += (ex.areas * np.abs(emission)).sum()
            # T itself is rounded: its last digit moves the emission by this much.
            gross += (ex.areas * 4.0 * STEFAN_BOLTZMANN * t**4).sum()
        gross += ((self.conduction_diagonal + self.pin) * t).sum()
        conduction, radiation = self.boundary_heat(state)
        exchanged = np.abs(conduction).sum() + np.abs(radiation).sum() + np.abs(self.sources).sum()
        if storage is not None:
            stored = storage.rate * (t - storage.base)
            heat -= stored
            exchanged += np.abs(stored).sum()
            gross += (storage.rate * t).sum()
        return heat, light, float(exchanged), float(4.0 * EPSILON * gross)

    def solve(
        self, t: Array, rate: Array, heat: Array, light: Array, *, rtol: float
    ) -> tuple[Array, Array, bool]:
        """One linear solve with the Jacobian at temperatures ``t``: minus the step for a residual.

        Returns steps of T (n,) [K] and of the irradiation (n,) [W/m2], and whether it succeeded.
        """
        n, ex = self.n, self.exchange
        own = self.conduction_diagonal + self.pin + rate
        if ex is None:

            def conduct(v: Array) -> Array:
                return own * v - self.contacts @ v

            step, _, ok = self._krylov(conduct, 1.0 / own, None, heat, rtol)
            return step, light, ok
        h = 4.0 * STEFAN_BOLTZMANN * t**3
        a_eps, areas = ex.areas * ex.emissivity, ex.areas
        if not self.is_grey:
            # Black: G is explicit, and its defect passes straight on as heat.
            pivot = 1.0 / (own + (areas - ex.diagonal) * h)

            def black(v: Array) -> Array:
                hv = h * v
                return own * v - self.contacts @ v + areas * hv - ex.matrix @ hv

            step, _, ok = self._krylov(black, pivot, None, heat + light, rtol)
            return step, (light + ex.matrix @ (h * step)) / areas, ok

        reflected, s = 1.0 - ex.emissivity, self.scale

        def grey(v: Array) -> Array:
            x, y = v[:n], s * v[n:]
            hx = h * x
            first = own * x - self.contacts @ x + a_eps * (hx - y)
            second = areas * y - ex.matrix @ (ex.emissivity * hx + reflected * y)
            return np.concatenate([first, second])

        a11, a12 = own + a_eps * h, -a_eps * s
        a21, a22 = -ex.diagonal * ex.emissivity * h, (areas - ex.diagonal * reflected) * s
        block = (a11, a12, a21, a22)
        det = a11 * a22 - a12 * a21
        x, y, ok = self._krylov(grey, 1.0 / det, block, np.concatenate([heat, light]), rtol)
        return x, s * y, ok

    def _krylov(
        self,
        apply: Callable[[Array], Array],
        pivot: Array,
        block: tuple[Array, ...] | None,
        rhs: Array,
        rtol: float,
    ) -> tuple[Array, Array, bool]:
        n, size = self.n, len(rhs)

        def precondition(v: Array) -> Array:
            if block is None:
                return pivot * v
            a11, a12, a21, a22 = block
            r1, r2 = v[:n], v[n:]
            return np.concatenate([(a22 * r1 - a12 * r2) * pivot, (a11 * r2 - a21 * r1) * pivot])

        operator = LinearOperator((size, size), apply, dtype=np.float64)
        inverse = LinearOperator((size, size), precondition, dtype=np.float64)
        step, info = gmres(operator, rhs, M=inverse, rtol=rtol, restart=150, maxiter=8)
        ok = info == 0 and bool(np.isfinite(step).all())
        return step[:n], step[n:], ok

    def solve_direct(
        self, t: Array, rate: Array, heat: Array, light: Array
    ) -> tuple[Array, Array, bool]:
        """The same step by sparse LU, for the rare matrix on which GMRES stalls."""
        n, ex = self.n, self.exchange
        own = diags(self.conduction_diagonal + self.pin + rate) - self.contacts
        if ex is None:
            return splu(own.tocsc()).solve(heat), np.zeros(n), True
        h, s = 4.0 * STEFAN_BOLTZMANN * t**3, self.scale
        emitted, absorbed = diags(ex.emissivity * h), diags(ex.areas * ex.emissivity)
        first = own + absorbed @ diags(h)
        second = (diags(ex.areas) - ex.matrix @ diags(1.0 - ex.emissivity)) * s
        matrix = bmat([[first, -s * absorbed], [-ex.matrix @ emitted, second]])
        step = splu(matrix.tocsc()).solve(np.concatenate([heat, light]))
        return step[:n], s * step[n:], bool(np.isfinite(step).all())


def newton(
    network: HeatNetwork,
    start: State,
    storage: Storage | None,
    *,
    tolerance: float,
    max_iterations: int,
) -> tuple[State, Status, list[float]]:
    """Newton iteration on the residual of ``network``.

    Parameters
    ----------
    network : HeatNetwork
        The equations.
    start : State
        First guess.
    storage : Storage or None
        None for a steady state.
    tolerance : float
        Residual over the heat exchanged at which it stops, above zero [-]; it also stops where
        only round-off is left.
    max_iterations : int
        Bound on the iterations [-].

    Returns
    -------
    state : State
        The last one.
    status : Status
        Whether and why it ended; never raises.
    residuals : list of float
        Residual before every iteration and at the end [-].
    """
    rate = np.zeros(network.n) if storage is None else storage.rate
    state, history = start, []
    for iteration in range(max_iterations + 1):
        heat, light, exchanged, floor = network.residual(state, storage)
        left = float(np.abs(heat).sum() + np.abs(light).sum())
        relative = left / exchanged if exchanged > 0.0 else (0.0 if left <= floor else np.inf)
        history.append(relative)
        if left <= tolerance * exchanged + floor:
            reason = f"converged to {relative:.1e} of the heat exchanged"
            if left > tolerance * exchanged:
                reason = "converged to round-off"
            return state, Status(True, reason, "", iteration, relative), history
        if not np.isfinite(left):
            sphere = int(np.argmin(np.isfinite(heat) & np.isfinite(light)))
            at = f"its temperature is {state.temperatures[sphere]:g} K"
            reason = f"the heat of sphere {sphere} is not finite ({at})"
            remedy = "look at its conductances, its source and what it sees"
            return state, Status(False, reason, remedy, iteration, relative), history
        if iteration == max_iterations:
            break
        t = state.temperatures
        step, light_step, ok = network.solve(t, rate, heat, light, rtol=1e-5)
        if not ok:
            try:
                step, light_step, ok = network.solve_direct(t, rate, heat, light)
            except RuntimeError:  # SuperLU: exactly singular
                ok = False
            if not ok:
                reason = "the linear system is singular or too ill-conditioned"
                remedy = "check for conductivities or emissivities that differ by many decades"
                return state, Status(False, reason, remedy, iteration, relative), history
        # T stays positive: no step takes away more than 80 % of a temperature.
        fall = float((-step / t).max(initial=0.0))
        damping = min(1.0, 0.8 / fall) if fall > 0.0 else 1.0
        state = State(t + damping * step, state.irradiation + damping * light_step)
    reason = f"residual is still {relative:.1e} of the heat exchanged after {iteration} iterations"
    remedy = "raise max_iterations or tolerance, or start from temperatures closer to the answer"
    return state, Status(False, reason, remedy, iteration, relative), history
