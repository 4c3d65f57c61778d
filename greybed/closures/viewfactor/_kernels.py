"""Compiled markers: what stands between two spheres, as a count and as a pencil of lines."""

import math

import numpy as np

from greybed.core.jit import njit

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}


@njit(**_OPTIONS)
def _smooth(x):
    """0 below 0, 1 above 1, with continuous slope."""
    x = min(max(x, 0.0), 1.0)
    return x * x * (3.0 - 2.0 * x)


@njit(**_OPTIONS)
def _shared(a, b, s):
    """Area that two discs of radii a and b share, their centres s apart."""
    if s >= a + b:
        return 0.0
    if s <= abs(a - b):
        return math.pi * min(a, b) ** 2
    x = (s * s + a * a - b * b) / (2.0 * s)
    y = s - x
    return (
        a * a * math.acos(min(max(x / a, -1.0), 1.0))
        + b * b * math.acos(min(max(y / b, -1.0), 1.0))
        - s * math.sqrt(max(a * a - x * x, 0.0))
    )


@njit(**_OPTIONS)
def _basis(x, y, z):
    """Two unit vectors across a unit vector (Duff et al. 2017, jcgt.org/published/0006/01/01)."""
    sign = math.copysign(1.0, z)
    a = -1.0 / (sign + z)
    b = x * y * a
    return (1.0 + sign * x * x * a, sign * b, -sign * x), (b, sign + y * y * a, -y)


@njit(**_OPTIONS)
def _pencil(r_a, r_b, axis, d, lines, edge, found, blockers, radii, gates):
    """Blocked share of the lines that meet both spheres, and blockers a line meets on average.

    ``blockers`` (found, 3) are centres relative to sphere a. Lines are laid as in the exact
    integral: direction at an angle whose sine times d is s, then a point of the lens in which
    the shadows of a and b overlap; each carries its share of the integral as weight.
    """
    e1, e2 = _basis(axis[0], axis[1], axis[2])
    p2 = (r_a + r_b) ** 2
    total, free, met = 0.0, 0.0, 0.0
    for m in range(lines.shape[0]):
        # Density falling to zero at s = r_a + r_b, where the lens vanishes.
        rest = math.sqrt(1.0 - lines[m, 0])
        s2 = p2 * (1.0 - rest)
        s = math.sqrt(s2)
        sin, cos = s / d, math.sqrt(max(1.0 - s2 / (d * d), 0.0))
        low, high = max(-r_a, s - r_b), min(r_a, s + r_b)
        u = low + (high - low) * lines[m, 1]
        height2 = min(r_a * r_a - u * u, r_b * r_b - (u - s) ** 2)
        if height2 <= 0.0 or cos <= 0.0:
            continue
        height = math.sqrt(height2)
        v = height * lines[m, 2]
        weight = (high - low) * height / (rest * cos)
        # Direction w of the line, and q towards the shadow of b's centre.
        cf, sf = lines[m, 3], lines[m, 4]
        gx = cf * e1[0] + sf * e2[0]
        gy = cf * e1[1] + sf * e2[1]
        gz = cf * e1[2] + sf * e2[2]
        wx, wy, wz = cos * axis[0] - sin * gx, cos * axis[1] - sin * gy, cos * axis[2] - sin * gz
        qx, qy, qz = sin * axis[0] + cos * gx, sin * axis[1] + cos * gy, sin * axis[2] + cos * gz
        tx, ty, tz = wy * qz - wz * qy, wz * qx - wx * qz, wx * qy - wy * qx
        ox, oy, oz = u * qx + v * tx, u * qy + v * ty, u * qz + v * tz
        begin = math.sqrt(max(r_a * r_a - u * u - v * v, 0.0))
        end = d * cos - math.sqrt(max(r_b * r_b - (u - s) ** 2 - v * v, 0.0))
        through = 1.0
        for k in range(found):
            bx, by, bz = blockers[k, 0] - ox, blockers[k, 1] - oy, blockers[k, 2] - oz
            t = bx * wx + by * wy + bz * wz
            if t <= begin or t >= end:
                continue
            away2 = bx * bx + by * by + bz * bz - t * t
            rim = radii[k] * (1.0 + edge)
            if away2 >= rim * rim:
                continue
            # A soft rim makes the marker follow the geometry without jumps.
            away = math.sqrt(max(away2, 0.0))
            cover = gates[k] * _smooth(0.5 + 0.5 * (radii[k] - away) / (edge * radii[k]))
            through *= 1.0 - cover
            met += weight * cover
        total += weight
        free += weight * through
    return 1.0 - free / total, met / total


