"""Exchange factors of a packing: who absorbs what a sphere emits, reflections included."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from greybed.core import InputError, Packing
from greybed.raytrace import _paths
from greybed.raytrace.arguments import whole_number
from greybed.raytrace.exchange_patches import patch_exchange
from greybed.raytrace.exchange_results import (
    ExchangeFactors,
    ExchangeRows,
    ImagePairs,
    PatchExchange,
    RayShares,
    error_of,
    outside_of,
    shares_of,
)
from greybed.raytrace.follow import Followed, follow_rays

Array = NDArray[np.float64]


def exchange_factors(
    packing: Packing,
    emissivity: ArrayLike | list[ArrayLike] = (0.3, 0.65, 0.8, 1.0),
    *,
    specular: ArrayLike = 0.0,
    wall_emissivity: ArrayLike = 1.0,
    wall_specular: ArrayLike = 0.0,
    rays: int = 10_000,
    seed: int = 0,
    threads: int | None = None,
    emitters: ArrayLike | None = None,
    max_distance: float = np.inf,
    images: bool = False,
    wall_rays: int = 0,
    show_progress: bool = False,
) -> ExchangeFactors:
    """Trace exchange (distribution) factors: absorption after any number of reflections.

    All emissivities share the paths of one trace: a surface that a path meets absorbs the share
    epsilon of what the path still carries, separately for each emissivity. Where a path carries
    less than 0.35 of its start it is absorbed whole with probability epsilon instead. Both
    are unbiased and lose nothing, so rows sum to one to round-off.

    Parameters
    ----------
    packing : Packing
        Spheres of any sizes, open or periodic, with planes and cylinders as walls.
    emissivity : float, or sequence of floats and (n,) arrays
        One set of factors for each entry, grey, 0.001 ... 1 [-]. An entry with n numbers holds
        one per sphere; a single such array goes into a list.
    specular : float or array_like, shape (n,)
        Share of the reflected part that is mirrored, 0 ... 1 [-]; the rest follows a cosine law.
    wall_emissivity : array_like, broadcast to (sets, n_walls)
        Of the walls, 0 ... 1 [-]; a diffuse wall with 0 is one that re-radiates locally.
    wall_specular : array_like, shape () or (n_walls,)
        As ``specular``, of the walls [-].
    rays : int
        Rays per sphere, at least 1 [-].
    seed : int
        Seed, at least 0.
    threads : int, optional
        Threads; all available ones by default. Does not change a bit of the result.
    emitters : array_like of int, optional
        Trace only from these spheres; the other rows are empty (walls, escape, spread: NaN).
    max_distance : float
        Light that meets nothing within it after start or reflection counts as escaped [m].
    images : bool
        Keep periodic images apart as well, in ``pairs``.
    wall_rays : int
        Rays from each wall that ends, too [-]; their rows are ``patches``. None by default.
    show_progress : bool
        Draw a progress bar on standard error.

    Returns
    -------
    ExchangeFactors

    Raises
    ------
    InputError
        For numbers out of range, shapes that disagree, walls that do not repeat along a periodic
        direction or cannot reflect, or a sphere wholly inside others.

    Notes
    -----
    Standard errors come from the sums and squares of what each ray left, after two more direct
    hits and two more misses: at emissivity 1 that is the error of :func:`view_factors`. Errors
    of summed images add in quadrature. Theory: Mahan, Radiation Heat Transfer (2002), and
    Modest & Mazumder, Radiative Heat Transfer, chapter on Monte Carlo (energy partitioning).

    Examples
    --------
    >>> pair = Packing([[0, 0, 0], [2, 0, 0]], 1.0)
    >>> black, grey = exchange_factors(pair, [1.0, 0.5], rays=20_000)
    >>> bool(black.factors[0, 1] > grey.factors[0, 1] > 0.5 * black.factors[0, 1])
    True
    """
    n = len(packing)
    sets = _sets(emissivity, n)
    wall_sets = _wall_sets(wall_emissivity, len(sets), packing.n_walls)
    optics: dict[str, Any] = {
        "specular": _share(specular, n, "specular"),
        "wall_specular": _share(wall_specular, packing.n_walls, "wall_specular"),
    }
    count = whole_number(wall_rays, "wall_rays", 0)
    patches: tuple[PatchExchange | None, ...] = (None,) * len(sets)
    if count:
        patches = patch_exchange(
            packing,
            sets,
            wall_sets,
            **optics,
            rays=count,
            seed=whole_number(seed, "seed", 0),
            threads=threads,
            max_distance=max_distance,
        )
    done = follow_rays(
        packing,
        sets,
        wall_sets,
        **optics,
        rays=rays,
        seed=seed,
        threads=threads,
        emitters=emitters,
        max_distance=max_distance,
        images=images,
        show_progress=show_progress,
    )
    return ExchangeFactors(
        tuple(
            _rows(packing, done, k, sets[k], wall_sets[k], images, patches[k])
            for k in range(len(sets))
        )
    )


def exchange_of_rays(
    packing: Packing,
    origins: ArrayLike,
    directions: ArrayLike,
    emissivity: ArrayLike | list[ArrayLike] = (0.3, 0.65, 0.8, 1.0),
    *,
    specular: ArrayLike = 0.0,
    wall_emissivity: ArrayLike = 1.0,
    wall_specular: ArrayLike = 0.0,
    seed: int = 0,
    max_distance: float = np.inf,
) -> tuple[RayShares, ...]:
    """Shares of spheres and walls in the energy of given rays, reflections included.

    With rays spread over a patch of a wall by a cosine law: the exchange factors of that patch.

    Parameters
    ----------
    packing : Packing
        Spheres and walls.
    origins, directions : array_like, shape (m, 3)
        Where the rays start, outside the spheres [m], and directions of any length [-].
    emissivity, specular, wall_emissivity, wall_specular, seed, max_distance
        As for :func:`exchange_factors`.

    Returns
    -------
    tuple of RayShares
        One for each emissivity.

    Raises
    ------
    InputError
        As for :func:`exchange_factors`, and for rays that are not finite.
    """
    n = len(packing)
    sets = _sets(emissivity, n)
    wall_sets = _wall_sets(wall_emissivity, len(sets), packing.n_walls)
    o = np.ascontiguousarray(origins, dtype=np.float64)
    d = np.array(directions, dtype=np.float64)
    if o.shape != d.shape or o.ndim != 2 or o.shape[1] != 3 or len(o) == 0:
        raise InputError(f"origins {o.shape} and directions {d.shape} must both be (m, 3), m > 0.")
    length = np.sqrt((d**2).sum(axis=1, keepdims=True))
    if not (np.isfinite(o).all() and np.isfinite(d).all() and (length > 0.0).all()):
        raise InputError("origins and directions must be finite, directions longer than zero.")
    done = follow_rays(
        packing,
        sets,
        wall_sets,
        specular=_share(specular, n, "specular"),
        wall_specular=_share(wall_specular, packing.n_walls, "wall_specular"),
        rays=len(o),
        seed=seed,
        free=(o, d / length),
        max_distance=max_distance,
    )
    return tuple(shares_of(done, k, sets[k], wall_sets[k]) for k in range(len(sets)))


def _sets(emissivity: ArrayLike | list[ArrayLike], n: int) -> Array:
    """Emissivities of all spheres, shape (sets, n)."""
    # Entries of different shapes make no array.
    listed = isinstance(emissivity, list | tuple)
    entries = list(emissivity) if listed else list(np.atleast_1d(np.asarray(emissivity)))  # type: ignore[arg-type]
    if not entries:
        raise InputError("emissivity is empty; give at least one value in 0.001 ... 1 [-].")
    sets = np.empty((len(entries), n))
    for k, entry in enumerate(entries):
        values = np.asarray(entry, dtype=np.float64)
        if values.shape not in ((), (n,)):
            raise InputError(
                f"emissivity[{k}] has shape {values.shape}; give one value or one per sphere, "
                f"shape ({n},)."
            )
        bad = ~((values >= _paths.LEAST_EMISSIVITY) & (values <= 1.0))
        if bad.any():
            raise InputError(
                f"emissivity[{k}] = {values[bad].flat[0]:g} [-] is outside "
                f"{_paths.LEAST_EMISSIVITY:g} ... 1: light between surfaces that hardly absorb "
                "never ends; take a larger one."
            )
        sets[k] = values
    return sets


def _wall_sets(wall_emissivity: ArrayLike, sets: int, n_walls: int) -> Array:
    values = np.asarray(wall_emissivity, dtype=np.float64)
    if values.ndim > 2 or (n_walls == 0 and values.ndim):
        raise InputError(f"wall_emissivity has shape {values.shape} for {n_walls} walls; mend it.")
    try:
        spread = np.array(np.broadcast_to(values, (sets, n_walls)))
    except ValueError:
        raise InputError(
            f"wall_emissivity has shape {values.shape}; give one value, one per wall ({n_walls},), "
            f"or one row per emissivity ({sets}, {n_walls})."
        ) from None
    if not ((values >= 0.0) & (values <= 1.0)).all():
        worst = values[~((values >= 0.0) & (values <= 1.0))].flat[0]
        raise InputError(f"wall_emissivity = {worst:g} [-] is outside 0 ... 1; mend it.")
    return spread


def _share(values: ArrayLike, n: int, name: str) -> Array:
    array = np.asarray(values, dtype=np.float64)
    if array.shape not in ((), (n,)):
        raise InputError(f"{name} has shape {array.shape}; give one value or {n} of them.")
    if not ((array >= 0.0) & (array <= 1.0)).all():
        worst = array[~((array >= 0.0) & (array <= 1.0))].flat[0]
        raise InputError(f"{name} = {worst:g} [-] is outside 0 ... 1; mend it.")
    return np.array(np.broadcast_to(array, (n,)))


def _rows(
    packing: Packing,
    done: Followed,
    k: int,
    emissivity: Array,
    walls: Array,
    images: bool,
    patches: PatchExchange | None,
) -> ExchangeRows:
    n, rays = len(packing), done.rays
    hit = (done.key >= 0) & (done.total[:, k] > 0.0)
    emitter, key = done.emitter[hit], done.key[hit]
    target, image = _paths.split_keys(key) if images else (key, None)
    factor = done.total[hit, k] / rays
    error = error_of(done.total[hit, k], done.square[hit, k], emissivity[target], rays)
    pairs = None if image is None else ImagePairs(emitter, target, image, factor, error)
    where, shape = (emitter, target), (n, n)
    variance = sparse.coo_array((error**2, where), shape=shape).tocsr()
    total, square = outside_of(done, k, n, walls)
    outer_error = error_of(total, square, np.append(walls, 1.0), rays)
    untraced = ~np.isfinite(done.buried)
    outer = total / rays
    outer[untraced] = np.nan
    outer_error[untraced] = np.nan
    # Sample variance of the mean, without pseudo-counts: a moment is no count.
    mean = done.moments[:, 0, k] / rays
    spread = np.sqrt(np.maximum(done.moments[:, 1, k] / rays - mean**2, 0.0) / max(rays - 1, 1))
    return ExchangeRows(
        factors=sparse.coo_array((factor, where), shape=shape).tocsr(),
        stderr=variance.sqrt(),
        wall_factors=outer[:, :-1],
        wall_stderr=outer_error[:, :-1],
        escaped=outer[:, -1],
        escaped_stderr=outer_error[:, -1],
        emissivity=emissivity,
        wall_emissivity=walls,
        areas=packing.areas * (1.0 - done.buried),
        buried=done.buried,
        spread=mean,
        spread_stderr=spread,
        pairs=pairs,
        patches=patches,
        cut=done.cut / (rays * max(int((~untraced).sum()), 1)),
        rays=rays,
        seed=done.seed,
        seconds=done.seconds,
    )
