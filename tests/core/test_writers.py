import base64
import re
import struct
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from greybed.core.errors import InputError, OutputError
from greybed.core.packing import Packing
from greybed.core.readers import read_packing
from greybed.core.writers import write_packing

BED = Packing([[0.1, 0.2, 0.3], [0.7, 0.7, 0.7]], [0.1, 0.2], [1, 1, 1])
CENTRES = arrays(
    np.float64, st.tuples(st.integers(1, 12), st.just(3)), elements=st.floats(-1e3, 1e3)
)


def parse_vtu(path):
    """Read inline base64 arrays as the VTK file format page describes them."""
    types = {"Float64": "<f8", "Int64": "<i8", "UInt8": "u1"}
    root = ElementTree.parse(path).getroot()
    assert root.attrib["header_type"] == "UInt64"
    piece = root.find("UnstructuredGrid/Piece")
    found = {"n": int(piece.attrib["NumberOfPoints"])}
    for item in piece.iter("DataArray"):
        raw = base64.b64decode(item.text)
        (size,) = struct.unpack("<Q", raw[:8])
        assert size == len(raw) - 8
        values = np.frombuffer(raw[8:], types[item.attrib["type"]])
        components = int(item.attrib["NumberOfComponents"])
        found[item.attrib["Name"]] = values.reshape(-1, components) if components > 1 else values
    return found


@given(CENTRES, st.floats(1e-9, 1e3))
@settings(max_examples=60, deadline=None)
def test_csv_round_trip(tmp_path_factory, centres, radius):
    bed = Packing(centres, radius * np.linspace(0.5, 1.0, len(centres)))
    again = read_packing(write_packing(bed, tmp_path_factory.mktemp("csv") / "bed.csv"))
    np.testing.assert_array_equal(again.centres, bed.centres)
    np.testing.assert_array_equal(again.radii, bed.radii)


@given(CENTRES, st.floats(1e-9, 1e3))
@settings(max_examples=60, deadline=None)
def test_vtu_round_trip(tmp_path_factory, centres, radius):
    n = len(centres)
    bed = Packing(centres, radius * np.linspace(0.5, 1.0, n))
    path = tmp_path_factory.mktemp("vtu") / "bed.vtu"
    found = parse_vtu(write_packing(bed, path, {"T <K> & 'more'": np.arange(n), "v": centres}))
    assert found["n"] == n
    np.testing.assert_array_equal(found["centres"], bed.centres)
    np.testing.assert_array_equal(found["radius"], bed.radii)
    np.testing.assert_array_equal(found["T <K> & 'more'"], np.arange(n))
    np.testing.assert_array_equal(found["v"], centres)
    np.testing.assert_array_equal(found["connectivity"], np.arange(n))
    np.testing.assert_array_equal(found["offsets"], np.arange(n) + 1)
    assert (found["types"] == 1).all()


def test_csv_fields(tmp_path):
    fields = {"temperature [K]": [300, 400], "v [m/s]": [[1, 2], [3, 4]], "n": [5, 6]}
    path = write_packing(BED, tmp_path / "bed.csv", fields)
    assert path.read_text().splitlines() == [
        "x [m],y [m],z [m],radius [m],temperature [K],v_0 [m/s],v_1 [m/s],n",
        "0.1,0.2,0.3,0.1,300.0,1.0,2.0,5.0",
        "0.7,0.7,0.7,0.2,400.0,3.0,4.0,6.0",
    ]
    assert len(read_packing(path)) == 2


@pytest.mark.parametrize("suffix", [".glb", ".ply", ".stl", ".STL"])
def test_meshes_have_the_volume_of_the_spheres(tmp_path, suffix):
    import trimesh

    path = write_packing(BED, tmp_path / f"bed{suffix}")
    mesh = trimesh.load(path, force="mesh", file_type=suffix[1:].lower())
    # 1280 facets inside each sphere take 1 % off its volume
    assert 0.985 < mesh.volume / BED.sphere_volume < 1.0
    np.testing.assert_allclose(mesh.bounds[1], 0.9, rtol=0.02)


@pytest.mark.parametrize(
    ("name", "fields", "message"),
    [
        ("bed.xyz", {}, r"bed\.xyz: no writer for the extension '\.xyz'; choose one of \.csv"),
        ("bed", {}, r"no writer for the extension ''"),
        ("bed.h5", {"T": [1, 2]}, r"\.h5 holds no fields \(got 'T'\); write \.csv or \.vtu"),
        ("bed.vtu", {"T": [1, 2, 3]}, r"field 'T' has shape \(3,\); .*each of the 2 spheres"),
        ("bed.vtu", {"T": 1.0}, r"field 'T' has shape \(\)"),
        ("bed.vtu", {"T\x00": [1, 2]}, r"cannot stand in a file"),
        ("bed.csv", {"a,b": [1, 2]}, r"cannot stand in a file; .*without commas"),
        ("bed.csv", {"Radius [mm]": [1, 2]}, r"takes a name of the packing itself"),
    ],
)
def test_refused(tmp_path, name, fields, message):
    with pytest.raises(InputError, match=message):
        write_packing(BED, tmp_path / name, fields)
    assert list(tmp_path.iterdir()) == []


def test_too_many_spheres_for_a_mesh(tmp_path):
    many = Packing(np.zeros((20_001, 3)), 1.0, source="bed.dump")
    with pytest.raises(InputError, match=r"bed\.dump: 20001 spheres .*at most 20000.*\.vtu"):
        write_packing(many, tmp_path / "bed.glb")


@pytest.mark.parametrize("suffix", [".csv", ".h5", ".vtu", ".ply"])
def test_a_missing_folder_is_one_sentence(tmp_path, suffix):
    target = tmp_path / "absent" / f"bed{suffix}"
    with pytest.raises(OutputError, match=re.escape(f"{target}: cannot write this file")):
        write_packing(BED, target)


@pytest.mark.parametrize("suffix", [".csv", ".h5", ".vtu"])
def test_same_packing_same_bytes(tmp_path, suffix):
    first = write_packing(BED, tmp_path / f"a{suffix}").read_bytes()
    assert write_packing(BED, tmp_path / f"b{suffix}").read_bytes() == first
