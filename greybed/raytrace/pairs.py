"""View factors of chosen pairs: the exact free factor times a traced visibility."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.core import InputError, Packing
from greybed.core.exact import pair_factor
from greybed.core.processors import available_threads
from greybed.raytrace import _pairs, _sobol
from greybed.raytrace.errors import LEAST_HITS, POOLED, PRIOR
from greybed.raytrace.scene import Scene

Array = NDArray[np.float64]
Index = NDArray[np.int64]

REPLICATES = 16
LEAST_LINES = 4  # of a replicate
MOST_LINES = 65_536
PAIRS_PER_BLOCK = 500


@dataclass(frozen=True, eq=False)
class PairFactors:
    """View factors of pairs, and what they cost.

    Attributes
    ----------
    pairs : (m, 2) int array
        Spheres i and j.
    image : (m, 3) int array
        Periodic image of j, in boxes.
    factor, stderr : (m,) arrays
        F_ij from i to j and its standard error [-]; the error is 0 where nothing reaches into the
        hull of the two. Multiply by (r_i / r_j)^2 for F_ji.
    visibility : (m,) array
        F_ij over the exact free factor, 0 to 1 [-].
    lines : (m,) int array
        Lines traced for each.
    """

    pairs: Index
    image: Index
    factor: Array
    stderr: Array
    visibility: Array
    lines: Index


def pair_factors(
    packing: Packing,
    pairs: ArrayLike,
    image: ArrayLike | None = None,
    *,
    rel_error: float | None = None,
    abs_error: ArrayLike | None = None,
    rays: int = 1024,
    seed: int = 0,
    threads: int | None = None,
    scene: Scene | None = None,
) -> PairFactors:
    """View factors of chosen pairs of a packing.

    Only lines that both spheres share are drawn, in the measure of the exact integral, so the
    error is that of the visibility: none for a free pair, and small for one that is hardly
    blocked.

    Parameters
    ----------
    packing : Packing
        The bed.
    pairs : array_like of int, shape (m, 2)
        Spheres i and j.
    image : array_like of int, shape (m, 3), optional
        Periodic image of j in boxes; by default the one nearest to i.
    rel_error : float, optional
        Relative standard error wanted for every pair, above 0 [-]: lines are quadrupled, from 64
        up to a million, until it is reached. A pair that is wholly hidden keeps the lines that
        would have shown one part in a thousand.
    abs_error : array_like, shape (m,), optional
        The same as absolute standard errors of F_ij, above 0 [-].
    rays : int
        Lines for each pair where no error is given, 64 to 1,048,576 [-]; whole
        multiples of 16.
    seed : int
        Seed of the scrambled sequences; the same bits for any threads and any other pairs.
    threads : int, optional
        Threads; all available ones by default.
    scene : Scene, optional
        That of the packing, where it is built already.

    Returns
    -------
    PairFactors

    Raises
    ------
    InputError
        For numbers out of range, a sphere paired with itself in the same box, spheres that
        overlap each other, or more than 512 spheres between a pair.

    Notes
    -----
    Surface inside other spheres counts as blocked, and the factor refers to the whole surface
    4 pi r^2 of i, not to the exposed part.
    """
    scene = Scene.of(packing) if scene is None else scene
    who = np.asarray(pairs, dtype=np.int64).reshape(-1, 2)
    n = len(packing)
    if len(who) and not (who.min() >= 0 and who.max() < n):
        raise InputError(
            f"pairs must number spheres 0 ... {n - 1}; got {who.min()} ... {who.max()}."
        )
    low, high = packing.bounds
    edge = np.asarray(high - low, dtype=np.float64)
    wraps = np.array(packing.periodic)
    delta = packing.centres[who[:, 1]] - packing.centres[who[:, 0]]
    if image is None:
        boxes = np.where(wraps, -np.round(delta / edge), 0.0).astype(np.int64)
    else:
        boxes = np.asarray(image, dtype=np.int64).reshape(-1, 3)
    distance = np.sqrt(((delta + boxes * edge) ** 2).sum(axis=1))
    r_i, r_j = packing.radii[who[:, 0]], packing.radii[who[:, 1]]
    deep = distance < (r_i + r_j) * (1.0 - 1e-9)
    if deep.any():
        k = int(deep.argmax())
        raise InputError(
            f"{packing.source}: spheres {who[k, 0]} and {who[k, 1]} overlap ({distance[k]:g} [m] "
            f"apart, radii {r_i[k]:g} and {r_j[k]:g}), so they have no free factor; trace them "
            "with view_factors."
        )
    if rel_error is not None and not rel_error > 0.0:
        raise InputError(f"rel_error = {rel_error:g} [-] must be above 0.")
    distance = np.maximum(distance, r_i + r_j)
    exact = pair_factor(r_j / distance, r_j / r_i)
    aimed = rel_error is not None or abs_error is not None
    per_replicate = LEAST_LINES if aimed else min(max(LEAST_LINES, rays // REPLICATES), MOST_LINES)
    wanted = np.full(len(who), np.inf if abs_error is None else abs_error) / exact
    share, error = np.ones(len(who)), np.zeros(len(who))
    lines = np.zeros(len(who), dtype=np.int64)
    left = np.arange(len(who))
    while len(left):
        v, e, hidden = _visibility(scene, who[left], boxes[left], per_replicate, seed, threads)
        share[left], error[left] = v, e
        lines[left] += np.where(hidden == 0, 0, REPLICATES * per_replicate)
        if not aimed or per_replicate >= MOST_LINES:
            break
        bound = wanted[left]
        if rel_error is not None:
            bound = np.minimum(bound, rel_error * np.maximum(v, 1e-3))
        left = left[e > bound]
        per_replicate *= 4
    return PairFactors(who, boxes, exact * share, exact * error, share, lines)


def _visibility(
    scene: Scene, pairs: Index, image: Index, per_replicate: int, seed: int, threads: int | None
) -> tuple[Array, Array, Index]:
    """Visible share, its error, and the number of spheres between, of each pair."""
    m = len(pairs)
    packing, tables = scene.packing, scene.tables
    points = np.zeros((_sobol.DIMENSIONS, per_replicate), np.uint32)
    _sobol.sequence(per_replicate, _sobol.direction_numbers(), points)
    low, high = packing.bounds
    edge = np.asarray(high - low, dtype=np.float64)
    share, own, equal, blockers = np.empty(m), np.empty(m), np.empty(m), np.empty(m, np.int64)
    lines = np.full(m, per_replicate)

    def some(span: slice) -> None:
        _pairs.visibility(
            pairs[span], image[span], lines[span], seed, points, tables.centres, tables.radii,
            edge, tables.places, scene.walls_between, tables.walls, share[span], own[span],
            equal[span], blockers[span],
        )  # fmt: skip

    spans = [slice(a, a + PAIRS_PER_BLOCK) for a in range(0, m, PAIRS_PER_BLOCK)]
    with ThreadPoolExecutor(threads or available_threads()) as pool:
        list(pool.map(some, spans))
    if (blockers < 0).any():
        i, j = pairs[int((blockers < 0).argmax())]
        raise InputError(
            f"{packing.source}: more than {_pairs.MOST} spheres stand between spheres {i} and {j}; "
            "choose nearer pairs, or trace the row with view_factors."
        )
    # As for rows: a pair's own replicates, averaged with what the pairs of the same emitter show;
    # where hardly any line is blocked, or free, independent lines are the honest measure.
    variance = np.zeros(m)
    known = np.flatnonzero(np.isfinite(equal))
    seen = share[known] * equal[known]
    hidden = equal[known] - seen
    variance[known] = (seen + 2.0) * (hidden + 2.0) / (equal[known] + 4.0) ** 3
    many = known[(seen >= LEAST_HITS) & (hidden >= LEAST_HITS)]
    dof = REPLICATES - 1.0
    _, alike = np.unique(pairs[many, 0], return_inverse=True)
    gain = (PRIOR + dof * np.bincount(alike, own[many] / variance[many])) / (
        PRIOR + dof * np.bincount(alike)
    )
    variance[many] = (POOLED * gain[alike] * variance[many] + dof * own[many]) / (POOLED + dof)
    return share, np.sqrt(variance), blockers
