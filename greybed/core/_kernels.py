"""Compiled bounded walls: a tree of triangles, discs, cones; rays against them, distances."""

import math

import numpy as np

from greybed.core.jit import njit

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}

LEAF = 4  # triangles of a leaf, at most, where they can be told apart
BINS = 16  # planes that a cut chooses from, along each axis, and one more
DEEP = 40  # levels with cuts by cost; further down halves, so that a trail fits into 64 bits
# Boxes are wider than their triangles by this times the size of the mesh: rounding loses nothing.
HAIR = 1e-9
# Edges of discs and cones reach this much further, relative, so that seams let nothing through.
SEAM = 1e-12


@njit(**_OPTIONS)
def build_tree(corners, order, boxes, links):
    """Build a tree over triangles ``corners`` (m, 9) [m]; returns its number of nodes.

    ``order`` (m,) int64 becomes the order in which leaves list triangles. ``boxes`` (2 m, 6) lower
    and upper corners; ``links`` (2 m, 3) int64: first child or first triangle, number of triangles
    (0: inner node, children side by side), parent. Cuts minimise the surface-area cost over bins
    (Wald 2007, doi 10.1109/RT.2007.4342588).
    """
    m = corners.shape[0]
    low = np.empty((m, 3))
    high = np.empty((m, 3))
    middle = np.empty((m, 3))
    size = 0.0
    for k in range(3):
        lowest, highest = np.inf, -np.inf
        for t in range(m):
            a, b, c = corners[t, k], corners[t, 3 + k], corners[t, 6 + k]
            low[t, k] = min(a, min(b, c))
            high[t, k] = max(a, max(b, c))
            middle[t, k] = 0.5 * (low[t, k] + high[t, k])
            lowest, highest = min(lowest, low[t, k]), max(highest, high[t, k])
        # The place counts as well: coordinates far from the origin round coarsely.
        size = max(size, max(highest - lowest, 1e-3 * max(abs(lowest), abs(highest))))
    pad = HAIR * size
    for t in range(m):
        order[t] = t
    begin = np.empty(2 * m, np.int64)
    end = np.empty(2 * m, np.int64)
    level = np.empty(2 * m, np.int64)
    begin[0], end[0], level[0], links[0, 2] = 0, m, 0, -1
    nodes, node = 1, 0
    number = np.empty(BINS, np.int64)
    bin_low = np.empty((BINS, 3))
    bin_high = np.empty((BINS, 3))
    cost_right = np.empty(BINS)
    side_low = np.empty(3)
    side_high = np.empty(3)
    while node < nodes:  # breadth first: children are made side by side
        first, last = begin[node], end[node]
        for k in range(3):
            a, b = np.inf, -np.inf
            for p in range(first, last):
                a, b = min(a, low[order[p], k]), max(b, high[order[p], k])
            boxes[node, k], boxes[node, 3 + k] = a - pad, b + pad
        count = last - first
        best, axis_best, cut_best = np.inf, -1, 0
        if count > LEAF and level[node] < DEEP:
            for k in range(3):
                a, b = np.inf, -np.inf
                for p in range(first, last):
                    a, b = min(a, middle[order[p], k]), max(b, middle[order[p], k])
                if not b > a:
                    continue
                scale = BINS / (b - a)
                number[:] = 0
                bin_low[:] = np.inf
                bin_high[:] = -np.inf
                for p in range(first, last):
                    t = order[p]
                    s = min(np.int64((middle[t, k] - a) * scale), BINS - 1)
                    number[s] += 1
                    for q in range(3):
                        bin_low[s, q] = min(bin_low[s, q], low[t, q])
                        bin_high[s, q] = max(bin_high[s, q], high[t, q])
                side_low[:], side_high[:], total = np.inf, -np.inf, 0
                for s in range(BINS - 1, 0, -1):
                    total += number[s]
                    cost_right[s] = total * _grown(side_low, side_high, bin_low[s], bin_high[s])
                side_low[:], side_high[:], total = np.inf, -np.inf, 0
                for s in range(BINS - 1):
                    total += number[s]
                    area = _grown(side_low, side_high, bin_low[s], bin_high[s])
                    cost = total * area + cost_right[s + 1]
                    if 0 < total < count and cost < best:
                        best, axis_best, cut_best = cost, k, s
        if count <= LEAF:
            links[node, 0], links[node, 1] = first, count
        else:
            if axis_best >= 0:
                a, b = np.inf, -np.inf
                for p in range(first, last):
                    t = order[p]
                    a, b = min(a, middle[t, axis_best]), max(b, middle[t, axis_best])
                scale = BINS / (b - a)
                p, q = first, last - 1
                while p <= q:
                    t = order[p]
                    s = min(np.int64((middle[t, axis_best] - a) * scale), BINS - 1)
                    if s <= cut_best:
                        p += 1
                    else:
                        order[p], order[q] = order[q], t
                        q -= 1
                half = p
            else:
                half = (first + last) // 2
            links[node, 0], links[node, 1] = nodes, 0
            for child in range(2):
                begin[nodes + child] = half if child else first
                end[nodes + child] = last if child else half
                level[nodes + child] = level[node] + 1
                links[nodes + child, 2] = node
            nodes += 2
        node += 1
    return nodes


