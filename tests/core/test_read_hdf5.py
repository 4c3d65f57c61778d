import json
import math

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from greybed.core.errors import InputError
from greybed.core.packing import Packing
from greybed.core.readers import read_packing
from greybed.core.walls import Cone, Cylinder, Disc, Mesh, Plane, box_walls
from greybed.core.writers import write_packing

WALLS = (
    Plane((0.1, 0.2, 0.3), (1.0, 2.0, 3.0), "floor"),
    Cylinder((0, 0, 0), (0.3, 0.1, 1.0), 0.7, 'pipe "A" — ä'),
)


@pytest.fixture
def path(tmp_path):
    bed = Packing([[0.1, 0.2, 0.3], [0.7, 0.7, 0.7]], [0.1, 0.2], [1, 1, 1], walls=WALLS)
    return write_packing(bed, tmp_path / "bed.h5")


VECTOR = st.tuples(*[st.floats(-10, 10)] * 3)


@given(
    arrays(np.float64, st.tuples(st.integers(1, 12), st.just(3)), elements=st.floats(0, 0.999)),
    st.floats(1e-9, 0.4),
    st.tuples(*[st.booleans()] * 3),
    VECTOR,
    VECTOR.filter(lambda v: math.hypot(*v) > 1e-3),
    st.text(st.characters(codec="utf-8", exclude_characters="\x00"), max_size=8),
)
@settings(max_examples=60, deadline=None)
def test_round_trip_is_lossless(tmp_path_factory, centres, radius, periodic, point, normal, name):
    radii = radius * np.linspace(0.5, 1.0, len(centres))
    walls = (Plane(point, normal, name), Cylinder(point, normal, radius, name))
    bed = Packing(centres, radii, [1, 1, 1], periodic, walls)
    again = read_packing(write_packing(bed, tmp_path_factory.mktemp("h5") / "bed.h5"))
    np.testing.assert_array_equal(again.centres, bed.centres)
    np.testing.assert_array_equal(again.radii, bed.radii)
    np.testing.assert_array_equal(again.box, bed.box)
    assert (again.periodic, again.walls) == (bed.periodic, bed.walls)


def test_units_and_format_stand_in_the_file(path):
    with h5py.File(path) as root:
        assert root.attrs["format"] == b"greybed-packing"
        assert root.attrs["version"] == 1
        assert {name: item.attrs["units"] for name, item in root.items()} == {
            "centres": b"m",
            "radii": b"m",
            "box": b"m",
        }


def test_no_box_no_walls(tmp_path):
    bed = read_packing(write_packing(Packing([[0, 0, 0]], 1.0), tmp_path / "one.hdf5"))
    assert bed.box is None
    assert bed.walls == ()


def test_given_walls_go_first(path):
    assert read_packing(path, WALLS[:1]).walls == WALLS[:1]


def test_many_walls(tmp_path):
    walls = [Plane((k, 0, 0), (1, k, 0), f"plane {k}") for k in range(3000)]  # above 64 KiB
    bed = read_packing(write_packing(Packing([[0, 0, 0]], 1.0, walls=walls), tmp_path / "a.h5"))
    assert bed.walls == tuple(walls)


def test_millimetres_of_another_writer(path):
    with h5py.File(path, "r+") as root:
        root["radii"].attrs["units"] = "mm"
    np.testing.assert_allclose(read_packing(path).radii, [1e-4, 2e-4], rtol=1e-15)


def _replace(root, name, values, units="m"):
    del root[name]
    root[name] = values
    if units:
        root[name].attrs["units"] = units


def _external(root, name):
    del root[name]
    root[name] = h5py.ExternalLink("/etc/other.h5", "centres")


