"""Rows of walls: what leaves each bounded wall and where it arrives, with standard errors."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from greybed.core import InputError, Packing
from greybed.core.processors import available_threads
from greybed.raytrace import _emission, _kernels, _sobol
from greybed.raytrace.arguments import whole_number
from greybed.raytrace.errors import sequence_error, standard_error
from greybed.raytrace.scene import Scene

Array = NDArray[np.float64]

REPLICATES = 16
MOST_RAYS = 10**9
RAYS_AT_ONCE = 65_536


@dataclass(frozen=True, eq=False)
class PatchFactors:
    """View factors from walls.

    Attributes
    ----------
    to_spheres, to_spheres_stderr : csr_array, shape (n_walls, n)
        Wall to sphere [-] and standard errors; rows of walls without end are empty.
    to_walls, to_walls_stderr : ndarray, shape (n_walls, n_walls)
        Wall to wall [-]; NaN in rows of walls without end.
    escaped : ndarray, shape (n_walls,)
        Share that meets nothing [-].
    areas : ndarray, shape (n_walls,)
        Surface on the bed's side, less what lies inside spheres [m2]; infinite without end. With
        it ``A_w F_wi = A_i F_iw`` holds within the errors.
    buried : ndarray, shape (n_walls,)
        Share of the surface inside spheres [-].
    rays : int
        Rays started from each wall; those inside spheres are not counted [-].
    """

    to_spheres: sparse.csr_array
    to_spheres_stderr: sparse.csr_array
    to_walls: Array
    to_walls_stderr: Array
    escaped: Array
    areas: Array
    buried: Array
    rays: int


def patch_factors(
    packing: Packing,
    *,
    rays: int = 100_000,
    seed: int = 0,
    threads: int | None = None,
    max_distance: float = np.inf,
) -> PatchFactors:
    """Trace the view factors of the bounded walls of a packing.

    Rays leave each wall on the bed's side (see :mod:`greybed.core.walls`) with a cosine law, by
    scrambled Sobol sequences in 16 replicates.

    Parameters
    ----------
    packing : Packing
        Spheres and walls.
    rays : int
        Rays from each wall, 16 or more [-]; rounded up to a multiple of 16.
    seed : int
        Seed, at least 0; the same bits on any number of threads.
    threads : int, optional
        Threads; all available ones by default.
    max_distance : float
        Rays that meet nothing within it count as escaped [m].

    Returns
    -------
    PatchFactors

    Raises
    ------
    InputError
        For numbers out of range, no wall that ends, or one wholly inside spheres.

    Notes
    -----
    Walls without end have no row: ``A_w F_wi = A_i F_iw`` gives their exchange from the rows of
    the spheres.
    """
    rays = whole_number(rays, "rays", REPLICATES, MOST_RAYS)
    seed = whole_number(seed, "seed", 0)
    each = -(-rays // REPLICATES)
    tables = _emission.emitters(packing.walls)
    finite = np.flatnonzero(np.isfinite(tables.area))
    if not len(finite):
        raise InputError(
            f"{packing.source}: no wall has an end, so none can emit; give bounded walls, or use "
            "A_w F_wi = A_i F_iw with the rows of view_factors."
        )
    n, walls = len(packing), packing.n_walls
    scene = Scene.of(packing).tables
    points = np.zeros((_sobol.DIMENSIONS, each), np.uint32)
    _sobol.sequence(each, _sobol.direction_numbers(), points)

    def work(task: tuple[int, int]) -> tuple[NDArray[np.int64], NDArray[np.int64], int]:
        """Keys that the rays of one replicate met, their counts, and starts inside spheres."""
        wall, replicate = task
        seeds = np.random.SeedSequence([seed, wall, replicate]).generate_state(4, np.uint32)
        counts = np.zeros(n + walls + 1, np.int64)
        lost = 0
        numbers = np.empty((each, 4))
        _sobol.cube(points, each, seeds, numbers)
        for first in range(0, each, RAYS_AT_ONCE):
            some = numbers[first : first + RAYS_AT_ONCE]
            start = np.empty((len(some), 6))
            _emission.emit_many(wall, some, tables, start)
            origins, directions = start[:, :3].copy(), start[:, 3:].copy()
            inside = np.empty(len(some), dtype=bool)
            _kernels.inside_spheres(origins, scene.grid, inside)
            lost += int(inside.sum())
            origins, directions = origins[~inside], directions[~inside]
            distance, hit = np.empty(len(origins)), np.empty(len(origins), np.int64)
            _kernels.first_hits(origins, directions, scene.grid, scene.walls, distance, hit)
            hit[distance > max_distance] = -1 - walls
            counts += np.bincount(np.where(hit >= 0, hit, n - 1 - hit), minlength=n + walls + 1)
        key = np.flatnonzero(counts)
        return key, counts[key], lost

    tasks = [(int(w), r) for w in finite for r in range(REPLICATES)]
    with ThreadPoolExecutor(threads or available_threads()) as pool:
        parts = list(pool.map(work, tasks))
    source = np.repeat([w for w, _ in tasks], [len(part[0]) for part in parts])
    key = np.concatenate([part[0] for part in parts])
    count = np.concatenate([part[1] for part in parts])
    lost = np.zeros(walls, np.int64)
    np.add.at(lost, [w for w, _ in tasks], [part[2] for part in parts])
    total = REPLICATES * each
    used = total - lost
    if (used[finite] == 0).any():
        name = packing.walls[int(finite[(used[finite] == 0).argmax()])].name
        raise InputError(f"wall {name!r} lies wholly inside spheres; move it or remove them.")
    size = n + walls + 1
    pair, entry = np.unique(source * size + key, return_inverse=True)
    hits = np.asarray(np.bincount(entry, count), dtype=np.int64)
    squares = np.asarray(np.bincount(entry, count.astype(np.float64) ** 2))
    wall, target = pair // size, pair % size
    # Errors refer to the rays that count; replicates lose nearly equal shares of theirs.
    error = sequence_error(wall, hits, squares, total, REPLICATES) * total / used[wall]
    value = hits / used[wall]
    sphere = target < n
    shape = (walls, n)
    ends = (wall[sphere], target[sphere])
    to_walls = np.full((walls, walls + 1), np.nan)
    to_walls[finite] = 0.0
    to_walls_error = np.full((walls, walls + 1), np.nan)
    to_walls_error[finite] = standard_error(0, used[finite])[:, None]
    to_walls[wall[~sphere], target[~sphere] - n] = value[~sphere]
    to_walls_error[wall[~sphere], target[~sphere] - n] = error[~sphere]
    buried = np.where(np.isfinite(tables.area), lost / total, np.nan)
    return PatchFactors(
        sparse.csr_array((value[sphere], ends), shape=shape),
        sparse.csr_array((error[sphere], ends), shape=shape),
        to_walls[:, :walls],
        to_walls_error[:, :walls],
        to_walls[:, walls],
        np.where(np.isfinite(tables.area), tables.area * (1.0 - buried), np.inf),
        buried,
        total,
    )
