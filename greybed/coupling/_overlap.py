"""Compiled exact volumes of spheres in the cells of a grid."""

import math

import numpy as np

from greybed.core.jit import njit

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}


@njit(**_OPTIONS)
def cap(radius, a):
    """Volume of a sphere about the origin where x > a."""
    if a >= radius:
        return 0.0
    if a <= -radius:
        return 4.0 / 3.0 * math.pi * radius**3
    return math.pi / 3.0 * (radius - a) ** 2 * (2.0 * radius + a)


@njit(**_OPTIONS)
def _wedge(radius, a, b):
    # For a, b >= 0, by integration of the segments of discs from a on.
    square = radius * radius - a * a - b * b
    if square <= 0.0:
        return 0.0
    c = math.sqrt(square)
    r2 = radius * radius
    return (
        2.0 / 3.0 * r2 * radius * math.atan2(radius * c, a * b)
        - a * (r2 - a * a / 3.0) * math.atan2(c, b)
        - b * (r2 - b * b / 3.0) * math.atan2(c, a)
        + 2.0 / 3.0 * a * b * c
    )


@njit(**_OPTIONS)
def wedge(radius, a, b):
    """Volume where x > a and y > b."""
    volume = _wedge(radius, abs(a), abs(b))
    if b < 0.0:
        volume = cap(radius, abs(a)) - volume
    if a < 0.0:
        volume = cap(radius, b) - volume
    return volume


@njit(**_OPTIONS)
def corner(radius, a, b, c):
    """Volume where x > a, y > b and z > c."""
    p, q, r = abs(a), abs(b), abs(c)
    volume = 0.0
    if p * p + q * q + r * r < radius * radius:
        # The box from the origin to (p, q, r) lies inside; the rest of its octant is caps and
        # wedges, counted by inclusion and exclusion.
        volume = (
            math.pi / 6.0 * radius**3
            - 0.25 * (cap(radius, p) + cap(radius, q) + cap(radius, r))
            + 0.5 * (_wedge(radius, p, q) + _wedge(radius, q, r) + _wedge(radius, r, p))
            - p * q * r
        )
    if c < 0.0:
        volume = _wedge(radius, p, q) - volume
    if b < 0.0:
        volume = wedge(radius, p, c) - volume
    if a < 0.0:
        volume = wedge(radius, b, c) - volume
    return volume


@njit(**_OPTIONS)
def _above(radius, i, a, j, b, k, c):
    """Volume beyond planes, of which those with number 0 are infinitely far below."""
    if i == 0:
        if j == 0:
            return 4.0 / 3.0 * math.pi * radius**3 if k == 0 else cap(radius, c)
        return cap(radius, b) if k == 0 else wedge(radius, b, c)
    if j == 0:
        return cap(radius, a) if k == 0 else wedge(radius, a, c)
    return wedge(radius, a, b) if k == 0 else corner(radius, a, b, c)


@njit(inline="always", **_OPTIONS)
def _planes(low, high, lower, over, count, periodic):
    first = math.floor((low - lower) * over)
    last = math.floor((high - lower) * over)
    if not periodic:  # what reaches across the rim stays in the cell there
        first, last = min(max(first, 0), count - 1), min(max(last, 0), count - 1)
    return first, last


@njit(inline="always", **_OPTIONS)
def _wrapped(at, count):
    return at if 0 <= at < count else at % count


@njit(**_OPTIONS)
def _cells_of_sphere(
    x, y, z, r, x0, y0, z0, mx, my, mz, lower, spacing, cells, table, cell, volume, at
):  # fmt: skip
    """Write a sphere's cells and volumes from ``at`` on; the place after the last one."""
    nx, ny, nz = cells[0], cells[1], cells[2]
    for k in range(mz + 1):
        c = lower[2] + (z0 + k) * spacing[2] - z
        for j in range(my + 1):
            b = lower[1] + (y0 + j) * spacing[1] - y
            for h in range(mx + 1):
                if h == mx or j == my or k == mz:
                    table[k, j, h] = 0.0
                    continue
                a = lower[0] + (x0 + h) * spacing[0] - x
                table[k, j, h] = _above(r, h, a, j, b, k, c)
    for k in range(mz):
        for j in range(my):
            for h in range(mx):
                near = table[k, j, h] - table[k, j, h + 1]
                near -= table[k, j + 1, h] - table[k, j + 1, h + 1]
                far = table[k + 1, j, h] - table[k + 1, j, h + 1]
                far -= table[k + 1, j + 1, h] - table[k + 1, j + 1, h + 1]
                if near - far > 0.0:
                    row = _wrapped(z0 + k, nz) * ny + _wrapped(y0 + j, ny)
                    cell[at] = row * nx + _wrapped(x0 + h, nx)
                    volume[at] = near - far
                    at += 1
    return at


@njit(inline="always", **_OPTIONS)
def _within(x, low, spacing, count, periodic):
    return periodic or (x >= low and x - low <= count * spacing)


