"""Standard errors of traced factors: of independent rays, and of scrambled sequences."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

# Expected hits from which a sequence can gain on independent rays; below, each hit is a ray of
# its own and the binomial error holds.
LEAST_HITS = 8
# Weight of the pairs with as many hits, in degrees of freedom, beside a pair's own replicates.
POOLED = 15.0
# Weight of independent rays in the pool of few pairs.
PRIOR = 2.0


def standard_error(count: ArrayLike, rays: ArrayLike) -> Array:
    """Standard error of a hit fraction ``count / rays`` of independent rays [-].

    The binomial error after two more hits and two more misses (Agresti & Coull 1998,
    doi 10.1080/00031305.1998.10480550). It tends to sqrt(p (1 - p) / N) for large counts and,
    unlike it, stays honest for small ones: intervals of 1.96 errors hold the truth in 95 % of
    the cases from three expected hits up, and no hit does not claim certainty.
    """
    k, n = np.asarray(count, dtype=np.float64), np.asarray(rays, dtype=np.float64)
    return np.sqrt((k + 2.0) * (n - k + 2.0) / (n + 4.0)) / (n + 4.0)


def sequence_error(
    emitter: ArrayLike, count: ArrayLike, squares: ArrayLike, rays: int, replicates: int
) -> Array:
    """Standard errors of hit fractions from independent replicates of a sequence [-].

    Parameters
    ----------
    emitter : (m,) int array
        Which sphere the rays of each pair come from.
    count : (m,) int array
        Hits of each pair, over all replicates.
    squares : (m,) int array
        Sum of the squares of the replicates' hits.
    rays : int
        Rays of each emitter.
    replicates : int
        Replicates, independent of each other.

    Returns
    -------
    ndarray, shape (m,)
        Errors above zero.

    Notes
    -----
    Sixteen replicates know their own spread to 18 %. So it is averaged with what pairs of the same
    emitter with as many hits (within a factor of two) have on average, relative to the binomial
    variance; each row stands for itself, whatever else is traced.
    """
    k = np.asarray(count, dtype=np.float64)
    binomial = standard_error(k, rays) ** 2
    if replicates < 4:
        return np.sqrt(binomial)
    dof = replicates - 1.0
    own = (np.asarray(squares, dtype=np.float64) - k**2 / replicates) * replicates / dof / rays**2
    many = np.flatnonzero(k >= LEAST_HITS)
    level = np.log2(k[many]).astype(np.int64)
    _, alike = np.unique(np.asarray(emitter)[many] * 64 + level, return_inverse=True)
    relative = own[many] / binomial[many]
    gain = (PRIOR + dof * np.bincount(alike, relative)) / (PRIOR + dof * np.bincount(alike))
    variance = binomial.copy()
    pooled = POOLED * gain[alike] * binomial[many]
    variance[many] = (pooled + dof * own[many]) / (POOLED + dof)
    return np.sqrt(variance)
