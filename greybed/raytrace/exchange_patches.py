"""Exchange factors of walls: where what a wall emits is absorbed, reflections included."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from greybed.core import InputError, Packing
from greybed.raytrace import _emission, _kernels
from greybed.raytrace.arguments import whole_number
from greybed.raytrace.exchange_results import PatchExchange, RayShares, shares_of
from greybed.raytrace.follow import follow_rays
from greybed.raytrace.scene import Scene

Array = NDArray[np.float64]

MOST_RAYS = 10**9
# Sets these streams apart from all others that the same seed gives.
_STREAM = 0x57A11


def patch_exchange(
    packing: Packing,
    emissivity: Array,
    wall_emissivity: Array,
    *,
    specular: Array,
    wall_specular: Array,
    rays: int,
    seed: int,
    threads: int | None = None,
    max_distance: float = np.inf,
) -> tuple[PatchExchange, ...]:
    """Rows of the walls that end, for each set of emissivities.

    Parameters
    ----------
    packing : Packing
        Spheres and walls.
    emissivity, wall_emissivity : ndarray, shapes (sets, n) and (sets, n_walls)
        Checked by :func:`greybed.raytrace.exchange_factors` [-].
    specular, wall_specular : ndarray, shapes (n,) and (n_walls,)
        Mirrored shares of what is reflected [-].
    rays : int
        Rays started from each wall, at least 1 [-]; those inside spheres are not counted.
    seed : int
        Seed, at least 0; the same bits on any number of threads.
    threads : int, optional
        Threads; all available ones by default.
    max_distance : float
        Of each flight [m].

    Returns
    -------
    tuple of PatchExchange

    Raises
    ------
    InputError
        For numbers out of range, no wall that ends, or one wholly inside spheres.
    """
    rays = whole_number(rays, "wall_rays", 1, MOST_RAYS)
    n, walls, sets = len(packing), packing.n_walls, len(emissivity)
    tables = _emission.emitters(packing.walls)
    finite = np.flatnonzero(np.isfinite(tables.area))
    if not len(finite):
        raise InputError(
            f"{packing.source}: no wall has an end, so none can emit; leave out wall_rays, or give "
            "bounded walls."
        )
    scene = Scene.of(packing)
    found: list[list[RayShares | None]] = [[None] * walls for _ in range(sets)]
    areas = np.full(walls, np.inf)
    buried = np.full(walls, np.nan)
    for wall in finite:
        source = np.random.SeedSequence([seed, int(wall), _STREAM])
        start = np.empty((rays, 6))
        numbers = np.random.Generator(np.random.PCG64(source)).random((rays, 4))
        _emission.emit_many(wall, numbers, tables, start)
        origins, directions = start[:, :3].copy(), start[:, 3:].copy()
        inside = np.empty(rays, dtype=bool)
        _kernels.inside_spheres(origins, scene.tables.grid, inside)
        if inside.all():
            name = packing.walls[int(wall)].name
            raise InputError(f"wall {name!r} lies wholly inside spheres; move it or remove them.")
        buried[wall] = inside.mean()
        areas[wall] = tables.area[wall] * (1.0 - buried[wall])
        done = follow_rays(
            packing,
            emissivity,
            wall_emissivity,
            specular=specular,
            wall_specular=wall_specular,
            rays=int((~inside).sum()),
            seed=int(source.generate_state(2, np.uint32)[1]),
            threads=threads,
            free=(origins[~inside], directions[~inside]),
            max_distance=max_distance,
            scene=scene,
        )
        for k in range(sets):
            found[k][wall] = shares_of(done, k, emissivity[k], wall_emissivity[k])
    return tuple(_joined(found[k], n, wall_emissivity[k], areas, buried, rays) for k in range(sets))


def _joined(
    shares: list[RayShares | None],
    n: int,
    emissivity: Array,
    areas: Array,
    buried: Array,
    rays: int,
) -> PatchExchange:
    """The rows of all walls in matrices; those of walls without end are empty or NaN."""
    walls = len(shares)
    empty, absent = np.zeros(n), np.full(walls, np.nan)

    def stack(name: str, instead: Array) -> Array:
        rows = [instead if share is None else getattr(share, name) for share in shares]
        return np.array(rows, dtype=np.float64)

    factors = stack("factors", empty)
    row, column = np.nonzero(factors)
    where, shape = (row, column), (walls, n)
    return PatchExchange(
        factors=sparse.csr_array((factors[where], where), shape=shape),
        stderr=sparse.csr_array((stack("stderr", empty)[where], where), shape=shape),
        wall_factors=stack("wall_factors", absent),
        wall_stderr=stack("wall_stderr", absent),
        escaped=stack("escaped", np.array(np.nan)),
        escaped_stderr=stack("escaped_stderr", np.array(np.nan)),
        emissivity=emissivity,
        areas=areas,
        buried=buried,
        rays=rays,
    )
