"""Where things are: the region of a case, and the box that LIGGGHTS is given."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from greybed.core.walls import Cylinder, Plane
from greybed.dem.case import ParticleCase
from greybed.dem.case_tables import FileTable
from greybed.dem.liggghts.meshes import triangles
from greybed.dem.liggghts.walls import WallPlan, swept

Array = NDArray[np.float64]

# Share of the extent of all things that endless walls reach beyond them.
_BEYOND = 0.25


def region_of(case: ParticleCase, centres: Array, radii: Array) -> Array:
    """Box of all that has an end, and a quarter more, shape (2, 3) [m]; of periodic axes theirs."""
    low = [(centres - radii[:, None]).min(axis=0)]
    high = [(centres + radii[:, None]).max(axis=0)]
    for table in case.particles:
        if not isinstance(table, FileTable):
            low.append(np.array(table.lower))
            high.append(np.array(table.upper))
    for wall in case.wall:
        shape = wall.wall()
        if isinstance(shape, Plane):
            # Only along its normal, and only if that is an axis: it is endless elsewhere.
            ends = np.where(np.abs(shape.normal) == 1.0, shape.point, np.nan)
            points = ends[None, :]
        elif isinstance(shape, Cylinder) and shape.length is None:
            across = shape.radius * np.sqrt(1.0 - np.square(shape.axis))
            ends = np.where(np.abs(shape.axis) > 1e-9, np.nan, shape.point)
            points = np.array([ends - across, ends + across])
        else:
            points = triangles(shape, np.zeros((2, 3)), shape_size(shape)).reshape(-1, 3)
        low.append(np.where(np.isnan(points), np.inf, points).min(axis=0))
        high.append(np.where(np.isnan(points), -np.inf, points).max(axis=0))
    box = np.array([np.min(low, axis=0), np.max(high, axis=0)])
    margin = _BEYOND * (box[1] - box[0]) + 2.0 * float(radii.max())
    box += np.outer([-1.0, 1.0], margin)
    if case.periodic is not None:
        for axis, name in enumerate("xyz"):
            if name in case.periodic.axes:
                box[:, axis] = case.periodic.lower[axis], case.periodic.upper[axis]
    return box


def shape_size(shape: object) -> float:
    """Some size of a shape, where only its outline matters [m]."""
    return float(getattr(shape, "radius", 1.0) or 1.0)


def box_of(
    case: ParticleCase,
    region: Array,
    walls: Sequence[WallPlan],
    time_step: float,
    largest: float,
) -> Array:
    """The box that LIGGGHTS starts with: it holds every mesh on its way, shape (2, 3) [m]."""
    points = [region]
    for wall in walls:
        span = wall.span
        end = min(span.stops, span.removed, case.duration / time_step)
        time = max(0.0, end - span.starts) * time_step if span.starts < end else 0.0
        points.append(swept(wall, time))
    every = np.concatenate(points)
    box = np.array([every.min(axis=0) - 2.0 * largest, every.max(axis=0) + 2.0 * largest])
    if case.periodic is not None:
        for axis, name in enumerate("xyz"):
            if name in case.periodic.axes:
                box[:, axis] = region[:, axis]
    return box