@njit(**_OPTIONS)
def _grown(low, high, more_low, more_high):
    """Half the surface of a box after it has grown to hold another one [m2]."""
    for k in range(3):
        low[k] = min(low[k], more_low[k])
        high[k] = max(high[k], more_high[k])
    a, b, c = high[0] - low[0], high[1] - low[1], high[2] - low[2]
    return a * b + b * c + c * a if a >= 0.0 else 0.0


@njit(inline="always", **_OPTIONS)
def _pace(d):
    """1 / d, huge instead of infinite, so that zero times it is zero."""
    return 1.0 / d if abs(d) > 1e-300 else math.copysign(1e300, d)


@njit(inline="always", **_OPTIONS)
def _entry(node, boxes, ox, oy, oz, px, py, pz, nearest):
    """Where a ray of paces p enters a box, inf where it does not or no nearer than ``nearest``."""
    ax, bx = (boxes[node, 0] - ox) * px, (boxes[node, 3] - ox) * px
    ay, by = (boxes[node, 1] - oy) * py, (boxes[node, 4] - oy) * py
    az, bz = (boxes[node, 2] - oz) * pz, (boxes[node, 5] - oz) * pz
    enter = max(max(min(ax, bx), min(ay, by)), max(min(az, bz), 0.0))
    leave = min(min(max(ax, bx), max(ay, by)), max(az, bz))
    return enter if enter <= leave * (1.0 + 1e-12) and enter <= nearest else np.inf


@njit(**_OPTIONS)
def triangle_hit(ox, oy, oz, dx, dy, dz, limit, boxes, links, corners):
    """First triangle along a ray, nearer than ``limit``: distance and place in the tree (-1).

    Ray and triangle by Woop, Benthin & Wald 2013 (jcgt.org/published/0002/01/05): two triangles
    work out their common edge with the same numbers, so no ray slips through between them. Walk
    without a stack by Afra & Szirmay-Kalos 2014 (doi 10.1111/cgf.12259): a bit for each level says
    whether the sibling there still waits.
    """
    nearest, found = limit, -1
    px, py, pz = _pace(dx), _pace(dy), _pace(dz)
    if _entry(0, boxes, ox, oy, oz, px, py, pz, nearest) == np.inf:
        return nearest, found
    # The direction's longest part becomes z; shears sx, sy bring the others to zero.
    if abs(dz) >= abs(dx) and abs(dz) >= abs(dy):
        kx, ky, kz, sx, sy, sz, qx, qy, qz = 0, 1, 2, dx / dz, dy / dz, 1.0 / dz, ox, oy, oz
    elif abs(dx) >= abs(dy):
        kx, ky, kz, sx, sy, sz, qx, qy, qz = 1, 2, 0, dy / dx, dz / dx, 1.0 / dx, oy, oz, ox
    else:
        kx, ky, kz, sx, sy, sz, qx, qy, qz = 2, 0, 1, dz / dy, dx / dy, 1.0 / dy, oz, ox, oy
    one = np.uint64(1)
    node, trail = 0, np.uint64(0)
    while True:
        child, count = links[node, 0], links[node, 1]
        if count == 0:
            a = _entry(child, boxes, ox, oy, oz, px, py, pz, nearest)
            b = _entry(child + 1, boxes, ox, oy, oz, px, py, pz, nearest)
            if a < np.inf or b < np.inf:
                trail <<= one
                if a < np.inf and b < np.inf:
                    trail |= one
                node = child if a <= b else child + 1
                continue
        else:
            for t in range(child, child + count):
                az, bz, cz = corners[t, kz] - qz, corners[t, 3 + kz] - qz, corners[t, 6 + kz] - qz
                ax = corners[t, kx] - qx - sx * az
                ay = corners[t, ky] - qy - sy * az
                bx = corners[t, 3 + kx] - qx - sx * bz
                by = corners[t, 3 + ky] - qy - sy * bz
                cx = corners[t, 6 + kx] - qx - sx * cz
                cy = corners[t, 6 + ky] - qy - sy * cz
                u = cx * by - cy * bx
                v = ax * cy - ay * cx
                w = bx * ay - by * ax
                if (u < 0.0 or v < 0.0 or w < 0.0) and (u > 0.0 or v > 0.0 or w > 0.0):
                    continue
                det = u + v + w
                if det == 0.0:
                    continue
                distance = (u * az + v * bz + w * cz) * sz / det
                if 0.0 < distance < nearest:
                    nearest, found = distance, t
        # Back up to the nearest level whose sibling waits and is still near enough.
        while True:
            while trail & one == 0:
                if trail == 0:
                    return nearest, found
                node = links[node, 2]
                trail >>= one
            trail ^= one
            node = ((node - 1) ^ 1) + 1
            if _entry(node, boxes, ox, oy, oz, px, py, pz, nearest) < np.inf:
                break


