"""Compiled parts of multigrid for diffusion between the cells of a box: arrays [z, y, x].

The flux through a face is its transmissibility times the difference of its two cells. Faces of an
axis with n cells are n + 1; the first and the last are the same one where the axis is periodic, and
lead to a value of 0 where it is not (transmissibility 0: a wall).
"""

from numba import njit

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}


@njit(**_OPTIONS)
def diagonal(tx, ty, tz, diag):
    """Sum of the transmissibilities around each cell."""
    nz, ny, nx = diag.shape
    for k in range(nz):
        for j in range(ny):
            for i in range(nx):
                diag[k, j, i] = (
                    tx[k, j, i] + tx[k, j, i + 1]
                    + ty[k, j, i] + ty[k, j + 1, i]
                    + tz[k, j, i] + tz[k + 1, j, i]
                )  # fmt: skip


@njit(**_OPTIONS)
def _others(p, k, j, i, tx, ty, tz, px, py, pz):
    """Sum of transmissibility times value over the neighbours of a cell on the rim."""
    nz, ny, nx = p.shape
    total = 0.0
    if i > 0:
        total += tx[k, j, i] * p[k, j, i - 1]
    elif px:
        total += tx[k, j, 0] * p[k, j, nx - 1]
    if i < nx - 1:
        total += tx[k, j, i + 1] * p[k, j, i + 1]
    elif px:
        total += tx[k, j, nx] * p[k, j, 0]
    if j > 0:
        total += ty[k, j, i] * p[k, j - 1, i]
    elif py:
        total += ty[k, 0, i] * p[k, ny - 1, i]
    if j < ny - 1:
        total += ty[k, j + 1, i] * p[k, j + 1, i]
    elif py:
        total += ty[k, ny, i] * p[k, 0, i]
    if k > 0:
        total += tz[k, j, i] * p[k - 1, j, i]
    elif pz:
        total += tz[0, j, i] * p[nz - 1, j, i]
    if k < nz - 1:
        total += tz[k + 1, j, i] * p[k + 1, j, i]
    elif pz:
        total += tz[nz, j, i] * p[0, j, i]
    return total


@njit(**_OPTIONS)
def sweep(p, b, tx, ty, tz, inverse, px, py, pz, colour):
    """One colour of a red-black Gauss-Seidel sweep."""
    nz, ny, nx = p.shape
    flat = nz == 1 and not pz
    for k in range(nz):
        for j in range(ny):
            begin = (k + j + colour) & 1
            rim = j == 0 or j == ny - 1 or (not flat and (k == 0 or k == nz - 1))
            if rim:
                for i in range(begin, nx, 2):
                    around = _others(p, k, j, i, tx, ty, tz, px, py, pz)
                    p[k, j, i] = (b[k, j, i] + around) * inverse[k, j, i]
                continue
            first = begin
            if begin == 0:
                around = _others(p, k, j, 0, tx, ty, tz, px, py, pz)
                p[k, j, 0] = (b[k, j, 0] + around) * inverse[k, j, 0]
                first = 2
            for i in range(first, nx - 1, 2):
                around = (
                    tx[k, j, i] * p[k, j, i - 1] + tx[k, j, i + 1] * p[k, j, i + 1]
                    + ty[k, j, i] * p[k, j - 1, i] + ty[k, j + 1, i] * p[k, j + 1, i]
                )  # fmt: skip
                if not flat:
                    around += tz[k, j, i] * p[k - 1, j, i] + tz[k + 1, j, i] * p[k + 1, j, i]
                p[k, j, i] = (b[k, j, i] + around) * inverse[k, j, i]
            if nx > 1 and (nx - 1 - begin) % 2 == 0:
                i = nx - 1
                around = _others(p, k, j, i, tx, ty, tz, px, py, pz)
                p[k, j, i] = (b[k, j, i] + around) * inverse[k, j, i]


