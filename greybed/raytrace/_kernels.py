"""Compiled ray tracing: traversal of the cell grid, buried starts, free rays."""

import math

import numpy as np

from greybed.core.jit import njit
from greybed.raytrace._streams import GOLDEN, MIX_2, draw, mix
from greybed.raytrace._walls import behind, crosses, wall_hit

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}

# Keys of the tallies: spheres are their number plus the coded image, walls -1 - k, and these: out
# of the bed, and still inside it when the distance limit ended the ray.
ESCAPED = -(2**62)
ENVIRONMENT = -(2**39)
# Attempts to start a ray on exposed surface before a sphere counts as wholly buried.
MAX_ATTEMPTS = 1000
# Image shifts are coded in ten bits an axis; a ray that goes further counts as escaped.
IMAGE_LIMIT = 500
IMAGE_SPAN = 1024


@njit(**_OPTIONS)
def _cell_of(position, low, inverse, count):
    """Cell number along one axis, clamped: emission points may lie a rounding outside."""
    return max(min(np.int64((position - low) * inverse), count - 1), 0)


@njit(**_OPTIONS)
def _walk(direction, position, low, cell, index, count):
    """Walk along one axis: step, distance to the next face, between faces, cells left ahead."""
    # Selections instead of branches: the sign is random, and a wrong guess costs more than this.
    ahead = direction > 0.0
    pace = 1.0 / direction if direction != 0.0 else np.inf
    to_face = (low + (index + ahead) * cell - position) * pace
    return (
        1 if ahead else -1,
        to_face if direction != 0.0 else np.inf,
        abs(cell * pace),
        count - 1 - index if ahead else index,
    )


# Inlined: as a call it would pass its many arguments through the stack for every ray.
@njit(inline="always", **_OPTIONS)
def march(ox, oy, oz, dx, dy, dz, limit, frame, start, items):
    """First sphere along a ray, no further than ``limit``: distance, entry, boxes crossed.

    Walks the cells that the ray crosses (Amanatides & Woo 1987) and stops at the first cell
    whose exit lies behind the nearest hit. Across periodic faces the origin moves back by one
    box while the ray goes on. The entry is -1 where the ray meets no sphere.
    """
    index, table = items
    low, cell, inverse = frame.low, frame.cell, frame.inverse
    nx, ny, nz = frame.nx, frame.ny, frame.nz
    ix = _cell_of(ox, low[0], inverse[0], nx)
    iy = _cell_of(oy, low[1], inverse[1], ny)
    iz = _cell_of(oz, low[2], inverse[2], nz)
    step_x, next_x, span_x, left_x = _walk(dx, ox, low[0], cell[0], ix, nx)
    step_y, next_y, span_y, left_y = _walk(dy, oy, low[1], cell[1], iy, ny)
    step_z, next_z, span_z, left_z = _walk(dz, oz, low[2], cell[2], iz, nz)
    stride_x, stride_y, stride_z = step_x * ny * nz, step_y * nz, step_z
    c = (ix * ny + iy) * nz + iz
    sx, sy, sz = 0, 0, 0
    hit_x, hit_y, hit_z = 0, 0, 0
    nearest, found = limit, -1
    while True:
        # Unsigned indices: for signed ones every access first tests for a count from the end,
        # which costs a third of the whole trace.
        for m in range(np.uint64(start[np.uint64(c)]), np.uint64(start[np.uint64(c + 1)])):
            e = index[np.uint64(m)]
            k = np.uint64(4) * np.uint64(e)
            qx = table[k] - ox
            qy = table[k + np.uint64(1)] - oy
            qz = table[k + np.uint64(2)] - oz
            b = qx * dx + qy * dy + qz * dz
            root = b * b - (qx * qx + qy * qy + qz * qz) + table[k + np.uint64(3)]
            # Spheres behind the origin include the emitter itself: it needs no other test.
            if b > 0.0 and root > 0.0:
                t = b - math.sqrt(root)
                if t < nearest:
                    nearest, found = t, np.int64(e)
                    # The walk may cross into another box before it is sure of this hit.
                    hit_x, hit_y, hit_z = sx, sy, sz
        exit_at = min(next_x, min(next_y, next_z))
        if nearest <= exit_at:
            break
        # Which face is crossed is as good as random: selections, no branches to guess wrong.
        cross_x, cross_y, cross_z = next_x == exit_at, next_y == exit_at, next_z == exit_at
        next_x += span_x if cross_x else 0.0
        next_y += span_y if cross_y else 0.0
        next_z += span_z if cross_z else 0.0
        c += (stride_x if cross_x else 0) + (stride_y if cross_y else 0)
        c += stride_z if cross_z else 0
        left_x -= cross_x
        left_y -= cross_y
        left_z -= cross_z
        if left_x < 0 or left_y < 0 or left_z < 0:
            if left_x < 0:
                sx, left_x, c = sx + step_x, nx - 1, c - stride_x * nx
                ox -= step_x * frame.edge[0]
                if not frame.periodic[0] or abs(sx) > IMAGE_LIMIT:
                    break
            if left_y < 0:
                sy, left_y, c = sy + step_y, ny - 1, c - stride_y * ny
                oy -= step_y * frame.edge[1]
                if not frame.periodic[1] or abs(sy) > IMAGE_LIMIT:
                    break
            if left_z < 0:
                sz, left_z, c = sz + step_z, nz - 1, c - stride_z * nz
                oz -= step_z * frame.edge[2]
                if not frame.periodic[2] or abs(sz) > IMAGE_LIMIT:
                    break
    return nearest, found, hit_x, hit_y, hit_z


