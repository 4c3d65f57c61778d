"""Compiled linear interpolation from staggered faces to particles, its transpose, and forces."""

import math

import numpy as np

from greybed.closures.drag._kernels import drag
from greybed.core.jit import njit

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}


# Arrays of faces have one layer more around them here, so that no place needs a look at the rims:
# beyond the outer points the value there holds, and a ring goes on. Functions that get arrays have
# no branches: numba would count references to the arrays at each of them.


@njit(**_OPTIONS)
def surround(field, at_z, at_y, at_x, out):
    """Fill ``out`` with the values of ``field`` whose numbers the three lists have."""
    for k in range(at_z.size):
        for j in range(at_y.size):
            for i in range(at_x.size):
                out[k, j, i] = field[at_z[k], at_y[j], at_x[i]]


@njit(**_OPTIONS)
def gather(sums, at_z, at_y, at_x, first, second):
    """Add the two values of each place of ``sums`` to where the lists say: the transpose."""
    for k in range(at_z.size):
        for j in range(at_y.size):
            for i in range(at_x.size):
                first[at_z[k], at_y[j], at_x[i]] += sums[k, j, i, 0]
                second[at_z[k], at_y[j], at_x[i]] += sums[k, j, i, 1]


@njit(inline="always", **_OPTIONS)
def _below(at):
    """Number of the point below a place, in an array that is surrounded, and what is beyond it."""
    low = math.floor(at)
    return low + 1, at - low


@njit(inline="always", **_OPTIONS)
def _in_turns(x, n, periodic):
    return x - n * math.floor(x / n) if periodic else x


@njit(**_OPTIONS)
def _steps(nx, ny):
    """From a row to the next one, and to the one above, in the arrays of u, v and w."""
    ru, rv, rw = nx + 3, nx + 2, nx + 2
    return ru, rv, rw, ru * (ny + 2), rv * (ny + 3), rw * (ny + 2)


@njit(inline="always", **_OPTIONS)
def _around(x, y, z, nx, ny, nz, px, py, pz):
    """Faces around a place, given in cells from the lower corner.

    The lowest one in the arrays of u, v and w, what the place is beyond it along x, y and z among
    faces, and the same among centres.
    """
    x, y, z = _in_turns(x, nx, px), _in_turns(y, ny, py), _in_turns(z, nz, pz)
    # Points of an axis are faces for the velocity along it, centres for the others; all of an
    # axis of one cell is at its centre.
    (fi, fa), (fj, fb), (fk, fc) = _below(x), _below(y), _below(z)
    i, a = _below(x - 0.5) if nx > 1 else (1, 0.0)
    j, b = _below(y - 0.5) if ny > 1 else (1, 0.0)
    k, c = _below(z - 0.5) if nz > 1 else (1, 0.0)
    ru, rv, rw, uu, uv, uw = _steps(nx, ny)
    au, av, aw = k * uu + j * ru + fi, k * uv + fj * rv + i, fk * uw + j * rw + i
    return au, av, aw, fa, fb, fc, a, b, c


@njit(**_OPTIONS)
def _row(field, at, a):
    # Numbers without sign: others are taken to count from the end, which costs a look at each.
    m = np.uint64(at)
    return field[m] * (1.0 - a) + field[m + np.uint64(1)] * a


@njit(**_OPTIONS)
def _pair(field, at, up, a, c):
    return _row(field, at, a) * (1.0 - c) + _row(field, at + up, a) * c


@njit(**_OPTIONS)
def read_faces(place, lower, spacing, cells, periodic, u, v, w, out):
    """Fill ``out`` (n, 3) with values of faces, surrounded and flat, at the particles."""
    ox, oy, oz = 1.0 / spacing[0], 1.0 / spacing[1], 1.0 / spacing[2]
    nx, ny, nz = cells[0], cells[1], cells[2]
    px, py, pz = periodic[0], periodic[1], periodic[2]
    ru, rv, rw, uu, uv, uw = _steps(nx, ny)
    for p in range(place.shape[0]):
        x, y, z = place[p, 0] - lower[0], place[p, 1] - lower[1], place[p, 2] - lower[2]
        au, av, aw, fa, fb, fc, a, b, c = _around(x * ox, y * oy, z * oz, nx, ny, nz, px, py, pz)
        out[p, 1] = _pair(v, av, uv, a, c) * (1.0 - fb) + _pair(v, av + rv, uv, a, c) * fb
        if b == 0.0:  # all is in one row
            out[p, 0] = _pair(u, au, uu, fa, c)
            out[p, 2] = _pair(w, aw, uw, a, fc)
        else:
            out[p, 0] = _pair(u, au, uu, fa, c) * (1.0 - b) + _pair(u, au + ru, uu, fa, c) * b
            out[p, 2] = _pair(w, aw, uw, a, fc) * (1.0 - b) + _pair(w, aw + rw, uw, a, fc) * b


