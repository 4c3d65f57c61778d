"""Compiled surfaces of walls: the nearest point of each kind."""

import math

from greybed.core.jit import njit

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}

# Kinds of surfaces. Data: a point, an axis or normal, then lengths; triangles hold three corners.
PLANE, TUBE, CONE, DISC, TRIANGLE = 0, 1, 2, 3, 4
# Where the nearest point of a surface lies: inside it, on its rim, or nowhere near.
FACE, RIM, NOWHERE = 0, 1, 2


@njit(**_OPTIONS)
def nearest(kind, data, x, y, z):
    """Signed distance from a surface to a point, its normal towards the point, and where it is.

    Surfaces without end give negative distances behind them; others have two sides.
    """
    px, py, pz = x - data[0], y - data[1], z - data[2]
    if kind == PLANE:
        ax, ay, az = data[3], data[4], data[5]
        return px * ax + py * ay + pz * az, ax, ay, az, FACE
    if kind == TRIANGLE:
        return _nearest_of_triangle(data, x, y, z)
    ax, ay, az = data[3], data[4], data[5]
    along = px * ax + py * ay + pz * az
    rx, ry, rz = px - along * ax, py - along * ay, pz - along * az
    out = math.sqrt(rx * rx + ry * ry + rz * rz)
    if out > 0.0:
        rx, ry, rz = rx / out, ry / out, rz / out
    elif kind != DISC:
        # On the axis every direction is as near: any one across it.
        rx, ry, rz = _across(ax, ay, az)
    if kind == DISC:
        if out <= data[6]:
            side = 1.0 if along >= 0.0 else -1.0
            return abs(along), side * ax, side * ay, side * az, FACE
        beyond = out - data[6]
        d = math.sqrt(along * along + beyond * beyond)
        return (
            d, (along * ax + beyond * rx) / d, (along * ay + beyond * ry) / d,
            (along * az + beyond * rz) / d, RIM,
        )  # fmt: skip
    # In the plane through axis and point: from (0, radius) to (length, end radius).
    length, radius, change = data[8], data[6], data[7] - data[6]
    if length == math.inf:
        return radius - out, -rx, -ry, -rz, FACE
    slant = math.sqrt(length * length + change * change)
    ua, ur = length / slant, change / slant
    at = along * ua + (out - radius) * ur
    if 0.0 <= at <= slant:
        # Positive where the axis is; what has an end has two sides.
        d = along * ur - (out - radius) * ua
        side = 1.0 if d >= 0.0 else -1.0
        ua, ur = side * ua, side * ur
        return abs(d), ur * ax - ua * rx, ur * ay - ua * ry, ur * az - ua * rz, FACE
    end = min(max(at, 0.0), slant)
    da, dr = along - end * ua, out - radius - end * ur
    d = math.sqrt(da * da + dr * dr)
    return (
        d, (da * ax + dr * rx) / d, (da * ay + dr * ry) / d, (da * az + dr * rz) / d, RIM,
    )  # fmt: skip


@njit(**_OPTIONS)
def _across(ax, ay, az):
    if abs(ax) < 0.9:
        x, y, z = 0.0, az, -ay
    else:
        x, y, z = -az, 0.0, ax
    size = math.sqrt(x * x + y * y + z * z)
    return x / size, y / size, z / size


@njit(**_OPTIONS)
def _nearest_of_triangle(data, x, y, z):
    """Nearest point of a triangle by its Voronoi regions (Ericson 2005, section 5.1.5)."""
    abx, aby, abz = data[3] - data[0], data[4] - data[1], data[5] - data[2]
    acx, acy, acz = data[6] - data[0], data[7] - data[1], data[8] - data[2]
    apx, apy, apz = x - data[0], y - data[1], z - data[2]
    d1 = abx * apx + aby * apy + abz * apz
    d2 = acx * apx + acy * apy + acz * apz
    bpx, bpy, bpz = apx - abx, apy - aby, apz - abz
    d3 = abx * bpx + aby * bpy + abz * bpz
    d4 = acx * bpx + acy * bpy + acz * bpz
    cpx, cpy, cpz = apx - acx, apy - acy, apz - acz
    d5 = abx * cpx + aby * cpy + abz * cpz
    d6 = acx * cpx + acy * cpy + acz * cpz
    v, w, where = 0.0, 0.0, RIM
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    if d1 <= 0.0 and d2 <= 0.0:
        pass
    elif d3 >= 0.0 and d4 <= d3:
        v = 1.0
    elif d6 >= 0.0 and d5 <= d6:
        w = 1.0
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        v = d1 / (d1 - d3)
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        w = d2 / (d2 - d6)
    elif va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        v = 1.0 - w
    else:
        total = va + vb + vc
        v, w, where = vb / total, vc / total, FACE
    qx = apx - v * abx - w * acx
    qy = apy - v * aby - w * acy
    qz = apz - v * abz - w * acz
    d = math.sqrt(qx * qx + qy * qy + qz * qz)
    if d == 0.0:
        nx, ny, nz = aby * acz - abz * acy, abz * acx - abx * acz, abx * acy - aby * acx
        size = math.sqrt(nx * nx + ny * ny + nz * nz)
        return 0.0, nx / size, ny / size, nz / size, where
    return d, qx / d, qy / d, qz / d, where
