"""Checked vectors and lengths of geometric input: three finite numbers, directions of length 1."""

from __future__ import annotations

import math

from greybed.core.errors import InputError

Vector = tuple[float, float, float]


def vector(values: object, what: str) -> Vector:
    """Three finite numbers.

    Raises
    ------
    InputError
        If ``values`` is something else; ``what`` names it.
    """
    try:
        x, y, z = (float(v) for v in values)  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        raise InputError(f"{what} = {values!r} is not a vector; give three numbers.") from None
    if not all(map(math.isfinite, (x, y, z))):
        raise InputError(f"{what} = {values!r} is not finite; give three finite numbers.")
    return x, y, z


def unit(values: object, what: str) -> Vector:
    """Direction scaled to length 1.

    Raises
    ------
    InputError
        If ``values`` is no vector or has no length.
    """
    x, y, z = vector(values, what)
    length = math.sqrt(x * x + y * y + z * z)
    if length == 0.0:
        raise InputError(f"{what} = {values!r} has no length; give a direction.")
    return x / length, y / length, z / length


def above_zero(value: float, what: str, give: str) -> float:
    """A finite number above zero.

    Raises
    ------
    InputError
        If it is not; ``give`` says what to give.
    """
    if not (math.isfinite(value) and value > 0.0):
        raise InputError(f"{what} = {value!r} [m] must be finite and above 0; give {give}.")
    return value