@njit(**_OPTIONS)
def _add(sums, at, a, weight, first, second):
    m = np.uint64(2 * at)
    low, high = weight * (1.0 - a), weight * a
    sums[m] += low * first
    sums[m + np.uint64(1)] += low * second
    sums[m + np.uint64(2)] += high * first
    sums[m + np.uint64(3)] += high * second


@njit(**_OPTIONS)
def _spread(sums, at, up, a, c, weight, first, second):
    _add(sums, at, a, weight * (1.0 - c), first, second)
    _add(sums, at + up, a, weight * c, first, second)


@njit(**_OPTIONS)
def give_to_faces(place, lower, spacing, cells, periodic, k, target, u, v, w):
    """Add ``k`` (n, 3), or (n, 1), and k times ``target`` (n, 3) to the faces that are read.

    ``u``, ``v`` and ``w`` are surrounded, flat, and have the two sums of a face side by side.
    """
    ox, oy, oz = 1.0 / spacing[0], 1.0 / spacing[1], 1.0 / spacing[2]
    nx, ny, nz = cells[0], cells[1], cells[2]
    px, py, pz = periodic[0], periodic[1], periodic[2]
    own = 1 if k.shape[1] == 3 else 0
    ru, rv, rw, uu, uv, uw = _steps(nx, ny)
    for p in range(place.shape[0]):
        x, y, z = place[p, 0] - lower[0], place[p, 1] - lower[1], place[p, 2] - lower[2]
        au, av, aw, fa, fb, fc, a, b, c = _around(x * ox, y * oy, z * oz, nx, ny, nz, px, py, pz)
        kx, ky, kz = k[p, 0], k[p, own], k[p, 2 * own]
        gx, gy, gz = kx * target[p, 0], ky * target[p, 1], kz * target[p, 2]
        _spread(u, au, uu, fa, c, 1.0 - b, kx, gx)
        _spread(v, av, uv, a, c, 1.0 - fb, ky, gy)
        _spread(w, aw, uw, a, fc, 1.0 - b, kz, gz)
        _spread(v, av + rv, uv, a, c, fb, ky, gy)
        if b != 0.0:  # it is 0 where all is in one row
            _spread(u, au + ru, uu, fa, c, b, kx, gx)
            _spread(w, aw + rw, uw, a, fc, b, kz, gz)


