"""Containers of random packings: boxes and cylinders that are sized by the solid they hold."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from greybed.core.errors import InputError
from greybed.core.packing import Packing
from greybed.core.walls import Cylinder, Plane, Wall

Array = NDArray[np.float64]


def _check_positive(what: str, *values: float) -> None:
    for value in values:
        if not (math.isfinite(value) and value > 0.0):
            raise InputError(f"{what} = {value:g} must be finite and above 0; mend it.")


def _plane_walls(lengths: Array, axes: tuple[int, ...]) -> tuple[Wall, ...]:
    """Two facing planes for each axis: floor and lid along z, else x_low, x_high, y_low, y_high."""
    walls: list[Wall] = []
    for axis in axes:
        low, high = ("floor", "lid") if axis == 2 else (f"{'xy'[axis]}_low", f"{'xy'[axis]}_high")
        normal = [0.0, 0.0, 0.0]
        normal[axis] = 1.0
        point = [0.0, 0.0, 0.0]
        point[axis] = float(lengths[axis])
        walls.append(Plane((0.0, 0.0, 0.0), (normal[0], normal[1], normal[2]), low))
        walls.append(
            Plane((point[0], point[1], point[2]), (-normal[0], -normal[1], -normal[2]), high)
        )
    return tuple(walls)


@dataclass(frozen=True, kw_only=True)
class PeriodicBox:
    """Box that repeats in x and y, and in z too unless it has a floor and a lid.

    Its lower corner is the origin.
    """

    aspect: tuple[float, float, float] = (1.0, 1.0, 1.0)  # relative edge lengths [-]
    floor_and_lid: bool = False  # walls instead of a repeat along z

    def __post_init__(self) -> None:
        _check_positive("aspect [-]", *self.aspect)

    @property
    def periodic(self) -> tuple[bool, bool, bool]:
        """Which directions repeat."""
        return True, True, not self.floor_and_lid

    def lengths(self, volume: float) -> Array:
        """Edges of the box that holds ``volume`` [m3], shape (3,) [m]."""
        aspect = np.array(self.aspect)
        return aspect * np.cbrt(volume / aspect.prod())

    def walls(self, lengths: Array) -> tuple[Wall, ...]:
        """Walls of the container with bounding edges ``lengths`` (3,) [m]."""
        return _plane_walls(lengths, (2,) if self.floor_and_lid else ())

    def __str__(self) -> str:
        return "a periodic box" + (" with floor and lid" if self.floor_and_lid else "")


@dataclass(frozen=True, kw_only=True)
class Box:
    """Box of six plane walls; its lower corner is the origin."""

    aspect: tuple[float, float, float] = (1.0, 1.0, 1.0)  # relative edge lengths [-]
    base: tuple[float, float] | None = None  # edges in x and y [m]; the height follows

    def __post_init__(self) -> None:
        _check_positive("aspect [-]", *self.aspect)
        if self.base is not None:
            _check_positive("base [m]", *self.base)

    @property
    def periodic(self) -> tuple[bool, bool, bool]:
        """Which directions repeat: none."""
        return False, False, False

    def lengths(self, volume: float) -> Array:
        """Edges of the box that holds ``volume`` [m3], shape (3,) [m]."""
        if self.base is not None:
            return np.array([*self.base, volume / (self.base[0] * self.base[1])])
        aspect = np.array(self.aspect)
        return aspect * np.cbrt(volume / aspect.prod())

    def walls(self, lengths: Array) -> tuple[Wall, ...]:
        """Walls of the container with bounding edges ``lengths`` (3,) [m]."""
        return _plane_walls(lengths, (0, 1, 2))

    def __str__(self) -> str:
        base = "" if self.base is None else f" of base {self.base[0]:g} x {self.base[1]:g} m"
        return f"a walled box{base}"


@dataclass(frozen=True, kw_only=True)
class CylinderContainer:
    """Upright circular cylinder around the z axis, with a flat floor at z = 0 and a flat lid."""

    radius: float | None = None  # inner radius [m]; the height follows
    aspect: float = 1.0  # height over diameter where no radius is given [-]

    def __post_init__(self) -> None:
        _check_positive("aspect [-]", self.aspect)
        if self.radius is not None:
            _check_positive("container radius [m]", self.radius)

    @property
    def periodic(self) -> tuple[bool, bool, bool]:
        """Which directions repeat: none."""
        return False, False, False

    def lengths(self, volume: float) -> Array:
        """Diameter twice and height of the cylinder that holds ``volume`` [m3], shape (3,) [m]."""
        radius = self.radius
        if radius is None:
            radius = float(np.cbrt(volume / (2.0 * np.pi * self.aspect)))
        return np.array([2.0 * radius, 2.0 * radius, volume / (np.pi * radius**2)])

    def walls(self, lengths: Array) -> tuple[Wall, ...]:
        """Walls of the container with bounding edges ``lengths`` (3,) [m]."""
        side = Cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.5 * float(lengths[0]), "cylinder")
        return (side, *_plane_walls(lengths, (2,)))

    def __str__(self) -> str:
        radius = "" if self.radius is None else f" of radius {self.radius:g} m"
        return f"a cylinder{radius}"


Container = PeriodicBox | Box | CylinderContainer


def solid_fraction_between_walls(packing: Packing) -> float:
    """Sphere volume over the volume between the walls of a generated packing [-].

    Equals ``packing.solid_fraction`` in a box; in a cylinder it counts the cylinder, not the box
    around it. The box must end at the walls, as that of :func:`random_packing` does.
    """
    volume = float(np.prod(packing.edges))
    for wall in packing.walls:
        if isinstance(wall, Cylinder):
            volume = np.pi * wall.radius**2 * float(packing.edges[2])
    return packing.sphere_volume / volume


def wall_overlap(packing: Packing) -> float:
    """Deepest overlap of a sphere with a wall, over its radius [-]; 0 where none overlaps."""
    deepest = 0.0
    for wall in packing.walls:
        if isinstance(wall, Plane):
            gap = (packing.centres - np.array(wall.point)) @ np.array(wall.normal)
        elif isinstance(wall, Cylinder) and wall.length is None:
            away, axis = packing.centres - np.array(wall.point), np.array(wall.axis)
            gap = wall.radius - np.linalg.norm(away - np.outer(away @ axis, axis), axis=1)
        else:
            from greybed.core.patches import distances

            gap = distances([wall], packing.centres)
        deepest = max(deepest, float(((packing.radii - gap) / packing.radii).max()))
    return deepest
