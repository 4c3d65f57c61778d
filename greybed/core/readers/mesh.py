"""Meshes of walls from STL, OBJ and PLY files, one named patch for every group of the file."""

from __future__ import annotations

import os
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from greybed.core.errors import GreybedError, InputError
from greybed.core.planar import cut, newell
from greybed.core.readers.opening import mapped, shown
from greybed.core.units import to_si
from greybed.core.walls import Mesh

# extension -> what trimesh calls it
FORMATS = {".stl": "stl", ".obj": "obj", ".ply": "ply"}
# Triangles of one file: the tree and the corners of so many take about 3 GB.
MOST_TRIANGLES = 20_000_000


def read_mesh(
    path: str | os.PathLike[str], unit: str = "m", name: str | None = None
) -> tuple[Mesh, ...]:
    """Read the walls of a mesh file.

    Parameters
    ----------
    path : path
        ``.stl`` (text or binary), ``.obj`` or ``.ply``.
    unit : str
        Unit of the file's coordinates, such as ``mm``: the formats do not say it.
    name : str, optional
        Name of the patch; the file's own by default. Several patches are called ``name_group``.

    Returns
    -------
    meshes : tuple of Mesh
        One for every group of an OBJ file or solid of an STL file, else one [m]. Their
        ``watertight``, ``winding_consistent`` and ``dropped`` say what is wrong with them.

    Raises
    ------
    InputError
        If the file is missing, of another format, damaged, empty, holds coordinates that are not
        finite, or has no area.
    """
    place = Path(path)
    kind = FORMATS.get(place.suffix.lower())
    if kind is None:
        raise InputError(
            f"{place}: extension {shown(place.suffix)} is none of {', '.join(FORMATS)}; save the "
            "mesh as one of these."
        )
    scale = float(to_si(np.ones(1), unit, "length", f"{place}: unit")[0])
    with mapped(place):  # refuses folders, devices, empty and missing files
        pass
    label = place.stem if name is None else name
    try:
        parts = _load(place, kind)
    except GreybedError:
        raise
    except Exception as error:  # what trimesh raises for a damaged file is not documented
        raise InputError(
            f"{place}: cannot be read as {kind.upper()} ({shown(str(error), 80)}); save the mesh "
            "again."
        ) from None
    parts = {group: part for group, part in parts.items() if len(part[1])}
    if not parts:
        raise InputError(f"{place}: the mesh is empty; give a file with triangles.")
    total = sum(len(faces) for _, faces in parts.values())
    if total > MOST_TRIANGLES:
        raise InputError(
            f"{place}: {total} triangles are more than {MOST_TRIANGLES}; coarsen the mesh."
        )
    try:
        return tuple(
            Mesh(scale * vertices, faces, label if len(parts) == 1 else f"{label}_{group}")
            for group, (vertices, faces) in parts.items()
        )
    except InputError as error:
        raise InputError(f"{place}: {error}") from None


def joined(meshes: Sequence[Mesh], name: str) -> Mesh:
    """One mesh of several, a patch of its own."""
    first = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    faces = [m.faces + at for m, at in zip(meshes, first[:-1], strict=True)]
    return Mesh(np.concatenate([m.vertices for m in meshes]), np.concatenate(faces), name)


def _load(place: Path, kind: str) -> dict[str, tuple[Any, Any]]:
    """Corners and faces of every group."""
    if kind == "obj":
        return _load_obj(place)
    import trimesh

    with open(place, "rb") as stream:
        scene = trimesh.load_scene(stream, file_type=kind, process=False)
    return {
        str(group): (np.asarray(part.vertices, dtype=np.float64), np.asarray(part.faces))
        for group, part in scene.geometry.items()
        if hasattr(part, "faces")
    }


def _load_obj(place: Path) -> dict[str, tuple[Any, Any]]:
    """The same of an OBJ file; trimesh would join its groups."""
    points: list[list[float]] = []
    faces: dict[str, list[tuple[int, int, int]]] = {}
    group = "mesh"
    with open(place, encoding="utf-8", errors="replace") as stream:
        for row, line in enumerate(stream, 1):
            key, *words = line.split("#", 1)[0].split() or [""]
            try:
                if key in ("g", "o"):
                    group = "_".join(words) or "mesh"
                elif key == "v":
                    x, y, z = (float(word) for word in words[:3])
                    points.append([x, y, z])
                elif key == "f":
                    # corner/texture/normal; below zero counts from the last corner so far
                    numbers = [int(word.split("/", 1)[0]) for word in words]
                    corners = [n - 1 if n > 0 else len(points) + n for n in numbers]
                    if len(corners) < 3 or not all(0 <= c < len(points) for c in corners):
                        raise ValueError
                    faces.setdefault(group, []).extend(_triangles(corners, points))
            except (ValueError, InputError):
                raise InputError(
                    f"{place}: line {row}: {shown(line.strip())} is no corner or face; mend it."
                ) from None
    vertices = np.array(points).reshape(-1, 3)
    return {name: (vertices, np.array(some)) for name, some in faces.items()}


def _triangles(corners: list[int], points: list[list[float]]) -> list[tuple[int, int, int]]:
    """Triangles of one face."""
    if len(corners) == 3:
        return [(corners[0], corners[1], corners[2])]
    places = np.array([points[c] for c in corners])
    normal = newell(places)
    length = float(np.linalg.norm(normal))
    if not length > 0.0:  # no area; NaN is refused with the corners
        return [(corners[0], b, c) for b, c in pairwise(corners[1:])]
    cuts = cut(places, normal / length, "face")
    return [(corners[a], corners[b], corners[c]) for a, b, c in cuts.tolist()]
