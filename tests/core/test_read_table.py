import numpy as np
import pytest
from particle_files import csv

from greybed.core.errors import InputError
from greybed.core.readers import read_packing


@pytest.fixture
def read(tmp_path):
    def _read(text, name="bed.csv", **options):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_packing(path, **options)

    return _read


def row(text, header="x [mm],y [mm],z [mm],radius [mm]"):
    return csv(["100,200,300,50", text], header)


@pytest.mark.parametrize(
    "text",
    [
        csv(["100,200,300,50"]),
        csv(["0.1,20,300,5"], "x [m], y [cm], z [mm], radius [cm]"),
        csv(["0.1;0.3;0.2;0.1"], "X [m];Z [m];Y [m];Diameter [m]"),
        csv(["0.1\t0.2\t0.3\t0.05"], "x [m]\ty (m)\tz [m]\tradius [m]"),
        csv(["7,steel,0.1,0.2,0.3,0.05"], "id,material,x [m],y [m],z [m],radius [m]"),
        csv(['"a, b",0.1,0.2,0.3,"0.05"'], 'what,"x [m]","y [m]",z [m],radius [m]'),
        csv(["0.1, 0.2, 0.3, 0.05"], "# made by hand\n\n# x [m], y [m], z [m], radius [m]"),
        csv(["100,200,300,50"]).replace("\n", "\r\n"),
        b"\xef\xbb\xbf" + csv(["100,200,300,50"]).encode(),
        csv(["100000,200000,300000,50000"], "x [µm],y [um],z [micrometer],radius [μm]"),
    ],
)
def test_headers(read, text):
    bed = read(text)
    # conversion to metres may round once
    np.testing.assert_allclose(bed.centres, [[0.1, 0.2, 0.3]], rtol=1e-14)
    np.testing.assert_allclose(bed.radii, [0.05], rtol=1e-14)


def test_rows_keep_their_order_or_follow_id(read):
    rows = ["2,0,0,2,1", "1,0,0,1,1"]
    header = "{},x [m],y [m],z [m],radius [m]"
    assert read(csv(rows, header.format("n"))).centres[:, 2].tolist() == [2.0, 1.0]
    assert read(csv(rows, header.format("id"))).centres[:, 2].tolist() == [1.0, 2.0]


@pytest.mark.parametrize("name", ["bed.txt", "bed.dat", "bed", "bed.csv"])
def test_any_name(read, name):
    assert len(read(csv(), name)) == 2


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (csv(header="x,y [mm],z [mm],radius [mm]"), r"line 1: column x has no unit; .*'x \[mm\]'"),
        (csv(header="x [mm],y [],z [mm],radius [mm]"), r"line 1: column y has no unit"),
        (csv(header="x [mm],y [mn],z [mm],radius [mm]"), r"line 1: column y: unit 'mn' is not kn"),
        (csv(header="x [mm],y [mm],z [mm],radius [kg]"), r"line 1: column radius: unit 'kg' does"),
        (csv(header="x [mm],y [mm],h [mm],radius [mm]"), r"line 1: no column z; .*x, y, h, radius"),
        (csv(header="x [mm],y [mm],z [mm],d [mm]"), r"line 1: no column radius or diameter"),
        (
            csv(["1,1,1,1,1"], "x [mm],x [mm],y [mm],z [mm],radius [mm]"),
            r"line 1: column x appears twice",
        ),
        ("1,2,3,4\n", r"line 1: the first line holds numbers.*header with units"),
        ("x [mm],y [mm],z [mm],radius [mm]\n", r"line 1: no rows follow"),
        ("# only\n# comments\n", r"no header line in 2 lines"),
        (row("1,2,3"), r"line 3: 3 values where the header names 4 columns; mend"),
        (row("1,2,3,4,5"), r"line 3: 5 values where the header names 4"),
        (row("1,2,,4"), r"line 3: z = '' is not a number; mend"),
        (row("1,2,three,4"), r"line 3: z = 'three' is not a number"),
        (row("1,2,nan,4"), r"line 3: z = nan \[m\] is not finite"),
        (row("1,2,3,0"), r"line 3: radius = 0 \[m\] must be finite and above 0"),
        (row("1,2,3,-4"), r"line 3: radius = -0\.004 \[m\]"),
        (row("1,2,3,1e14"), r"line 3: radius = 1e\+11 \[m\]; no bed .*length unit"),
        (row('1,2,3,"4'), r"line 3: a quotation mark is not closed"),
        ("# note\n" + row("1,2,three,4"), r"line 4: z = 'three'"),
        (
            csv(["7,1,1,1,1", "7,2,2,2,1"], "id,x [m],y [m],z [m],radius [m]"),
            r"line 3: id = 7 is already taken by .*line 2",
        ),
        (row("1,2,3,\x01"), r"line 3: byte 0x01 is not text"),
        (
            row("1,2,3,4").replace("y [mm]", "y [mm] é").encode("latin-1"),
            r"line 1: column y: unit|line 1: no column y",
        ),
        (row("1,2,3,\u00e9").encode("latin-1"), r"line 3: byte 0xe9 is not UTF-8.*save"),
    ],
)
def test_refused(read, text, message):
    with pytest.raises(InputError, match=message) as caught:
        read(text)
    assert "bed.csv" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"unit": "mm"}, r"a CSV table states its own units; leave out the length unit 'mm'"),
        ({"frame": 0}, r"a CSV table has no frames; leave out frame = 0"),
        ({"periodic": (True, True, True)}, r"needs a box"),
        ({"box": [1, 1]}, r"box has shape \(2,\)"),
        ({"box": [0.2, 1, 1]}, r"line 3: x = 0\.5 \[m\] is outside the box \[0, 0\.2\]"),
    ],
)
def test_options_refused(read, options, message):
    with pytest.raises(InputError, match=message):
        read(csv(), **options)
