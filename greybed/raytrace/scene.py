"""Scene: a packing made ready for tracing (grid, wall tables, exposed spheres)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from greybed.core import Cylinder, InputError, Packing, Plane, Wall
from greybed.core.patches import bounded
from greybed.raytrace import _bundle, _grid, _rows, _walls

# Cell edge over mean radius. Measured at solid fractions 0.2 and 0.5, for rays that have left the
# bundles: a tenth faster than 1.25, and memory falls with the cube.
CELL_OVER_RADIUS = 2.0
# A sparse bed of tiny spheres in a wide box must not ask for more cells than memory holds.
MAX_CELLS_PER_SPHERE = 64
# Neighbours that a mean sphere takes into its bundles. Measured at solid fractions 0.2 and 0.5.
NEIGHBOURS = 100.0


@dataclass(frozen=True, eq=False)
class Scene:
    """What the compiled tracer needs of a packing; made by :meth:`of`."""

    packing: Packing
    tables: _rows.Tables

    @classmethod
    def of(cls, packing: Packing) -> Scene:
        """Build the scene of a packing.

        Raises
        ------
        InputError
            If a wall is not invariant under the packing's periodic shifts; no bounded wall is.
        """
        for wall in packing.walls:
            _check_periodic(wall, packing.periodic)
        low, high = packing.bounds
        r = packing.radii[:, None]
        periodic = np.array(packing.periodic)
        low = np.where(periodic, low, (packing.centres - r).min(axis=0))
        high = np.where(periodic, high, (packing.centres + r).max(axis=0))
        size = CELL_OVER_RADIUS * float(packing.radii.mean())
        size = max(
            size, float((np.prod(high - low) / (MAX_CELLS_PER_SPHERE * len(packing))) ** (1 / 3))
        )
        grid = _grid.build(packing.centres, packing.radii, low, high, periodic, size)
        places = _bundle.sort_places(
            packing.centres, packing.radii, low, high, periodic, NEIGHBOURS
        )
        exposed, clearance = _freedom(packing)
        return cls(
            packing,
            _rows.Tables(
                np.ascontiguousarray(packing.centres),
                np.ascontiguousarray(packing.radii),
                exposed,
                clearance,
                grid,
                places,
                _walls.tables(packing.walls),
            ),
        )

    @property
    def walls_between(self) -> bool:
        """Whether a wall may stand between two spheres; one that bounds the bed cannot."""
        return any(bounded(wall) for wall in self.packing.walls)


def _check_periodic(wall: Wall, periodic: tuple[bool, bool, bool]) -> None:
    if any(periodic) and bounded(wall):
        raise InputError(
            f"wall {wall.name!r} ends and so does not repeat along the periodic direction "
            f"{'xyz'[periodic.index(True)]}; make all directions open, or take an unbounded plane "
            "or cylinder."
        )
    for axis in range(3):
        if not periodic[axis]:
            continue
        fits = (
            wall.normal[axis] == 0.0
            if isinstance(wall, Plane)
            else isinstance(wall, Cylinder) and abs(abs(wall.axis[axis]) - 1.0) < 1e-12
        )
        if not fits:
            raise InputError(
                f"wall {wall.name!r} does not repeat along the periodic direction "
                f"{'xyz'[axis]}; make that direction open or turn the wall."
            )


def _freedom(packing: Packing) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Spheres whose whole surface is free, and how far from each centre the next wall is [m]."""
    exposed = np.ones(len(packing), dtype=bool)
    overlaps = packing.overlaps()
    exposed[overlaps.pairs.ravel()] = False
    # Of two equal spheres in one place neither hides the other: both would count as free.
    sizes = packing.radii[overlaps.pairs]
    twins = (sizes[:, 0] == sizes[:, 1]) & (overlaps.depth == sizes.sum(axis=1))
    if twins.any():
        i, j = overlaps.pairs[int(twins.argmax())]
        raise InputError(
            f"{packing.source}: spheres {i} and {j} are the same sphere twice (centre, radius "
            f"{sizes[twins][0, 0]:g} [m]); remove one of them."
        )
    clearance = _walls.clearance(packing.walls, packing.centres)
    exposed &= clearance >= packing.radii
    return exposed, clearance
