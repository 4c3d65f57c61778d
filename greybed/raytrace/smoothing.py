r"""Reciprocity and row sums of traced factors, both exact, with the errors that remain.

Measured are exchange areas S_ij = A_i F_ij, from both directions, each with a variance; known is
that S is symmetric and that each row adds up to A_i. The most likely S under these constraints,
for variances proportional to the values as counts have them, is

.. math:: S = \hat S\, e^{-\rho (\lambda_i + \lambda_j)},\qquad \rho = v / \hat S ,

with one multiplier per row; Larsen & Howell 1986 (J. Heat Transfer 108:239) do it by least squares,
van Leersum 1989 (Int. J. Heat Fluid Flow 10:83) and Taylor & Luck 1995 (J. Thermophys. Heat
Transfer 9:660) weigh. To first order it is the weighted least-squares answer, but it never changes
a sign, and zeros stay zero. The variance left is

.. math:: v' = v - v^2 (M^{-1}_{ii} + M^{-1}_{jj} + 2 M^{-1}_{ij}),\qquad M = C V C^T .
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import cg

from greybed.core import InputError

if TYPE_CHECKING:
    from greybed.raytrace.viewfactors import ViewFactors

Array = NDArray[np.float64]
Index = NDArray[np.int64]

MOST_STEPS = 60
TOLERANCE = 1e-13
# Up to so many spheres the inverse is computed whole.
DENSE = 600


@dataclass(frozen=True, eq=False)
class Exchange:
    """Exchange areas of a bed: pairs once, walls and opening by sphere.

    Attributes
    ----------
    i, j : (m,) int arrays
        Spheres, i <= j; a sphere and its own images once, with i = j.
    value, variance : (m,) arrays
        A_i F_ij [m2] and its variance [m4].
    outside, outside_variance : (n, n_walls + 2) arrays
        The same to walls, to the opening, and to the surroundings beyond a distance limit.
    areas : (n,) array
        What the rows add up to [m2].
    """

    i: Index
    j: Index
    value: Array
    variance: Array
    outside: Array
    outside_variance: Array
    areas: Array


def closed(measured: Exchange) -> Exchange:
    """The most likely exchange areas whose rows add up, with their variances.

    Raises
    ------
    InputError
        If a row is empty, or no such areas exist.
    """
    n = len(measured.areas)
    i, j = measured.i, measured.j
    apart = i != j
    a = measured.areas
    rows = np.concatenate([i, j[apart]])
    cols = np.concatenate([j, i[apart]])
    entry = np.concatenate([np.arange(len(i)), np.flatnonzero(apart)])
    rho = np.divide(
        measured.variance, measured.value, out=np.zeros_like(measured.value),
        where=measured.value > 0.0,
    )  # fmt: skip
    rho_out = np.divide(
        measured.outside_variance, measured.outside,
        out=np.zeros_like(measured.outside), where=measured.outside > 0.0,
    )  # fmt: skip
    if (np.bincount(rows, measured.value[entry], n) + measured.outside.sum(axis=1) <= 0.0).any():
        raise InputError("a sphere sees nothing at all; trace with more rays or a longer reach.")
    multiplier = np.zeros(n)

    def state(x: Array) -> tuple[Array, Array, Array]:
        pull = np.where(apart, x[i] + x[j], x[i])
        value = measured.value * np.exp(-rho * pull)
        outside = measured.outside * np.exp(-rho_out * x[:, None])
        received = np.bincount(rows, value[entry], n) + outside.sum(axis=1)
        return value, outside, received - a

    value, outside, left = state(multiplier)
    worst = float(abs(left / a).max())
    for _ in range(MOST_STEPS):
        if worst <= TOLERANCE:
            break
        matrix = _normal(n, rows, cols, entry, rho * value, (rho_out * outside).sum(axis=1))
        scale = 1.0 / matrix.diagonal()
        step, _ = cg(matrix, left, rtol=1e-10, maxiter=2000, M=sparse.diags_array(scale))
        length = 1.0
        while True:  # backtracking: the exponentials may overshoot from far away
            trial = state(multiplier + length * step)
            new = float(abs(trial[2] / a).max())
            if new < worst or length < 1e-6:
                break
            length *= 0.5
        if not new < worst:
            break
        multiplier = multiplier + length * step
        (value, outside, left), worst = trial, new
    if worst > 1e-12:
        raise InputError(
            f"row sums cannot be closed: one is still off by {worst:.1e} [-]; trace with more rays "
            "or check that walls and opening are part of the rows."
        )
    variance, outside_variance = _left(measured, rows, cols, entry, value, rho, outside, rho_out)
    return replace(
        measured, value=value, variance=variance, outside=outside,
        outside_variance=outside_variance,
    )  # fmt: skip


def _normal(
    n: int, rows: Index, cols: Index, entry: Index, variance: Array, outside: Array
) -> sparse.csr_array:
    """M = C V C^T: the variance of each row sum, and what two rows share."""
    v = variance[entry]
    own = np.bincount(rows, v, n) + outside
    off = rows != cols
    matrix = sparse.coo_array((v[off], (rows[off], cols[off])), shape=(n, n)).tocsr()
    return sparse.csr_array(matrix + sparse.diags_array(own))


def _left(
    measured: Exchange, rows: Index, cols: Index, entry: Index, value: Array, rho: Array,
    outside: Array, rho_out: Array,
) -> tuple[Array, Array]:  # fmt: skip
    """Variances after the constraints."""
    n = len(measured.areas)
    v, v_out = rho * value, rho_out * outside
    matrix = _normal(n, rows, cols, entry, v, v_out.sum(axis=1))
    i, j = measured.i, measured.j
    known = matrix.diagonal() > 0.0  # rows that are exact already have nothing to give
    if n <= DENSE:
        inverse = np.linalg.pinv(matrix.toarray(), hermitian=True)
        own, shared = np.diag(inverse).copy(), inverse[i, j]
    else:
        # Neumann's series around the diagonal: its terms are chances of walking from i to j, which
        # fall fast in three dimensions.
        d = np.where(known, matrix.diagonal(), 1.0)
        walk = sparse.diags_array(1.0 / d) @ (matrix - sparse.diags_array(matrix.diagonal()))
        two = walk @ walk
        series = sparse.csr_array(sparse.eye_array(n) - walk + two - two @ walk)
        own = series.diagonal() / d
        shared = np.asarray(series[i, j]).ravel() / d[j]
    apart = i != j
    given = np.where(apart, own[i] + own[j] + 2.0 * shared, own[i])
    variance = np.maximum(v - v**2 * given, 0.0)
    return variance, np.maximum(v_out - v_out**2 * own[:, None], 0.0)


def smoothed(result: ViewFactors) -> ViewFactors:
    """Factors made reciprocal, with rows that add up to one, and the errors that remain.

    Parameters
    ----------
    result : ViewFactors
        Traced from every sphere of the bed.

    Returns
    -------
    ViewFactors
        ``A_i F_ij = A_j F_ji`` to 1e-14 and row sums of one to 1e-12; errors smaller by a factor
        of about 1.4 for pairs. Zeros stay zero.

    Raises
    ------
    InputError
        If a row was not traced.
    """
    return scattered(closed(gathered(result)), result)


def gathered(result: ViewFactors) -> Exchange:
    """Exchange areas of both directions, averaged with the weights that counts have."""
    if not np.isfinite(result.escaped).all():
        k = int((~np.isfinite(result.escaped)).argmax())
        raise InputError(f"sphere {k} was not traced; smoothing needs every row: drop emitters.")
    n = len(result.areas)
    f = result.factors.tocoo()
    i, j = f.row.astype(np.int64), f.col.astype(np.int64)
    outside = np.column_stack([result.wall_factors, result.escaped, result.environment])
    out_error = np.column_stack(
        [result.wall_stderr, result.escaped_stderr, result.environment_stderr]
    )
    out_var = np.where(outside > 0.0, out_error**2, 0.0)
    error = result.stderr.tocoo().data
    a = result.areas
    if result.reciprocal:  # each pair is one estimate, of its own lines
        once = i <= j
        i, j = i[once], j[once]
        scale = a[:, None]
        return Exchange(
            i, j, a[i] * f.data[once], (a[i] * error[once]) ** 2,
            outside * scale, out_var * scale**2, a,
        )  # fmt: skip
    raw, raw_out = _unconditional(n, i, error**2, out_var)
    # With equal rays the variance of A_i F_ij falls with 1 / A_i: so the estimates weigh.
    weight = a[j] / (a[i] + a[j])
    weight[i == j] = 1.0
    low, high = np.minimum(i, j), np.maximum(i, j)
    key, pair = np.unique(low * n + high, return_inverse=True)
    value, variance = (
        np.asarray(np.bincount(pair, terms, len(key)), dtype=np.float64)
        for terms in (weight * a[i] * f.data, (weight * a[i]) ** 2 * raw)
    )
    return Exchange(
        key // n, key % n, value, variance, outside * a[:, None], raw_out * a[:, None] ** 2, a
    )


def _unconditional(n: int, row: Index, variance: Array, outside: Array) -> tuple[Array, Array]:
    """Variances as if the rays of a row had not been known to add up to one.

    A row's counts are anticorrelated, because each ray ends somewhere. The smoothing imposes that
    sum itself; so first the variances are found that give the stated ones under it.
    """
    u, u_out = variance.copy(), outside.copy()
    for _ in range(200):
        total = np.bincount(row, u, n) + u_out.sum(axis=1)
        total = np.where(total > 0.0, total, 1.0)
        new = variance / np.maximum(1.0 - u / total[row], 0.05)
        new_out = outside / np.maximum(1.0 - u_out / total[:, None], 0.05)
        change = max(
            float(abs(new - u).max(initial=0.0)), float(abs(new_out - u_out).max(initial=0.0))
        )
        u, u_out = new, new_out
        if change <= 1e-6 * float(u.max(initial=0.0) + u_out.max(initial=0.0)):
            break
    return u, u_out


def scattered(exchange: Exchange, result: ViewFactors) -> ViewFactors:
    """View factors of exchange areas, the rest as in ``result``."""
    n, a = len(exchange.areas), exchange.areas
    apart = exchange.i != exchange.j
    rows = np.concatenate([exchange.i, exchange.j[apart]])
    cols = np.concatenate([exchange.j, exchange.i[apart]])
    value = np.concatenate([exchange.value, exchange.value[apart]]) / a[rows]
    error = np.sqrt(np.concatenate([exchange.variance, exchange.variance[apart]])) / a[rows]
    outside = exchange.outside / a[:, None]
    out_error = np.sqrt(exchange.outside_variance) / a[:, None]
    return replace(
        result,
        factors=sparse.csr_array((value, (rows, cols)), shape=(n, n)),
        stderr=sparse.csr_array((error, (rows, cols)), shape=(n, n)),
        wall_factors=outside[:, :-2],
        wall_stderr=out_error[:, :-2],
        escaped=outside[:, -2],
        escaped_stderr=out_error[:, -2],
        environment=outside[:, -1],
        environment_stderr=out_error[:, -1],
        reciprocal=True,
    )
