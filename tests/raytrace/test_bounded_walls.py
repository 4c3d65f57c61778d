"""Tracing against bounded walls: exact factors, closed surfaces, spheres in walls, emission."""

import numpy as np
import pytest
from scipy.stats import kstest

from greybed.closures.viewfactor.patches import sphere_to_disk, sphere_to_polygon
from greybed.core import (
    Cone,
    Cylinder,
    Disc,
    InputError,
    Mesh,
    Packing,
    Plane,
    Polygon,
    box_walls,
)
from greybed.raytrace import _emission, _walls, first_hits, view_factors
from greybed.raytrace.scene import Scene

RAYS = 50_000


def traced(walls, centre=(0.0, 0.0, 0.0), radius=0.3, seed=1):
    result = view_factors(Packing([centre], radius, walls=walls), rays=RAYS, seed=seed)
    return result.wall_factors[0], result.wall_stderr[0], result.escaped[0]


def test_rectangle_triangle_disc_against_exact_factors():
    """Side by side, none before another."""
    walls = [
        Polygon([(-1, -1, -1), (2, -1, -1), (2, 1.5, -1), (-1, 1.5, -1)], "rectangle"),
        Polygon([(1.5, -1, 0), (1.5, 1, -0.5), (1.5, 0, 2)], "triangle"),
        Disc((-0.6, 0.2, 1.4), (0.5, 0, -1), 0.8, "disc"),
        Polygon([(-2, 2, 2), (1, 2, 2), (1, 2, 1), (-1, 2, 1), (-1, 2, 0), (-2, 2, 0)], "L"),
    ]
    got, error, escaped = traced(walls)
    exact = [
        sphere_to_polygon((0, 0, 0), w.vertices, 0.3)
        if isinstance(w, Polygon)
        else sphere_to_disk((0, 0, 0), w.point, w.normal, w.radius, 0.3)
        for w in walls
    ]
    assert (np.abs(got - exact) < 4 * error).all()
    assert (error < 2.5e-3).all()
    assert escaped > 0.0
    assert got.sum() + escaped == pytest.approx(1.0, abs=1e-14)


def test_mesh_around_a_sphere_takes_all_and_each_part_its_share():
    box = box_walls((-1, -0.7, -0.5), (0.6, 0.9, 2))
    corners = np.concatenate([w.triangles for w in box[2:]]).reshape(-1, 3)
    rest = Mesh(corners, np.arange(len(corners)).reshape(-1, 3), "rest")
    got, error, escaped = traced([box[0], rest, box[1]])
    assert escaped == 0.0
    assert got.sum() == pytest.approx(1.0, abs=1e-14)
    exact = [sphere_to_polygon((0, 0, 0), box[k].vertices, 0.3) for k in (0, 1)]
    assert (np.abs(got[[0, 2]] - exact) < 4 * error[[0, 2]]).all()


@pytest.mark.parametrize("end", [0.5, 1.0, 1.8])
def test_cone_and_tube_between_discs(end):
    """The lids take what the closed form says, the side takes all the rest."""
    axis = np.array([1.0, 2.0, -2.0]) / 3.0
    point = -0.8 * axis
    side = Cone(point, axis, 1.0, end, 2.0) if end != 1.0 else Cylinder(point, axis, 1.0, length=2)
    walls = [Disc(point, axis, 1.0), side, Disc(point + 2 * axis, -axis, end)]
    got, error, escaped = traced(walls, seed=2)
    near, far = (0.5 * (1 - 1 / np.hypot(1, r / h)) for r, h in ((1.0, 0.8), (end, 1.2)))
    assert escaped == 0.0
    assert (np.abs(got - [near, 1 - near - far, far]) < 4 * error).all()


def test_walls_between_spheres_hide_them_from_both_sides():
    screen = Disc((0, 0, 0), (1, 0, 0), 5.0)
    pair = Packing([[-1, 0, 0], [1, 0, 0]], 0.5, walls=[screen])
    result = view_factors(pair, rays=5_000)
    assert result.factors.nnz == 0
    exact = sphere_to_disk([(-1, 0, 0), (1, 0, 0)], (0, 0, 0), (1, 0, 0), 5.0)
    assert (np.abs(result.wall_factors[:, 0] - exact) < 4 * result.wall_stderr[:, 0]).all()


