"""Walls of a simulation: shapes of the core with a material and a motion."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from greybed.core.errors import InputError
from greybed.core.walls import Cone, Cylinder, Disc, Mesh, Plane, Polygon, Wall
from greybed.dem import _surfaces

Array = NDArray[np.float64]
Vector = tuple[float, float, float]


@dataclass(frozen=True)
class SolidWall:
    """A wall that particles bounce off.

    Attributes
    ----------
    shape : Wall
        Plane, Cylinder, Cone, Disc, Polygon or Mesh. Spheres are on the side of a plane's normal
        and inside a cylinder without end; shapes with an end have two sides.
    material : str, optional
        Name of one of the simulation's materials; by default that of the first.
    velocity, spin : (3,) floats
        Of the wall [m/s], [1/s]; the shape moves along.
    centre : (3,) floats, optional
        A point that the axis of the spin goes through [m]; the shape's own point by default.
    """

    shape: Wall
    material: str | None = None
    velocity: Vector = (0.0, 0.0, 0.0)
    spin: Vector = (0.0, 0.0, 0.0)
    centre: Vector | None = None

    def __post_init__(self) -> None:
        for part in ("velocity", "spin", "centre"):
            value = getattr(self, part)
            if value is not None and (len(value) != 3 or not np.isfinite(value).all()):
                raise InputError(
                    f"wall {self.shape.name!r}: {part} = {value} must be three finite numbers."
                )


def surfaces_of(
    walls: Sequence[SolidWall],
) -> tuple[NDArray[np.int64], Array, NDArray[np.int64], Array]:
    """Kinds, data, owners of all surfaces, and the motion of each wall."""
    kinds: list[int] = []
    data: list[Array] = []
    owner: list[int] = []
    motion = np.zeros((len(walls), 9))
    for number, wall in enumerate(walls):
        parts = _parts(wall.shape)
        kinds += [kind for kind, _ in parts]
        data += [values for _, values in parts]
        owner += [number] * len(parts)
        own = parts[0][1][:3] if len(parts) == 1 else np.mean([d[10:13] for _, d in parts], axis=0)
        centre = own if wall.centre is None else wall.centre
        motion[number] = [*wall.velocity, *wall.spin, *centre]
    return (
        np.array(kinds, np.int64), np.array(data).reshape(-1, 13), np.array(owner, np.int64), motion
    )  # fmt: skip


def _parts(shape: Wall) -> list[tuple[int, Array]]:
    row = np.zeros(13)
    if isinstance(shape, Plane):
        row[:3], row[3:6] = shape.point, shape.normal
        row[9], row[10:] = math.inf, shape.point
        return [(_surfaces.PLANE, row)]
    if isinstance(shape, Disc):
        row[:3], row[3:6], row[6] = shape.point, shape.normal, shape.radius
        row[9], row[10:] = shape.radius, shape.point
        return [(_surfaces.DISC, row)]
    if isinstance(shape, Cylinder | Cone):
        end = shape.end_radius if isinstance(shape, Cone) else shape.radius
        length = math.inf if shape.length is None else shape.length
        row[:3], row[3:6] = shape.point, shape.axis
        row[6], row[7], row[8] = shape.radius, end, length
        if math.isinf(length):
            row[9], row[10:] = math.inf, shape.point
        else:
            row[9] = math.hypot(0.5 * length, max(shape.radius, end))
            row[10:] = np.asarray(shape.point) + 0.5 * length * np.asarray(shape.axis)
        return [(_surfaces.TUBE if end == shape.radius else _surfaces.CONE, row)]
    if isinstance(shape, Polygon | Mesh):
        corners = shape.triangles
        parts = []
        for triangle in np.asarray(corners).reshape(-1, 3, 3):
            row = np.zeros(13)
            row[:9] = triangle.ravel()
            row[10:] = triangle.mean(axis=0)
            row[9] = float(np.sqrt(((triangle - row[10:]) ** 2).sum(axis=1)).max())
            parts.append((_surfaces.TRIANGLE, row))
        return parts
    raise InputError(f"wall {shape.name!r}: {type(shape).__name__} is no wall for particles.")
