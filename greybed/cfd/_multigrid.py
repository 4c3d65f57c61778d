"""Compiled parts of multigrid for diffusion between the cells of a box: arrays [z, y, x].

The flux through a face is its transmissibility times the difference of its two cells; an axis with
n cells has n + 1 faces. In loops over cells every axis wraps round: where one does not repeat, its
first and last transmissibilities are 0 and what they lead to is in the diagonal only. ``deep`` is
whether there is anything along z. Work is done row by row along x, in loops of few arrays with no
branches in them, which compilers turn into vector instructions.
"""

import numpy as np

from greybed.core.jit import njit

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}


@njit(**_OPTIONS)
def _around_row(row, south, north, west_face, south_face, north_face, out):
    """Sum of transmissibility times value over the four neighbours in a plane."""
    n = row.size
    before, behind, low, high = row[: n - 2], row[2:], south[1:], north[1:]
    west, east, bottom, top = west_face[1:], west_face[2:], south_face[1:], north_face[1:]
    to = out[1:]
    for i in range(n - 2):
        to[i] = (
            west[i] * before[i] + east[i] * behind[i] + bottom[i] * low[i] + top[i] * high[i]
        )  # fmt: skip
    for i in (0, n - 1):
        out[i] = (
            west_face[i] * row[i - 1 if i > 0 else n - 1]
            + west_face[i + 1] * row[i + 1 if i < n - 1 else 0]
            + south_face[i] * south[i] + north_face[i] * north[i]
        )  # fmt: skip


@njit(**_OPTIONS)
def _add_row(below, above, low_face, high_face, out):
    for i in range(out.size):
        out[i] += low_face[i] * below[i] + high_face[i] * above[i]


@njit(**_OPTIONS)
def _around(p, tx, ty, tz, k, j, deep, out):
    """Sum of transmissibility times value over the neighbours of a row of cells."""
    nz, ny, _ = p.shape
    south, north = j - 1 if j > 0 else ny - 1, j + 1 if j < ny - 1 else 0
    _around_row(p[k, j], p[k, south], p[k, north], tx[k, j], ty[k, j], ty[k, j + 1], out)
    if deep:
        below, above = k - 1 if k > 0 else nz - 1, k + 1 if k < nz - 1 else 0
        _add_row(p[below, j], p[above, j], tz[k, j], tz[k + 1, j], out)


@njit(**_OPTIONS)
def _sum_row(a, b):
    """Sum of products, in four parts that do not wait for each other."""
    n = a.size // 4
    s0, s1, s2, s3 = 0.0, 0.0, 0.0, 0.0
    for i in range(n):
        s0 += a[4 * i] * b[4 * i]
        s1 += a[4 * i + 1] * b[4 * i + 1]
        s2 += a[4 * i + 2] * b[4 * i + 2]
        s3 += a[4 * i + 3] * b[4 * i + 3]
    for i in range(4 * n, a.size):
        s0 += a[i] * b[i]
    return (s0 + s1) + (s2 + s3)


# -- coefficients ---------------------------------------------------------------------------------


@njit(**_OPTIONS)
def _faces_row(west, south, north, low, high, out, inverse):
    east = west[1:]
    for i in range(out.size):
        out[i] = west[i] + east[i] + south[i] + north[i] + low[i] + high[i]
    for i in range(out.size):
        inverse[i] = 1.0 / out[i] if out[i] > 0.0 else 0.0


@njit(**_OPTIONS)
def diagonal(tx, ty, tz, diag, inverse):
    """Sum of the transmissibilities around each cell, and one over it: 0 where there are none."""
    nz, ny, _ = diag.shape
    for k in range(nz):
        for j in range(ny):
            _faces_row(
                tx[k, j], ty[k, j], ty[k, j + 1], tz[k, j], tz[k + 1, j], diag[k, j], inverse[k, j]
            )


@njit(**_OPTIONS)
def sound(t):
    """Whether all numbers are finite and at least 0."""
    ok = True
    for k in range(t.shape[0]):
        for j in range(t.shape[1]):
            for i in range(t.shape[2]):
                ok &= 0.0 <= t[k, j, i] < np.inf
    return ok


@njit(**_OPTIONS)
def _gather_row(fine, at, share, out):
    """Add faces across x of a fine row to those of the coarse row that holds it."""
    for i in range(out.size):
        out[i] += share[i] * fine[at[i]]