@njit(**_OPTIONS)
def disc_hit(ox, oy, oz, dx, dy, dz, disc):
    """Distance to a disc (point, normal, radius) along a ray, inf where it misses."""
    towards = dx * disc[3] + dy * disc[4] + dz * disc[5]
    if towards == 0.0:
        return np.inf
    rx, ry, rz = ox - disc[0], oy - disc[1], oz - disc[2]
    t = -(rx * disc[3] + ry * disc[4] + rz * disc[5]) / towards
    x, y, z = rx + t * dx, ry + t * dy, rz + t * dz
    inside = x * x + y * y + z * z <= disc[6] * disc[6] * (1.0 + SEAM)
    return t if t > 0.0 and inside else np.inf


@njit(**_OPTIONS)
def cone_hit(ox, oy, oz, dx, dy, dz, cone):
    """Distance to a cone (point, axis, radius, end radius, length) along a ray, inf for none."""
    ax, ay, az = cone[3], cone[4], cone[5]
    length = cone[8]
    widening = (cone[7] - cone[6]) / length
    rx, ry, rz = ox - cone[0], oy - cone[1], oz - cone[2]
    s, p = rx * ax + ry * ay + rz * az, dx * ax + dy * ay + dz * az
    qx, qy, qz = rx - s * ax, ry - s * ay, rz - s * az
    ux, uy, uz = dx - p * ax, dy - p * ay, dz - p * az
    # |q + t u|^2 = (r + g t)^2 with r the radius of the cone beside the origin
    r, g = cone[6] + widening * s, widening * p
    a = ux * ux + uy * uy + uz * uz - g * g
    b = qx * ux + qy * uy + qz * uz - r * g
    c = qx * qx + qy * qy + qz * qz - r * r
    root = b * b - a * c
    if root < 0.0:
        return np.inf
    # The root of equal signs, and the other one from their product: neither cancels.
    h = -(b + math.copysign(math.sqrt(root), b))
    one = h / a if a != 0.0 else np.inf
    two = c / h if h != 0.0 else np.inf
    slack = SEAM * length
    nearest = np.inf
    for t in (one, two):
        along = s + t * p
        # The second nappe, beyond the apex, lies beyond the ends as well.
        if 0.0 < t < nearest and -slack <= along <= length + slack:
            nearest = t
    return nearest


@njit(**_OPTIONS)
def patch_hit(ox, oy, oz, dx, dy, dz, limit, patches):
    """First bounded wall along a ray, nearer than ``limit``: distance and its number (-1)."""
    nearest, wall = limit, -1
    discs, cones = patches.discs, patches.cones
    for k in range(discs.shape[0]):
        t = disc_hit(ox, oy, oz, dx, dy, dz, discs[k])
        if t < nearest:
            nearest, wall = t, patches.disc_number[k]
    for k in range(cones.shape[0]):
        t = cone_hit(ox, oy, oz, dx, dy, dz, cones[k])
        if t < nearest:
            nearest, wall = t, patches.cone_number[k]
    if patches.corners.shape[0] > 0:
        nearest, place = triangle_hit(
            ox, oy, oz, dx, dy, dz, nearest, patches.boxes, patches.links, patches.corners
        )
        if place >= 0:
            wall = patches.triangle_number[place]
    return nearest, wall


@njit(**_OPTIONS)
def patch_hits(origins, directions, patches, distance):
    """Distance to the first bounded wall of rays (m, 3), inf where there is none [m]."""
    for k in range(origins.shape[0]):
        distance[k], _ = patch_hit(
            origins[k, 0], origins[k, 1], origins[k, 2],
            directions[k, 0], directions[k, 1], directions[k, 2], np.inf, patches,
        )  # fmt: skip


