"""Walls of a case file: one table for every kind of shape, to which rooms add what they need."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from greybed.core.config import quantity, vector
from greybed.core.walls import Cone, Cylinder, Disc, Plane, Polygon, Wall


@dataclass(frozen=True, kw_only=True)
class PlaneShape:
    """``[[wall]]`` with ``kind = "plane"``."""

    name: str
    point: tuple[float, float, float] = vector("length", (0.0, 0.0, 0.0))  # [m]
    normal: tuple[float, float, float] = vector("dimensionless")  # into the bed, any length [-]

    def wall(self) -> Wall:
        """The wall itself."""
        return Plane(self.point, self.normal, self.name)


@dataclass(frozen=True, kw_only=True)
class CylinderShape:
    """``[[wall]]`` with ``kind = "cylinder"``; the bed is inside."""

    name: str
    point: tuple[float, float, float] = vector("length", (0.0, 0.0, 0.0))  # of the axis [m]
    axis: tuple[float, float, float] = vector("dimensionless", (0.0, 0.0, 1.0))  # any length [-]
    radius: float = quantity("length", above=0.0)  # [m]
    length: float | None = quantity("length", None, above=0.0)  # from point on; None: no end [m]

    def wall(self) -> Wall:
        """The wall itself."""
        return Cylinder(self.point, self.axis, self.radius, self.name, self.length)


@dataclass(frozen=True, kw_only=True)
class ConeShape:
    """``[[wall]]`` with ``kind = "cone"``; the bed is inside."""

    name: str
    point: tuple[float, float, float] = vector("length", (0.0, 0.0, 0.0))  # of the first end [m]
    axis: tuple[float, float, float] = vector("dimensionless", (0.0, 0.0, 1.0))  # any length [-]
    radius: float = quantity("length", at_least=0.0)  # of the first end [m]
    end_radius: float = quantity("length", at_least=0.0)  # [m]
    length: float = quantity("length", above=0.0)  # [m]

    def wall(self) -> Wall:
        """The wall itself."""
        return Cone(self.point, self.axis, self.radius, self.end_radius, self.length, self.name)


@dataclass(frozen=True, kw_only=True)
class DiscShape:
    """``[[wall]]`` with ``kind = "disc"``."""

    name: str
    point: tuple[float, float, float] = vector("length", (0.0, 0.0, 0.0))  # its middle [m]
    normal: tuple[float, float, float] = vector("dimensionless")  # into the bed, any length [-]
    radius: float = quantity("length", above=0.0)  # [m]

    def wall(self) -> Wall:
        """The wall itself."""
        return Disc(self.point, self.normal, self.radius, self.name)


@dataclass(frozen=True, kw_only=True)
class RectangleShape:
    """``[[wall]]`` with ``kind = "rectangle"``, or a parallelogram; normal along a x b."""

    name: str
    corner: tuple[float, float, float] = vector("length")  # [m]
    a: tuple[float, float, float] = vector("length")  # one side, from the corner [m]
    b: tuple[float, float, float] = vector("length")  # the other one [m]

    def wall(self) -> Wall:
        """The wall itself."""
        p, a, b = (np.array(v) for v in (self.corner, self.a, self.b))
        x, y, z, w = (tuple(v.tolist()) for v in (p, p + a, p + a + b, p + b))
        return Polygon((x, y, z, w), self.name)


@dataclass(frozen=True, kw_only=True)
class MeshShape:
    """``[[wall]]`` with ``kind = "mesh"``: all groups of one file, as one wall."""

    name: str
    file: Path  # relative to the case
    unit: str = "m"  # of the file

    def wall(self) -> Wall:
        """The wall itself."""
        from greybed.core.readers.mesh import joined, read_mesh

        return joined(read_mesh(self.file, self.unit), self.name)