def _huge(root):
    del root["radii"]
    root.create_dataset("radii", (10**12,), "f8", chunks=(1000,)).attrs["units"] = "m"


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda root: root.pop("radii"), r"no dataset 'radii'; the file has: box, centres"),
        (lambda root: root["radii"].attrs.pop("units"), r"'radii' has no attribute units; .*'m'"),
        (
            lambda root: root["box"].attrs.__setitem__("units", "kg"),
            r"'box': unit 'kg' does not meas",
        ),
        (lambda root: root.attrs.pop("format"), r"format = 'missing' is not 'greybed-packing'"),
        (lambda root: root.attrs.modify("version", 2), r"version = '2' .* is not 1.*newer"),
        (
            lambda root: root.attrs.__setitem__("periodic", [1, 0]),
            r"periodic = '\[1 0\]' is not three",
        ),
        (lambda root: root.attrs.modify("walls", "[{"), r"attribute walls cannot be read"),
        (lambda root: root.attrs.modify("walls", "[" * 10**4), r"attribute walls cannot be read"),
        (lambda root: root.attrs.modify("walls", "3"), r"attribute walls cannot be read"),
        (
            lambda root: root.attrs.modify("walls", json.dumps([{"kind": "torus", "name": "a"}])),
            r"attribute walls .*'torus' is none of plane",
        ),
        (lambda root: _replace(root, "radii", [0.1]), r"2 centres and 1 radii; .*write"),
        (lambda root: _replace(root, "radii", [0.1, -1.0]), r"row 2: radius = -1 \[m\] must"),
        (lambda root: _replace(root, "radii", [0.1, np.nan]), r"row 2: radius = nan \[m\] must"),
        (lambda root: _replace(root, "centres", [[0.0, 1.0]]), r"'centres' has shape \(1, 2\)"),
        (lambda root: _replace(root, "centres", np.zeros((0, 3))), r"0 centres|states shape"),
        (lambda root: _replace(root, "radii", [b"a", b"b"]), r"'radii' has shape \(2,\) of"),
        (lambda root: _replace(root, "radii", ["a", "b"]), r"'radii' has shape \(2,\) of object"),
        (lambda root: _external(root, "centres"), r"cut or damaged|not a dataset of this file"),
        (_huge, r"'radii' states shape \(1000000000000,\) but stores 0 bytes"),
    ],
)
def test_refused(path, damage, message):
    with h5py.File(path, "r+") as root:
        damage(root)
    with pytest.raises(InputError, match=message) as caught:
        read_packing(path)
    assert "bed.h5" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("share", [0.01, 0.1, 0.5, 0.9, 0.99])
def test_truncated(path, share):
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    with pytest.raises(InputError, match=r"bed\.h5: the HDF5 content is cut or damaged.*again"):
        read_packing(path)


def test_a_flipped_bit_is_noticed(path):
    content = bytearray(path.read_bytes())
    at = content.find(np.float64(0.7).tobytes())
    content[at] ^= 1
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"cut or damaged"):
        read_packing(path)


def test_bounded_walls_come_back(tmp_path):
    """Also more of them than an attribute of old holds, and meshes with what they said."""
    rng = np.random.default_rng(1)
    mesh = Mesh(rng.uniform(size=(30, 3)), [*np.arange(30).reshape(-1, 3), [0, 0, 1]], "m")
    assert mesh.dropped == 1
    round_ones = ((0.1, 0.2, 0.3), (0.3, 0.1, 1.0))
    walls = (
        mesh,
        Cylinder(*round_ones, 0.7, "tube", 0.3),
        Cone(*round_ones, 0.7, 0.1, 0.3, "cone"),
        Disc(*round_ones, 0.7, "disc"),
        *(w for k in range(200) for w in box_walls((0, 0, 0), rng.uniform(1, 2, 3), f"box {k}")),
        mesh.flipped(),
    )
    path = write_packing(Packing([[0.1, 0.2, 0.3]], 0.1, walls=walls), tmp_path / "bed.h5")
    again = read_packing(path).walls
    assert again == walls
    assert (again[0].dropped, again[0].watertight) == (1, False)
    assert [w.area for w in again] == [w.area for w in walls]
    with h5py.File(path, "r+") as root:
        root["wall_0_vertices"][3, 1] += 1e-9
    with pytest.raises(InputError, match="'m': corners or faces are not those"):
        read_packing(path)
    with h5py.File(path, "r+") as root:
        del root["wall_0_faces"]
    with pytest.raises(InputError, match="no dataset 'wall_0_faces'"):
        read_packing(path)
