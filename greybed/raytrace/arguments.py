"""Checks of the arguments that every trace takes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.core import InputError


def whole_number(value: int, name: str, least: int, most: int = 2**63 - 1) -> int:
    """A whole number between two bounds, or a refusal that says so."""
    if not least <= value <= most or value != int(value):
        raise InputError(
            f"{name} = {value!r} must be a whole number of at least {least} and at most {most}; "
            "mend it."
        )
    return int(value)


def sphere_numbers(emitters: ArrayLike) -> NDArray[np.int64]:
    """Numbers of spheres; a mask is refused."""
    given = np.asarray(emitters)
    if given.size == 0:
        raise InputError("emitters is empty; leave it out to trace from all spheres.")
    if given.dtype.kind not in "iu":  # a mask would silently mean the spheres 0 and 1
        raise InputError(
            f"emitters of type {given.dtype} must be sphere numbers; for a mask give "
            "np.flatnonzero(mask)."
        )
    return given.astype(np.int64)