@njit(**_OPTIONS)
def times(p, tx, ty, tz, diag, px, py, pz, out):
    """Net flux out of each cell; returns the sum of value times flux."""
    nz, ny, nx = p.shape
    flat = nz == 1 and not pz
    total = 0.0
    for k in range(nz):
        for j in range(ny):
            rim = j == 0 or j == ny - 1 or (not flat and (k == 0 or k == nz - 1))
            begin, end = (0, nx) if rim else (1, nx - 1)
            if not rim:
                for i in range(1, nx - 1):
                    around = (
                        tx[k, j, i] * p[k, j, i - 1] + tx[k, j, i + 1] * p[k, j, i + 1]
                        + ty[k, j, i] * p[k, j - 1, i] + ty[k, j + 1, i] * p[k, j + 1, i]
                    )  # fmt: skip
                    if not flat:
                        around += tz[k, j, i] * p[k - 1, j, i] + tz[k + 1, j, i] * p[k + 1, j, i]
                    out[k, j, i] = diag[k, j, i] * p[k, j, i] - around
                for i in (0, nx - 1):
                    around = _others(p, k, j, i, tx, ty, tz, px, py, pz)
                    out[k, j, i] = diag[k, j, i] * p[k, j, i] - around
            else:
                for i in range(begin, end):
                    around = _others(p, k, j, i, tx, ty, tz, px, py, pz)
                    out[k, j, i] = diag[k, j, i] * p[k, j, i] - around
            for i in range(nx):
                total += p[k, j, i] * out[k, j, i]
    return total


@njit(**_OPTIONS)
def _parents(i, halved, n, coarse, periodic):
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
def restrict(residual, coarse, hx, hy, hz, px, py, pz):
    """Residuals into the coarse cells: the transpose of :func:`prolong`."""
    nz, ny, nx = residual.shape
    mz, my, mx = coarse.shape
    coarse[:, :, :] = 0.0
    for k in range(nz):
        k0, k1, kw = _parents(k, hz, nz, mz, pz)
        for j in range(ny):
            j0, j1, jw = _parents(j, hy, ny, my, py)
            a, b = (1.0 - kw) * (1.0 - jw), (1.0 - kw) * jw
            c, d = kw * (1.0 - jw), kw * jw
            for i in range(nx):
                i0, i1, iw = _parents(i, hx, nx, mx, px)
                r = residual[k, j, i]
                own, other = (1.0 - iw) * r, iw * r
                coarse[k0, j0, i0] += a * own
                coarse[k0, j0, i1] += a * other
                if jw > 0.0:
                    coarse[k0, j1, i0] += b * own
                    coarse[k0, j1, i1] += b * other
                if kw > 0.0:
                    coarse[k1, j0, i0] += c * own
                    coarse[k1, j0, i1] += c * other
                    if jw > 0.0:
                        coarse[k1, j1, i0] += d * own
                        coarse[k1, j1, i1] += d * other


@njit(**_OPTIONS)
def prolong(coarse, p, hx, hy, hz, px, py, pz):
    """Add the corrections of coarse cells, linear between their centres."""
    nz, ny, nx = p.shape
    mz, my, mx = coarse.shape
    for k in range(nz):
        k0, k1, kw = _parents(k, hz, nz, mz, pz)
        for j in range(ny):
            j0, j1, jw = _parents(j, hy, ny, my, py)
            a, b = (1.0 - kw) * (1.0 - jw), (1.0 - kw) * jw
            c, d = kw * (1.0 - jw), kw * jw
            for i in range(nx):
                i0, i1, iw = _parents(i, hx, nx, mx, px)
                own = a * coarse[k0, j0, i0] + b * coarse[k0, j1, i0]
                other = a * coarse[k0, j0, i1] + b * coarse[k0, j1, i1]
                if kw > 0.0:
                    own += c * coarse[k1, j0, i0] + d * coarse[k1, j1, i0]
                    other += c * coarse[k1, j0, i1] + d * coarse[k1, j1, i1]
                p[k, j, i] += (1.0 - iw) * own + iw * other


@njit(**_OPTIONS)
def coarsen(t, axis, halved, coarse):
    """Transmissibilities of coarse faces: in parallel across them, over a longer way along."""
    nz, ny, nx = t.shape
    coarse[:, :, :] = 0.0
    for k in range(nz):
        for j in range(ny):
            for i in range(nx):
                place = (k, j, i)
                n = (nz, ny, nx)[axis] - 1
                at = place[axis]
                if halved[axis] and at % 2 == 1 and at != n:
                    continue  # inside a coarse cell
                K = ((k + 1) // 2 if axis == 0 else k // 2) if halved[0] else k
                J = ((j + 1) // 2 if axis == 1 else j // 2) if halved[1] else j
                I = ((i + 1) // 2 if axis == 2 else i // 2) if halved[2] else i  # noqa: E741
                way = 1.0
                if halved[axis]:
                    # Cells before and behind the face, in fine ones: an odd one ends with one.
                    before = 2.0 if (at != n or n % 2 == 0) else 1.0
                    behind = 1.0 if at == n - 1 and n % 2 == 1 else 2.0
                    way = 0.5 * (before + behind)
                    if at == 0:
                        way = 2.0
                    elif at == n:
                        way = before
                coarse[K, J, I] += t[k, j, i] / way
