"""Pictures of beds: known colours at known places, transparency, the cut, refusals."""

import math

import numpy as np
import pytest

from greybed.core import Cylinder, InputError, Packing, Plane
from greybed.report.picture import HEAT, View, bed_picture, colour_of, in_view, value_limits

FRONT = View(elevation=0.0, distance=math.inf)


def hue(rgb):
    """A colour without its brightness: what shading leaves alone."""
    rgb = np.asarray(rgb, dtype=float)
    return rgb / np.linalg.norm(rgb)


def test_each_sphere_has_the_colour_of_its_value():
    pair = Packing([[-2e-3, 0, 0], [2e-3, 0, 0]], 1e-3)
    picture = bed_picture(pair, [300.0, 900.0], width=60, height=20, view=FRONT, cut=False)
    assert picture.shape == (20, 60, 4)
    assert picture.dtype == np.uint8
    for column, value in ((10, 0.0), (49, 1.0)):
        assert picture[10, column, 3] == 255
        np.testing.assert_allclose(
            hue(picture[10, column, :3]), hue(HEAT(value)[:3]), atol=0.01
        )  # fmt: skip
    assert (picture[:, 30, 3] == 0).all()
    assert (picture[[0, 0, -1, -1], [0, -1, 0, -1], 3] == 0).all()


def test_limits_make_colours_comparable_between_pictures():
    one = Packing([[0, 0, 0]], 1e-3)
    options = {"width": 16, "height": 16, "limits": (0.0, 1.0)}
    same = bed_picture(one, [0.5], **options)
    np.testing.assert_array_equal(same, bed_picture(one, [0.5], **options))
    assert (same != bed_picture(one, [0.9], **options)).any()


def test_upper_left_is_the_bright_side():
    picture = bed_picture(Packing([[0, 0, 0]], 1e-3), [1.0], width=40, height=40, view=FRONT)
    brightness = picture[..., :3].sum(axis=2)
    assert brightness[10, 12] > brightness[28, 26]


def test_walls_do_not_block_the_eye_and_edges_are_smooth():
    walls = (Cylinder((0, 0, 0), (0, 0, 1), 2e-3), Plane((0, 0, -1e-3), (0, 0, 1)))
    with_walls = Packing([[0, 0, 0]], 1e-3, walls=walls)
    picture = bed_picture(with_walls, [1.0], width=30, height=30)
    np.testing.assert_array_equal(
        picture, bed_picture(Packing([[0, 0, 0]], 1e-3), [1.0], width=30, height=30)
    )
    assert ((picture[..., 3] > 0) & (picture[..., 3] < 255)).any()


@pytest.mark.parametrize("distance", [3.0, math.inf])
def test_the_cut_takes_away_what_faces_the_eye(distance):
    front_and_back = Packing([[0, -1.5e-3, 0], [0, 1.5e-3, 0]], 1e-3)
    view = View(elevation=0.0, distance=distance)
    assert in_view(front_and_back, view).tolist() == [False, True]
    for cut, value in ((True, 1.0), (False, 0.0)):
        picture = bed_picture(
            front_and_back, [0.0, 1.0], width=21, height=21, view=view, cut=cut, limits=(0.0, 1.0)
        )
        np.testing.assert_allclose(hue(picture[10, 10, :3]), hue(HEAT(value)[:3]), atol=0.01)


def test_height_follows_from_the_bed():
    tall = Packing([[0, 0, 2e-3 * k] for k in range(5)], 1e-3)
    assert bed_picture(tall, np.arange(5), width=10, view=FRONT).shape == (50, 10, 4)


def test_values_without_spread_and_not_finite():
    assert value_limits([3.0, np.nan, 3.0]) == (2.5, 3.5)
    assert value_limits([np.nan]) == (0.0, 1.0)
    np.testing.assert_allclose(colour_of([np.nan, 1.0], (0.0, 1.0))[0], 0.6)


def test_refusals_name_the_remedy():
    with pytest.raises(InputError, match=r"values have shape \(2,\); give one per sphere, \(1,\)"):
        bed_picture(Packing([[0, 0, 0]], 1e-3), [1.0, 2.0])
    with pytest.raises(InputError, match="0 x 5 pixels is empty"):
        bed_picture(Packing([[0, 0, 0]], 1e-3), [1.0], width=0, height=5)
