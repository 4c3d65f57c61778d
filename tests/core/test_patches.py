"""Bounded walls: what is refused, areas, triangles, files, rays and distances."""

import math

import numpy as np
import pytest

from greybed.core import Cone, Cylinder, Disc, InputError, Mesh, Plane, Polygon, _kernels, box_walls
from greybed.core import patches as tables
from greybed.core.readers import read_mesh

CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
# Right-hand normals outwards.
FACES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]
)  # fmt: skip
L_SHAPE = [(0, 0, 0), (3, 0, 0), (3, 1, 0), (1, 1, 0), (1, 2, 0), (0, 2, 0)]


def test_areas():
    assert Plane((0, 0, 0), (0, 0, 1)).area == Cylinder((0, 0, 0), (0, 0, 1), 2.0).area == math.inf
    assert Cylinder((0, 0, 0), (0, 0, 1), 2.0, length=3.0).area == pytest.approx(12 * math.pi)
    assert Disc((0, 0, 0), (0, 0, 1), 2.0).area == pytest.approx(4 * math.pi)
    # A whole cone of radius 3 and height 4: pi r s with the slant height 5.
    assert Cone((0, 0, 0), (0, 0, 1), 0.0, 3.0, 4.0).area == pytest.approx(15 * math.pi)
    assert Polygon(L_SHAPE).area == pytest.approx(4.0)
    assert Mesh(CUBE, FACES).area == pytest.approx(6.0)
    assert sum(wall.area for wall in box_walls((0, 0, 0), (1, 2, 3))) == pytest.approx(22.0)


def test_normals_of_a_box_point_inwards():
    walls = box_walls((0, 0, 0), (1, 2, 3), "oven")
    assert [w.name for w in walls][:3] == ["oven_x_low", "oven_x_high", "oven_y_low"]
    for wall in walls:
        inwards = np.array([0.5, 1.0, 1.5]) - np.mean(wall.vertices, axis=0)
        assert inwards @ wall.normal > 0.4


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Polygon([(0, 0, 0), (1, 0, 0)]), "at least three"),
        (lambda: Polygon([(0, 0, 0), (1, 0, 0), (2, 0, 0)]), "no area"),
        (lambda: Polygon([(0, 0, 0), (1, 0, 0), (1, 1, 0.1), (0, 1, 0)]), "off a plane"),
        (lambda: Polygon([(0, 0, 0), (2, 0, 0), (0, 1, 0), (3, 2.5, 0)]), "cross"),
        (lambda: Polygon([(0, 0, 0), (1, 0, math.nan), (1, 1, 0)]), "not finite"),
        (lambda: Polygon(7), "corners"),
        (lambda: Disc((0, 0, 0), (0, 0, 1), 0.0), "radius"),
        (lambda: Cylinder((0, 0, 0), (0, 0, 1), 1.0, length=-1.0), "length"),
        (lambda: Cone((0, 0, 0), (0, 0, 1), 0.0, 0.0, 1.0), "radius"),
        (lambda: Cone((0, 0, 0), (0, 0, 1), -1.0, 1.0, 1.0), "at least 0"),
        (lambda: Cone((0, 0, 0), (0, 0, 1), 1.0, 1.0, math.inf), "length"),
        (lambda: Mesh([], []), "empty"),
        (lambda: Mesh(1e10 * np.asarray(CUBE), FACES), r"farther than 1e\+09 m from the origin"),
        (lambda: Mesh(CUBE, FACES[:0]), "empty"),
        (lambda: Mesh(CUBE, [[0, 1, 8]]), "corner numbers"),
        (lambda: Mesh(CUBE, [[0, 1, -1]]), "corner numbers"),
        (lambda: Mesh(CUBE, [[0.0, 1.0, 2.0]]), "corner numbers"),
        (lambda: Mesh(CUBE[:, :2], FACES), r"must be \(n, 3\)"),
        (lambda: Mesh(CUBE * np.nan, FACES), "not finite"),
        (lambda: Mesh(CUBE, [[0, 0, 1]]), "no area"),
        (lambda: Mesh([[0, 0, 0], [1, 1, 1], [2, 2, 2]], [[0, 1, 2]]), "no area"),
        (lambda: box_walls((0, 0, 0), (1, 1, 0)), "exceed"),
    ],
)
def test_refusals(make, says):
    with pytest.raises(InputError, match=says):
        make()


