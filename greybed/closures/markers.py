"""Markers, the dimensionless inputs of closures: their names, meanings and hard ranges."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.core.errors import RangeError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Marker:
    """One input of a closure.

    Attributes
    ----------
    name, meaning : str
        Keyword of ``evaluate`` and what it stands for.
    low, high : float
        Hard range [-]; ``low_open`` excludes the lower end.
    free : float, optional
        Value where there is nothing to correct; None where it says nothing of that.
    typical : (float, float), optional
        Range to draw from when limits are checked; None where others say it.
    """

    name: str
    meaning: str
    low: float
    high: float
    low_open: bool = False
    free: float | None = None
    typical: tuple[float, float] | None = None


def checked_markers(known: Sequence[Marker], given: Mapping[str, ArrayLike]) -> dict[str, Array]:
    """The markers of a closure as arrays of one shape, in its order.

    Raises
    ------
    RangeError
        If one is missing, unknown, not finite or out of its hard range.
    """
    names = [marker.name for marker in known]
    missing, unknown = sorted(set(names) - set(given)), sorted(set(given) - set(names))
    if missing or unknown:
        raise RangeError(
            f"this closure takes the markers {', '.join(names)}; missing: "
            f"{', '.join(missing) or 'none'}, unknown: {', '.join(unknown) or 'none'}: give those, "
            "or take a closure with other markers."
        )
    arrays = np.broadcast_arrays(*(np.asarray(given[name], dtype=np.float64) for name in names))
    for marker, value in zip(known, arrays, strict=True):
        bad = ~np.isfinite(value) | (value > marker.high)
        bad |= (value <= marker.low) if marker.low_open else (value < marker.low)
        if bad.any():
            at = np.unravel_index(int(bad.argmax()), bad.shape)
            place = f"[{', '.join(map(str, at))}]" if at else ""
            raise RangeError(
                f"{marker.name}{place} = {value[at]:g} [-] ({marker.meaning}) must lie in "
                f"{'(' if marker.low_open else '['}{marker.low:g}, {marker.high:g}]; "
                "check how the markers were made."
            )
    return dict(zip(names, arrays, strict=True))
