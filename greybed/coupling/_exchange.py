"""Compiled linear interpolation from staggered faces to particles, and its transpose."""

import math

from numba import njit

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}


@njit(inline="always", **_OPTIONS)
def _between(x, lower, spacing, n, periodic, faces):
    """Numbers of the two points of an axis beside x, and the weight of the second one.

    Along the axis that faces cut they are n + 1 points (n on a ring) from the rim on; else they
    are the centres, and beyond the outer ones the value there holds.
    """
    at = (x - lower) / spacing
    if not faces:
        at -= 0.5
    low = math.floor(at)
    weight = at - low
    i = int(low)
    if periodic:
        return i % n, (i + 1) % n, weight
    last = n if faces else n - 1
    if i < 0:
        return 0, 0, 0.0
    if i >= last:
        return last, last, 0.0
    return i, i + 1, weight


@njit(**_OPTIONS)
def read_faces(place, axis, lower, spacing, cells, periodic, field, out):
    """Fill ``out`` (n,) with the face values of one component at the particles."""
    for p in range(place.shape[0]):
        i, i1, a = _between(place[p, 0], lower[0], spacing[0], cells[0], periodic[0], axis == 0)
        j, j1, b = _between(place[p, 1], lower[1], spacing[1], cells[1], periodic[1], axis == 1)
        k, k1, c = _between(place[p, 2], lower[2], spacing[2], cells[2], periodic[2], axis == 2)
        low = (field[k, j, i] * (1.0 - a) + field[k, j, i1] * a) * (1.0 - b)
        low += (field[k, j1, i] * (1.0 - a) + field[k, j1, i1] * a) * b
        high = (field[k1, j, i] * (1.0 - a) + field[k1, j, i1] * a) * (1.0 - b)
        high += (field[k1, j1, i] * (1.0 - a) + field[k1, j1, i1] * a) * b
        out[p] = low * (1.0 - c) + high * c


@njit(**_OPTIONS)
def give_to_faces(place, axis, lower, spacing, cells, periodic, values, second, out, out2):
    """Add two values of each particle to the faces that :func:`read_faces` reads."""
    for p in range(place.shape[0]):
        i, i1, a = _between(place[p, 0], lower[0], spacing[0], cells[0], periodic[0], axis == 0)
        j, j1, b = _between(place[p, 1], lower[1], spacing[1], cells[1], periodic[1], axis == 1)
        k, k1, c = _between(place[p, 2], lower[2], spacing[2], cells[2], periodic[2], axis == 2)
        v, w = values[p], second[p]
        for kk, wz in ((k, 1.0 - c), (k1, c)):
            for jj, wy in ((j, 1.0 - b), (j1, b)):
                for ii, wx in ((i, 1.0 - a), (i1, a)):
                    weight = wx * wy * wz
                    out[kk, jj, ii] += weight * v
                    out2[kk, jj, ii] += weight * w
    if periodic[axis]:  # the last face is the first one
        if axis == 0:
            out[:, :, cells[0]] = out[:, :, 0]
            out2[:, :, cells[0]] = out2[:, :, 0]
        elif axis == 1:
            out[:, cells[1], :] = out[:, 0, :]
            out2[:, cells[1], :] = out2[:, 0, :]
        else:
            out[cells[2], :, :] = out[0, :, :]
            out2[cells[2], :, :] = out2[0, :, :]


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