def test_polygons_of_any_shape_are_cut_into_triangles():
    turn, _ = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))
    star = [
        (r * math.cos(k * math.pi / 7), r * math.sin(k * math.pi / 7), 2.0)
        for k, r in enumerate([1.0, 0.2] * 7)
    ]
    # Corners on straight edges, and a corner cut so deep that fans from a corner would fail.
    comb = [(0, 0, 0), (2, 0, 0), (4, 0, 0), (4, 2, 0), (3, 0.1, 0), (2, 2, 0), (1, 0.1, 0)]
    for corners in (L_SHAPE, star, comb, comb[::-1]):
        polygon = Polygon(tuple(map(tuple, np.array(corners) @ turn)))
        t = polygon.triangles
        cross = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
        assert (cross @ np.array(polygon.normal) > 0.0).all()
        assert 0.5 * np.linalg.norm(cross, axis=1).sum() == pytest.approx(polygon.area, rel=1e-12)


def test_what_a_mesh_says_of_itself():
    whole = Mesh(CUBE, FACES)
    assert (whole.watertight, whole.winding_consistent, whole.dropped) == (True, True, 0)
    assert whole.volume == pytest.approx(1.0)
    assert whole.flipped().volume == pytest.approx(-1.0)
    assert not Mesh(CUBE, FACES[1:]).watertight
    turned = FACES.copy()
    turned[0] = turned[0, ::-1]
    assert Mesh(CUBE, turned).watertight
    assert not Mesh(CUBE, turned).winding_consistent
    # Corners of their own for every triangle, as in STL, and two triangles without area.
    soup = np.concatenate([CUBE[FACES].reshape(-1, 3), [[0, 0, 0]] * 3, [[0, 0, 0]] * 3])
    mesh = Mesh(soup, np.arange(len(soup)).reshape(-1, 3))
    assert (len(mesh.vertices), len(mesh.faces), mesh.dropped) == (8, 12, 2)
    assert (mesh.watertight, mesh.winding_consistent) == (True, True)
    assert mesh == whole
    assert hash(mesh) == hash(whole)
    assert mesh != whole.flipped()
    assert repr(mesh) != repr(whole.flipped())


OBJ = """# a box without lid
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 0 0 1
v 1 0 1
g floor
f 1/1/1 2/2/1 3/3/1 4/4/1
g front wall
f -6 -5 -1 -2
"""


def test_groups_of_an_obj_file_are_patches(tmp_path):
    path = tmp_path / "oven.obj"
    path.write_text(OBJ)
    floor, front = read_mesh(path, unit="mm")
    assert (floor.name, front.name) == ("oven_floor", "oven_front_wall")
    assert floor.area == pytest.approx(1e-6)
    assert front.vertices[:, 1].max() == 0.0
    assert not floor.watertight
    assert floor.winding_consistent
    assert read_mesh(path, name="a")[0].name == "a_floor"