@njit(**_OPTIONS)
def between(r_i, r_j, delta, near, near_radii, near_distance, largest, lines, edge, scratch, work):
    """Markers of one pair: (spheres between whole, by cover, blocked share, blockers per line).

    ``delta`` is the vector from i to j; ``near`` (m, 3) the neighbours of i relative to it, by
    growing distance. A sphere stands between where it reaches into the convex hull of i and j,
    beside their connecting line.
    """
    d = math.sqrt(delta[0] ** 2 + delta[1] ** 2 + delta[2] ** 2)
    ax, ay, az = delta[0] / d, delta[1] / d, delta[2] / d
    tilt = (r_i - r_j) / d
    lean = math.sqrt(max(1.0 - tilt * tilt, 0.0))
    found, cover = 0, 0.0
    widest = max(r_i, r_j)
    for k in range(near_distance.size):
        # The hull ends at j; what lies further away than that cannot reach into it.
        if near_distance[k] > d + widest + largest:
            break
        x, y, z = near[k, 0], near[k, 1], near[k, 2]
        along = x * ax + y * ay + z * az
        if along <= 0.0 or along >= d:
            continue
        rho2 = x * x + y * y + z * z - along * along
        reach = widest + near_radii[k]
        if rho2 >= reach * reach:
            continue
        # Radius of the hull there and the sphere's way off its axis, across the hull's surface.
        hull, away = r_i - along * tilt, math.sqrt(max(rho2, 0.0)) * lean
        depth = near_radii[k] + hull - away
        if depth <= 0.0:
            continue
        if (x - delta[0]) ** 2 + (y - delta[1]) ** 2 + (z - delta[2]) ** 2 < 1e-12 * d * d:
            continue
        if found == scratch.shape[0]:
            break
        scratch[found, 0], scratch[found, 1], scratch[found, 2] = x, y, z
        work[found, 0] = near_radii[k]
        work[found, 1] = _smooth(depth / (2.0 * edge * near_radii[k]))
        cover += _shared(hull, near_radii[k], away) / (math.pi * hull * hull)
        found += 1
    if found == 0:
        return 0, 0.0, 0.0, 0.0
    # One order of the pair for both directions: the marker must not depend on who asks.
    if r_i != r_j:
        keep = r_i < r_j
    elif ax != 0.0:
        keep = ax > 0.0
    elif ay != 0.0:
        keep = ay > 0.0
    else:
        keep = az > 0.0
    if keep:
        blocked, met = _pencil(
            r_i, r_j, (ax, ay, az), d, lines, edge, found, scratch, work[:, 0], work[:, 1]
        )
    else:
        for k in range(found):
            scratch[k, 0] -= delta[0]
            scratch[k, 1] -= delta[1]
            scratch[k, 2] -= delta[2]
        blocked, met = _pencil(
            r_j, r_i, (-ax, -ay, -az), d, lines, edge, found, scratch, work[:, 0], work[:, 1]
        )
    return found, cover, blocked, met


@njit(**_OPTIONS)
def pairs_between(
    emitters, target, start, near, near_radii, near_distance, near_start, radii, lines, edge,
    count, cover, blocked, met,
):  # fmt: skip
    """Markers of the pairs (emitters[e], neighbour target[m]), m in start[e]:start[e + 1].

    ``target[m]`` numbers a neighbour of the emitter inside its list ``near_start[e]`` on.
    """
    scratch = np.empty((512, 3))
    work = np.empty((512, 2))
    largest = radii.max()
    for e in range(emitters.size):
        a, b = near_start[e], near_start[e + 1]
        for m in range(start[e], start[e + 1]):
            j = a + target[m]
            count[m], cover[m], blocked[m], met[m] = between(
                radii[emitters[e]], near_radii[j], near[j], near[a:b], near_radii[a:b],
                near_distance[a:b], largest, lines, edge, scratch, work,
            )  # fmt: skip


@njit(**_OPTIONS)
def free_lines(
    emitters, vector, near_radii, start, stop, directions, offsets, length, edge, through
):  # fmt: skip
    """Share of each line that gets past the neighbours, ``through`` (e, n_lines).

    Line m of emitter e leaves its surface along ``directions[e, m]``, from the point
    ``offsets[e, m]`` (relative to the centre), and ends after ``length[e, m]``.
    """
    for e in range(emitters.size):
        for m in range(directions.shape[1]):
            wx, wy, wz = directions[e, m, 0], directions[e, m, 1], directions[e, m, 2]
            ox, oy, oz = offsets[e, m, 0], offsets[e, m, 1], offsets[e, m, 2]
            share = 1.0
            for k in range(start[e], stop[e]):
                bx, by, bz = vector[k, 0] - ox, vector[k, 1] - oy, vector[k, 2] - oz
                t = bx * wx + by * wy + bz * wz
                if t <= 0.0 or t >= length[e, m]:
                    continue
                r = near_radii[k]
                away2 = bx * bx + by * by + bz * bz - t * t
                rim = r * (1.0 + edge)
                if away2 < rim * rim:
                    away = math.sqrt(max(away2, 0.0))
                    share *= 1.0 - _smooth(0.5 + 0.5 * (r - away) / (edge * r))
                    if share == 0.0:
                        break
            through[e, m] = share
