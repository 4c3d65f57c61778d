"""Walls of a packing: unbounded planes and circular cylinders, each one a patch with a name."""

from __future__ import annotations

import math
from dataclasses import dataclass

from greybed.core.errors import InputError

Vector = tuple[float, float, float]


def _vector(values: object, what: str) -> Vector:
    try:
        x, y, z = (float(v) for v in values)  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        raise InputError(f"{what} = {values!r} is not a vector; give three numbers.") from None
    if not all(map(math.isfinite, (x, y, z))):
        raise InputError(f"{what} = {values!r} is not finite; give three finite numbers.")
    return x, y, z


def _unit(values: object, what: str) -> Vector:
    x, y, z = _vector(values, what)
    length = math.sqrt(x * x + y * y + z * z)
    if length == 0.0:
        raise InputError(f"{what} = {values!r} has no length; give a direction.")
    return x / length, y / length, z / length


@dataclass(frozen=True)
class Plane:
    """Unbounded plane; the bed lies on the side that ``normal`` points to.

    Parameters
    ----------
    point : three floats
        Any point of the plane [m].
    normal : three floats
        Direction into the bed, of any length [-].
    name : str
        Name of the patch in results and reports.
    """

    point: Vector
    normal: Vector
    name: str = "plane"

    def __post_init__(self) -> None:
        object.__setattr__(self, "point", _vector(self.point, f"wall {self.name!r}: point [m]"))
        object.__setattr__(self, "normal", _unit(self.normal, f"wall {self.name!r}: normal"))


@dataclass(frozen=True)
class Cylinder:
    """Unbounded circular cylinder; the bed lies inside.

    Parameters
    ----------
    point : three floats
        Any point of the axis [m].
    axis : three floats
        Direction of the axis, of any length [-].
    radius : float
        Inner radius, above zero [m].
    name : str
        Name of the patch in results and reports.
    """

    point: Vector
    axis: Vector
    radius: float
    name: str = "cylinder"

    def __post_init__(self) -> None:
        object.__setattr__(self, "point", _vector(self.point, f"wall {self.name!r}: point [m]"))
        object.__setattr__(self, "axis", _unit(self.axis, f"wall {self.name!r}: axis"))
        if not (math.isfinite(self.radius) and self.radius > 0.0):
            raise InputError(
                f"wall {self.name!r}: radius = {self.radius!r} [m] must be finite and above 0; "
                "give the inner radius in metres."
            )


Wall = Plane | Cylinder
