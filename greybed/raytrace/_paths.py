"""Compiled light paths: rays followed through reflections, for many emissivities at once."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from greybed.core.errors import InputError
from greybed.core.jit import njit
from greybed.core.walls import Cone, Cylinder, Disc, Mesh, Plane, Polygon, Wall
from greybed.raytrace._emission import emitters
from greybed.raytrace._kernels import (
    ESCAPED,
    IMAGE_LIMIT,
    IMAGE_SPAN,
    MAX_ATTEMPTS,
    buried,
    march,
)
from greybed.raytrace._streams import GOLDEN, MIX_1, emit, in_disc, mix
from greybed.raytrace._walls import crosses, patch_normal, wall_hit

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}

# Weight below which a path is absorbed whole or not at all instead of in shares: unbiased like the
# shares, ends every path, and leaves each row's sum at one. In a dense lattice, of 0.02, 0.1, 0.2,
# 0.35, 0.5 and 2 this one gave the least variance x time for emissivities from 0.3 up.
WHOLE_BELOW = 0.35
# A path between walls that absorb nothing may never end; what is left then counts as escaped.
MOST_HITS = 100_000
# Below, paths grow long without end in sight: a bed of such spheres is best taken as mirrors.
LEAST_EMISSIVITY = 1e-3
# Answers of :func:`follow` other than a number of keys.
BURIED, FULL = -1, -2

_PLANE, _CYLINDER, _PATCH = 0.0, 1.0, 2.0
_S11 = np.uint64(11)
_UNIT = 2.0**-53


def normal_tables(walls: Sequence[Wall], reflecting: np.ndarray) -> np.ndarray:
    """What :func:`_wall_normal` needs of each wall, shape (n_walls, 7): kind, point [m], vector.

    Raises
    ------
    InputError
        For a reflecting wall whose normal is not known here.
    """
    rows = np.full((len(walls), 7), np.nan)
    for k, wall in enumerate(walls):
        if isinstance(wall, Plane):
            rows[k] = _PLANE, *wall.point, *wall.normal
        elif isinstance(wall, Cylinder) and wall.length is None:
            rows[k] = _CYLINDER, *wall.point, *wall.axis
        elif isinstance(wall, Cylinder | Cone | Disc | Polygon | Mesh):
            # Met from both sides: the normal follows from the hit, the lift from the size.
            rows[k, :2] = _PATCH, emitters([wall]).lift[0]
        elif reflecting[k]:
            raise InputError(
                f"wall {k} is a {type(wall).__name__}, from which no light is reflected yet; "
                "give it emissivity 1 or use another kind."
            )
    return rows


def split_keys(key: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Spheres (m,) and periodic images (m, 3) of keys with images."""
    span, code = IMAGE_SPAN, key >> 32
    image = np.stack([code // span**2, code // span % span, code % span], axis=1) - span // 2
    return key & 0xFFFFFFFF, image


@njit(**_OPTIONS)
def _wall_normal(x, y, z, row):
    """Normal into the bed at a point on a wall, from its row of :func:`normal_tables`."""
    if row[0] == _PLANE:
        return row[4], row[5], row[6]
    qx, qy, qz = x - row[1], y - row[2], z - row[3]
    along = qx * row[4] + qy * row[5] + qz * row[6]
    qx, qy, qz = along * row[4] - qx, along * row[5] - qy, along * row[6] - qz
    scale = 1.0 / math.sqrt(qx * qx + qy * qy + qz * qz)
    return qx * scale, qy * scale, qz * scale


@njit(**_OPTIONS)
def _uniform(state):
    """Number in [0, 1) and the advanced state."""
    state += GOLDEN
    return np.float64(mix(state) >> _S11) * _UNIT, state


@njit(**_OPTIONS)
def _reflect(dx, dy, dz, nx, ny, nz, mirror, state):
    """Direction after a reflection: mirrored with the given probability, else a cosine law."""
    if mirror > 0.0:
        chance, state = _uniform(state)
        if chance < mirror:
            twice = 2.0 * (dx * nx + dy * ny + dz * nz)
            dx, dy, dz = dx - twice * nx, dy - twice * ny, dz - twice * nz
            scale = 1.0 / math.sqrt(dx * dx + dy * dy + dz * dz)
            return dx * scale, dy * scale, dz * scale, state
    u, v, s, state = in_disc(state)
    # Orthonormal basis without branches: Duff et al. 2017, jcgt.org/published/0006/01/01
    sign = math.copysign(1.0, nz)
    a = -1.0 / (sign + nz)
    b = nx * ny * a
    lift = math.sqrt(1.0 - s)
    return (
        u * (1.0 + sign * nx * nx * a) + v * b + lift * nx,
        u * (sign * b) + v * (sign + ny * ny * a) + lift * ny,
        u * (-sign * nx) - v * ny + lift * nz,
        state,
    )


@njit(**_OPTIONS)
def _into(position, low, edge, periodic):
    """Coordinate moved into the box along a periodic axis, and the boxes moved by."""
    if not periodic:
        return position, 0
    boxes = math.floor((position - low) / edge)
    return position - boxes * edge, np.int64(boxes)


@njit(**_OPTIONS)
def _gate(o, d, low, edge, enter, leave):
    """Narrow the stretch [enter, leave] of a ray to where it is inside along one open axis."""
    if d == 0.0:
        return enter, leave if low <= o <= low + edge else -1.0
    near, far = (low - o) / d, (low + edge - o) / d
    return max(enter, min(near, far)), min(leave, max(near, far))


@njit(**_OPTIONS)
def _place(key, stamp, keys, used, slots):
    """Slot of a key in an open-addressing table (stamp -1: free), and the slots in use."""
    mask = keys.size - 1
    slot = np.int64(mix(np.uint64(key)) & np.uint64(mask))
    while stamp[slot] >= 0:
        if keys[slot] == key:
            return slot, used
        slot = (slot + 1) & mask
    keys[slot] = key
    slots[used] = slot
    return slot, used + 1


@njit(**_OPTIONS)
def follow(
    emitter, first_ray, last_ray, seed, centres, radii, exposed, origins, directions, images,
    grid, walls, normals, limit, absorb, mirror, wall_absorb, wall_mirror, keys, stamp, now,
    total, square, slots, moments, extra,
):  # fmt: skip
    """Follow rays [first_ray, last_ray) of one emitter until they are absorbed or gone.

    Rays leave sphere ``emitter``, or start at ``origins`` (m, 3) where there are any. Column m of
    ``absorb`` (n, e) and ``wall_absorb`` (n_walls, e) is one set of emissivities; all sets share
    the paths. Per key and set, ``total`` sums what each ray left there and ``square`` its square
    (``now`` holds that of the ray ``stamp``). ``moments`` (2, e, 4) takes the sums and the sums
    of squares of sum_k w_k (x_k^2, y_k^2, z_k^2, all three) over the absorptions w_k of a ray at
    spheres x_k away from the emitter [m2]; ``extra`` starts on buried surface, paths cut short,
    hits. Returns the number of keys, or BURIED, or FULL where the table must be larger.
    """
    frame, start, items, owner, image = grid
    low, edge, periodic = frame.low, frame.edge, frame.periodic
    sets = absorb.shape[1]
    weight = np.empty(sets)
    ray_moment = np.zeros((sets, 4))
    free = origins.shape[0] > 0
    half = IMAGE_SPAN // 2
    used = 0
    stream = mix(np.uint64(seed) * MIX_1 + mix(np.uint64(emitter) + GOLDEN))
    for ray in range(first_ray, last_ray):
        state = mix(stream + np.uint64(ray) * GOLDEN)
        if free:
            ox, sx = _into(origins[ray, 0], low[0], edge[0], periodic[0])
            oy, sy = _into(origins[ray, 1], low[1], edge[1], periodic[1])
            oz, sz = _into(origins[ray, 2], low[2], edge[2], periodic[2])
            dx, dy, dz = directions[ray, 0], directions[ray, 1], directions[ray, 2]
        else:
            attempt, radius = 0, radii[emitter]
            while True:
                dx, dy, dz, ox, oy, oz, state = emit(state)
                ox, sx = _into(centres[emitter, 0] + radius * ox, low[0], edge[0], periodic[0])
                oy, sy = _into(centres[emitter, 1] + radius * oy, low[1], edge[1], periodic[1])
                oz, sz = _into(centres[emitter, 2] + radius * oz, low[2], edge[2], periodic[2])
                if exposed[emitter] or not (
                    buried(ox, oy, oz, frame, start, items, walls)
                    or crosses(
                        centres[emitter, 0], centres[emitter, 1], centres[emitter, 2],
                        ox, oy, oz, walls,
                    )
                ):  # fmt: skip
                    break
                attempt += 1
                if attempt == MAX_ATTEMPTS:
                    return BURIED
            extra[0] += attempt
        weight[:] = 1.0
        outside = free  # whether the ray may start outside the grid
        hits = 0
        while True:
            at_wall, wall = wall_hit(ox, oy, oz, dx, dy, dz, walls)
            reach = min(limit, at_wall)
            enter, leave = 0.0, reach
            if outside:
                for axis in range(3):
                    if not periodic[axis]:
                        o = ox if axis == 0 else (oy if axis == 1 else oz)
                        d = dx if axis == 0 else (dy if axis == 1 else dz)
                        enter, leave = _gate(o, d, low[axis], edge[axis], enter, leave)
            item, mx, my, mz = -1, 0, 0, 0
            ex, ey, ez, tx, ty, tz = ox, oy, oz, 0, 0, 0
            t = 0.0
            if enter <= leave:
                if enter > 0.0:
                    ex, tx = _into(ox + enter * dx, low[0], edge[0], periodic[0])
                    ey, ty = _into(oy + enter * dy, low[1], edge[1], periodic[1])
                    ez, tz = _into(oz + enter * dz, low[2], edge[2], periodic[2])
                t, item, mx, my, mz = march(
                    ex, ey, ez, dx, dy, dz, reach - enter, frame, start, items
                )
            mirrored = 0.0
            if item >= 0:
                k = 4 * item
                j = owner[item]
                mx, my, mz = mx + tx, my + ty, mz + tz
                cx, cy, cz = items.table[k], items.table[k + 1], items.table[k + 2]
                nx = ex + t * dx - (mx - tx) * edge[0] - cx
                ny = ey + t * dy - (my - ty) * edge[1] - cy
                nz = ez + t * dz - (mz - tz) * edge[2] - cz
                sx, sy, sz = sx + mx, sy + my, sz + mz
                key = np.int64(j)
                ix = sx + np.int64(image[3 * item + 0])
                iy = sy + np.int64(image[3 * item + 1])
                iz = sz + np.int64(image[3 * item + 2])
                if images:
                    key += (((ix + half) * IMAGE_SPAN + iy + half) * IMAGE_SPAN + iz + half) << 32
                    if max(abs(ix), max(abs(iy), abs(iz))) > IMAGE_LIMIT:
                        key = np.int64(ESCAPED)
                shares, mirrored = absorb[j], mirror[j]
            elif wall >= 0 and at_wall <= limit:
                key = np.int64(-1 - wall)
                shares, mirrored = wall_absorb[wall], wall_mirror[wall]
            else:
                key = np.int64(ESCAPED)
                shares = weight  # not used: all that is left has escaped
            hits += 1
            gone = key == ESCAPED or hits == MOST_HITS
            if gone and key != ESCAPED:
                key = np.int64(ESCAPED)
                extra[1] += 1
            if 2 * used >= keys.size:
                return FULL
            slot, used = _place(key, stamp, keys, used, slots)
            if stamp[slot] != ray:
                for m in range(sets):
                    if stamp[slot] >= 0:
                        total[slot, m] += now[slot, m]
                        square[slot, m] += now[slot, m] * now[slot, m]
                    else:
                        total[slot, m] = 0.0
                        square[slot, m] = 0.0
                    now[slot, m] = 0.0
                stamp[slot] = ray
            chance, state = _uniform(state)
            alive = False
            at_sphere = item >= 0 and not gone and not free
            if at_sphere:
                ux = cx + sx * edge[0] - centres[emitter, 0]
                uy = cy + sy * edge[1] - centres[emitter, 1]
                uz = cz + sz * edge[2] - centres[emitter, 2]
                ux, uy, uz = ux * ux, uy * uy, uz * uz
            for m in range(sets):
                w = weight[m]
                if w == 0.0:
                    continue
                if gone:
                    left = w
                elif w >= WHOLE_BELOW:
                    left = w * shares[m]
                else:
                    left = w if chance < shares[m] else 0.0
                weight[m] = w - left
                now[slot, m] += left
                alive = alive or weight[m] > 0.0
                if at_sphere:
                    ray_moment[m, 0] += left * ux
                    ray_moment[m, 1] += left * uy
                    ray_moment[m, 2] += left * uz
            if gone or not alive:
                break
            if item >= 0:
                scale = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz)
                nx, ny, nz = nx * scale, ny * scale, nz * scale
                radius = radii[j]
                ox, tx = _into(cx + radius * nx, low[0], edge[0], periodic[0])
                oy, ty = _into(cy + radius * ny, low[1], edge[1], periodic[1])
                oz, tz = _into(cz + radius * nz, low[2], edge[2], periodic[2])
                outside = False
            else:
                if normals[wall, 0] == _PATCH:
                    nx, ny, nz = patch_normal(ox, oy, oz, dx, dy, dz, at_wall, wall, walls.patches)
                    lift = normals[wall, 1]
                    ox += at_wall * dx + lift * nx
                    oy += at_wall * dy + lift * ny
                    oz += at_wall * dz + lift * nz
                else:
                    ox, oy, oz = ox + at_wall * dx, oy + at_wall * dy, oz + at_wall * dz
                    nx, ny, nz = _wall_normal(ox, oy, oz, normals[wall])
                ox, tx = _into(ox, low[0], edge[0], periodic[0])
                oy, ty = _into(oy, low[1], edge[1], periodic[1])
                oz, tz = _into(oz, low[2], edge[2], periodic[2])
                outside = True
            sx, sy, sz = sx + tx, sy + ty, sz + tz
            dx, dy, dz, state = _reflect(dx, dy, dz, nx, ny, nz, mirrored, state)
        extra[2] += hits
        for m in range(sets):
            ray_moment[m, 3] = ray_moment[m, 0] + ray_moment[m, 1] + ray_moment[m, 2]
            for axis in range(4):
                moments[0, m, axis] += ray_moment[m, axis]
                moments[1, m, axis] += ray_moment[m, axis] * ray_moment[m, axis]
                ray_moment[m, axis] = 0.0
    for place in range(used):
        slot = slots[place]
        for m in range(sets):
            total[slot, m] += now[slot, m]
            square[slot, m] += now[slot, m] * now[slot, m]
    return used
