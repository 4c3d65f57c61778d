"""Walls of a case in the words of LIGGGHTS: primitives that stay, meshes that may move or go."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from greybed.core.walls import Cylinder, Plane
from greybed.dem.case_tables import WallTable
from greybed.dem.liggghts.meshes import cut, triangles
from greybed.dem.walls import SolidWall, surfaces_of

Array = NDArray[np.float64]
Vector = tuple[float, float, float]

# Share of its velocity that a servo wall changes by at each look, as in our own engine.
SERVO = 0.2


@dataclass(frozen=True)
class Span:
    """Steps at which a wall begins to move, stops and goes; none of it before the end: infinite."""

    starts: float
    stops: float
    removed: float


@dataclass(frozen=True)
class WallPlan:
    """A wall of the deck.

    Attributes
    ----------
    number : int
        In the case.
    table : WallTable
        Of the case.
    kind : int
        Atom type.
    primitive : str
        Words of an endless wall along the axes; empty for a mesh.
    mesh : ndarray, shape (m, 3, 3)
        Triangles [m].
    motion : str
        ``none``, ``surface`` (moves in itself: only its surface has a velocity), ``linear``,
        ``servo`` or ``rotate``.
    span : Span
        When.
    centre : ndarray, shape (3,)
        A point of the axis of the spin [m].
    """

    number: int
    table: WallTable
    kind: int
    primitive: str
    mesh: Array
    motion: str
    span: Span
    centre: Array

    def define(self, *, moving: bool) -> str:
        """The mesh, with the velocity of its surface where that is its motion."""
        line = f"fix mesh_{self.number} all mesh/surface/stress file {self.file} type {self.kind}"
        if moving and self.motion == "surface":
            if any(self.table.spin):
                spin = np.array(self.table.spin)
                omega = float(np.linalg.norm(spin))
                axis = _words(spin / omega)
                line += f" surface_ang_vel origin {_words(self.centre)} axis {axis} omega {omega!r}"
            else:
                line += f" surface_vel {_words(self.table.velocity)}"
        return line

    def move(self) -> list[str]:
        """Begin to move."""
        k = self.number
        if self.motion == "linear":
            return [
                f"fix move_{k} all move/mesh mesh mesh_{k} linear {_words(self.table.velocity)}"
            ]
        if self.motion == "rotate":
            spin = np.array(self.table.spin)
            omega = float(np.linalg.norm(spin))
            return [
                f"fix move_{k} all move/mesh mesh mesh_{k} rotate origin {_words(self.centre)} "
                f"axis {_words(spin / omega)} period {2.0 * math.pi / omega!r}"
            ]
        if self.motion == "servo":
            parts = zip("xyz", self.table.velocity, strict=True)
            return [
                f"variable share_{k} equal 1.0",
                *(f"variable v{a}_{k} equal v_share_{k}*({v!r})" for a, v in parts),
                f"fix move_{k} all move/mesh mesh mesh_{k} "
                f"linear/variable v_vx_{k} v_vy_{k} v_vz_{k}",
            ]
        return []

    def stop(self) -> list[str]:
        """Move no further."""
        return [f"unfix move_{self.number}"] if self.motion in ("linear", "rotate", "servo") else []

    def look(self) -> list[str]:
        """What a servo does at each look: turn its speed to where its force is the wanted one."""
        if self.motion != "servo":
            return []
        k, table = self.number, self.table
        assert table.servo is not None
        along = np.array(table.velocity) / np.linalg.norm(table.velocity) / table.servo
        push = "+".join(f"f_mesh_{k}[{a}]*({w!r})" for a, w in enumerate(along.tolist(), 1))
        free = f"v_free_{k}"
        return [
            f"variable free_{k} equal 1+{push}",
            f"variable wanted_{k} equal ({free}>1)-({free}<-1)+({free}>=-1)*({free}<=1)*{free}",
            f"variable next_{k} equal {1.0 - SERVO!r}*v_share_{k}+{SERVO!r}*v_wanted_{k}",
            f"variable share_{k} equal ${{next_{k}}}",
        ]

    @property
    def file(self) -> str:
        """Name of the file of triangles."""
        return f"wall_{self.number}.stl"


def plan(
    number: int,
    table: WallTable,
    kind: int,
    span: Span,
    region: Array,
    periodic: tuple[bool, bool, bool],
    smallest: float,
) -> WallPlan:
    """How LIGGGHTS is to have a wall.

    Parameters
    ----------
    number : int
        In the case.
    table : WallTable
        Of the case.
    kind : int
        Atom type.
    span : Span
        Its steps.
    region : ndarray, shape (2, 3)
        Where endless walls are cut off [m].
    periodic : three bools
        Directions in which every wall is cut at the region.
    smallest : float
        Radius of the smallest particle [m].
    """
    shape = table.wall()
    solid = SolidWall(shape, spin=table.spin, centre=table.centre)
    centre = surfaces_of([solid])[3][0, 6:9]
    moves = math.isfinite(span.starts) and (any(table.velocity) or any(table.spin))
    motion = "none"
    if moves and table.servo is not None and any(table.velocity):
        motion = "servo"
    elif moves and _keeps_place(table, centre):
        motion = "surface"
    elif moves:
        motion = "rotate" if any(table.spin) else "linear"
    primitive = _primitive(shape) if motion == "none" else ""
    mesh = np.empty((0, 3, 3))
    if not primitive:
        mesh = cut(triangles(shape, region, smallest), region, periodic)
    return WallPlan(number, table, kind, primitive, mesh, motion, span, centre)


def swept(wall: WallPlan, time: float) -> Array:
    """Points that a mesh comes to within a time of moving, shape (k, 3) [m]."""
    points = wall.mesh.reshape(-1, 3)
    if wall.motion == "linear":
        return np.concatenate([points, points + time * np.array(wall.table.velocity)])
    if wall.motion == "rotate":
        spin = np.array(wall.table.spin)
        omega = float(np.linalg.norm(spin))
        most = min(omega * time, 2.0 * math.pi)
        parts = [turned(points - wall.centre, spin / omega, a) for a in np.linspace(0, most, 25)]
        return np.concatenate(parts) + wall.centre
    return points


def turned(points: Array, axis: Array, angle: float) -> Array:
    """Points turned about an axis through the origin (Rodrigues), shape (k, 3)."""
    along = points @ axis
    result: Array = (
        math.cos(angle) * points
        + math.sin(angle) * np.cross(axis, points)
        + (1.0 - math.cos(angle)) * np.outer(along, axis)
    )
    return result


def _keeps_place(table: WallTable, centre: Array) -> bool:
    """Whether the motion maps an endless wall onto itself."""
    shape = table.wall()
    velocity, spin = np.array(table.velocity), np.array(table.spin)
    if isinstance(shape, Plane):
        along = np.array(shape.normal)
        return bool(abs(velocity @ along) == 0.0 and _parallel(spin, along))
    if isinstance(shape, Cylinder):
        along = np.array(shape.axis)
        on_axis = _parallel(centre - np.array(shape.point), along)
        moves = _parallel(velocity, along) if shape.length is None else not velocity.any()
        return bool(moves and _parallel(spin, along) and on_axis)
    return False


def _parallel(a: Array, b: Array) -> bool:
    return float(np.linalg.norm(np.cross(a, b))) <= 1e-12 * float(np.linalg.norm(a) or 1.0)


def _primitive(shape: object) -> str:
    """Words of a plane or an endless cylinder along an axis, or nothing."""
    if isinstance(shape, Plane):
        for axis, name in enumerate("xyz"):
            if abs(shape.normal[axis]) == 1.0:
                return f"{name}plane {float(shape.point[axis])!r}"
    if isinstance(shape, Cylinder) and shape.length is None:
        for axis, name in enumerate("xyz"):
            if abs(shape.axis[axis]) == 1.0:
                others = [float(shape.point[other]) for other in range(3) if other != axis]
                return f"{name}cylinder {shape.radius!r} " + " ".join(map(repr, others))
    return ""


def _words(values: Sequence[float] | Array) -> str:
    return " ".join(f"{float(value)!r}" for value in values)
