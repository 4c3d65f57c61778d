"""Walls on the command line: kind, place and size in one word."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from greybed.core.walls import Wall


def _number(text: str, where: str, *, length: bool) -> float:
    """One number: a length in metres or with its unit, or a plain number."""
    from greybed.core.errors import InputError
    from greybed.core.units import parse_quantity

    try:
        return float(text)
    except ValueError:
        if length:
            return parse_quantity(text, "length", where)
        raise InputError(f"{where}: {text!r} is not a number; give one without unit.") from None


# kind -> how it is typed, an example, numbers in each part
WALLS = {
    "plane": ("plane:X,Y,Z:NX,NY,NZ", "plane:0,0,0:0,0,1", ([3, 3],)),
    "cylinder": (
        "cylinder:X,Y,Z:AX,AY,AZ:R[:LENGTH]",
        "cylinder:0,0,0:0,0,1:30mm",
        ([3, 3, 1], [3, 3, 1, 1]),
    ),
    "cone": (
        "cone:X,Y,Z:AX,AY,AZ:R:END_R:LENGTH",
        "cone:0,0,0:0,0,1:10mm:30mm:50mm",
        ([3, 3, 1, 1, 1],),
    ),
    "disc": ("disc:X,Y,Z:NX,NY,NZ:R", "disc:0,0,0:0,0,1:30mm", ([3, 3, 1],)),
    "box": ("box:X,Y,Z:X,Y,Z", "box:0,0,0:1cm,1cm,2cm", ([3, 3],)),
    "polygon": ("polygon:X,Y,Z:X,Y,Z:X,Y,Z...", "polygon:0,0,0:1cm,0,0:0,1cm,0", ()),
}


def parse_walls(text: str, name: str) -> tuple[Wall, ...]:
    """Read what ``--wall`` takes; a box is six walls, a mesh file one for each of its groups.

    Raises
    ------
    InputError
        If the kind is unknown, a number is missing or wrong, or a file cannot be used.
    """
    from greybed.core.errors import InputError
    from greybed.core.readers import read_mesh
    from greybed.core.walls import Cone, Cylinder, Disc, Plane, Polygon, box_walls

    where = f"--wall {text}"
    kind, _, rest = text.partition(":")
    if kind == "mesh":
        # A colon may also stand in the name of the file.
        named = Path(rest).suffix.lower() in (".stl", ".obj", ".ply")
        file, _, unit = (rest, "", "m") if named else rest.rpartition(":")
        if not file:
            raise InputError(f"{where}: give mesh:FILE[:UNIT], such as mesh:oven.stl:mm.")
        return read_mesh(file, unit, name)
    if kind not in WALLS:
        raise InputError(
            f"{where}: give {', '.join(said for said, _, _ in WALLS.values())} or mesh:FILE[:UNIT]."
        )
    parts = [part.split(",") for part in rest.split(":")]
    counts = [len(part) for part in parts]
    said, example, layouts = WALLS[kind]
    if counts not in layouts and not (kind == "polygon" and counts == [3] * max(len(counts), 3)):
        raise InputError(f"{where}: give {said}, such as {example}.")
    numbers = [
        [_number(word, where, length=kind in ("box", "polygon") or k != 1) for word in part]
        for k, part in enumerate(parts)
    ]
    if kind == "polygon":
        return (Polygon(tuple((x, y, z) for x, y, z in numbers), name),)
    (x, y, z), (u, v, w) = numbers[:2]
    sizes = [part[0] for part in numbers[2:]]
    if kind == "box":
        return box_walls((x, y, z), (u, v, w), name)
    if kind == "plane":
        return (Plane((x, y, z), (u, v, w), name),)
    if kind == "disc":
        return (Disc((x, y, z), (u, v, w), sizes[0], name),)
    if kind == "cone":
        return (Cone((x, y, z), (u, v, w), sizes[0], sizes[1], sizes[2], name),)
    return (Cylinder((x, y, z), (u, v, w), sizes[0], name, *sizes[1:]),)
