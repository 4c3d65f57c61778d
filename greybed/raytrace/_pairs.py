"""Compiled pair sampling: of all lines that two free spheres share, how many nothing blocks.

The lines are laid as in the exact integral: a direction at the angle whose sine times the distance
is s, then a point of the lens in which the two shadows overlap; each carries its share of the
integral as weight. So F = F_exact * (free weight / weight), and the rays decide on visibility only.
"""

import math

import numpy as np

from greybed.core.jit import njit
from greybed.raytrace._sobol import scrambled, turn
from greybed.raytrace._streams import GOLDEN, MIX_1, MIX_2, S32, mix
from greybed.raytrace._walls import wall_hit

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}

MOST = 512  # spheres that may stand between one pair


@njit(**_OPTIONS)
def _between(centre, delta, r_i, r_j, centres, radii, places, out):
    """Spheres and images that reach into the hull of a pair: (5, MOST) vector, radius^2, radius.

    Returns their number, or -1 where there are more than fit. ``centre`` is that of i, ``delta``
    leads to j. The two themselves are left out.
    """
    shape, cell, low, edge = places.shape, places.cell, places.low, places.edge
    d = math.sqrt(delta[0] ** 2 + delta[1] ** 2 + delta[2] ** 2)
    ax, ay, az = delta[0] / d, delta[1] / d, delta[2] / d
    tilt = (r_i - r_j) / d
    lean = math.sqrt(max(1.0 - tilt * tilt, 0.0))
    first, last = np.empty(3, np.int64), np.empty(3, np.int64)
    for k in range(3):
        lowest = centre[k] + min(-r_i, delta[k] - r_j) - places.largest
        highest = centre[k] + max(r_i, delta[k] + r_j) + places.largest
        first[k] = math.floor((lowest - low[k]) / cell[k])
        last[k] = math.floor((highest - low[k]) / cell[k])
        if not places.periodic[k]:
            first[k], last[k] = max(first[k], 0), min(last[k], shape[k] - 1)
    found = 0
    for ix in range(first[0], last[0] + 1):
        wx = ix // shape[0]
        for iy in range(first[1], last[1] + 1):
            wy = iy // shape[1]
            line = ((ix - wx * shape[0]) * shape[1] + iy - wy * shape[1]) * shape[2]
            for iz in range(first[2], last[2] + 1):
                wz = iz // shape[2]
                c = line + iz - wz * shape[2]
                for p in range(places.start[c], places.start[c + 1]):
                    m = places.sphere[p]
                    x = centres[m, 0] + wx * edge[0] - centre[0]
                    y = centres[m, 1] + wy * edge[1] - centre[1]
                    z = centres[m, 2] + wz * edge[2] - centre[2]
                    r = radii[m]
                    along = x * ax + y * ay + z * az
                    if along <= -r - r_i or along >= d + r + r_j:
                        continue
                    square = x * x + y * y + z * z
                    across = math.sqrt(max(square - along * along, 0.0))
                    # Depth inside the cone that touches both; a hair more, against rounding.
                    if r * (1.0 + 1e-9) + r_i - across * lean - along * tilt <= 0.0:
                        continue
                    away = (x - delta[0]) ** 2 + (y - delta[1]) ** 2 + (z - delta[2]) ** 2
                    if square < 1e-18 * d * d or away < 1e-18 * d * d:
                        continue  # i and j themselves
                    if found == MOST:
                        return -1
                    out[0, found], out[1, found], out[2, found] = x, y, z
                    out[3, found], out[4, found] = r * r, r
                    found += 1
    return found


@njit(**_OPTIONS)
def _lay(points, n, seeds, delta, r_i, r_j, line):
    """Lay ``n`` lines into ``line`` (9, n): start, direction, begin, end, weight."""
    d = math.sqrt(delta[0] ** 2 + delta[1] ** 2 + delta[2] ** 2)
    ax, ay, az = delta[0] / d, delta[1] / d, delta[2] / d
    sign = math.copysign(1.0, az)
    a = -1.0 / (sign + az)
    b = ax * ay * a
    e1x, e1y, e1z = 1.0 + sign * ax * ax * a, sign * b, -sign * ax
    e2x, e2y, e2z = b, sign + ay * ay * a, -ay
    widest2 = (r_i + r_j) ** 2
    p0, p1, p2, p3 = points[0, :n], points[1, :n], points[2, :n], points[3, :n]
    s0, s1, s2, s3 = seeds[0], seeds[1], seeds[2], seeds[3]
    l0, l1, l2 = line[0, :n], line[1, :n], line[2, :n]
    l3, l4, l5 = line[3, :n], line[4, :n], line[5, :n]
    l6, l7, l8 = line[6, :n], line[7, :n], line[8, :n]
    for k in range(n):
        rest = math.sqrt(1.0 - scrambled(p0[k], s0))
        square = widest2 * (1.0 - rest)
        s = math.sqrt(square)
        sine = s / d
        cosine = math.sqrt(max(1.0 - sine * sine, 1e-30))
        low, high = max(-r_i, s - r_j), min(r_i, s + r_j)
        u = low + (high - low) * scrambled(p1[k], s1)
        height2 = max(min(r_i * r_i - u * u, r_j * r_j - (u - s) ** 2), 0.0)
        height = math.sqrt(height2)
        v = height * (2.0 * scrambled(p2[k], s2) - 1.0)
        cf, sf = turn(scrambled(p3[k], s3))
        gx, gy, gz = cf * e1x + sf * e2x, cf * e1y + sf * e2y, cf * e1z + sf * e2z
        wx, wy, wz = cosine * ax - sine * gx, cosine * ay - sine * gy, cosine * az - sine * gz
        qx, qy, qz = sine * ax + cosine * gx, sine * ay + cosine * gy, sine * az + cosine * gz
        tx, ty, tz = wy * qz - wz * qy, wz * qx - wx * qz, wx * qy - wy * qx
        l0[k], l1[k], l2[k] = u * qx + v * tx, u * qy + v * ty, u * qz + v * tz
        l3[k], l4[k], l5[k] = wx, wy, wz
        l6[k] = math.sqrt(max(r_i * r_i - u * u - v * v, 0.0))
        l7[k] = d * cosine - math.sqrt(max(r_j * r_j - (u - s) ** 2 - v * v, 0.0))
        l8[k] = (high - low) * height / (rest * cosine)


