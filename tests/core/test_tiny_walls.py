"""Distances and rays to bounded walls, a few of each: quick also where kernels are plain Python."""

from __future__ import annotations

import math

import numpy as np
import pytest

from greybed.core import Cone, Cylinder, Disc, Mesh, box_walls
from greybed.core.patches import distances, ray_distances

SQUARE = Mesh([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], [[0, 1, 2], [0, 2, 3]])
FLOOR = box_walls((-1, -1, 0), (1, 1, 1))[4]
# Above its middle, beside it, beyond a corner.
POINTS = np.array([[0.1, 0.2, 0.5], [3.0, 0.0, 0.0], [2.0, 2.0, 1.0]])


@pytest.mark.parametrize("wall", [SQUARE, FLOOR], ids=["mesh", "polygon"])
def test_distances_to_a_square(wall):
    found = distances([wall], POINTS)
    np.testing.assert_allclose(np.ravel(found), [0.5, 2.0, math.sqrt(3.0)], rtol=1e-12)


def test_distances_to_round_walls():
    walls = [
        Disc((0, 0, 0), (0, 0, 1), 1.0),
        Cylinder((0, 0, -1), (0, 0, 1), 1.0, length=2.0),
        Cone((0, 0, 0), (0, 0, 1), 1.0, 2.0, 1.0),
    ]
    points = np.array([[3.0, 0.0, 0.0], [0.0, 0.0, 0.25]])
    disc, tube, cone = (distances([wall], points) for wall in walls)
    np.testing.assert_allclose(disc, [2.0, 0.25], rtol=1e-12)
    np.testing.assert_allclose(tube, [2.0, 1.0], rtol=1e-12)
    # Both nearest to a rim: the wide one, the narrow one.
    np.testing.assert_allclose(cone, [math.sqrt(2.0), math.hypot(1.0, 0.25)], rtol=1e-12)
    np.testing.assert_allclose(distances(walls, points), [math.sqrt(2.0), 0.25], rtol=1e-12)


@pytest.mark.parametrize(
    ("wall", "along"),
    [
        (SQUARE, 2.0),
        (FLOOR, 2.0),
        (Disc((0, 0, 0), (0, 0, 1), 1.0), 2.0),
        (Cylinder((0, 0, -3), (0, 0, 1), 1.0, length=6.0), math.inf),
        (Cone((0, 0, -4), (0, 0, 1), 0.1, 8.1, 8.0), 5.8),
    ],
    ids=["mesh", "polygon", "disc", "tube", "cone"],
)
def test_rays_meet_walls_where_they_stand(wall, along):
    origins, directions = np.array([[0.3, 0.0, 2.0]]), np.array([[0.0, 0.0, -1.0]])
    assert ray_distances(wall, origins, directions)[0] == pytest.approx(along)