def test_free_rays_meet_bounded_walls_and_spheres_in_order():
    bed = Packing(
        [[0, 0, 0]], 0.5, walls=[Disc((0, 0, 2), (0, 0, 1), 1.0), *box_walls((-3,) * 3, (3,) * 3)]
    )
    distance, hit = first_hits(
        bed,
        [[0, 0, 2.5], [0, 0, 1.0], [0, 0, 1.0], [2, 2, 2.5]],
        [[0, 0, -1], [0, 0, -1], [0, 0, 1], [0, 0, 1]],
    )
    np.testing.assert_allclose(distance, [0.5, 0.5, 1.0, 0.5])
    assert hit.tolist() == [-1, 0, -1, -1 - 6]


def test_limit_stops_the_search_before_a_wall():
    tables = _walls.tables([Plane((0, 0, -3), (0, 0, 1)), Disc((0, 0, -2), (0, 0, 1), 1.0)])
    ray = (0.0, 0.0, 0.0, 0.0, 0.0, -1.0)
    assert _walls.wall_hit(*ray, tables) == (2.0, 1)
    assert _walls.wall_hit_within(*ray, 2.5, tables) == (2.0, 1)
    assert _walls.wall_hit_within(*ray, 1.5, tables) == (1.5, -1)


def test_clearance_and_exposure():
    walls = [Plane((0, 0, -2), (0, 0, 1)), Disc((0, 0, 1), (0, 0, 1), 0.5)]
    bed = Packing([[0, 0, 0], [3, 0, 0], [0.3, 3, 0.8], [-0.8, 0, 1]], 0.45, walls=walls)
    free = _walls.clearance(walls, bed.centres)
    np.testing.assert_allclose(free, [1.0, 2.0, np.hypot(np.hypot(0.3, 3) - 0.5, 0.2), 0.3])
    assert Scene.of(bed).tables.exposed.tolist() == [True, True, True, False]


def test_what_a_wall_through_a_sphere_hides():
    """The cap beyond the wall, and only where the wall reaches."""
    tables = _walls.tables([Disc((0, 0, 0.5), (0, 0, 1), 0.6)])
    for x, z, hidden in ((0.0, 1.0, True), (0.3, 0.95, True), (0.8, 0.6, False), (0, -1, False)):
        length = np.hypot(x, z)
        point = (x / length, 0.0, z / length)
        assert _walls.crosses(0.0, 0.0, 0.0, *point, tables) == hidden
        assert not _walls.behind(*point, tables)


def test_bounded_walls_do_not_repeat():
    for wall in (Disc((0, 0, 0), (0, 0, 1), 1.0), Cylinder((0, 0, 0), (0, 0, 1), 1.0, length=1.0)):
        bed = Packing([[1, 1, 1]], 0.3, [3, 3, 3], (False, False, True), [wall])
        with pytest.raises(InputError, match="does not repeat along the periodic direction z"):
            view_factors(bed, rays=10)


EMITTING = [
    Disc((0.2, 0.1, 0), (1, 2, -2), 0.7),
    Cone((0.1, 0.3, -0.2), (2, 1, 2), 1.0, 0.3, 1.1),
    Cone((0.1, 0.3, -0.2), (2, 1, 2), 0.0, 0.9, 1.1),
    Cylinder((0, 0.5, 0), (1, 0, 1), 0.6, length=0.8),
    Polygon([(0, 0, 0), (3, 0, 0), (3, 1, 0), (1, 1, 0), (1, 2, 0), (0, 2, 0)]),
]


def emitted(wall, n=4000, seed=0):
    # An unbounded wall before it: numbers of walls, not of rows, count.
    tables = _emission.emitters([Plane((0, 0, 0), (0, 0, 1)), wall])
    rays = np.empty((n, 6))
    _emission.emit_many(1, np.random.default_rng(seed).random((n, 4)), tables, rays)
    return rays[:, :3], rays[:, 3:]


def normals(wall, points):
    """Normals on the bed's side, from the shape."""
    if isinstance(wall, Disc | Polygon):
        return np.broadcast_to(wall.normal, points.shape)
    axis = np.array(wall.axis)
    offset = points - wall.point
    out = offset - np.outer(offset @ axis, axis)
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    rise = (getattr(wall, "end_radius", wall.radius) - wall.radius) / wall.length
    return (rise * axis - out) / np.hypot(1, rise)