@pytest.mark.parametrize("suffix", [".stl", ".ply", ".obj"])
def test_files_of_trimesh(tmp_path, suffix):
    import trimesh

    path = tmp_path / f"ball{suffix}"
    trimesh.creation.icosphere(subdivisions=2).export(path)
    (mesh,) = read_mesh(path, unit="cm")
    assert mesh.name == "ball"
    assert (mesh.watertight, mesh.winding_consistent, mesh.dropped) == (True, True, 0)
    assert len(mesh.faces) == 320
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices, axis=1), 0.01, rtol=1e-6)


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("a.step", b"x", "extension"),
        ("a.stl", b"", "empty"),
        ("a.stl", b"\x00" * 84, "empty"),
        ("a.stl", b"\x01" * 90, "STL|empty"),
        ("a.ply", b"ply\nformat ascii 1.0\nend_header\n", "empty|PLY"),
        ("a.ply", b"\xff\xfe\x00 nonsense", "PLY"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\n", "empty"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nf 1 2 3\n", "line 3"),
        ("a.obj", b"v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "not finite"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "no area"),
        ("a.obj", b"v 0 0 x\n", "line 1"),
    ],
)
def test_refused_files(tmp_path, name, content, says):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(InputError, match=says) as caught:
        read_mesh(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_missing_file_and_wrong_unit(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_mesh(tmp_path / "none.stl")
    with pytest.raises(InputError, match="unit"):
        read_mesh(tmp_path / "none.stl", unit="kg")


def lumpy(n, rng):
    """A closed mesh, not convex, with triangles of very different sizes."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=n)
    bump = 1.0 + 0.4 * np.sin(5.0 * ball.vertices @ rng.normal(size=3))
    return Mesh(ball.vertices * bump[:, None] * [1.0, 2.0, 0.3], ball.faces, "lumps")


def brute_rays(triangles, o, d):
    """Moeller & Trumbore 1997, every triangle against every ray."""
    a, u, v = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    p = np.cross(d[:, None], v)
    with np.errstate(divide="ignore", invalid="ignore"):
        f = 1.0 / (p * u).sum(axis=-1)
        s = o[:, None] - a
        b = f * (s * p).sum(axis=-1)
        q = np.cross(s, u)
        c = f * (d[:, None] * q).sum(axis=-1)
        t = f * (q * v).sum(axis=-1)
    hit = (b >= 0) & (c >= 0) & (b + c <= 1) & (t > 0)
    return np.where(hit, t, np.inf).min(axis=1)


def directions(rng, n):
    d = rng.normal(size=(n, 3))
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def test_tree_of_triangles_against_all_of_them():
    rng = np.random.default_rng(3)
    mesh = lumpy(2, rng)
    o, d = rng.uniform(-2, 2, (3000, 3)), directions(rng, 3000)
    d[:300] = np.eye(3)[rng.integers(0, 3, 300)] * rng.choice([-1, 1], (300, 1))  # along the axes
    want = brute_rays(mesh.triangles, o, d)
    got = tables.ray_distances(mesh, o, d)
    assert 500 < np.isfinite(want).sum() < 2900
    np.testing.assert_allclose(got, want, rtol=1e-9, atol=1e-12)


def test_no_ray_slips_through_edges_and_corners():
    """Aimed at every edge and corner from inside, at any scale and far from the origin."""
    rng = np.random.default_rng(4)
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=4)
    for scale, shift in ((1.0, 0.0), (1e-6, 0.0), (1e3, 1e5)):
        mesh = Mesh(ball.vertices * scale + shift, ball.faces)
        t = mesh.triangles
        part = rng.uniform(size=(len(t), 1))
        aims = np.concatenate(
            [t[:, 0], 0.5 * (t[:, 0] + t[:, 1]), t[:, 1] + part * (t[:, 2] - t[:, 1])]
        )
        o = shift + scale * rng.uniform(-0.4, 0.4, (len(aims), 3))
        d = (aims - o) / np.linalg.norm(aims - o, axis=1, keepdims=True)
        reach = tables.ray_distances(mesh, o, d)
        np.testing.assert_allclose(reach, np.linalg.norm(aims - o, axis=1), rtol=1e-6)
    # Exactly through corners and edges, where products are exact and areas zero.
    n = 5
    grid = np.array([[x, y, 0.0] for x in range(n + 1) for y in range(n + 1)])
    cell = np.array([k * (n + 1) + m for k in range(n) for m in range(n)])
    both = [cell, cell + n + 1, cell + n + 2], [cell, cell + n + 2, cell + 1]
    for order in ((0, 1, 2), (2, 1, 0)):
        flat = Mesh(grid, np.concatenate([np.stack(f, axis=1)[:, order] for f in both]))
        x, y = (a.ravel() for a in np.meshgrid(*[np.arange(0, n + 0.25, 0.25)] * 2))
        for axis in range(3):
            turned = Mesh(np.roll(flat.vertices, axis, axis=1), flat.faces)
            o = np.roll(np.stack([x, y, 0 * x + 2], axis=1), axis, axis=1)
            d = np.roll(np.tile([0.0, 0, -1], (len(x), 1)), axis, axis=1)
            assert (tables.ray_distances(turned, o, d) == 2.0).all()
    # Along the edges of a box, and from outside.
    box = Mesh(CUBE, FACES)
    o = np.array([[0.5, 0.5, 0.5], [0.5, 0.5, -1.0], [-1.0, -1.0, -1.0], [0.5, 0.0, 0.5]])
    d = np.array([[0.0, 0, 1], [0, 0, 1], [3**-0.5] * 3, [1, 0, 0]])
    reach = tables.ray_distances(box, o, d)
    np.testing.assert_allclose(reach, [0.5, 1.0, 3**0.5, 0.5], rtol=1e-12)


def march_to(inside, o, d, far, steps=4001):
    """First change of ``inside`` along rays, by bisection: knows nothing of the closed forms."""
    t = np.linspace(0, far, steps)
    side = inside(o[:, None] + t[:, None] * d[:, None])
    change = side[:, 1:] != side[:, :-1]
    k = change.argmax(axis=1)
    low, high = t[k], t[k + 1]
    start = side[np.arange(len(o)), k]
    for _ in range(60):
        middle = 0.5 * (low + high)
        same = inside(o + middle[:, None] * d) == start
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return np.where(change.any(axis=1), low, np.inf)


def test_rays_meet_a_cone_between_two_discs():
    """Together a closed body: each ray meets what a march with an inside test finds."""
    rng = np.random.default_rng(5)
    for begin, end in ((1.0, 0.4), (0.7, 0.7), (0.0, 1.2)):
        axis = directions(rng, 1)[0]
        point = np.array([0.3, -0.2, 0.1])
        side = Cone(point, axis, begin, end, 1.5)
        if begin == end:
            side = Cylinder(point, axis, begin, length=1.5)
        lids = [Disc(point + 1.5 * axis, axis, end)] + ([Disc(point, axis, begin)] if begin else [])

        def inside(p, point=point, axis=axis, begin=begin, end=end):
            s = (p - point) @ axis
            rho = np.linalg.norm(p - point - s[..., None] * axis, axis=-1)
            return (s > 0) & (s < 1.5) & (rho < begin + (end - begin) * s / 1.5)

        o, d = rng.uniform(-1.5, 1.5, (600, 3)), directions(rng, 600)
        got = np.min([tables.ray_distances(w, o, d) for w in (side, *lids)], axis=0)
        want = march_to(inside, o, d, 8.0)
        # Chords shorter than a step of the march are lost to it.
        lost = np.isinf(want) & np.isfinite(got)
        assert lost.sum() < 10
        assert np.isfinite(want).sum() > 80
        np.testing.assert_allclose(got[~lost], want[~lost], atol=1e-9)


def test_distances_against_dense_points():
    rng = np.random.default_rng(6)
    walls = [
        lumpy(1, rng),
        Polygon(L_SHAPE),
        Disc((0.2, 0, 0), (1, 2, 3), 0.7),
        Cone((0.1, 0, -0.5), (1, 1, 2), 1.0, 0.3, 1.2),
        Cylinder((0, 0.5, 0), (1, 0, 1), 0.6, length=0.8),
    ]
    points = rng.uniform(-2.5, 2.5, (200, 3))
    for wall in walls:
        u, v = (a.ravel() for a in np.meshgrid(np.linspace(0, 1, 161), np.linspace(0, 1, 161)))
        if isinstance(wall, Mesh | Polygon):
            t = wall.triangles[:, :, None]
            u, v = u[::16] * (1 - v[::16]), v[::16]
            cloud = t[:, 0] + u[:, None] * (t[:, 1] - t[:, 0]) + v[:, None] * (t[:, 2] - t[:, 0])
        else:
            axis = np.array(wall.normal if isinstance(wall, Disc) else wall.axis)
            e = np.linalg.svd(axis[None])[2][1:]
            ring = np.cos(2 * np.pi * v)[:, None] * e[0] + np.sin(2 * np.pi * v)[:, None] * e[1]
            end = getattr(wall, "end_radius", wall.radius)
            rho = (
                wall.radius * u if isinstance(wall, Disc) else wall.radius + u * (end - wall.radius)
            )
            s = 0.0 * u if isinstance(wall, Disc) else u * wall.length
            cloud = np.array(wall.point) + s[:, None] * axis + rho[:, None] * ring
        cloud = cloud.reshape(-1, 3)
        near = np.min(
            [np.linalg.norm(points - c, axis=1) for c in cloud[:: 1 + len(cloud) // 20000]], axis=0
        )
        got = tables.distances([wall], points)
        assert (got <= near + 1e-12).all()
        assert (near - got).max() < 0.08
        assert np.median(near - got) < 5e-3
    together = tables.distances(walls, points)
    each = np.min([tables.distances([w], points) for w in walls], axis=0)
    np.testing.assert_allclose(together, each, rtol=1e-14)
    assert np.isinf(tables.distances([Plane((0, 0, 0), (0, 0, 1))], points)).all()


def test_points_that_are_read_only_need_no_machine_code_of_their_own():
    walls = box_walls((-1, -1, 0), (1, 1, 1))
    points = np.array([[0.1, 0.2, 0.5]])
    writable = tables.distances(walls, points)
    known = list(_kernels.patch_distances.signatures)
    points.setflags(write=False)
    np.testing.assert_array_equal(tables.distances(walls, points), writable)
    assert list(_kernels.patch_distances.signatures) == known
