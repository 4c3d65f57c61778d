"""Compiled rows: the rays of one sphere from start to tally, in bundles first, then one by one."""

import math
from typing import NamedTuple

import numpy as np

from greybed.core.jit import njit
from greybed.raytrace._blocks import (
    distance_of,
    first_neighbours,
    in_blocks,
)
from greybed.raytrace._bundle import (
    Places,
    gather,
    room_for_neighbours,
    sort_by_direction,
)
from greybed.raytrace._grid import Grid
from greybed.raytrace._kernels import (
    ENVIRONMENT,
    ESCAPED,
    IMAGE_SPAN,
    in_bed,
    march,
    redraw,
    wrapped,
)
from greybed.raytrace._scratch import room_for_tasks
from greybed.raytrace._sobol import sphere_rays
from greybed.raytrace._streams import GOLDEN, draw, mix, replicate_seeds, stream_of
from greybed.raytrace._walls import Walls, wall_hit, walls_ahead

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}

# Bits for the number that a key carries when it is sorted, and what stands for the escape key.
_ROOM = 20
_FAR = 2**40


@njit(**_OPTIONS)
def slot_for(key, keys, slots, used, mask):
    """Slot of a key in an open-addressing table; ``used`` where it is new."""
    place = np.int64(mix(np.uint64(key)) & np.uint64(mask))
    while slots[place] >= 0:
        if keys[place] == key:
            return slots[place], place
        place = (place + 1) & mask
    keys[place] = key
    slots[place] = used
    return used, place


@njit(**_OPTIONS)
def _key(sphere, x, y, z, images):
    """Key of a sphere, with its image (in boxes) where images are kept apart."""
    if not images:
        return np.int64(sphere)
    half = IMAGE_SPAN // 2
    code = ((x + half) * IMAGE_SPAN + y + half) * IMAGE_SPAN + z + half
    return np.int64(sphere) + (code << 32)


@njit(**_OPTIONS)
def _start_rays(sphere, first, last, offsets, seed, quasi, points, radius, hidden, scene, rays):
    """Rays of replicates ``first`` to ``last`` in columns from 0 on; returns rejected starts.

    Replicate r holds rays ``offsets[r]`` to ``offsets[r + 1]``. A quasi-random replicate is one
    scrambled sequence; else ray k draws from a stream of its own. Starts on buried surface are
    drawn again from such a stream; -1 where the whole sphere is buried.
    """
    stream = stream_of(sphere, seed)
    begin = offsets[first]
    n = offsets[last] - begin
    if quasi:
        seeds = np.empty(4, np.uint32)
        for r in range(first, last):
            replicate_seeds(stream, r, seeds)
            sphere_rays(points, offsets[r + 1] - offsets[r], seeds, rays, offsets[r] - begin)
    else:
        for k in range(n):
            draw(mix(stream + np.uint64(begin + k) * GOLDEN), rays, k)
    if not hidden:
        return 0
    rejected = 0
    for k in range(n):
        attempts = redraw(stream, begin + k, sphere, radius, scene, rays, k)
        if attempts < 0:
            return -1
        rejected += attempts
    return rejected


class Tables(NamedTuple):
    """What the compiled tracer needs of a packing."""

    centres: np.ndarray  # (n, 3) [m]
    radii: np.ndarray  # (n,) [m]
    exposed: np.ndarray  # (n,) bool, no surface inside other spheres or walls
    clearance: np.ndarray  # (n,) no wall is nearer to the centre [m]
    grid: Grid
    places: Places
    walls: Walls


@njit(**_OPTIONS)
def _outside(x, y, z, frame):
    """Whether a place on a ray lies out of the bed: there is no way back, for a bed is convex."""
    low, edge, periodic = frame.low, frame.edge, frame.periodic
    out_x = ((x < low[0]) | (x > low[0] + edge[0])) & (not periodic[0])
    out_y = ((y < low[1]) | (y > low[1] + edge[1])) & (not periodic[1])
    out_z = ((z < low[2]) | (z > low[2] + edge[2])) & (not periodic[2])
    return out_x | out_y | out_z


@njit(**_OPTIONS)
def march_on(m, rays, ahead, bound, centre, images, frame, start, items, owner, image, key):
    """Keys of what ``m`` pending rays meet that have come ``ahead`` [m] freely.

    One loop over all of them: arrays handed to a function for every ray would be reference-counted
    every time, with a locked instruction that all threads wait for.
    """
    low, edge, periodic = frame.low, frame.edge, frame.periodic
    for q in range(m):
        key[q] = ESCAPED
        if ahead[q] >= bound[q]:
            continue
        dx, dy, dz = rays[0, q], rays[1, q], rays[2, q]
        x, sx = wrapped(centre[0] + rays[3, q] + ahead[q] * dx, low[0], edge[0], periodic[0])
        y, sy = wrapped(centre[1] + rays[4, q] + ahead[q] * dy, low[1], edge[1], periodic[1])
        z, sz = wrapped(centre[2] + rays[5, q] + ahead[q] * dz, low[2], edge[2], periodic[2])
        if ahead[q] > 0.0 and _outside(x, y, z, frame):
            continue
        _, item, mx, my, mz = march(x, y, z, dx, dy, dz, bound[q] - ahead[q], frame, start, items)
        if item >= 0:
            key[q] = _key(
                owner[item],
                sx + mx + np.int64(image[3 * item]),
                sy + my + np.int64(image[3 * item + 1]),
                sz + mz + np.int64(image[3 * item + 2]),
                images,
            )