@pytest.mark.parametrize("wall", EMITTING, ids=lambda w: f"{w.name}_{getattr(w, 'radius', 0)}")
def test_emission_is_even_and_follows_the_cosine(wall):
    from greybed.core import patches

    o, d = emitted(wall)
    np.testing.assert_allclose(np.linalg.norm(d, axis=1), 1.0, rtol=1e-13)
    assert patches.distances([wall], o).max() < 1e-9
    normal = normals(wall, o)
    cosine = (d * normal).sum(axis=1)
    assert cosine.min() > 0.0
    # Cosine law: the squared sine is even; the azimuth is even too.
    assert kstest(1 - cosine**2, "uniform").pvalue > 1e-3
    assert np.linalg.norm(np.mean(d - cosine[:, None] * normal, axis=0)) < 4 * (0.5 / len(o)) ** 0.5
    # Even: the share of a part is the share of its area.
    if isinstance(wall, Polygon):
        assert abs(np.mean(o[:, 0] < 1.0) - 0.5) < 4 * (0.25 / len(o)) ** 0.5
        assert kstest(o[o[:, 0] > 1.0][:, 1], "uniform").pvalue > 1e-3
    elif isinstance(wall, Disc):
        rho = np.linalg.norm(o - wall.point, axis=1) / wall.radius
        assert kstest(rho**2, "uniform").pvalue > 1e-3
    else:
        s = (o - wall.point) @ np.array(wall.axis) / wall.length
        end = getattr(wall, "end_radius", wall.radius)
        area = (2 * wall.radius * s + (end - wall.radius) * s**2) / (wall.radius + end)
        assert kstest(area, "uniform").pvalue > 1e-3


def test_triangles_of_a_mesh_emit_by_their_area():
    rng = np.random.default_rng(8)
    mesh = Mesh(rng.uniform(size=(60, 3)), np.arange(60).reshape(-1, 3))
    o, _ = emitted(mesh, 20_000)
    t = mesh.triangles
    area = 0.5 * np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1)
    assert area.sum() == pytest.approx(mesh.area)
    # Mean of the points: of the middles by area.
    want = (area[:, None] * t.mean(axis=1)).sum(axis=0) / area.sum()
    assert (np.abs(o.mean(axis=0) - want) < 4 * o.std(axis=0) / len(o) ** 0.5).all()


def test_unbounded_walls_cannot_emit():
    tables = _emission.emitters([Cylinder((0, 0, 0), (0, 0, 1), 1.0)])
    assert np.isnan(_emission.emit(0, 0.5, 0.5, 0.5, 0.5, tables)).all()
    assert np.isinf(tables.area[0])


def test_walls_and_sphere_exchange_alike():
    """A_i F_ij = A_j F_ji between a sphere and what emits to it, through wall_hit as well."""
    centre, radius = np.array([0.2, 0.1, 0.9]), 0.4
    for wall in (EMITTING[4], Disc((0, 0, 0), (0, 0, 1), 1.0)):
        o, d = emitted(wall, 40_000, seed=3)
        b = ((centre - o) * d).sum(axis=1)
        hit = (b > 0) & (b * b - ((centre - o) ** 2).sum(axis=1) + radius**2 > 0)
        if isinstance(wall, Disc):
            exact = sphere_to_disk(centre, wall.point, wall.normal, wall.radius, radius)
        else:
            exact = sphere_to_polygon(centre, wall.vertices, radius)
        want = exact * 4 * np.pi * radius**2 / wall.area
        assert abs(hit.mean() - want) < 4 * (want * (1 - want) / len(o)) ** 0.5


def test_rays_that_leave_the_inside_of_a_closed_can_stay_inside():
    walls = [
        Disc((0, 0, 0), (0, 0, 1), 1.0),
        Cone((0, 0, 0), (0, 0, 1), 1.0, 0.5, 2.0),
        Disc((0, 0, 2), (0, 0, -1), 0.5),
        *box_walls((-3,) * 3, (3,) * 3),
    ]
    emitters = _emission.emitters(walls)
    bed = Packing([[0, 0, 5]], 0.1, walls=walls)
    rays = np.empty((4000, 6))
    for k in range(3):
        _emission.emit_many(k, np.random.default_rng(k).random((4000, 4)), emitters, rays)
        _, hit = first_hits(bed, rays[:, :3], rays[:, 3:])
        assert set(np.unique(hit)) == {-1 - w for w in range(3) if w != k or k == 1}
