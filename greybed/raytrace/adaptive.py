"""View factors to a wanted accuracy: rows first, then lines for the pairs that need them.

A row of rays tells who sees whom. What a row knows badly is then measured where it is cheap: a
pair of spheres by lines that both share (:mod:`greybed.raytrace.pairs`), since there only the
visibility is left to chance; walls, the opening and overlapping pairs, which have no such lines,
by tracing the row again with four times the rays.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from greybed.core import InputError, Packing
from greybed.core.exact import pair_factor
from greybed.core.progress import progress
from greybed.raytrace import _kernels, tally
from greybed.raytrace.errors import sequence_error, standard_error
from greybed.raytrace.pairs import pair_factors
from greybed.raytrace.scene import Scene
from greybed.raytrace.smoothing import Exchange, scattered
from greybed.raytrace.viewfactors import ViewFactors

Array = NDArray[np.float64]
Index = NDArray[np.int64]

# Rays of a row at most: an error of 0.1 % for a factor of a half.
MOST_RAYS = 2**20
# Looks at the pairs: the first one goes by what rows say, which a few factors fall short of.
ROUNDS = 6
# Says which of two opposite images is ahead: the first one that differs along x, y, z decides.
AHEAD = np.array([2**20, 2**10, 1])


@dataclass(frozen=True, eq=False)
class _Rows:
    """What rows of rays show: entries (emitter, key) with their errors, and rays by emitter."""

    emitter: Index
    key: Index
    value: Array
    error: Array
    rays: Index
    buried: Array


def refined(
    packing: Packing,
    rel_error: float,
    least: float,
    *,
    rays: int,
    seed: int,
    threads: int | None,
    max_distance: float,
    show_progress: bool,
) -> ViewFactors:
    """Factors of ``least`` or more to a relative standard error; see ``view_factors``.

    Raises
    ------
    InputError
        For numbers out of range.
    """
    if not rel_error > 0.0:
        raise InputError(f"rel_error = {rel_error:g} [-] must be above 0.")
    if not 0.0 < least < 1.0:
        raise InputError(f"least = {least:g} [-] must lie between 0 and 1.")
    begin = time.perf_counter()
    scene = Scene.of(packing)
    # A factor of the least size must be found: eight rays of either sphere meet it.
    enough = max(rays, math.ceil(8.0 / least))
    if any(packing.periodic):
        # And images that no ray meets, about 1 / rays each, must not matter beside the others.
        enough = max(enough, min(math.ceil(2.0 / (rel_error * least)), MOST_RAYS // 4))
    with progress(3, "rows, rows again, pairs", show=show_progress) as advance:
        rows = _trace(packing, enough, seed, threads, max_distance, None)
        advance(1)
        while True:
            again = _lacking(packing, rows, rel_error, least)
            if not len(again):
                break
            more = min(4 * int(rows.rays[again].max()), MOST_RAYS)
            rows = _replaced(rows, _trace(packing, more, seed, threads, max_distance, again), again)
        advance(1)
        areas = packing.areas * (1.0 - rows.buried)
        exchange, cost = _pairs(scene, rows, areas, rel_error, least, seed, threads)
        advance(1)
    empty = np.zeros(len(packing))
    shell = ViewFactors(
        factors=None, stderr=None, wall_factors=None, wall_stderr=None,  # type: ignore[arg-type]
        escaped=empty, escaped_stderr=empty, environment=empty, environment_stderr=empty,
        buried=rows.buried, areas=areas, rays=enough,
        seed=seed, seconds=time.perf_counter() - begin, cost=cost,
    )  # fmt: skip
    return scattered(exchange, shell)


def _trace(
    packing: Packing, rays: int, seed: int, threads: int | None, limit: float, who: Index | None
) -> _Rows:
    found = tally.trace(
        packing, rays=rays, seed=seed, threads=threads, emitters=who, images=True,
        max_distance=limit,
    )  # fmt: skip
    error = sequence_error(found.emitter, found.count, found.squares, rays, found.replicates)
    return _Rows(
        found.emitter, found.key, found.count / rays, error,
        np.full(len(packing), rays), found.buried,
    )  # fmt: skip


def _replaced(rows: _Rows, new: _Rows, who: Index) -> _Rows:
    """The rows of ``who`` taken from a longer trace."""
    mine = np.isin(rows.emitter, who)
    emitter, key, value, error = (
        np.concatenate([old[~mine], fresh])
        for old, fresh in (
            (rows.emitter, new.emitter),
            (rows.key, new.key),
            (rows.value, new.value),
            (rows.error, new.error),
        )
    )
    order = np.lexsort((key, emitter))
    rays, buried = rows.rays.copy(), rows.buried.copy()
    rays[who], buried[who] = new.rays[who], new.buried[who]
    return _Rows(emitter[order], key[order], value[order], error[order], rays, buried)


def _lacking(packing: Packing, rows: _Rows, rel_error: float, least: float) -> Index:
    """Emitters whose walls, opening or overlapping neighbours need more rays."""
    coarse = (rows.value >= least) & (rows.error > rel_error * rows.value)
    coarse &= rows.rays[rows.emitter] < MOST_RAYS
    _, _, distance, touch = _apart(packing, rows)
    overlapping = np.zeros(len(rows.key), dtype=bool)
    overlapping[rows.key >= 0] = distance < touch
    return np.unique(rows.emitter[coarse & ((rows.key < 0) | overlapping)])


def _apart(packing: Packing, rows: _Rows) -> tuple[Index, Index, Array, Array]:
    """Of the entries that are spheres: sphere, image, distance, and where they would touch [m]."""
    seen = rows.key >= 0
    sphere, image = tally.split_keys(rows.key[seen])
    i = rows.emitter[seen]
    delta = packing.centres[sphere] + image * packing.edges - packing.centres[i]
    distance = np.sqrt((delta**2).sum(axis=1))
    touch = (packing.radii[i] + packing.radii[sphere]) * (1.0 - 1e-9)
    return sphere, image, distance, touch


def _pairs(
    scene: Scene,
    rows: _Rows,
    areas: Array,
    rel_error: float,
    least: float,
    seed: int,
    threads: int | None,
) -> tuple[Exchange, Index]:
    """Exchange areas: of rows where they are known well enough, of lines where not."""
    packing = scene.packing
    n = len(packing)
    seen = rows.key >= 0
    i = rows.emitter[seen]
    j, image, _, _ = _apart(packing, rows)
    # Each pair once: the sphere of lower number first; of one's own images the one ahead.
    turn = (i > j) | ((i == j) & ((image @ AHEAD) < 0))
    low, high = np.where(turn, j, i), np.where(turn, i, j)
    image = np.where(turn[:, None], -image, image)
    code = tally.image_keys(high, image)
    order = np.lexsort((code, low))
    new = np.ones(len(order), dtype=bool)
    new[1:] = (np.diff(low[order]) != 0) | (np.diff(code[order]) != 0)
    pair = np.empty(len(order), np.int64)
    pair[order] = np.cumsum(new) - 1
    m = int(new.sum())
    pick = order[new]
    low, high, image = low[pick], high[pick], image[pick]
    # Of both directions: what they would weigh with the counts that their rays expect.
    share = rows.rays / areas
    weight = share[i] / (share[low] + share[high])[pair]
    value, variance = (
        np.asarray(np.bincount(pair, terms, m), dtype=np.float64)
        for terms in (
            weight * areas[i] * rows.value[seen],
            (weight * areas[i] * rows.error[seen]) ** 2,
        )
    )
    delta = packing.centres[high] + image * packing.edges - packing.centres[low]
    distance = np.sqrt((delta**2).sum(axis=1))
    touch = (packing.radii[low] + packing.radii[high]) * (1.0 - 1e-9)
    at = np.maximum(distance, packing.radii[low] + packing.radii[high])
    free = areas[low] * pair_factor(
        packing.radii[high] / at, packing.radii[high] / packing.radii[low]
    )
    # Images of one sphere are one entry; a sphere's own images count there and back.
    key, entry = np.unique(low * n + high, return_inverse=True)
    twice = np.where(low == high, 2.0, 1.0)

    def of_entries(values: Array) -> Array:
        return np.asarray(np.bincount(entry, values, len(key)), dtype=np.float64)

    cost = rows.rays.copy()
    for _ in range(ROUNDS):
        summed, spread = of_entries(twice * value), of_entries(twice**2 * variance)
        narrow = np.minimum(areas[key // n], areas[key % n])
        coarse = (summed >= least * narrow) & (np.sqrt(spread) > rel_error * summed)
        # Each image's part of the error: variances that add up to what the entry may have, split
        # so that the lines are fewest. They cost F_exact F / variance.
        weight = np.sqrt(free * np.maximum(value, 1e-4 * free))
        part = rel_error * summed[entry]
        part *= np.sqrt(weight / of_entries(twice**2 * weight)[entry])
        which = np.flatnonzero(coarse[entry] & (np.sqrt(variance) > part) & (distance >= touch))
        if not len(which):
            break
        full = packing.areas[low[which]]
        lines = pair_factors(
            packing, np.stack([low[which], high[which]], axis=1), image[which],
            abs_error=part[which] / full, seed=seed, threads=threads, scene=scene,
        )  # fmt: skip
        value[which] = full * lines.factor
        variance[which] = (full * lines.stderr) ** 2
        cost += (0.5 * np.bincount(low[which], lines.lines, n)).astype(np.int64)
        cost += (0.5 * np.bincount(high[which], lines.lines, n)).astype(np.int64)
    summed, spread = of_entries(twice * value), of_entries(twice**2 * variance)
    outside = np.zeros((n, packing.n_walls + 2))
    out_error = np.broadcast_to(standard_error(0, rows.rays)[:, None], outside.shape).copy()
    beyond = ~seen
    column = -1 - rows.key[beyond]
    column[rows.key[beyond] == _kernels.ESCAPED] = packing.n_walls
    column[rows.key[beyond] == _kernels.ENVIRONMENT] = packing.n_walls + 1
    outside[rows.emitter[beyond], column] = rows.value[beyond]
    out_error[rows.emitter[beyond], column] = rows.error[beyond]
    scale = areas[:, None]
    return (
        Exchange(
            key // n, key % n, summed, spread, outside * scale, (out_error * scale) ** 2, areas
        ),
        cost,
    )