@njit(**_OPTIONS)
def at_limit(rays, k, centre, limit, clear, frame, walls):
    """Key of a ray that met nothing up to the distance limit: the environment inside the bed."""
    dx, dy, dz = rays[0, k], rays[1, k], rays[2, k]
    x = centre[0] + rays[3, k] + limit * dx
    y = centre[1] + rays[4, k] + limit * dy
    z = centre[2] + rays[5, k] + limit * dz
    # Between the outermost sphere and a wall is bed, too.
    if in_bed(x, y, z, frame) or (clear < np.inf and wall_hit(x, y, z, dx, dy, dz, walls)[1] >= 0):
        return np.int64(ENVIRONMENT)
    return np.int64(ESCAPED)


@njit(**_OPTIONS)
def trace_sphere(
    sphere, first, last, offsets, seed, quasi, points, images, scene, limit, work, around
):  # fmt: skip
    """Trace replicates ``first`` to ``last`` of one sphere into ``work``.

    Returns the number of slots in use and of starts rejected because they lay on buried surface
    (-1 where the whole sphere is buried). What a ray meets depends on the scene and on its own
    numbers alone, so neither the order nor the thread of the work changes a bit of the result.
    """
    radius, clear = scene.radii[sphere], scene.clearance[sphere]
    cx, cy, cz = scene.centres[sphere, 0], scene.centres[sphere, 1], scene.centres[sphere, 2]
    n = offsets[last] - offsets[first]
    hidden = not scene.exposed[sphere]
    rejected = _start_rays(
        sphere, first, last, offsets, seed, quasi, points, radius, hidden, scene, work.raw
    )
    if rejected < 0:
        return 0, -1
    ball = radius + scene.places.reach
    found = gather(sphere, scene.centres, scene.radii, scene.places, ball, around)
    raw, rays, order, waiting = work.raw, work.rays, work.order, work.waiting
    single = work.single
    if found >= 0:
        sort_by_direction(n, raw, work.code, work.fields, order)
        in_blocks(n, order, raw, work.distance, single)
    else:
        ball = 0.0
        for k in range(n):
            order[k] = k
    code = work.code
    for r in range(first, last):
        for k in range(offsets[r] - offsets[first], offsets[r + 1] - offsets[first]):
            code[k] = r - first
    if found >= 0:
        first_neighbours(
            n, found, around, raw, order, single, work.room, work.distance, work.nearest
        )
    # Names for the arrays: through ``work`` each access would be reference-counted.
    keys, slots, counts = work.keys, work.slots, work.counts
    places, slot_of, part = work.places, work.slot_of, work.code
    index, reach = work.nearest, work.distance
    hits, met, key_of = work.hit, work.met, work.key
    mask = keys.size - 1
    used = 0
    replicates = last - first
    for p in range(found):
        key = _key(
            around.sphere[p], around.image[0, p], around.image[1, p], around.image[2, p], images
        )
        slot, place = slot_for(key, keys, slots, used, mask)
        if slot == used:
            places[used] = place
            for r in range(replicates):
                counts[used, r] = 0
            used += 1
        slot_of[p] = slot
    # Rays that escape are many in sparse beds: a slot of their own, which takes no search.
    lost, place = slot_for(np.int64(ESCAPED), keys, slots, used, mask)
    places[used] = place
    for r in range(replicates):
        counts[used, r] = 0
    used += 1
    # Most rays end at a neighbour before anything else could matter; the others wait.
    pending, ahead, bound, wall = work.pending, work.ahead, work.bound, work.wall
    safe = np.float32(min(min(ball, clear) - radius, limit) / radius - around.margins[1])
    waits = n
    if found >= 0:
        waits = 0
        slot_of[0] = slot_of[0] if found > 0 else 0
        for k in range(np.uint64(n)):
            # No branch: the processor would guess wrong too often. Rays that meet none count 0.
            settled = reach[k] < safe
            slot = slot_of[np.uint64(max(index[k], 0))]
            counts[np.uint64(slot), np.uint64(part[np.uint64(order[k])])] += settled
            waiting[np.uint64(waits)] = k
            waits += not settled
    frame, start, items, owner, image = scene.grid
    m = 0
    for q in range(waits):
        k = waiting[q] if found >= 0 else q
        hit = np.int64(index[k]) if found >= 0 else -1
        column = order[k]
        dx, dy, dz = raw[0, column], raw[1, column], raw[2, column]
        px, py, pz = raw[3, column] * radius, raw[4, column] * radius, raw[5, column] * radius
        begin, distance = 0.0, np.inf
        if found >= 0:
            # Where the ray leaves the ball inside which all spheres are known.
            along = px * dx + py * dy + pz * dz
            begin = math.sqrt(along * along + ball * ball - radius * radius) - along
            if hit >= 0:
                distance = distance_of(hit, around, radius, raw, column)
                hit = -1 if distance > begin else hit
        at_x, at_y, at_z = cx + px + begin * dx, cy + py + begin * dy, cz + pz + begin * dz
        free = hit < 0 and begin < limit and clear == np.inf
        if free and begin > 0.0 and _outside(at_x, at_y, at_z, frame):
            counts[lost, part[column]] += 1
            continue
        rays[0, m], rays[1, m], rays[2, m] = dx, dy, dz
        rays[3, m], rays[4, m], rays[5, m] = px, py, pz
        # What is known already needs no march, only a look at the walls and the limit.
        hits[m], met[m], ahead[m] = hit, distance, begin if hit < 0 else np.inf
        pending[m], bound[m], wall[m] = column, limit, -1
        m += 1
    if clear < np.inf:
        walls_ahead(m, rays, scene.centres[sphere], scene.walls, bound, wall)
    march_on(
        m, rays, ahead, bound, scene.centres[sphere], images, frame, start, items, owner,
        image, key_of,
    )  # fmt: skip
    for q in range(m):
        replicate = part[pending[q]]
        hit, key = hits[q], key_of[q]
        if hit >= 0 and met[q] < bound[q]:
            counts[slot_of[hit], replicate] += 1
            continue
        if key == ESCAPED and wall[q] >= 0:
            key = np.int64(-1 - wall[q])
        elif key == ESCAPED and limit < np.inf:
            key = at_limit(rays, q, scene.centres[sphere], limit, clear, frame, scene.walls)
        if key == ESCAPED:
            counts[lost, replicate] += 1
            continue
        slot, place = slot_for(key, keys, slots, used, mask)
        if slot == used:
            places[used] = place
            for r in range(replicates):
                counts[used, r] = 0
            used += 1
        counts[slot, replicate] += 1
    return used, rejected


