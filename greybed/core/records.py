"""Walls as plain records for files: names and numbers, meshes by their arrays or their hash."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from greybed.core.errors import InputError
from greybed.core.walls import Cone, Cylinder, Disc, Mesh, Plane, Polygon, Wall

KINDS: dict[str, type[Any]] = {
    "plane": Plane,
    "cylinder": Cylinder,
    "cone": Cone,
    "disc": Disc,
    "polygon": Polygon,
    "mesh": Mesh,
}
# kind -> what its record holds, in the order in which the wall takes it
_VECTORS = ("point", "normal", "axis")
_PARTS = {
    "plane": ("point", "normal"),
    "cylinder": ("point", "axis", "radius", "length"),
    "cone": ("point", "axis", "radius", "end_radius", "length"),
    "disc": ("point", "normal", "radius"),
    "polygon": ("vertices",),
    "mesh": (),
}
# What a mesh once said of itself; of the mesh that is left of it, it would say other things.
_SAID = ("dropped", "watertight", "winding_consistent")


def record(wall: Wall) -> dict[str, Any]:
    """What a file keeps of a wall: kind, name, numbers in SI; of a mesh its hash, no arrays."""
    kind = next(name for name, made in KINDS.items() if isinstance(wall, made))
    parts: dict[str, Any] = {"kind": kind, "name": wall.name}
    for part in _PARTS[kind]:
        value = getattr(wall, part)
        if value is not None:  # the length of an unbounded cylinder
            parts[part] = value if isinstance(value, tuple) else float(value)
    if isinstance(wall, Mesh):
        parts["sha256"] = wall.digest
        parts |= {name: getattr(wall, name) for name in _SAID}
    return parts


def wall_of(parts: Mapping[str, Any], arrays: Callable[[], tuple[Any, Any]]) -> Wall:
    """The wall of a record; ``arrays`` gives corners and faces where it is a mesh.

    Raises
    ------
    InputError
        For an unknown kind, a wrong number, or a mesh other than the recorded one.
    KeyError, TypeError, ValueError
        For a record that is none.
    """
    kind, name = parts["kind"], str(parts["name"])
    if kind not in KINDS:
        raise InputError(f"kind {str(kind)[:40]!r} is none of {', '.join(KINDS)}")
    if kind == "mesh":
        mesh = Mesh(*arrays(), name)
        if mesh.digest != parts["sha256"]:
            raise InputError(f"wall {name[:40]!r}: corners or faces are not those of the record")
        for said in _SAID:
            object.__setattr__(mesh, said, type(getattr(mesh, said))(parts[said]))
        return mesh
    given: dict[str, Any] = {}
    for part in _PARTS[kind]:
        if part in _VECTORS:
            given[part] = parts[part]
        elif part == "vertices":
            given[part] = tuple(map(tuple, parts[part]))
        elif part != "length" or kind != "cylinder" or part in parts:
            given[part] = float(parts[part])
    wall: Wall = KINDS[kind](**given, name=name)
    for part in ("normal", "axis"):
        if part in parts and part in given:
            _exact(wall, part, parts[part])
    return wall


def _exact(wall: Wall, name: str, stored: Any) -> None:
    """Put back the stored unit vector: scaling it to length 1 again may move its last digit."""
    vector = (float(stored[0]), float(stored[1]), float(stored[2]))
    if np.allclose(vector, getattr(wall, name), rtol=0.0, atol=1e-12):
        object.__setattr__(wall, name, vector)
