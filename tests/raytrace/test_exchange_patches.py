"""Reflections from bounded walls: the same light as from planes, closed and reciprocal boxes."""

from __future__ import annotations

import numpy as np
import pytest

from greybed.core import Cone, Cylinder, Disc, Mesh, Packing, Plane, box_walls
from greybed.raytrace import exchange_factors

CENTRES = [[0.3, 0.3, 0.3], [0.7, 0.6, 0.4], [0.4, 0.7, 0.75]]
RADII = [0.15, 0.2, 0.12]


def planes():
    walls = []
    for axis in range(3):
        for at, sign in ((0.0, 1.0), (1.0, -1.0)):
            point, normal = [0.0] * 3, [0.0] * 3
            point[axis], normal[axis] = at, sign
            walls.append(Plane(tuple(point), tuple(normal)))
    return walls


def cube_mesh():
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    faces = [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]  # fmt: skip
    return Mesh(corners, faces, "cube")


def rows(walls, specular):
    packing = Packing(CENTRES, RADII, walls=walls)
    return exchange_factors(
        packing, emissivity=[0.6], wall_emissivity=0.4, wall_specular=specular, rays=25_000,
        seed=3,
    )[0]  # fmt: skip


@pytest.mark.parametrize("specular", [0.0, 0.7])
def test_polygons_and_meshes_reflect_as_planes_do(specular):
    reference = rows(planes(), specular)
    for walls in (box_walls((0, 0, 0), (1, 1, 1)), [cube_mesh()]):
        result = rows(walls, specular)
        error = np.hypot(result.stderr.toarray(), reference.stderr.toarray())
        off = np.abs((result.factors - reference.factors).toarray()) / error
        assert off.max() < 4.5
        total = result.factors.sum(axis=1) + result.wall_factors.sum(axis=1)
        np.testing.assert_allclose(total, 1.0, atol=1e-12)
        assert (result.escaped == 0.0).all()
        to_walls = result.wall_factors.sum(axis=1) - reference.wall_factors.sum(axis=1)
        assert np.abs(to_walls).max() < 0.02  # four standard errors


def test_tubes_and_cones_with_lids_are_closed():
    """A tube between discs reflects as a cylinder between planes; a frustum lets nothing out."""
    ball = Packing([[0.1, 0.0, 0.5]], 0.3).centres, 0.3
    lids = [Disc((0, 0, 0), (0, 0, 1), 1.0), Disc((0, 0, 1), (0, 0, -1), 1.0)]
    tube = [Cylinder((0, 0, 0), (0, 0, 1), 1.0, length=1.0), *lids]
    endless = [
        Cylinder((0, 0, 0), (0, 0, 1), 1.0),
        Plane((0, 0, 0), (0, 0, 1)),
        Plane((0, 0, 1), (0, 0, -1)),
    ]
    options = {"emissivity": [0.5], "wall_emissivity": 0.3, "rays": 50_000, "seed": 5}
    a = exchange_factors(Packing(*ball, walls=tube), **options)[0]
    b = exchange_factors(Packing(*ball, walls=endless), **options)[0]
    difference = np.abs(a.wall_factors - b.wall_factors)
    assert (difference < 4.5 * np.hypot(a.wall_stderr, b.wall_stderr)).all()
    frustum = [Cone((0, 0, 0), (0, 0, 1), 1.0, 1.5, 1.0), lids[0], Disc((0, 0, 1), (0, 0, -1), 1.5)]
    c = exchange_factors(Packing(*ball, walls=frustum), **options)[0]
    assert c.escaped[0] == 0.0
    assert c.factors.sum() + c.wall_factors.sum() == pytest.approx(1.0, abs=1e-12)


def test_a_sphere_cut_by_a_disc_shines_from_one_side():
    """A wide disc half a radius below the centre buries a quarter of the surface."""
    disc = Disc((0, 0, -0.5), (0, 0, 1), 50.0)
    result = exchange_factors(
        Packing([[0, 0, 0]], 1.0, walls=[disc]), emissivity=[1.0], rays=100_000, seed=1
    )[0]
    area = 4.0 * np.pi * 0.75
    assert result.areas[0] == pytest.approx(area, rel=0.01)
