"""Meshes of a packing for a look in a browser or CAD: every sphere a faceted ball."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from greybed.core.errors import InputError
from greybed.core.packing import Packing

# 20,000 balls of 80 faces are 1.6 million triangles: about what a browser still turns smoothly.
MOST_SPHERES = 20_000
# spheres up to this number -> subdivisions of the icosahedron
_FINENESS = ((200, 3), (2_000, 2), (MOST_SPHERES, 1))


def write(packing: Packing, path: Path, fields: dict[str, NDArray[np.float64]]) -> None:
    """Write one mesh of all spheres, in metres.

    Parameters
    ----------
    packing : Packing
        The bed [m], 20,000 spheres at most.
    path : Path
        Where to write; the extension chooses ``.glb``, ``.ply`` or ``.stl``.
    fields : dict
        Empty; a mesh holds none.

    Raises
    ------
    InputError
        If there are more spheres than a viewer can turn.
    """
    n = len(packing)
    if n > MOST_SPHERES:
        raise InputError(
            f"{packing.source}: {n} spheres are too many for a mesh (at most {MOST_SPHERES}); "
            "write .vtu and open it in ParaView."
        )
    import trimesh

    ball = trimesh.creation.icosphere(
        subdivisions=next(fineness for most, fineness in _FINENESS if n <= most)
    )
    # The facets lie inside the sphere, so that touching spheres show as touching at most.
    vertices = packing.centres[:, None] + packing.radii[:, None, None] * ball.vertices
    faces = np.arange(n)[:, None, None] * len(ball.vertices) + ball.faces
    mesh = trimesh.Trimesh(vertices.reshape(-1, 3), faces.reshape(-1, 3), process=False)
    with open(path, "wb") as stream:
        mesh.export(stream, file_type=path.suffix.lower().removeprefix("."))
