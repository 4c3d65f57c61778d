"""Analysis of variance of a two-level design: which factors move a response."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as f_distribution

Array = NDArray[np.float64]


@dataclass(frozen=True)
class AnovaRow:
    """One line of the table.

    Attributes
    ----------
    source : str
        Factor, or ``residual``.
    effect : float
        Change of the response from the low to the high level.
    squares : float
        Sum of squares.
    freedom : int
        Degrees of freedom [-].
    f, p : float
        Ratio to the residual's mean square and its chance without effect; NaN of the residual [-].
    """

    source: str
    effect: float
    squares: float
    freedom: int
    f: float = float("nan")
    p: float = float("nan")


def anova(x: Array, y: Array, names: Sequence[str]) -> list[AnovaRow]:
    """Main effects by least squares, each tested against what all of them leave.

    Parameters
    ----------
    x : ndarray (n, d)
        Points of the unit cube [-].
    y : ndarray (n,)
        Response, in its unit.
    names : sequence of str
        Of the factors.

    Returns
    -------
    list of AnovaRow
        A row for each factor, and the residual: interactions and scatter together.

    Notes
    -----
    Sums of squares are partial ones (type III): those that the fit loses without the factor. In a
    balanced design they add up to the total.
    """
    n = len(x)
    level = x.max(axis=0) - x.min(axis=0)
    level = np.where(level > 0.0, level, 1.0)
    z = 2.0 * (x - 0.5 * (x.max(axis=0) + x.min(axis=0))) / level
    terms = np.column_stack([np.ones(n), z])
    beta, left = _fit(terms, y)
    freedom = n - int(np.linalg.matrix_rank(terms))
    mean_square = left / freedom if freedom > 0 else float("nan")
    rows = []
    for k, name in enumerate(names):
        _, without = _fit(np.delete(terms, k + 1, axis=1), y)
        squares = max(without - left, 0.0)
        ratio = squares / mean_square if mean_square > 0.0 else float("inf")
        p = float(f_distribution.sf(ratio, 1, freedom)) if freedom > 0 else float("nan")
        rows.append(AnovaRow(name, 2.0 * float(beta[k + 1]), squares, 1, ratio, p))
    rows.append(AnovaRow("residual", float("nan"), left, freedom))
    return rows


def _fit(terms: Array, y: Array) -> tuple[Array, float]:
    beta, *_ = np.linalg.lstsq(terms, y, rcond=None)
    return np.asarray(beta, float), float(((y - terms @ beta) ** 2).sum())


def active_factors(tables: Sequence[Sequence[AnovaRow]], level: float = 0.05) -> tuple[int, ...]:
    """Factors that move at least one response (Holm's correction over all tests).

    Parameters
    ----------
    tables : sequence of ANOVA tables
        One for each response, with the same factors.
    level : float
        Chance to call any factor active by accident [-].
    """
    tests = [
        (row.p if np.isfinite(row.p) else 1.0, k)
        for table in tables
        for k, row in enumerate(table[:-1])
    ]
    active: set[int] = set()
    for rank, (p, k) in enumerate(sorted(tests)):
        if p > level / (len(tests) - rank):
            break
        active.add(k)
    return tuple(sorted(active))