@njit(**_OPTIONS)
def drag_both_ways(
    place, motion, first, cell, volume, void_fraction, code, least_solids, most_solids,
    most_reynolds, density, viscosity, over, lower, spacing, cells, periodic, u, v, w, su, sv, sw,
    void, reynolds, k, steepness,
):  # fmt: skip
    """Drag of a law in one pass: what is read, and what is given with the particles' velocity.

    ``u``, ``v`` and ``w`` as of :func:`read_faces`, ``su``, ``sv`` and ``sw`` as ``u``, ``v`` and
    ``w`` of :func:`give_to_faces`, with the velocities of ``motion`` as targets. Fills the void
    fraction at the particles, Re, drag over slip [N s/m], if ``over`` over the void fraction, and
    the slope of drag over that, (n,) each. Returns how many lie outside the range of the law, the
    first particle whose F is no number from 0 on, or -1, and the fastest relaxation [1/s].
    """
    ox, oy, oz = 1.0 / spacing[0], 1.0 / spacing[1], 1.0 / spacing[2]
    nx, ny, nz = cells[0], cells[1], cells[2]
    px, py, pz = periodic[0], periodic[1], periodic[2]
    ru, rv, rw, uu, uv, uw = _steps(nx, ny)
    outside, bad, fastest = 0, -1, 0.0
    for p in range(place.shape[0]):
        x, y, z = place[p, 0] - lower[0], place[p, 1] - lower[1], place[p, 2] - lower[2]
        au, av, aw, fa, fb, fc, a, b, c = _around(x * ox, y * oy, z * oz, nx, ny, nz, px, py, pz)
        x = _pair(u, au, uu, fa, c)
        y = _pair(v, av, uv, a, c) * (1.0 - fb) + _pair(v, av + rv, uv, a, c) * fb
        z = _pair(w, aw, uw, a, fc)
        if b != 0.0:  # it is 0 where all is in one row
            x = x * (1.0 - b) + _pair(u, au + ru, uu, fa, c) * b
            z = z * (1.0 - b) + _pair(w, aw + rw, uw, a, fc) * b
        gx, gy, gz = motion[p, 0], motion[p, 1], motion[p, 2]
        x, y, z = x - gx, y - gy, z - gz
        total, whole = 0.0, 0.0
        for n in range(first[p], first[p + 1]):
            total += volume[n] * void_fraction[cell[n]]
            whole += volume[n]
        eps, d = total / whole, 2.0 * place[p, 3]
        phi = 1.0 - eps
        re = eps * density * d * math.sqrt(x**2 + y**2 + z**2) / viscosity
        force, slope = drag(code, phi, re)
        if not (phi >= least_solids and phi <= most_solids and re <= most_reynolds):
            outside += 1
        if bad < 0 and not (force >= 0.0 and force < np.inf):
            bad = p
        each = 3.0 * math.pi * viscosity * d * eps * force
        each = each / eps if over else each
        if each > fastest * motion[p, 6]:
            fastest = each / motion[p, 6]
        void[p], reynolds[p], k[p] = eps, re, each
        steepness[p] = max(1.0 + (slope / force if force > 0.0 else 0.0), 0.5)
        gx, gy, gz = each * gx, each * gy, each * gz
        _spread(su, au, uu, fa, c, 1.0 - b, each, gx)
        _spread(sv, av, uv, a, c, 1.0 - fb, each, gy)
        _spread(sw, aw, uw, a, fc, 1.0 - b, each, gz)
        _spread(sv, av + rv, uv, a, c, fb, each, gy)
        if b != 0.0:
            _spread(su, au + ru, uu, fa, c, b, each, gx)
            _spread(sw, aw + rw, uw, a, fc, b, each, gz)
    return outside, bad, fastest


@njit(**_OPTIONS)
def forces_of(
    k, target, steady, first, cell, volume, slopes, lift, place, lower, spacing, cells, periodic,
    u, v, w, out, sums,
):  # fmt: skip
    """Fill ``out`` (n, 3) with all that the gas does to particles.

    The force is k (what is read of ``u``, ``v`` and ``w`` - target) + steady - sum of volumes times
    slopes + lift r^3, ``steady`` of (n, 3) and ``slopes`` of (cells, 3), or none, (0, 3). ``sums``
    (3, 3) gets the sums of the first part, of its absolutes, and of the third.
    """
    own = 1 if k.shape[1] == 3 else 0
    further, pressure = steady.shape[0] > 0, slopes.shape[0] > 0
    ox, oy, oz = 1.0 / spacing[0], 1.0 / spacing[1], 1.0 / spacing[2]
    nx, ny, nz = cells[0], cells[1], cells[2]
    wx, wy, wz = periodic[0], periodic[1], periodic[2]
    ru, rv, rw, uu, uv, uw = _steps(nx, ny)
    fx = fy = fz = ax = ay = az = gx = gy = gz = 0.0
    for p in range(place.shape[0]):
        x, y, z = place[p, 0] - lower[0], place[p, 1] - lower[1], place[p, 2] - lower[2]
        au, av, aw, fa, fb, fc, a, b, c = _around(x * ox, y * oy, z * oz, nx, ny, nz, wx, wy, wz)
        x = _pair(u, au, uu, fa, c)
        y = _pair(v, av, uv, a, c) * (1.0 - fb) + _pair(v, av + rv, uv, a, c) * fb
        z = _pair(w, aw, uw, a, fc)
        if b != 0.0:  # it is 0 where all is in one row
            x = x * (1.0 - b) + _pair(u, au + ru, uu, fa, c) * b
            z = z * (1.0 - b) + _pair(w, aw + rw, uw, a, fc) * b
        x = k[p, 0] * (x - target[p, 0])
        y = k[p, own] * (y - target[p, 1])
        z = k[p, 2 * own] * (z - target[p, 2])
        fx, fy, fz = fx + x, fy + y, fz + z
        ax, ay, az = ax + abs(x), ay + abs(y), az + abs(z)
        if further:
            x, y, z = x + steady[p, 0], y + steady[p, 1], z + steady[p, 2]
        px = py = pz = 0.0
        if pressure:
            for n in range(first[p], first[p + 1]):
                part, at = volume[n], cell[n]
                px, py = px - part * slopes[at, 0], py - part * slopes[at, 1]
                pz = pz - part * slopes[at, 2]
            gx, gy, gz = gx + px, gy + py, gz + pz
        cube = place[p, 3] ** 3
        out[p, 0] = x + px + lift[0] * cube
        out[p, 1] = y + py + lift[1] * cube
        out[p, 2] = z + pz + lift[2] * cube
    for row, found in enumerate(((fx, fy, fz), (ax, ay, az), (gx, gy, gz))):
        for c in range(3):
            sums[row, c] = found[c]


