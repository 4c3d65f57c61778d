"""Contact conductances against closed forms, Hertz scaling, and refusals."""

import numpy as np
import pytest
from scipy.special import ellipe, ellipk

from greybed.core import Cone, Cylinder, Disc, InputError, Packing, Plane, box_walls
from greybed.coupling import contact_conductances
from greybed.coupling.conduction import wall_contacts

R, DELTA, K = 1e-3, 2e-6, 15.0


def pair(gap=-DELTA, radii=(R, R), **kwargs):
    return Packing([[0, 0, 0], [0, 0, radii[0] + radii[1] + gap]], radii, **kwargs)


def test_pair_follows_batchelor_and_obrien():
    c = contact_conductances(pair(radii=(R, 2 * R)), [K, 3 * K])
    a = np.sqrt(R * 2 * R / (3 * R) * DELTA)
    k_eff = 2 * K * 3 * K / (4 * K)
    np.testing.assert_allclose(c.contact_radius, [a], rtol=1e-9)  # distance rounds at 1e-16/2e-6
    np.testing.assert_allclose(c.matrix.toarray(), 2 * k_eff * a * np.eye(2)[::-1], rtol=1e-9)


def test_stiffness_ratio_shrinks_the_radius_as_hertz_says():
    soft = contact_conductances(pair(), K).matrix[0, 1]
    stiff = contact_conductances(pair(), K, stiffness_ratio=1000.0).matrix[0, 1]
    assert stiff == pytest.approx(soft / 10.0, rel=1e-12)


def test_gap_conducts_only_within_the_stated_tolerance():
    apart = pair(gap=1e-7)
    assert contact_conductances(apart, K).n_contacts == 0
    near = contact_conductances(apart, K, touching_gap=3e-7)
    np.testing.assert_allclose(near.contact_radius, np.sqrt(R / 2 * 2e-7), rtol=1e-8)


def test_periodic_contacts_count():
    bed = Packing([[0.1e-3, 1e-3, 1e-3], [2.099e-3, 1e-3, 1e-3]], R, [3.997e-3] * 3, (True,) * 3)
    # Both sides touch; the nearest image alone counts once per pair.
    assert contact_conductances(bed, K).n_contacts == 1


def test_plane_contact_is_isothermal_or_in_series_with_the_wall():
    bed = Packing([[0, 0, R - DELTA]], R, walls=[Plane((0, 0, 0), (0, 0, 1))])
    a = np.sqrt(R * DELTA)
    assert contact_conductances(bed, K).walls[0, 0] == pytest.approx(4 * K * a, rel=1e-9)
    series = contact_conductances(bed, K, wall_conductivity=K).walls[0, 0]
    assert series == pytest.approx(2 * K * a, rel=1e-9)


@pytest.mark.parametrize("ratio", [0.05, 0.2, 0.5])
def test_mean_curvature_in_a_cylinder_is_within_one_percent_of_the_elliptic_spot(ratio):
    bed = Packing([[R / ratio - R, 0, 0]], R, walls=[Cylinder((0, 0, 0), (0, 0, 1), R / ratio)])
    effective = wall_contacts(bed, bed.walls[0])[1][0]
    # Elliptic Hertz contact with semi-axes 1 and b: find b from the curvature ratio.
    low, high = 1e-9, 0.999
    for _ in range(100):
        e2 = (low + high) / 2
        k, e = ellipk(e2), ellipe(e2)
        curvatures = (k - e, e / (1 - e2) - k)  # times b / e2
        low, high = (low, e2) if curvatures[1] / curvatures[0] > 1 / (1 - ratio) else (e2, high)
    b = np.sqrt(1 - e2)
    radius = 0.5 / np.sqrt(curvatures[0] * curvatures[1] * (b / e2) ** 2)
    area_over_overlap = b / (b * k) / radius  # a b / (R delta)
    assert area_over_overlap == pytest.approx(1.0, abs=0.01)
    assert effective == pytest.approx(R / np.sqrt(1 - ratio), rel=1e-12)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"conductivity": 0.0}, r"conductivity = 0 \[W/m/K\]"),
        ({"conductivity": [1.0, np.nan]}, r"conductivity\[1\] = nan"),
        ({"conductivity": [1.0] * 3}, r"shape \(3,\)"),
        ({"stiffness_ratio": -1.0}, r"stiffness_ratio = -1 .*above 0"),
        ({"touching_gap": -1e-6}, r"touching_gap = -1e-06 \[m\]"),
        ({"wall_conductivity": 0.0}, r"wall_conductivity = 0"),
    ],
)
def test_refusals_name_value_and_bound(options, message):
    with pytest.raises(InputError, match=message):
        contact_conductances(pair(), **{"conductivity": K, **options})


def test_sphere_behind_a_wall_is_refused():
    for wall in (Plane((0, 0, 1), (0, 0, 1), "floor"), Cylinder((1, 0, 0), (0, 0, 1), 0.5, "side")):
        with pytest.raises(InputError, match=rf"sphere 0 .* behind wall '{wall.name}'"):
            contact_conductances(Packing([[0, 0, 0]], R, walls=[wall]), K)
    with pytest.raises(InputError, match="does not fit"):
        contact_conductances(
            Packing([[0, 0, 0]], R, walls=[Cylinder((0, 0, 0), (0, 0, 1), R / 2)]), K
        )


def test_bounded_walls_touch_as_unbounded_ones_do():
    centres, up = [[0.2, 0.3, 0.95], [0.0, -2.02, 2.0]], (0, 0, 1)
    bed = Packing(centres, 1.0)
    plane, flat = (
        Plane((0, 0, 0), up),
        (Disc((0, 0, 0), up, 9.0), box_walls((-9,) * 3, (9, 9, 0))[5]),
    )
    for wall in flat:
        for got, want in zip(wall_contacts(bed, wall), wall_contacts(bed, plane), strict=True):
            np.testing.assert_allclose(got, want, rtol=1e-12)
    pipe = Cylinder((0, 0, -5), up, 3.0)
    for wall in (Cylinder((0, 0, -5), up, 3.0, length=20), Cone((0, 0, -5), up, 3.0, 3.0, 20)):
        for got, want in zip(wall_contacts(bed, wall), wall_contacts(bed, pipe), strict=True):
            np.testing.assert_allclose(got, want, rtol=1e-12)


def test_curvature_of_cones_and_of_the_outside_of_tubes():
    # Outside: 1/R* is the mean of the sphere's 1/r and of 1/r + 1/R.
    outside = Packing([[3.99, 0, 0]], 1.0, walls=[Cylinder((0, 0, -5), (0, 0, 1), 3.0, length=10)])
    overlap, effective = wall_contacts(outside, outside.walls[0])
    assert overlap[0] == pytest.approx(0.01)
    assert effective[0] == pytest.approx((1.0 * (1.0 + 1 / 3)) ** -0.5)
    # A cone of half angle 45 degrees: the normal from the wall meets the axis after sqrt(2) rho.
    cone = Cone((0, 0, 0), (0, 0, 1), 0.0, 10.0, 10.0)
    middle = np.array([4.0, 0, 4.0]) + 0.99 * np.array([-1, 0, 1]) / 2**0.5
    overlap, effective = wall_contacts(Packing([middle], 1.0), cone)
    assert overlap[0] == pytest.approx(0.01)
    assert effective[0] == pytest.approx((1.0 * (1.0 - 1 / (4.0 * 2**0.5))) ** -0.5)
    with pytest.raises(InputError, match="does not fit"):
        wall_contacts(Packing([[0, 0, 5]], 4.0), Cylinder((0, 0, 0), (0, 0, 1), 3.0, length=10))
