"""Compiled rows: the rays of one sphere from start to tally, in bundles first, then one by one."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from greybed.raytrace._bundle import (
    BLOCK,
    MOST,
    Places,
    first_neighbours,
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
def march_on(
    m, pending, rays, ahead, bound, centre, images, frame, start, items, owner, image, key
):
    """Keys of what ``m`` pending rays meet that have come ``ahead`` [m] freely.

    One loop over all of them: arrays handed to a function for every ray would be reference-counted
    every time, with a locked instruction that all threads wait for.
    """
    low, edge, periodic = frame.low, frame.edge, frame.periodic
    for q in range(m):
        key[q] = ESCAPED
        if ahead[q] >= bound[q]:
            continue
        k = pending[q]
        dx, dy, dz = rays[0, k], rays[1, k], rays[2, k]
        x, sx = wrapped(centre[0] + rays[3, k] + ahead[q] * dx, low[0], edge[0], periodic[0])
        y, sy = wrapped(centre[1] + rays[4, k] + ahead[q] * dy, low[1], edge[1], periodic[1])
        z, sz = wrapped(centre[2] + rays[5, k] + ahead[q] * dz, low[2], edge[2], periodic[2])
        if ahead[q] > 0.0 and (
            x < low[0] or x > low[0] + edge[0]
            or y < low[1] or y > low[1] + edge[1]
            or z < low[2] or z > low[2] + edge[2]
        ):  # fmt: skip
            continue  # out of the bed, and no way back
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
    n = offsets[last] - offsets[first]
    hidden = not scene.exposed[sphere]
    rejected = _start_rays(
        sphere, first, last, offsets, seed, quasi, points, radius, hidden, scene, work.raw
    )
    if rejected < 0:
        return 0, -1
    ball = radius + scene.places.reach
    found = gather(sphere, scene.centres, scene.radii, scene.places, ball, around)
    raw, rays, order = work.raw, work.rays, work.order
    if found >= 0:
        sort_by_direction(n, raw, work.code, work.fields, order)
    else:
        ball = 0.0
        for k in range(n):
            order[k] = k
    for row in range(3):
        for k in range(n):
            rays[row, k] = raw[row, order[k]]
        for k in range(n):
            rays[3 + row, k] = raw[3 + row, order[k]] * radius
    code = work.code
    for r in range(first, last):
        for k in range(offsets[r] - offsets[first], offsets[r + 1] - offsets[first]):
            code[k] = r - first
    if found >= 0:
        first_neighbours(
            n, radius, found, around, rays, work.distance, work.nearest, work.lists,
            work.best, work.who,
        )  # fmt: skip
    # Names for the arrays: through ``work`` each access would be reference-counted.
    keys, slots, counts = work.keys, work.slots, work.counts
    places, slot_of, part = work.places, work.slot_of, work.code
    index, reach = work.nearest, work.distance
    hits, key_of = work.hit, work.key
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
    # Most rays end at a neighbour before anything else could matter; the others wait.
    pending, ahead, bound, wall = work.pending, work.ahead, work.bound, work.wall
    m = 0
    for k in range(n):
        hit, begin = -1, 0.0
        if found >= 0:
            hit, distance = index[k], reach[k]
            if hit < 0 or radius + distance > ball:
                # Where the ray leaves the ball inside which all spheres are known.
                px, py, pz = rays[3, k], rays[4, k], rays[5, k]
                along = px * rays[0, k] + py * rays[1, k] + pz * rays[2, k]
                begin = math.sqrt(along * along + ball * ball - radius * radius) - along
                if hit >= 0 and distance > begin:
                    hit = -1
            if hit >= 0 and radius + distance < clear and distance <= limit:
                counts[slot_of[hit], part[order[k]]] += 1
                continue
        pending[m], hits[m], ahead[m], bound[m], wall[m] = k, hit, begin, limit, -1
        m += 1
    if clear < np.inf:
        walls_ahead(m, pending, rays, scene.centres[sphere], scene.walls, bound, wall)
    for q in range(m):
        if hits[q] >= 0:
            # Known already, but for the wall: nothing left to march for.
            ahead[q] = np.inf
    frame, start, items, owner, image = scene.grid
    march_on(
        m, pending, rays, ahead, bound, scene.centres[sphere], images, frame, start, items, owner,
        image, key_of,
    )  # fmt: skip
    for q in range(m):
        k = pending[q]
        replicate = part[order[k]]
        hit, key = hits[q], key_of[q]
        if hit >= 0 and reach[k] < bound[q]:
            counts[slot_of[hit], replicate] += 1
            continue
        if key == ESCAPED and wall[q] >= 0:
            key = np.int64(-1 - wall[q])
        elif key == ESCAPED and limit < np.inf:
            key = at_limit(rays, k, scene.centres[sphere], limit, clear, frame, scene.walls)
        slot, place = slot_for(key, keys, slots, used, mask)
        if slot == used:
            places[used] = place
            for r in range(replicates):
                counts[used, r] = 0
            used += 1
        counts[slot, replicate] += 1
    return used, rejected


class Work(NamedTuple):
    """Scratch of one thread, for tasks of up to so many rays and replicates."""

    raw: np.ndarray  # (6, rays): direction, place on the unit sphere
    rays: np.ndarray  # (6, rays): the same by direction, places in metres
    order: np.ndarray  # (rays,) int64
    code: np.ndarray  # (rays,) int64
    fields: np.ndarray  # (4097,) int64
    distance: np.ndarray  # (rays,) [m]
    nearest: np.ndarray  # (rays,) int64, neighbour
    pending: np.ndarray  # (rays,) int64, rays that no neighbour has settled
    hit: np.ndarray  # (rays,) int64, their neighbour or -1
    ahead: np.ndarray  # (rays,) how far they have come [m]
    bound: np.ndarray  # (rays,) how far they may go [m]
    wall: np.ndarray  # (rays,) int64, what is there, or -1
    key: np.ndarray  # (rays,) int64, what they meet
    lists: np.ndarray  # (2, MOST) int64
    best: np.ndarray  # (BLOCK,) [m]
    who: np.ndarray  # (BLOCK,) int64
    keys: np.ndarray  # (2^k,) int64
    slots: np.ndarray  # (2^k,) int64, -1 where free
    places: np.ndarray  # (slots,) int64
    slot_of: np.ndarray  # (MOST,) int64
    counts: np.ndarray  # (slots, replicates) int32


@njit(**_OPTIONS)
def room_for_tasks(rays, replicates):
    """Scratch for tasks of up to ``rays`` rays."""
    most = rays + MOST
    size = 1
    while size < 2 * most:
        size *= 2
    padded = rays + BLOCK
    return Work(
        np.empty((6, padded)),
        np.empty((6, padded)),
        np.empty(padded, np.int64),
        np.empty(padded, np.int64),
        np.empty(4097, np.int64),
        np.empty(padded),
        np.empty(padded, np.int64),
        np.empty(padded, np.int64),
        np.empty(padded, np.int64),
        np.empty(padded),
        np.empty(padded),
        np.empty(padded, np.int64),
        np.empty(padded, np.int64),
        np.empty((2, MOST), np.int64),
        np.empty(BLOCK),
        np.empty(BLOCK, np.int64),
        np.empty(size, np.int64),
        np.full(size, -1, np.int64),
        np.empty(most, np.int64),
        np.empty(MOST, np.int64),
        np.empty((most, replicates), np.int32),
    )


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
