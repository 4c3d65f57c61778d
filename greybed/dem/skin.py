"""How far beyond contact pairs are listed: wide where particles move fast, thin where they rest."""

from __future__ import annotations

import math

# Skins over the mean radius.
AT_START, LEAST, MOST = 0.25, 0.02, 0.5
# To list a particle anew takes as long as to look at so many pairs in a step; a skin as wide as a
# radius adds so many pairs to each particle. Both measured in settled beds of 20,000 spheres.
RENEWAL, PAIRS = 160.0, 4.5
# Steps between two looks at whether the skin is too wide.
LOOK = 256
# A skin that should be narrower than this share of itself is worth a renewal.
TOO_WIDE = 0.7


def best_skin(way: float, radius: float) -> float:
    """Skin with the least work per step [m].

    A skin s costs ``PAIRS s / radius`` looks at pairs in each step, and ``RENEWAL`` in every
    ``s / way`` steps.

    Parameters
    ----------
    way : float
        By which the two fastest particles may have come nearer to each other in a step [m].
    radius : float
        Mean radius [m].
    """
    best = math.sqrt(way * radius * RENEWAL / PAIRS)
    return min(max(best, LEAST * radius), MOST * radius)