@njit(**_OPTIONS)
def _pair_row(fine, halved, share, out):
    """Add faces along x of a fine row, two and two side by side."""
    if not halved:
        for i in range(out.size):
            out[i] += share * fine[i]
        return
    for i in range(fine.size // 2):
        out[i] += share * (fine[2 * i] + fine[2 * i + 1])
    if fine.size % 2 == 1:
        out[out.size - 1] += share * fine[fine.size - 1]


@njit(**_OPTIONS)
def coarsen(tx, ty, tz, halved, at, share, cx, cy, cz):
    """Transmissibilities of coarse faces: in parallel across them, over a longer way along.

    ``at`` has, for each axis, the fine face at each coarse one, ``share`` one over the way in fine
    cells that its flux has to go.
    """
    nz, ny = tx.shape[0], tx.shape[1]
    (hz, hy, hx), (z_at, y_at, x_at), (z_share, y_share, x_share) = halved, at, share
    cx[:, :, :] = 0.0
    cy[:, :, :] = 0.0
    cz[:, :, :] = 0.0
    for k in range(nz):
        coarse_k = k // 2 if hz else k
        for j in range(ny):
            _gather_row(tx[k, j], x_at, x_share, cx[coarse_k, j // 2 if hy else j])
        for j in range(y_at.size):
            _pair_row(ty[k, y_at[j]], hx, y_share[j], cy[coarse_k, j])
    for k in range(z_at.size):
        for j in range(ny):
            _pair_row(tz[z_at[k], j], hx, z_share[k], cz[k, j // 2 if hy else j])


# -- a cycle --------------------------------------------------------------------------------------


@njit(**_OPTIONS)
def _blend_row(b, around, inverse, first, row):
    for i in range(row.size):
        fresh = (b[i] + around[i]) * inverse[i]
        row[i] = fresh if (i & 1) == first else row[i]


@njit(**_OPTIONS)
def begin(p, b, inverse):
    """Red cells from values of 0 everywhere: the first half of a sweep."""
    nz, ny, nx = p.shape
    for k in range(nz):
        for j in range(ny):
            row, given, by = p[k, j], b[k, j], inverse[k, j]
            first = (k + j) & 1
            for i in range(nx):
                row[i] = given[i] * by[i] if (i & 1) == first else 0.0


@njit(**_OPTIONS)
def sweep(p, b, tx, ty, tz, inverse, deep, colour):
    """One colour of a red-black Gauss-Seidel sweep."""
    nz, ny, nx = p.shape
    around = np.empty(nx)
    for k in range(nz):
        for j in range(ny):
            _around(p, tx, ty, tz, k, j, deep, around)
            _blend_row(b[k, j], around, inverse[k, j], (k + j + colour) & 1, p[k, j])


@njit(**_OPTIONS)
def _parents(i, halved, coarse, periodic):
    """The coarse cell that holds a fine one, the next nearest one, and the latter's weight."""
    if not halved:
        return i, i, 0.0
    own = i >> 1
    other = own - 1 if i % 2 == 0 else own + 1
    if other < 0 or other >= coarse:
        if not periodic or coarse == 1:
            return own, own, 0.0
        other = coarse - 1 if other < 0 else 0
    return own, other, 0.25


@njit(**_OPTIONS)
def _residual_row(b, diag, p, residual):
    """What is left of ``b``, where ``residual`` holds what the neighbours give."""
    for i in range(p.size):
        residual[i] += b[i] - diag[i] * p[i]


@njit(**_OPTIONS)
def _restrict_row(fine, halved, periodic, out):
    """The transpose of :func:`_prolong_row`."""
    n, m = fine.size, out.size
    if not halved:
        out[:] = fine
        return
    left, middle, right, next_left = fine[1:], fine[2:], fine[3:], fine[4:]
    inner = out[1:]
    for i in range(m - 2):
        inner[i] = 0.75 * (middle[2 * i] + right[2 * i]) + 0.25 * (left[2 * i] + next_left[2 * i])
    out[0] = 0.0
    out[m - 1] = 0.0
    for i in range(n):
        if 3 <= i < n - 3:
            continue
        own, other, share = _parents(i, True, m, periodic)
        if own == 0 or own == m - 1:
            out[own] += (1.0 - share) * fine[i]
        if other == 0 or other == m - 1:
            out[other] += share * fine[i]


@njit(**_OPTIONS)
def _onto_row(values, share, out):
    for i in range(out.size):
        out[i] += share * values[i]


@njit(**_OPTIONS)
def restrict(p, b, tx, ty, tz, diag, deep, halved, periodic, coarse):
    """Residuals into the coarse cells: the transpose of :func:`prolong`."""
    nz, ny, nx = p.shape
    mz, my, mx = coarse.shape
    (hz, hy, hx), (pz, py, px) = halved, periodic
    residual, along = np.empty(nx), np.empty(mx)
    coarse[:, :, :] = 0.0
    for k in range(nz):
        k0, k1, kw = _parents(k, hz, mz, pz)
        for j in range(ny):
            j0, j1, jw = _parents(j, hy, my, py)
            _around(p, tx, ty, tz, k, j, deep, residual)
            _residual_row(b[k, j], diag[k, j], p[k, j], residual)
            _restrict_row(residual, hx, px, along)
            _onto_row(along, (1.0 - kw) * (1.0 - jw), coarse[k0, j0])
            if jw > 0.0:
                _onto_row(along, (1.0 - kw) * jw, coarse[k0, j1])
            if kw > 0.0:
                _onto_row(along, kw * (1.0 - jw), coarse[k1, j0])
                if jw > 0.0:
                    _onto_row(along, kw * jw, coarse[k1, j1])


@njit(**_OPTIONS)
def _prolong_row(coarse, halved, periodic, out):
    """Add values of coarse cells, linear between their centres."""
    n, m = out.size, coarse.size
    if not halved:
        for i in range(n):
            out[i] += coarse[i]
        return
    before, own, behind, inner = coarse, coarse[1:], coarse[2:], out[2:]
    for i in range(m - 2):
        inner[2 * i] += 0.75 * own[i] + 0.25 * before[i]
        inner[2 * i + 1] += 0.75 * own[i] + 0.25 * behind[i]
    for i in range(n):
        if 2 <= i < 2 * m - 2:
            continue
        mine, other, share = _parents(i, True, m, periodic)
        out[i] += (1.0 - share) * coarse[mine] + share * coarse[other]


@njit(**_OPTIONS)
def prolong(coarse, p, halved, periodic):
    """Add the corrections of coarse cells, linear between their centres."""
    nz, ny, _ = p.shape
    mz, my, mx = coarse.shape
    (hz, hy, hx), (pz, py, px) = halved, periodic
    across = np.empty(mx)
    for k in range(nz):
        k0, k1, kw = _parents(k, hz, mz, pz)
        for j in range(ny):
            j0, j1, jw = _parents(j, hy, my, py)
            across[:] = 0.0
            _onto_row(coarse[k0, j0], (1.0 - kw) * (1.0 - jw), across)
            if jw > 0.0:
                _onto_row(coarse[k0, j1], (1.0 - kw) * jw, across)
            if kw > 0.0:
                _onto_row(coarse[k1, j0], kw * (1.0 - jw), across)
                if jw > 0.0:
                    _onto_row(coarse[k1, j1], kw * jw, across)
            _prolong_row(across, hx, px, p[k, j])


# -- conjugate gradients --------------------------------------------------------------------------


@njit(**_OPTIONS)
def _out_row(p, diag, out):
    """Net flux out, where ``out`` holds what the neighbours give."""
    for i in range(p.size):
        out[i] = diag[i] * p[i] - out[i]


@njit(**_OPTIONS)
def times(p, tx, ty, tz, diag, deep, out):
    """Net flux out of each cell; returns the sum of value times flux."""
    nz, ny, _ = p.shape
    total = 0.0
    for k in range(nz):
        for j in range(ny):
            _around(p, tx, ty, tz, k, j, deep, out[k, j])
            _out_row(p[k, j], diag[k, j], out[k, j])
            total += _sum_row(p[k, j], out[k, j])
    return total


@njit(**_OPTIONS)
def product(a, b):
    """Sum of products."""
    total = 0.0
    for k in range(a.shape[0]):
        for j in range(a.shape[1]):
            total += _sum_row(a[k, j], b[k, j])
    return total


@njit(**_OPTIONS)
def turn(z, less, share, direction):
    """The next direction: ``z - less + share direction``."""
    flat, to = z.reshape(-1), direction.reshape(-1)
    for i in range(to.size):
        to[i] = flat[i] - less + share * to[i]


@njit(**_OPTIONS)
def go(share, direction, flux, p, r):
    """A step along a direction, whose net flux is given; returns the sum of squares left."""
    total = 0.0
    for k in range(p.shape[0]):
        for j in range(p.shape[1]):
            _onto_row(direction[k, j], share, p[k, j])
            _onto_row(flux[k, j], -share, r[k, j])
            total += _sum_row(r[k, j], r[k, j])
    return total