@njit(**_OPTIONS)
def in_bed(x, y, z, frame):
    """Whether a point lies inside the grid; along periodic axes the bed has no end."""
    low, edge, periodic = frame.low, frame.edge, frame.periodic
    return (
        (periodic[0] or low[0] <= x <= low[0] + edge[0])
        and (periodic[1] or low[1] <= y <= low[1] + edge[1])
        and (periodic[2] or low[2] <= z <= low[2] + edge[2])
    )


@njit(**_OPTIONS)
def buried(x, y, z, frame, start, items, walls):
    """Whether a surface point lies inside another sphere or behind a wall."""
    low, inverse = frame.low, frame.inverse
    ix = _cell_of(x, low[0], inverse[0], frame.nx)
    iy = _cell_of(y, low[1], inverse[1], frame.ny)
    iz = _cell_of(z, low[2], inverse[2], frame.nz)
    c = (ix * frame.ny + iy) * frame.nz + iz
    for m in range(np.int64(start[c]), np.int64(start[c + 1])):
        k = 4 * np.int64(items.entry[m])
        qx, qy, qz = items.table[k] - x, items.table[k + 1] - y, items.table[k + 2] - z
        # The emitter itself is in the list, at its radius but for rounding.
        if qx * qx + qy * qy + qz * qz < items.table[k + 3] * (1.0 - 1e-9):
            return True
    return behind(x, y, z, walls)


@njit(**_OPTIONS)
def wrapped(position, low, edge, periodic):
    """Coordinate moved into the box along a periodic axis, and the boxes moved by."""
    boxes = 0
    if periodic:
        while position < low:
            position, boxes = position + edge, boxes - 1
        while position >= low + edge:
            position, boxes = position - edge, boxes + 1
    return position, boxes


@njit(**_OPTIONS)
def _hidden_start(sphere, px, py, pz, radius, scene):
    """Whether a place of the unit sphere, put on ``sphere``, is buried."""
    frame = scene.grid.frame
    low, edge, periodic = frame.low, frame.edge, frame.periodic
    centre = scene.centres[sphere]
    x, _ = wrapped(centre[0] + radius * px, low[0], edge[0], periodic[0])
    y, _ = wrapped(centre[1] + radius * py, low[1], edge[1], periodic[1])
    z, _ = wrapped(centre[2] + radius * pz, low[2], edge[2], periodic[2])
    if buried(x, y, z, frame, scene.grid.start, scene.grid.items, scene.walls):
        return True
    return crosses(centre[0], centre[1], centre[2], x, y, z, scene.walls)