@njit(**_OPTIONS)
def _block(n, line, x, y, z, square, free):
    """Take out the lines that a sphere crosses between their ends."""
    l0, l1, l2 = line[0, :n], line[1, :n], line[2, :n]
    l3, l4, l5 = line[3, :n], line[4, :n], line[5, :n]
    l6, l7 = line[6, :n], line[7, :n]
    open_ = free[:n]
    for k in range(n):
        bx, by, bz = x - l0[k], y - l1[k], z - l2[k]
        t = bx * l3[k] + by * l4[k] + bz * l5[k]
        inside2 = square - (bx * bx + by * by + bz * bz - t * t)
        half = math.sqrt(max(inside2, 0.0))
        hidden = (inside2 > 0.0) & (t + half > l6[k]) & (t - half < l7[k])
        open_[k] = 0.0 if hidden else open_[k]


@njit(**_OPTIONS)
def visibility(
    pairs, image, lines, seed, points, centres, radii, edge, places, bounded, walls,
    share, variance, equal, blockers,
):  # fmt: skip
    """Visible share of each pair (i, j, image), 16 replicates of ``lines[k]`` lines each.

    Fills ``share``, its ``variance`` as the replicates show it, ``equal``, the number of lines of
    equal weight that would be as good (infinite where nothing can block), and ``blockers``, the
    spheres that reach into the hull (-1: too many). ``bounded`` says whether walls may stand
    between.
    """
    longest = points.shape[1]
    line, free = np.empty((9, longest)), np.empty(longest)
    crowd = np.empty((5, MOST))
    seeds = np.empty(4, np.uint32)
    delta = np.empty(3)
    saw, weighed = np.empty(16), np.empty(16)
    for q in range(pairs.shape[0]):
        i, j = pairs[q, 0], pairs[q, 1]
        for k in range(3):
            delta[k] = centres[j, k] + image[q, k] * edge[k] - centres[i, k]
        found = _between(centres[i], delta, radii[i], radii[j], centres, radii, places, crowd)
        blockers[q] = found
        if found < 0 or (found == 0 and not bounded):
            share[q], variance[q], equal[q] = 1.0, 0.0, np.inf
            continue
        stream = mix(np.uint64(seed) * MIX_1 + mix(np.uint64(i) + GOLDEN))
        stream = mix(stream ^ mix(np.uint64(j) * MIX_2 + np.uint64(image[q, 0] + 512)))
        stream = mix(stream ^ np.uint64((image[q, 1] + 512) * 1024 + image[q, 2] + 512))
        n = lines[q]
        total, heavy, weight = 0.0, 0.0, 0.0
        for r in range(16):
            state = mix(stream ^ mix(np.uint64(r) + MIX_2))
            for k in range(4):
                state += GOLDEN
                seeds[k] = np.uint32(mix(state) >> S32)
            _lay(points, n, seeds, delta, radii[i], radii[j], line)
            for k in range(n):
                free[k] = 1.0
            for b in range(found):
                _block(n, line, crowd[0, b], crowd[1, b], crowd[2, b], crowd[3, b], free)
            if bounded:
                for k in range(n):
                    if free[k] > 0.0:
                        t, _ = wall_hit(
                            centres[i, 0] + line[0, k] + line[6, k] * line[3, k],
                            centres[i, 1] + line[1, k] + line[6, k] * line[4, k],
                            centres[i, 2] + line[2, k] + line[6, k] * line[5, k],
                            line[3, k], line[4, k], line[5, k], walls,
                        )  # fmt: skip
                        if t < line[7, k] - line[6, k]:
                            free[k] = 0.0
            seen, all_ = 0.0, 0.0
            for k in range(n):
                seen += line[8, k] * free[k]
                all_ += line[8, k]
                heavy += line[8, k] ** 2
            saw[r], weighed[r] = seen, all_
            total += seen
            weight += all_
        # One ratio of all: those of short replicates would each be off by one over their lines.
        share[q] = total / weight
        rest = 0.0
        for r in range(16):
            rest += (saw[r] - share[q] * weighed[r]) ** 2
        variance[q] = rest * 16.0 / 15.0 / weight**2
        # Lines count by weight: so many equal ones would be as good.
        equal[q] = weight * weight / heavy