@njit(**_OPTIONS)
def void_of(solids, volume, limit, void):
    """Fill ``void`` from volumes of spheres, no less than ``limit``; the least, and how many are.

    All arrays are flat.
    """
    least, low = np.inf, 0
    for i in range(solids.size):
        found = 1.0 - solids[i] / volume
        least = min(least, found)
        if found < limit:
            low += 1
        void[i] = max(found, limit)
    return least, low


@njit(**_OPTIONS)
def overlaps(place, lower, spacing, cells, periodic, most, first, cell, volume, solids):
    """Rows of cells and volumes of each sphere, ``first`` (n + 1,); the number of entries.

    Adds the volumes to ``solids`` (cells,). Where a centre is not in the grid it stops, and returns
    -1 less the number of that sphere.
    """
    table = np.empty((most + 1, most + 1, most + 1))
    nx, ny, nz = cells[0], cells[1], cells[2]
    px, py, pz = periodic[0], periodic[1], periodic[2]
    ox, oy, oz = 1.0 / spacing[0], 1.0 / spacing[1], 1.0 / spacing[2]
    at = 0
    for i in range(place.shape[0]):
        first[i] = at
        x, y, z, r = place[i, 0], place[i, 1], place[i, 2], place[i, 3]
        if not (
            _within(x, lower[0], spacing[0], nx, px)
            and _within(y, lower[1], spacing[1], ny, py)
            and _within(z, lower[2], spacing[2], nz, pz)
        ):
            return -1 - i
        x0, x1 = _planes(x - r, x + r, lower[0], ox, nx, px)
        y0, y1 = _planes(y - r, y + r, lower[1], oy, ny, py)
        z0, z1 = _planes(z - r, z + r, lower[2], oz, nz, pz)
        across = (x1 - x0) + (y1 - y0) + (z1 - z0)
        if across > 1:
            at = _cells_of_sphere(
                x, y, z, r, x0, y0, z0, x1 - x0 + 1, y1 - y0 + 1, z1 - z0 + 1, lower, spacing,
                cells, table, cell, volume, at,
            )  # fmt: skip
            continue
        # Most lie in one cell, or across one plane.
        beyond = 0.0
        if across == 1:
            plane = lower[2] + z1 * spacing[2] - z
            if x1 > x0:
                plane = lower[0] + x1 * spacing[0] - x
            elif y1 > y0:
                plane = lower[1] + y1 * spacing[1] - y
            beyond = cap(r, plane)
        short = 4.0 / 3.0 * math.pi * r**3 - beyond
        if short > 0.0:
            cell[at] = (_wrapped(z0, nz) * ny + _wrapped(y0, ny)) * nx + _wrapped(x0, nx)
            volume[at] = short
            at += 1
        if beyond > 0.0:
            cell[at] = (_wrapped(z1, nz) * ny + _wrapped(y1, ny)) * nx + _wrapped(x1, nx)
            volume[at] = beyond
            at += 1
    first[place.shape[0]] = at
    for m in range(at):
        solids[cell[m]] += volume[m]
    return at


@njit(**_OPTIONS)
def centre_cells(place, lower, spacing, cells, periodic, first, cell, volume, solids):
    """The same with each sphere in the cell of its centre."""
    nx, ny, nz = cells[0], cells[1], cells[2]
    over = 1.0 / spacing
    for i in range(place.shape[0]):
        for axis in range(3):
            if not _within(place[i, axis], lower[axis], spacing[axis], cells[axis], periodic[axis]):
                return -1 - i
        x, _ = _planes(place[i, 0], place[i, 0], lower[0], over[0], nx, periodic[0])
        y, _ = _planes(place[i, 1], place[i, 1], lower[1], over[1], ny, periodic[1])
        z, _ = _planes(place[i, 2], place[i, 2], lower[2], over[2], nz, periodic[2])
        first[i], cell[i] = i, ((z % nz) * ny + y % ny) * nx + x % nx
        volume[i] = 4.0 / 3.0 * math.pi * place[i, 3] ** 3
        solids[cell[i]] += volume[i]
    first[place.shape[0]] = place.shape[0]
    return place.shape[0]


@njit(**_OPTIONS)
def spread(first, cell, weight, values, out):
    """Add ``values`` (n, k), times the weights of the rows, to ``out`` (cells, k)."""
    for i in range(first.size - 1):
        for m in range(first[i], first[i + 1]):
            for c in range(values.shape[1]):
                out[cell[m], c] += weight[m] * values[i, c]


@njit(**_OPTIONS)
def collect(first, cell, weight, field, out):
    """Fill ``out`` (n, k) with sums of weights times ``field`` (cells, k): the transpose."""
    for i in range(first.size - 1):
        for c in range(field.shape[1]):
            total = 0.0
            for m in range(first[i], first[i + 1]):
                total += weight[m] * field[cell[m], c]
            out[i, c] = total
