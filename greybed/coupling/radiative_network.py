"""Radiative network: net heats and temperatures of spheres and walls, any of the two given."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import bmat, csr_matrix, diags
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import LinearOperator, gmres, splu

from greybed.core.errors import InputError
from greybed.coupling.conduction import per_sphere
from greybed.coupling.radiation import STEFAN_BOLTZMANN
from greybed.coupling.results import SolverError, Status
from greybed.coupling.rows import Rows, balanced

Array = NDArray[np.float64]

# Spheres up to which a stubborn system is factorised directly.
MOST_DIRECT = 20_000


@dataclass(frozen=True, eq=False)
class RadiativeResult:
    """Temperatures and net heats of a radiative network.

    Attributes
    ----------
    temperatures, heats : array, shape (n,)
        Of the spheres [K], and what each gives off less what it absorbs [W].
    wall_temperatures, wall_heats : array, shape (n_walls + 1,)
        The same of the walls and, last, of the opening; locally re-radiating ones have no
        temperature (NaN) and no heat (0).
    imbalance : float
        Violation of row sums and reciprocity before balancing [-].
    defect : float
        Sum of all net heats over half the sum of their absolute values [-].
    """

    temperatures: Array
    heats: Array
    wall_temperatures: Array
    wall_heats: Array
    imbalance: float
    defect: float


def radiative_network(
    factors: Any,
    *,
    temperatures: ArrayLike | None = None,
    heats: ArrayLike | None = None,
    emissivity: ArrayLike | None = None,
    wall_temperatures: Sequence[float | None] = (),
    wall_heats: Sequence[float | None] = (),
    environment_temperature: float | None = None,
    wall_emissivity: ArrayLike = 1.0,
    wall_exchange: ArrayLike | None = None,
) -> RadiativeResult:
    r"""Solve the exchange between spheres, walls and opening, for heats or temperatures.

    From exchange factors directly,

    .. math:: q_i = A_i\varepsilon_i\sigma T_i^4 - \sum_j A_j\varepsilon_j D_{ji}\sigma T_j^4,

    or, where the factors are view factors, with one radiosity per surface (equivalent to
    Gebhart's absorption factors),

    .. math:: A_i G_i = \sum_j A_i F_{ij} J_j,\quad
              J = \varepsilon\sigma T^4 + (1-\varepsilon) G,\quad q = A (J - G).

    Parameters
    ----------
    factors : object
        Exchange factors of one emissivity (an object with ``emission_areas``, such as
        ``greybed.raytrace.ExchangeRows``), or view factors (anything with ``factors``,
        ``wall_factors``, ``escaped`` and ``areas``). Exchange factors at emissivity 1 are view
        factors where ``emissivity`` is given. Balanced here.
    temperatures : array_like, shape () or (n,), optional
        Of the spheres, above zero [K]; NaN where the heat is given.
    heats : array_like, shape () or (n,), optional
        Net heat that each sphere gives off, so the heat supplied to it [W]; NaN where the
        temperature is given. By default 0 (radiative equilibrium) where no temperature is.
    emissivity : array_like, shape () or (n,)
        With view factors only, in (0, 1] [-].
    wall_temperatures : sequence of n_walls floats or None
        [K]; None where the heat is given or the wall re-radiates locally.
    wall_heats : sequence of n_walls floats or None, optional
        Net heat of walls of one unknown temperature [W]; None elsewhere.
    environment_temperature : float or None
        What the opening looks at [K]; None where it returns to each sphere what it gets.
    wall_emissivity : array_like, shape () or (n_walls,)
        With view factors only, in (0, 1] [-]; exchange factors have it inside.
    wall_exchange : array_like, shape (n_walls, n_walls), optional
        Exchange areas between the walls themselves, symmetric: A F or, with exchange factors,
        A epsilon D [m2]. By default that of exchange factors with ``patches``, else zero: heat
        from wall to wall is then not counted.

    Returns
    -------
    RadiativeResult

    Raises
    ------
    InputError
        For shapes that disagree, values out of range, a surface with both or nothing given, a
        group without any temperature, heats that would need a negative emission, or rows that
        cannot be balanced.
    SolverError
        If the linear solve fails.

    Notes
    -----
    A wall is one surface of one temperature. One that re-radiates locally (neither temperature
    nor heat) returns to each sphere what it receives from it, and counts for nothing in
    ``wall_exchange``. With view factors a grey wall has the area that rows and ``wall_exchange``
    give it. Sources: Howell, Menguc & Siegel, Thermal Radiation Heat Transfer, enclosures of
    diffuse-grey surfaces; Mahan, Radiation Heat Transfer (2002), distribution factors; Gebhart,
    Int. J. Heat Mass Transfer 3 (1961) 341.
    """
    rows, direct = _thermal_rows(factors, emissivity is not None)
    n, n_walls = rows.wall_factors.shape
    if direct and (emissivity is not None or np.any(np.asarray(wall_emissivity) != 1.0)):
        raise InputError(
            "emissivity is given, but these exchange factors already hold it; leave it out or "
            "give view factors."
        )
    if not direct and emissivity is None:
        raise InputError("emissivity is missing; view factors need one or (n,) of them [-].")
    eps = per_sphere(1.0 if direct else emissivity, n, "emissivity", "-", at_most=1.0)  # type: ignore[arg-type]
    wall_eps = per_sphere(wall_emissivity, n_walls, "wall_emissivity", "-", at_most=1.0)
    imbalance = rows.imbalance
    rows = rows if imbalance < 1e-12 else balanced(rows)
    known, given, given_walls = _conditions(
        n, n_walls, temperatures, heats, wall_temperatures, wall_heats, environment_temperature
    )
    if wall_exchange is None and direct:
        wall_exchange = getattr(factors, "wall_exchange", None)
    a = rows.areas[:, None]
    outside = a * np.column_stack([rows.wall_factors, rows.escaped])
    exchange, areas = _nodes(diags(rows.areas) @ rows.factors, outside, given_walls, wall_exchange)
    all_eps = np.concatenate([eps, wall_eps, [1.0]])
    return _solve(exchange, areas, all_eps, known, given, given_walls, n, imbalance)


def pairwise_network(
    factors: Any,
    *,
    emissivity: ArrayLike,
    temperatures: ArrayLike | None = None,
    heats: ArrayLike | None = None,
    wall_temperatures: Sequence[float | None] = (),
    wall_heats: Sequence[float | None] = (),
    environment_temperature: float | None = None,
    wall_emissivity: ArrayLike = 1.0,
    wall_areas: ArrayLike = math.inf,
    wall_exchange: ArrayLike | None = None,
) -> RadiativeResult:
    r"""The two-surface formula on every pair by itself: a baseline, wrong in a bed.

    .. math:: q_{ij} = \sigma(T_i^4 - T_j^4) \Big/ \left[\frac{1-\varepsilon_i}{A_i\varepsilon_i}
              + \frac{1}{A_i F_{ij}} + \frac{1-\varepsilon_j}{A_j\varepsilon_j}\right]

    holds for two surfaces that see only each other. In a bed each sphere has many partners, and
    the formula charges the surface resistance to each of them as if it were the only one.

    Parameters
    ----------
    factors : object
        View factors, as for :func:`radiative_network`.
    emissivity, temperatures, heats, wall_temperatures, wall_heats, environment_temperature
        As there.
    wall_emissivity, wall_areas : array_like, shape () or (n_walls,)
        In (0, 1] [-] and above zero [m2]; areas matter for grey walls only.
    wall_exchange : array_like, shape (n_walls, n_walls), optional
        Exchange areas A F between walls, symmetric [m2].

    Returns
    -------
    RadiativeResult

    Raises
    ------
    InputError
        As for :func:`radiative_network`.
    SolverError
        If the linear solve fails.
    """
    rows, direct = _thermal_rows(factors, True)
    if direct:
        raise InputError("the pairwise formula takes view factors; trace with emissivity 1.")
    n, n_walls = rows.wall_factors.shape
    eps = per_sphere(emissivity, n, "emissivity", "-", at_most=1.0)
    wall_eps = per_sphere(wall_emissivity, n_walls, "wall_emissivity", "-", at_most=1.0)
    a_walls = np.array(np.broadcast_to(np.asarray(wall_areas, dtype=np.float64), (n_walls,)))
    if not (a_walls > 0.0).all() or (np.isinf(a_walls) & (wall_eps < 1.0)).any():
        raise InputError("wall_areas must be above 0 [m2], and finite for a grey wall; give them.")
    imbalance = rows.imbalance
    rows = rows if imbalance < 1e-12 else balanced(rows)
    known, given, given_walls = _conditions(
        n, n_walls, temperatures, heats, wall_temperatures, wall_heats, environment_temperature
    )
    outside = rows.areas[:, None] * np.column_stack([rows.wall_factors, rows.escaped])
    exchange, _ = _nodes(diags(rows.areas) @ rows.factors, outside, given_walls, wall_exchange)
    resistance = np.concatenate(
        [(1.0 - eps) / (rows.areas * eps), (1.0 - wall_eps) / (a_walls * wall_eps), [0.0]]
    )
    s = exchange.tocoo()
    s = csr_matrix(
        (1.0 / (resistance[s.row] + resistance[s.col] + 1.0 / s.data), (s.row, s.col)), s.shape
    )
    areas = np.asarray(s.sum(axis=1)).ravel()
    ones = np.ones(len(areas))
    return _solve(s, areas, ones, known, given, given_walls, n, imbalance)


def _thermal_rows(factors: Any, as_view_factors: bool) -> tuple[Rows, bool]:
    """Rows whose areas weigh black emission, and whether reflections are inside them."""
    rows = Rows.taken(factors)
    # Black spheres absorb what they meet first: their exchange factors are either.
    either = getattr(factors, "emission_areas", None) is not None and not as_view_factors
    return rows, rows.emissivity is not None or either


def _conditions(
    n: int,
    n_walls: int,
    temperatures: ArrayLike | None,
    heats: ArrayLike | None,
    wall_temperatures: Sequence[float | None],
    wall_heats: Sequence[float | None],
    environment: float | None,
) -> tuple[Array, Array, Array]:
    """Emission [W/m2] and heat [W] of all nodes, NaN where not given, and who takes part."""
    t = np.full(n, np.nan) if temperatures is None else _spread(temperatures, n, "temperatures")
    q = np.full(n, np.nan) if heats is None else _spread(heats, n, "heats")
    if heats is None:
        q = np.where(np.isnan(t), 0.0, np.nan)
    walls_t, walls_q = list(wall_temperatures), list(wall_heats) or [None] * n_walls
    if len(walls_t) != n_walls or len(walls_q) != n_walls:
        raise InputError(
            f"{len(walls_t)} wall temperatures and {len(walls_q)} wall heats for {n_walls} walls; "
            "give one per wall, None where the other one holds or the wall re-radiates."
        )
    t_all = np.concatenate([t, [math.nan if v is None else v for v in [*walls_t, environment]]])
    q_all = np.concatenate([q, [math.nan if v is None else v for v in [*walls_q, None]]])
    if (t_all <= 0.0).any() or np.isinf(t_all).any() or np.isinf(q_all).any():
        raise InputError("temperatures must be finite and above 0 [K], heats finite [W]; mend it.")
    both = np.isfinite(t_all) & np.isfinite(q_all)
    neither = np.isnan(t_all[:n]) & np.isnan(q_all[:n])
    if both.any() or neither.any():
        i = int(both.argmax()) if both.any() else int(neither.argmax())
        name = f"sphere {i}" if i < n else f"wall {i - n}"
        raise InputError(
            f"{name} has {'both' if both.any() else 'neither'} of temperature and heat; give "
            "exactly one."
        )
    takes_part = np.isfinite(t_all) | np.isfinite(q_all)
    return STEFAN_BOLTZMANN * t_all**4, q_all, takes_part[n:]


def _spread(values: ArrayLike, n: int, name: str) -> Array:
    array = np.asarray(values, dtype=np.float64)
    if array.shape not in ((), (n,)):
        raise InputError(f"{name} has shape {array.shape}; give one or one per sphere ({n},).")
    return np.array(np.broadcast_to(array, (n,)))


def _nodes(
    spheres: csr_matrix, outside: Array, takes_part: Array, wall_exchange: ArrayLike | None
) -> tuple[csr_matrix, Array]:
    """Symmetric exchange areas of spheres, walls and opening, and the areas: their sums [m2]."""
    n_walls = len(takes_part) - 1
    between = np.zeros((n_walls + 1, n_walls + 1))
    if wall_exchange is not None:
        w = np.asarray(wall_exchange, dtype=np.float64)
        if w.shape != (n_walls, n_walls) or not (np.isfinite(w).all() and (w >= 0.0).all()):
            raise InputError(
                f"wall_exchange of shape {w.shape} must be ({n_walls}, {n_walls}), finite and at "
                "least 0 [m2]."
            )
        if not np.allclose(w, w.T, rtol=1e-9, atol=0.0):
            raise InputError("wall_exchange [m2] must be symmetric; give the mean of both ways.")
        between[:-1, :-1] = 0.5 * (w + w.T)
    local = np.logical_not(takes_part)
    returned = outside[:, local].sum(axis=1)
    outside = np.where(local, 0.0, outside)
    between[local] = 0.0
    between[:, local] = 0.0
    s = spheres + diags(returned)
    s = (0.5 * (s + s.T)).tocsr()  # its last digits too
    outer = csr_matrix(outside)
    matrix = bmat([[s, outer], [outer.T, csr_matrix(between)]]).tocsr()
    matrix.eliminate_zeros()
    return matrix, np.asarray(matrix.sum(axis=1)).ravel()


def _solve(
    exchange: csr_matrix,
    areas: Array,
    emissivity: Array,
    emission: Array,
    heat: Array,
    takes_part: Array,
    n: int,
    imbalance: float,
) -> RadiativeResult:
    """One linear system in the irradiation G, which holds for given heats and emissions alike."""
    fixed, driven = ~np.isnan(emission), ~np.isnan(heat)
    seen = areas > 0.0
    _, label = connected_components(exchange, directed=False)
    loose = driven & ~np.isin(label, np.unique(label[fixed])) & seen
    if loose.any() or (driven & ~seen & (np.nan_to_num(heat) != 0.0)).any():
        i = int((loose | (driven & ~seen)).argmax())
        raise InputError(
            f"{f'sphere {i}' if i < n else f'wall {i - n}'} exchanges with no surface of given "
            "temperature, so its own is not determined; give one."
        )
    base = float(emission[fixed].min()) if fixed.any() else 0.0
    safe = np.where(seen, areas, 1.0)
    # J = keep G + source: keep = 1 - emissivity where T is given, 1 where the heat is.
    keep = np.where(fixed, 1.0 - emissivity, 1.0)
    source = np.where(fixed, emissivity * (emission - base), np.nan_to_num(heat) / safe)
    matrix = diags(np.where(seen, areas, 1.0)) - exchange @ diags(keep)
    arriving = exchange @ source
    g = _linear(matrix.tocsr(), arriving)
    j = keep * g + source
    # Node by node A (J - G), written over the pairs so that the sum of all is zero to round-off.
    out = areas * j - exchange @ j
    out = np.where(driven, np.nan_to_num(heat), out)
    e = np.where(fixed, emission, base + g + np.nan_to_num(heat) / (safe * emissivity))
    took_part = np.concatenate([np.ones(n, bool), takes_part])
    cold = took_part & seen & ~(e > 0.0)
    if cold.any():
        i = int(cold.argmax())
        raise InputError(
            f"{f'sphere {i}' if i < n else f'wall {i - n}'} cannot give off {heat[i]:g} [W]: its "
            "emission would be negative; raise its heat or the temperatures around it."
        )
    e = np.where(took_part & (seen | fixed), e, np.nan)
    t = (e / STEFAN_BOLTZMANN) ** 0.25
    gross = 0.5 * float(np.abs(out).sum())
    floor = 1e3 * float(np.finfo(float).eps) * float((areas * np.nan_to_num(e)).sum())
    defect = abs(float(out.sum())) / gross if gross > floor else 0.0
    out = np.where(took_part, out, 0.0)
    return RadiativeResult(t[:n], out[:n], t[n:], out[n:], imbalance, defect)


def _linear(matrix: csr_matrix, right: Array) -> Array:
    """Solve by GMRES with refinement; directly where that stalls."""
    size = len(right)
    pivot = 1.0 / matrix.diagonal()
    precondition = LinearOperator((size, size), lambda v: pivot * v, dtype=np.float64)
    result, rest = right * pivot, right
    scale = float(np.abs(right).sum())
    for _ in range(4):
        rest = right - matrix @ result
        if np.abs(rest).sum() <= 1e-14 * scale:
            return result
        step, _ = gmres(matrix, rest, M=precondition, rtol=1e-8, restart=100, maxiter=20)
        result = result + step
    rest = right - matrix @ result
    if np.abs(rest).sum() <= 1e-11 * scale:
        return result
    if size <= MOST_DIRECT:
        result = splu(matrix.tocsc()).solve(right)
        rest = right - matrix @ result
        if np.abs(rest).sum() <= 1e-9 * scale:
            return result
    raise SolverError(
        Status(
            False,
            "the radiative network is too ill-conditioned",
            "check for emissivities or heats that differ by many decades",
            0,
            float(np.abs(rest).sum() / scale),
        )
    )
