"""Compiled: the coarsest grid of a multigrid cycle, solved as a whole."""

import numpy as np

from greybed.core.jit import njit

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}


@njit(**_OPTIONS)
def dense(tx, ty, tz, diag, matrix):
    """All of it as a matrix."""
    nz, ny, nx = diag.shape
    matrix[:, :] = 0.0
    for k in range(nz):
        for j in range(ny):
            for i in range(nx):
                row = matrix[(k * ny + j) * nx + i]
                row[(k * ny + j) * nx + i] += diag[k, j, i]
                row[(k * ny + j) * nx + (i - 1) % nx] -= tx[k, j, i]
                row[(k * ny + j) * nx + (i + 1) % nx] -= tx[k, j, i + 1]
                row[(k * ny + (j - 1) % ny) * nx + i] -= ty[k, j, i]
                row[(k * ny + (j + 1) % ny) * nx + i] -= ty[k, j + 1, i]
                row[((k - 1) % nz * ny + j) * nx + i] -= tz[k, j, i]
                row[((k + 1) % nz * ny + j) * nx + i] -= tz[k + 1, j, i]


@njit(**_OPTIONS)
def factor(matrix):
    """L D L^T of a symmetric matrix in place: L below the diagonal, one over D on it.

    Without LAPACK, whose threads would wait at full speed for the next matrix of this size. Where
    nothing is left of a pivot the matrix is singular there, and the value is to be 0.
    """
    n = matrix.shape[0]
    scaled = np.empty(n)
    for j in range(n):
        row = matrix[j]
        pivot = row[j]
        for k in range(j):
            scaled[k] = row[k] * matrix[k, k]
            pivot -= row[k] * scaled[k]
        inverse = 1.0 / pivot if pivot > 1e-11 * row[j] else 0.0
        row[j] = pivot
        for i in range(j + 1, n):
            lower = matrix[i]
            left = lower[j]
            for k in range(j):
                left -= lower[k] * scaled[k]
            lower[j] = left * inverse
        if inverse == 0.0:
            row[j] = 0.0
    for j in range(n):
        matrix[j, j] = 1.0 / matrix[j, j] if matrix[j, j] > 0.0 else 0.0


@njit(**_OPTIONS)
def solve_factored(matrix, b, x):
    """Values whose products with a matrix that :func:`factor` has taken apart are ``b``."""
    n = matrix.shape[0]
    flat, to = b.reshape(-1), x.reshape(-1)
    for i in range(n):
        left = flat[i]
        for k in range(i):
            left -= matrix[i, k] * to[k]
        to[i] = left
    for i in range(n - 1, -1, -1):
        left = to[i] * matrix[i, i]
        for k in range(i + 1, n):
            left -= matrix[k, i] * to[k]
        to[i] = left