@njit(**_OPTIONS)
def _in_order(found, images):
    """Numbers of the keys in growing order."""
    if images:
        return np.argsort(found)
    # Sorting numbers is twice as fast as sorting by numbers: so a key carries its own along.
    packed = np.empty(found.size, np.int64)
    for m in range(found.size):
        packed[m] = (max(found[m], -_FAR) << _ROOM) + m
    packed = np.sort(packed)
    for m in range(found.size):
        packed[m] &= (1 << _ROOM) - 1
    return packed


@njit(**_OPTIONS)
def store(used, replicates, images, work, filled, out_keys, out_counts, out_squares):
    """Write the ``used`` slots of one task, sorted by key, from ``filled`` on, and free them.

    Returns the new end of the output, -1 where they do not fit.
    """
    if filled + used > out_keys.size:
        return -1
    found = work.keys[work.places[:used]]
    order = _in_order(found, images)
    for m in range(used):
        slot = order[m]
        total, squares = 0, 0
        for r in range(replicates):
            c = np.int64(work.counts[slot, r])
            total += c
            squares += c * c
        if total > 0:
            out_keys[filled] = found[slot]
            out_counts[filled] = total
            out_squares[filled] = squares
            filled += 1
    for m in range(used):
        work.slots[work.places[m]] = -1
    return filled


@njit(**_OPTIONS)
def trace_block(
    tasks, offsets, seed, quasi, points, images, scene, limit, most_rays, most_replicates,
    out_keys, out_counts, out_squares, ends, rejected,
):  # fmt: skip
    """Trace tasks (sphere, first replicate, last replicate) and store their tallies.

    Task k fills the outputs up to ``ends[k]``, sorted by key: rays, and the sum of the squares of
    the replicates' rays. Returns the number of tasks done; fewer than asked where the output is
    full.
    """
    work = room_for_tasks(most_rays, most_replicates)
    around = room_for_neighbours()
    filled = 0
    for k in range(tasks.shape[0]):
        replicates = tasks[k, 2] - tasks[k, 1]
        used, rejected[k] = trace_sphere(
            tasks[k, 0], tasks[k, 1], tasks[k, 2], offsets, seed, quasi, points, images, scene,
            limit, work, around,
        )  # fmt: skip
        filled = store(used, replicates, images, work, filled, out_keys, out_counts, out_squares)
        if filled < 0:
            return k
        ends[k] = filled
    return tasks.shape[0]
