"""Rows of a data set beside pairs of spheres: spheres and walls, exchange by reflections."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from greybed.closures.viewfactor import MARKER_SETS, exact_view_factor, neighbourhood
from greybed.closures.viewfactor.bed import inner_fraction, near_reach
from greybed.closures.viewfactor.walls import wall_distance, wall_markers
from greybed.core import Packing
from greybed.raytrace import exchange_factors, view_factors
from greybed.raytrace.tally import image_keys, trace

Array = NDArray[np.float64]

RESULTS = ("exact", "factor", "stderr", "weight")
WALL_MARKERS = MARKER_SETS["wall"].names
WALL_COLUMNS = (*WALL_MARKERS, *RESULTS)
EXCHANGE_MARKERS = MARKER_SETS["exchange"].names
EXCHANGE_COLUMNS = (*EXCHANGE_MARKERS, *RESULTS)
# One trace of reflecting paths serves all of them.
EMISSIVITIES = (0.2, 0.4, 0.6, 0.8, 0.95)
# Paths with reflections cost several rays each, and every pair is there at each emissivity.
FEWER_EMITTERS, FEWER_RAYS = 4, 4
EXCHANGE_REACH = 8.0  # [mean radii]
SPARSE_SHARE = 0.3  # of the pairs further apart than half of it


def wall_rows_of(packing: Packing, emitters: int, rays: int, seed: int) -> dict[str, Array]:
    """Trace the spheres near walls and give a row for every (emitter, wall)."""
    if not packing.walls:
        return {name: np.empty(0) for name in WALL_COLUMNS}
    phi = inner_fraction(packing)
    reach = near_reach(packing, phi)
    everyone = np.arange(len(packing))
    # Nobody deep in the bed sees a wall; there are three emitters here for one of the pairs.
    near = np.min(
        [wall_distance(packing, w, everyone) / packing.radii for w in packing.walls], axis=0
    )
    rng = np.random.default_rng([seed, 1])
    weight = np.exp(-0.3 * near)
    some = min(3 * emitters, len(packing))
    who = np.sort(rng.choice(len(packing), some, replace=False, p=weight / weight.sum()))
    m = wall_markers(packing, neighbourhood(packing, reach, who), reach, phi, sparing=False)
    traced = view_factors(packing, rays=rays, seed=seed + 1, emitters=who)
    columns = {name: getattr(m, name).ravel() for name in WALL_MARKERS} | {
        "exact": m.wall_share.ravel(),
        "factor": traced.wall_factors[who].ravel(),
        "stderr": traced.wall_stderr[who].ravel(),
        "weight": np.ones(m.wall_share.size),
    }
    seen = columns["wall_share"] > 1e-6
    return {name: column[seen] for name, column in columns.items()}


def exchange_rows_of(packing: Packing, emitters: int, rays: int, seed: int) -> dict[str, Array]:
    """Trace paths with reflections in a periodic bed and give a row for every pair, emissivity."""
    if packing.walls:
        return {name: np.empty(0) for name in EXCHANGE_COLUMNS}
    rng = np.random.default_rng([seed, 2])
    some = max(1, min(emitters // FEWER_EMITTERS, len(packing)))
    share = packing.areas / packing.areas.sum()
    who = np.sort(rng.choice(len(packing), some, replace=False, p=share))
    reach = EXCHANGE_REACH * float(packing.radii.mean())
    hood = neighbourhood(packing, reach, who)
    kept = np.where(hood.distance > 0.5 * reach, SPARSE_SHARE, 1.0)
    chosen = hood.within & (rng.random(len(kept)) < kept)
    owner, sphere = hood.owner[chosen], hood.sphere[chosen]
    key = image_keys(sphere, hood.image[chosen])
    r_i, r_j = packing.radii[owner], packing.radii[sphere]
    distance = np.maximum(hood.distance[chosen], r_i + r_j)
    free = exact_view_factor(r_i, r_j, distance)
    tally = trace(packing, rays=rays, seed=seed, emitters=who, images=True)
    direct = _matched(owner, key, tally.emitter, tally.key, tally.count / rays)
    grey = exchange_factors(
        packing, EMISSIVITIES, rays=max(100, rays // FEWER_RAYS), seed=seed + 2, emitters=who,
        images=True,
    )  # fmt: skip
    visible = np.clip(direct / free, 0.0, 1.0)
    phi = np.full(len(key), inner_fraction(packing))
    parts = []
    for emissivity, rows in zip(EMISSIVITIES, grey, strict=True):
        assert rows.pairs is not None
        found = rows.pairs
        there = image_keys(found.target, found.image)
        markers = {
            "radius_over_distance": r_j / distance,
            "radius_ratio": r_j / r_i,
            "visible_share": visible,
            "emissivity": np.full(len(key), emissivity),
            "solid_fraction": phi,
        }
        parts.append(
            markers
            | {
                "exact": MARKER_SETS["exchange"].exact(markers),
                "factor": _matched(owner, key, found.emitter, there, found.factor),
                # What no path reached is known to a path of the mean weight.
                "stderr": _matched(
                    owner, key, found.emitter, there, found.stderr, float(found.stderr.min())
                ),
                "weight": 1.0 / kept[chosen],
            }
        )
    return {name: np.concatenate([part[name] for part in parts]) for name in EXCHANGE_COLUMNS}


def _matched(
    owner: NDArray[np.int64],
    key: NDArray[np.int64],
    emitter: NDArray[np.int64],
    there: NDArray[np.int64],
    values: Array,
    missing: float = 0.0,
) -> Array:
    """Values of the pairs (owner, key) among those of (emitter, there); ``missing`` where none."""
    result = np.full(len(key), missing)
    for i in np.unique(owner):
        mine = np.flatnonzero(emitter == i)
        order = mine[np.argsort(there[mine])]
        if not len(order):
            continue
        wanted = owner == i
        at = np.minimum(np.searchsorted(there[order], key[wanted]), len(order) - 1)
        hit = there[order][at] == key[wanted]
        result[wanted] = np.where(hit, values[order][at], missing)
    return result
