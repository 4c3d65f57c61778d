"""Walls of a packing: planes, tubes, cones, discs, polygons and meshes, each a named patch."""

from __future__ import annotations

import math
from dataclasses import dataclass

from greybed.core.errors import InputError
from greybed.core.planar import Mesh, Polygon, box_walls
from greybed.core.vectors import Vector, above_zero, unit, vector

__all__ = ["Cone", "Cylinder", "Disc", "Mesh", "Plane", "Polygon", "Wall", "box_walls"]


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
        object.__setattr__(self, "point", vector(self.point, f"wall {self.name!r}: point [m]"))
        object.__setattr__(self, "normal", unit(self.normal, f"wall {self.name!r}: normal"))

    @property
    def area(self) -> float:
        """Infinite [m2]."""
        return math.inf


@dataclass(frozen=True)
class Cylinder:
    """Circular cylinder; the bed lies inside.

    Parameters
    ----------
    point : three floats
        Any point of the axis; of a bounded tube the middle of its first end [m].
    axis : three floats
        Direction of the axis, of any length [-].
    radius : float
        Inner radius, above zero [m].
    name : str
        Name of the patch in results and reports.
    length : float, optional
        Length of a tube from ``point`` along ``axis``, above zero [m]; it is open at both ends and
        rays meet it from inside and outside. Without it the cylinder is unbounded.
    """

    point: Vector
    axis: Vector
    radius: float
    name: str = "cylinder"
    length: float | None = None

    def __post_init__(self) -> None:
        what = f"wall {self.name!r}"
        object.__setattr__(self, "point", vector(self.point, f"{what}: point [m]"))
        object.__setattr__(self, "axis", unit(self.axis, f"{what}: axis"))
        above_zero(self.radius, f"{what}: radius", "the inner radius in metres")
        if self.length is not None:
            above_zero(self.length, f"{what}: length", "it in metres, or leave it out")

    @property
    def area(self) -> float:
        """Inner surface [m2]; infinite where the cylinder is unbounded."""
        return math.inf if self.length is None else 2.0 * math.pi * self.radius * self.length


@dataclass(frozen=True)
class Cone:
    """Side of a truncated cone, open at both ends; the bed lies inside.

    Parameters
    ----------
    point : three floats
        Middle of the first end [m].
    axis : three floats
        Direction from the first end to the other, of any length [-].
    radius, end_radius : float
        Inner radii at the first and at the other end, zero or above, one of them above zero [m].
    length : float
        Distance of the ends, above zero [m].
    name : str
        Name of the patch in results and reports.
    """

    point: Vector
    axis: Vector
    radius: float
    end_radius: float
    length: float
    name: str = "cone"

    def __post_init__(self) -> None:
        what = f"wall {self.name!r}"
        object.__setattr__(self, "point", vector(self.point, f"{what}: point [m]"))
        object.__setattr__(self, "axis", unit(self.axis, f"{what}: axis"))
        above_zero(self.length, f"{what}: length", "the distance of its ends in metres")
        for value, name in ((self.radius, "radius"), (self.end_radius, "end_radius")):
            if not (math.isfinite(value) and value >= 0.0):
                raise InputError(
                    f"{what}: {name} = {value!r} [m] must be finite and at least 0; give the inner "
                    "radius in metres."
                )
        above_zero(max(self.radius, self.end_radius), f"{what}: larger radius", "one above 0")

    @property
    def area(self) -> float:
        """Inner surface of the side [m2]."""
        slant = math.hypot(self.length, self.end_radius - self.radius)
        return math.pi * (self.radius + self.end_radius) * slant


@dataclass(frozen=True)
class Disc:
    """Flat disc, met from both sides; it radiates to the side that ``normal`` points to.

    Parameters
    ----------
    point : three floats
        Its middle [m].
    normal : three floats
        Direction into the bed, of any length [-].
    radius : float
        Radius, above zero [m].
    name : str
        Name of the patch in results and reports.
    """

    point: Vector
    normal: Vector
    radius: float
    name: str = "disc"

    def __post_init__(self) -> None:
        what = f"wall {self.name!r}"
        object.__setattr__(self, "point", vector(self.point, f"{what}: point [m]"))
        object.__setattr__(self, "normal", unit(self.normal, f"{what}: normal"))
        above_zero(self.radius, f"{what}: radius", "it in metres")

    @property
    def area(self) -> float:
        """Surface of one side [m2]."""
        return math.pi * self.radius**2


Wall = Plane | Cylinder | Cone | Disc | Polygon | Mesh