@njit(**_OPTIONS)
def _square_to_triangle(x, y, z, c):
    """Squared distance of a point to a triangle (9,), by Ericson 2004, section 5.1.5 [m2]."""
    ux, uy, uz = c[3] - c[0], c[4] - c[1], c[5] - c[2]
    vx, vy, vz = c[6] - c[0], c[7] - c[1], c[8] - c[2]
    px, py, pz = x - c[0], y - c[1], z - c[2]
    d1, d2 = ux * px + uy * py + uz * pz, vx * px + vy * py + vz * pz
    if d1 <= 0.0 and d2 <= 0.0:
        return px * px + py * py + pz * pz
    bx, by, bz = x - c[3], y - c[4], z - c[5]
    d3, d4 = ux * bx + uy * by + uz * bz, vx * bx + vy * by + vz * bz
    if d3 >= 0.0 and d4 <= d3:
        return bx * bx + by * by + bz * bz
    cx, cy, cz = x - c[6], y - c[7], z - c[8]
    d5, d6 = ux * cx + uy * cy + uz * cz, vx * cx + vy * cy + vz * cz
    if d6 >= 0.0 and d5 <= d6:
        return cx * cx + cy * cy + cz * cz
    vc, vb, va = d1 * d4 - d3 * d2, d5 * d2 - d1 * d6, d3 * d6 - d5 * d4
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        f, g = d1 / (d1 - d3), 0.0
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        f, g = 0.0, d2 / (d2 - d6)
    elif va <= 0.0 and d4 >= d3 and d5 >= d6:
        g = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        f = 1.0 - g
    else:
        f, g = vb / (va + vb + vc), vc / (va + vb + vc)
    ex, ey, ez = px - f * ux - g * vx, py - f * uy - g * vy, pz - f * uz - g * vz
    return ex * ex + ey * ey + ez * ez


@njit(**_OPTIONS)
def _square_to_box(x, y, z, box):
    """Squared distance of a point to a box, zero inside [m2]."""
    ex = max(max(box[0] - x, x - box[3]), 0.0)
    ey = max(max(box[1] - y, y - box[4]), 0.0)
    ez = max(max(box[2] - z, z - box[5]), 0.0)
    return ex * ex + ey * ey + ez * ez


@njit(**_OPTIONS)
def _triangle_square(x, y, z, nearest, boxes, links, corners):
    """Squared distance of a point to the triangles of a tree, ``nearest`` at most [m2]."""
    one = np.uint64(1)
    node, trail = 0, np.uint64(0)
    while True:
        child, count = links[node, 0], links[node, 1]
        if count == 0:
            a, b = _square_to_box(x, y, z, boxes[child]), _square_to_box(x, y, z, boxes[child + 1])
            if min(a, b) < nearest:
                trail <<= one
                if max(a, b) < nearest:
                    trail |= one
                node = child if a <= b else child + 1
                continue
        else:
            for t in range(child, child + count):
                nearest = min(nearest, _square_to_triangle(x, y, z, corners[t]))
        while True:
            while trail & one == 0:
                if trail == 0:
                    return nearest
                node = links[node, 2]
                trail >>= one
            trail ^= one
            node = ((node - 1) ^ 1) + 1
            if _square_to_box(x, y, z, boxes[node]) < nearest:
                break


@njit(**_OPTIONS)
def patch_distances(points, patches, distance):
    """Distance of points (n, 3) to the nearest bounded wall, from either side [m]."""
    for k in range(points.shape[0]):
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        square = np.inf
        for m in range(patches.discs.shape[0]):
            d = patches.discs[m]
            qx, qy, qz = x - d[0], y - d[1], z - d[2]
            s = qx * d[3] + qy * d[4] + qz * d[5]
            rho = math.sqrt(max(qx * qx + qy * qy + qz * qz - s * s, 0.0))
            over = max(rho - d[6], 0.0)
            square = min(square, s * s + over * over)
        for m in range(patches.cones.shape[0]):
            c = patches.cones[m]
            qx, qy, qz = x - c[0], y - c[1], z - c[2]
            s = qx * c[3] + qy * c[4] + qz * c[5]
            ex, ey, ez = qx - s * c[3], qy - s * c[4], qz - s * c[5]
            rho = math.sqrt(ex * ex + ey * ey + ez * ez)
            # In the half plane through the axis the side is a straight line.
            wide, long = c[7] - c[6], c[8]
            f = ((rho - c[6]) * wide + s * long) / (wide * wide + long * long)
            f = min(max(f, 0.0), 1.0)
            over, along = rho - c[6] - f * wide, s - f * long
            square = min(square, over * over + along * along)
        if patches.corners.shape[0] > 0:
            square = _triangle_square(
                x, y, z, square, patches.boxes, patches.links, patches.corners
            )
        distance[k] = math.sqrt(square)