@njit(**_OPTIONS)
def shares(total, aimed, volume, drag, aim):
    """Fill ``drag`` with ``total`` over the volume and ``aim`` with ``aimed`` over ``total``."""
    for i in range(total.size):
        drag[i] = total[i] / volume
        aim[i] = aimed[i] / total[i] if total[i] > 0.0 else 0.0


@njit(**_OPTIONS)
def inside_and_rims(field, along, periodic):
    """Sums of faces across an axis of the array, inside and at rims; a face counts once."""
    inside, rims = 0.0, 0.0
    last = field.shape[along] - 1
    for k in range(field.shape[0]):
        for j in range(field.shape[1]):
            for i in range(field.shape[2]):
                at = k if along == 0 else j if along == 1 else i
                if at > 0 and at < last:
                    inside += field[k, j, i]
                elif not periodic:
                    rims += field[k, j, i]
                elif at == 0:  # the last one is the same
                    inside += field[k, j, i]
    return inside, rims


@njit(**_OPTIONS)
def cell_means(u, v, w, out):
    """Fill ``out`` (nz, ny, nx, 3) with the means of the two faces of each cell."""
    nz, ny, nx = out.shape[0], out.shape[1], out.shape[2]
    for k in range(nz):
        for j in range(ny):
            for i in range(nx):
                out[k, j, i, 0] = 0.5 * (u[k, j, i] + u[k, j, i + 1])
                out[k, j, i, 1] = 0.5 * (v[k, j, i] + v[k, j + 1, i])
                out[k, j, i, 2] = 0.5 * (w[k, j, i] + w[k + 1, j, i])


@njit(inline="always", **_OPTIONS)
def _slope(before, here, after, i, n, h, periodic):
    """Mean of the slopes on both faces of cell i; on a rim that of the face inside."""
    if n == 1:
        return 0.0
    low, high = (here - before) / h, (after - here) / h
    if i == 0 and not periodic:
        low = high
    if i == n - 1 and not periodic:
        high = low
    return 0.5 * (low + high)


@njit(**_OPTIONS)
def cell_slopes(p, spacing, periodic, out):
    """Fill ``out`` (nz, ny, nx, 3) with means of the gradients on the two faces of each cell."""
    nz, ny, nx = p.shape
    hx, hy, hz = spacing[0], spacing[1], spacing[2]
    px, py, pz = periodic[0], periodic[1], periodic[2]
    for k in range(nz):
        up, down = (k + 1) % nz, k - 1 if k > 0 else nz - 1
        for j in range(ny):
            far, near = (j + 1) % ny, j - 1 if j > 0 else ny - 1
            for i in range(nx):
                right, left = (i + 1) % nx, i - 1 if i > 0 else nx - 1
                here = p[k, j, i]
                out[k, j, i, 0] = _slope(p[k, j, left], here, p[k, j, right], i, nx, hx, px)
                out[k, j, i, 1] = _slope(p[k, near, i], here, p[k, far, i], j, ny, hy, py)
                out[k, j, i, 2] = _slope(p[down, j, i], here, p[up, j, i], k, nz, hz, pz)
