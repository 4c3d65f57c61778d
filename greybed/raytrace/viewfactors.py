"""View factors of a packing by Monte Carlo: sparse, with a standard error for every factor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from greybed.core import InputError, Packing
from greybed.raytrace import _kernels, tally
from greybed.raytrace.errors import sequence_error, standard_error
from greybed.raytrace.scene import Scene
from greybed.raytrace.smoothing import smoothed

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ViewFactors:
    """View factors F_ij: the fraction of the radiation leaving i that reaches j directly.

    Attributes
    ----------
    factors : csr_array, shape (n, n)
        Sphere to sphere [-], periodic images summed. Row i, all ``wall_factors[i]``,
        ``escaped[i]`` and ``environment[i]`` add up to one.
    stderr : csr_array, shape (n, n)
        Standard errors of ``factors`` [-], same pattern.
    wall_factors, wall_stderr : ndarray, shape (n, n_walls)
        Sphere to wall, in the order of ``packing.walls`` [-].
    escaped, escaped_stderr : ndarray, shape (n,)
        Fraction that leaves the bed, and its standard error [-].
    environment, environment_stderr : ndarray, shape (n,)
        Fraction still under way inside the bed at the distance limit, and its standard error [-];
        0 without a limit. It belongs to the surroundings of the sphere: solvers give it the local
        mean, see :func:`greybed.core.rows.localised`.
    buried : ndarray, shape (n,)
        Fraction of the surface inside other spheres or walls [-]. Rays start on the rest.
    areas : ndarray, shape (n,)
        Exposed surface 4 pi r^2 (1 - buried) [m2]: with it ``A_i F_ij = A_j F_ji`` holds within
        the errors.
    rays : int
        Rays per sphere, at least [-].
    seed : int
        Seed of the random streams.
    seconds : float
        Wall time [s].
    cost : ndarray of int, shape (n,)
        Rays and lines that each row cost; a pair's lines count half for either sphere [-].
    reciprocal : bool
        Whether both directions of each pair are one estimate already.
    """

    factors: sparse.csr_array
    stderr: sparse.csr_array
    wall_factors: Array
    wall_stderr: Array
    escaped: Array
    escaped_stderr: Array
    environment: Array
    environment_stderr: Array
    buried: Array
    areas: Array
    rays: int
    seed: int
    seconds: float
    cost: NDArray[np.int64]
    reciprocal: bool = False


def view_factors(
    packing: Packing,
    *,
    rays: int = 10_000,
    rel_error: float | None = None,
    least: float = 1e-3,
    seed: int = 0,
    threads: int | None = None,
    emitters: ArrayLike | None = None,
    max_distance: float = np.inf,
    sampling: str = "sobol",
    smooth: bool = False,
    scene: Scene | None = None,
    device: str = "cpu",
    show_progress: bool = False,
) -> ViewFactors:
    """Trace the view factors of a packing.

    Rays leave each sphere's exposed surface with a cosine law and end at the first sphere or
    wall. Every ray draws from its own random stream, so a seed gives the same bits on any number
    of threads.

    Parameters
    ----------
    packing : Packing
        Spheres of any sizes, open or periodic, with planes and cylinders as walls.
    rays : int
        Rays per sphere, at least 1 [-].
    rel_error : float, optional
        Relative standard error wanted of every factor of ``least`` or more, above 0 [-]. Rows
        are traced with ``rays`` rays first; then pairs one by one, and rows once more where walls,
        opening or overlapping pairs need it (see :mod:`greybed.raytrace.adaptive`).
    least : float
        Smallest factor that ``rel_error`` holds for, between 0 and 1 [-].
    seed : int
        Seed, at least 0.
    threads : int, optional
        Threads; all available ones by default.
    emitters : array_like of int, optional
        Trace only from these spheres; the other rows are empty (walls, escape: NaN).
    max_distance : float
        Rays that meet nothing within it end there and count as ``environment``, or as ``escaped``
        where they have left the bed by then [m].
    sampling : {"sobol", "random"}
        Scrambled quasi-random rays, or independent ones.
    smooth : bool
        Make the factors reciprocal and the rows add up to one, see
        :func:`greybed.raytrace.smoothed`.
    scene : Scene, optional
        That of the packing, where it is built already: for calls with a few emitters each.
    device : {"cpu", "cuda"}
        Where rays are traced: on the processor, or on an NVIDIA GPU, which needs
        ``pip install 'greybed[gpu]'``. A ray that grazes may end differently there, by rounding.
    show_progress : bool
        Draw a progress bar on standard error.

    Returns
    -------
    ViewFactors

    Raises
    ------
    InputError
        For numbers out of range, walls that do not repeat along a periodic direction, a sphere
        wholly inside others, or a device that is not there.

    Notes
    -----
    Overlaps: surface inside another sphere or behind a wall neither emits nor receives; factors
    refer to the exposed surface. See ``docs/overlaps.md``.

    Examples
    --------
    >>> pair = Packing([[0, 0, 0], [2, 0, 0]], 1.0)
    >>> result = view_factors(pair, rays=100_000)
    >>> bool(abs(result.factors[0, 1] - 0.0755868) < 4 * result.stderr[0, 1])
    True
    """
    if rel_error is not None:
        from greybed.raytrace.adaptive import refined

        if emitters is not None:
            raise InputError("rel_error refines all rows; leave out emitters, or give rays.")
        if device != "cpu":
            raise InputError(
                f"rel_error measures pairs on the processor only; device = {device!r} needs rays "
                "instead, or leave device out."
            )
        result = refined(
            packing, rel_error, least, rays=rays, seed=seed, threads=threads,
            max_distance=max_distance, show_progress=show_progress,
        )  # fmt: skip
        return smoothed(result) if smooth else result
    counts = tally.trace(
        packing,
        rays=rays,
        seed=seed,
        threads=threads,
        emitters=emitters,
        max_distance=max_distance,
        sampling=sampling,
        scene=scene,
        device=device,
        show_progress=show_progress,
    )
    if sampling == "sobol":
        error = sequence_error(
            counts.emitter, counts.count, counts.squares, counts.rays, counts.replicates
        )
    else:
        error = standard_error(counts.count, counts.rays)
    n = len(packing)
    traced = np.isfinite(counts.buried)
    to_sphere = counts.key >= 0
    start = np.searchsorted(counts.emitter[to_sphere], np.arange(n + 1))
    index = counts.key[to_sphere]
    hits = counts.count[to_sphere]
    shape = (n, n)
    factors = sparse.csr_array((hits / counts.rays, index, start), shape=shape)
    errors = sparse.csr_array((error[to_sphere], index, start), shape=shape)
    # Walls, then what leaves, then what the limit ends: a column each.
    inside = counts.key < 0
    column = -1 - counts.key
    column[counts.key == _kernels.ESCAPED] = packing.n_walls
    column[counts.key == _kernels.ENVIRONMENT] = packing.n_walls + 1
    outside = np.full((n, packing.n_walls + 2), np.nan)
    outside[traced] = 0.0
    outside[counts.emitter[inside], column[inside]] = counts.count[inside] / counts.rays
    out_error = np.where(traced[:, None], standard_error(0, counts.rays), outside)
    out_error[counts.emitter[inside], column[inside]] = error[inside]
    if np.isinf(max_distance):
        out_error[traced, -1] = 0.0
    result = ViewFactors(
        factors=factors,
        stderr=errors,
        wall_factors=outside[:, :-2],
        wall_stderr=out_error[:, :-2],
        escaped=outside[:, -2],
        escaped_stderr=out_error[:, -2],
        environment=outside[:, -1],
        environment_stderr=out_error[:, -1],
        buried=counts.buried,
        areas=packing.areas * (1.0 - counts.buried),
        rays=counts.rays,
        seed=seed,
        seconds=counts.seconds,
        cost=np.where(traced, counts.rays, 0),
    )
    return smoothed(result) if smooth else result