@njit(**_OPTIONS)
def redraw(stream, number, sphere, radius, scene, rays, k):
    """Draw ray ``number``, in column ``k``, again until it starts on exposed surface.

    Returns the rejected starts, -1 where there seems to be no such surface.
    """
    # After the draw of the ray itself, so that redrawn starts are new ones.
    state = mix(stream + np.uint64(number) * GOLDEN) ^ MIX_2
    attempts = 0
    while _hidden_start(sphere, rays[3, k], rays[4, k], rays[5, k], radius, scene):
        attempts += 1
        if attempts == MAX_ATTEMPTS:
            return -1
        state = draw(state, rays, k)
    return attempts


@njit(**_OPTIONS)
def _into_box(position, low, edge, periodic):
    """Coordinate moved by whole boxes into the box along a periodic axis."""
    return position - edge * math.floor((position - low) / edge) if periodic else position


@njit(**_OPTIONS)
def first_hits(origins, directions, grid, walls, distance, owner):
    """Nearest sphere or wall of free rays: ``distance`` (inf where none) and ``owner``.

    ``owner`` is the sphere, -1 - k for wall k, and -1 - n_walls for nothing.
    """
    frame, start, items, owners, _ = grid
    nothing = -1 - walls.total
    for k in range(origins.shape[0]):
        ox, oy, oz = origins[k, 0], origins[k, 1], origins[k, 2]
        dx, dy, dz = directions[k, 0], directions[k, 1], directions[k, 2]
        at_wall, wall = wall_hit(ox, oy, oz, dx, dy, dz, walls)
        owner[k] = -1 - wall if wall >= 0 else nothing
        # An origin outside the grid first moves to where the ray enters it.
        enter, leave = 0.0, at_wall
        for axis in range(3):
            o, d = origins[k, axis], directions[k, axis]
            low, high = frame.low[axis], frame.low[axis] + frame.edge[axis]
            if frame.periodic[axis]:
                continue
            if d == 0.0:
                if o < low or o > high:
                    leave = -1.0
                continue
            near, far = (low - o) / d, (high - o) / d
            enter = max(enter, min(near, far))
            leave = min(leave, max(near, far))
        distance[k] = at_wall
        if enter > leave:
            continue
        ox = _into_box(ox + enter * dx, frame.low[0], frame.edge[0], frame.periodic[0])
        oy = _into_box(oy + enter * dy, frame.low[1], frame.edge[1], frame.periodic[1])
        oz = _into_box(oz + enter * dz, frame.low[2], frame.edge[2], frame.periodic[2])
        t, item, _, _, _ = march(ox, oy, oz, dx, dy, dz, at_wall - enter, frame, start, items)
        if item >= 0:
            distance[k] = t + enter
            owner[k] = owners[item]


@njit(**_OPTIONS)
def inside_spheres(origins, grid, mask):
    """Which points (m, 3) of an open packing lie inside a sphere."""
    frame, start, items = grid.frame, grid.start, grid.items
    low, edge = frame.low, frame.edge
    for k in range(origins.shape[0]):
        x, y, z = origins[k, 0], origins[k, 1], origins[k, 2]
        within = low[0] <= x <= low[0] + edge[0]
        within = within and low[1] <= y <= low[1] + edge[1]
        within = within and low[2] <= z <= low[2] + edge[2]
        mask[k] = False
        if not within:
            continue
        ix = _cell_of(x, low[0], frame.inverse[0], frame.nx)
        iy = _cell_of(y, low[1], frame.inverse[1], frame.ny)
        iz = _cell_of(z, low[2], frame.inverse[2], frame.nz)
        c = (ix * frame.ny + iy) * frame.nz + iz
        for m in range(np.int64(start[c]), np.int64(start[c + 1])):
            e = 4 * np.int64(items.entry[m])
            qx, qy, qz = items.table[e] - x, items.table[e + 1] - y, items.table[e + 2] - z
            if qx * qx + qy * qy + qz * qz < items.table[e + 3]:
                mask[k] = True
                break
