from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from particle_files import ROWS, dump

from greybed.core.errors import InputError
from greybed.core.readers import read_packing
from greybed.core.walls import Plane

FINITE = st.floats(-0.99, 0.99, allow_subnormal=False)


@pytest.fixture
def read(tmp_path):
    def _read(text, **options):
        path = tmp_path / "bed.dump"
        path.write_text(text)
        return read_packing(path, **options)

    return _read


def test_sorted_by_id_with_box(read):
    bed = read(dump())
    np.testing.assert_array_equal(bed.radii, [0.1, 0.02, 0.05])
    np.testing.assert_array_equal(bed.centres[2], [0.1, 0.2, 0.3])
    np.testing.assert_array_equal(bed.box, [[0, 0, 0], [1, 1, 2]])
    assert bed.periodic == (False, False, False)
    assert bed.source == "bed.dump"


@pytest.mark.parametrize(
    ("columns", "row", "centre", "radius"),
    [
        ("radius z id y x", "0.05 0.3 1 0.2 0.1", (0.1, 0.2, 0.3), 0.05),
        ("x y z diameter", "0.1 0.2 0.3 0.1", (0.1, 0.2, 0.3), 0.05),
        ("xu yu zu radius", "0.1 0.2 0.3 0.05", (0.1, 0.2, 0.3), 0.05),
        ("xs ys zs radius", "0.1 0.2 0.15 0.05", (0.1, 0.2, 0.3), 0.05),
        ("xsu ysu zsu radius", "0.1 0.2 0.15 0.05", (0.1, 0.2, 0.3), 0.05),
        ("xs ys zs x y z radius", "9 9 9 0.1 0.2 0.3 0.05", (0.1, 0.2, 0.3), 0.05),
        ("element x y z radius f[1]", "Fe 0.1 0.2 0.3 0.05 nan", (0.1, 0.2, 0.3), 0.05),
    ],
)
def test_columns(read, columns, row, centre, radius):
    bed = read(dump([row], columns=columns))
    np.testing.assert_allclose(bed.centres, [centre], rtol=1e-15)
    assert bed.radii[0] == radius


@pytest.mark.parametrize(
    ("flags", "periodic"),
    [
        ("pp pp ff", (True, True, False)),
        ("fs mm pp", (False, False, True)),
        ("ss fm ms", (False, False, False)),
        ("", (False, False, False)),
    ],
)
def test_flags(read, flags, periodic):
    assert read(dump(flags=flags)).periodic == periodic


def test_unwrapped_coordinates_are_wrapped_where_periodic(read):
    bed = read(dump(["2.25 0.5 0.5 0.1"], columns="xu yu zu radius", flags="pp ff ff"))
    np.testing.assert_allclose(bed.centres, [[0.25, 0.5, 0.5]], rtol=1e-15)


def test_length_unit_scales_box_too(read):
    bed = read(dump(), unit="mm")
    np.testing.assert_allclose(bed.box[1], [1e-3, 1e-3, 2e-3], rtol=1e-15)
    np.testing.assert_allclose(bed.radii[0], 1e-4, rtol=1e-15)


def test_units_style_of_new_lammps(read):
    assert read("ITEM: UNITS\ncgs\nITEM: TIME\n0.5\n" + dump()).radii[0] == 0.1e-2
    assert read("ITEM: UNITS\nlj\n" + dump(), unit="m").radii[0] == 0.1
    with pytest.raises(InputError, match=r"line 2: units style 'lj' .*--length-unit"):
        read("ITEM: UNITS\nlj\n" + dump())


def test_frames(read):
    text = "".join(dump([f"1 0.5 0.5 {z} 0.1"]) for z in (0.25, 0.5, 0.75))
    heights = {k: read(text, frame=k).centres[0, 2] for k in (0, 1, 2, -1, -2, -3, None)}
    assert heights == {0: 0.25, 1: 0.5, 2: 0.75, -1: 0.75, -2: 0.5, -3: 0.25, None: 0.75}
    for frame in (3, -4):
        with pytest.raises(InputError, match=rf"frame = {frame} .* has 3 \(0 to 2"):
            read(text, frame=frame)


def test_a_cut_last_frame_leaves_the_one_before(read):
    text = dump() + dump()[:-30]
    with pytest.raises(InputError, match=r"line 16: 3 atoms are stated but only 2 .*frame = -2"):
        read(text)
    assert len(read(text, frame=-2)) == 3


def test_line_ends_of_other_systems(read):
    assert len(read(dump().replace("\n", "\r\n"))) == 3
    assert len(read(dump(end=""))) == 3
    assert len(read(dump(end="\n\n \n"))) == 3


def test_options_replace_what_the_file_says(read):
    floor = Plane((0, 0, 0), (0, 0, 1), "floor")
    bed = read(dump(), walls=[floor], box=[3, 3, 3], periodic=(True, True, False))
    assert bed.walls == (floor,)
    assert bed.periodic == (True, True, False)
    np.testing.assert_array_equal(bed.box, [[0, 0, 0], [3, 3, 3]])


def with_row(row):
    return dump([ROWS[0], row, ROWS[2]])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (dump(ROWS[:2], n=3), r"line 4: 3 atoms are stated but only 2 rows follow, to line 11"),
        (dump(n=2), r"line 4: 2 atoms are stated but 3 rows follow from line 10"),
        (dump(n=10**15), r"line 4: 1000000000000000 atoms are stated but only 3"),
        (dump(n="9" * 30), r"line 4: number of atoms = '9+' is not a whole number"),
        (dump(n="x"), r"line 4: number of atoms = 'x' is not a whole number"),
        (dump(n=0), r"line 4: number of atoms = 0; .*at least 1"),
        (dump(n=-3), r"line 4: number of atoms = -3; .*at least 1"),
        (dump(columns="id x y type radius"), r"line 9: no column z .*has: id, x, y, type, radius"),
        (dump(columns="id x y zs radius"), r"line 9: no column x y z of one kind"),
        (dump(columns="id x y z mass"), r"line 9: no column radius or diameter; .*add radius"),
        (dump(columns="id x x z radius"), r"line 9: column 'x' appears twice"),
        (with_row("1 nan 0.5 1.5 0.1"), r"line 11: x = nan \[m\] is not finite.*mend"),
        (with_row("1 0.5 inf 1.5 0.1"), r"line 11: y = inf \[m\] is not finite"),
        (with_row("1 0.5 1e999 1.5 0.1"), r"line 11: y = inf \[m\] is not finite"),
        (with_row("1 0.5 0,5 1.5 0.1"), r"line 11: y = '0,5' is not a number; mend"),
        (with_row("1 0.5 0x5 1.5 0.1"), r"line 11: y = '0x5' is not a number"),
        (with_row("1 0.5 1_0 1.5 0.1"), r"line 11: y = '1_0' is not a number"),
        (with_row("1 0.5 0.5 1.5 0"), r"line 11: radius = 0 \[m\] must be finite and above 0"),
        (with_row("1 0.5 0.5 1.5 -0.1"), r"line 11: radius = -0\.1 \[m\] must be .* above 0"),
        (with_row("1 0.5 0.5 2.5 0.1"), r"line 11: z = 2\.5 \[m\] is outside the box \[0, 2\]"),
        (with_row("1 2e9 0.5 0.5 0.1"), r"line 11: x = 2e\+09 \[m\]; no bed .*1e\+09.*unit"),
        (with_row("1 0.5 0.5 0.5 2e9"), r"line 11: radius = 2e\+09 \[m\]; no bed"),
        (with_row("3 0.5 0.5 1.5 0.1"), r"line 11: id = 3 is already taken by .*line 10;.*remove"),
        (with_row("1.5 0.5 0.5 1.5 0.1"), r"line 11: id = 1\.5 is not a whole number"),
        (with_row("1 0.5 0.5 1.5"), r"line 11: 4 values where the header names 5 columns; mend"),
        (with_row("1 0.5 0.5 1.5 1 1"), r"line 11: 6 values where the header names 5"),
        (with_row(""), r"line 11: 0 values where the header names 5"),
        (with_row("1 0.5 0.5 1.5 \x00"), r"line 11: byte 0x00 is not text"),
        (with_row("1 0.5\u00a00.5 1.5 1 1"), r"line 11: byte 0xc2 is not text"),
        (dump(flags="xy xz yz pp pp pp"), r"line 5: the box is triclinic .*orthogonal"),
        (dump(box="0 1 0\n0 1 0\n0 2 0\n"), r"line 6: x bounds = '0 1 0' are not two numbers"),
        (dump(box="0 1\n1 1\n0 2\n"), r"line 7: y bounds \[1, 1\] are empty.*mend"),
        (dump(box="0 1\n0 nan\n0 2\n"), r"line 7: y bounds .*not finite"),
        (dump(box="0 1\n"), r"line 7: y bounds = 'ITEM: ATOMS"),
        (dump(box="-2e9 2e9\n" * 3), r"bed.dump: box bound 2e\+09 \[m\]; no bed"),
        (dump().split("ITEM: ATOMS")[0], r"ends in line 8, before 'ITEM: ATOMS'; .*cut"),
        ("ITEM: TIMESTEP\n0\nITEM: ATOMS x\n1\n", r"line 3: 'ITEM: NUMBER OF ATOMS' is missing"),
        ("ITEM: ATOMS\n", r"no line 'ITEM: TIMESTEP' was found; give a text dump"),
        ("hello\n", r"no line 'ITEM: TIMESTEP' was found"),
        ("ITEM: TIMESTEP", r"ends in line 1"),
    ],
)
def test_refused(read, text, message):
    with pytest.raises(InputError, match=message) as caught:
        read(text)
    assert "bed.dump" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_frame_without_atoms(read):
    with pytest.raises(InputError, match=r"line 3: a second frame starts before 'ITEM: ATOMS'"):
        read("ITEM: TIMESTEP\n0\n" + dump(), frame=0)


def test_scaled_coordinates_need_a_box(read):
    text = "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n1\nITEM: ATOMS xs ys zs radius\n0 0 0 1\n"
    with pytest.raises(InputError, match=r"line 5: scaled .*'ITEM: BOX BOUNDS'.*dump x y z"):
        read(text)


def test_errors_count_lines_from_the_start_of_the_file(read):
    with pytest.raises(InputError, match=r"line 23: y = 'b' "):
        read(dump() + with_row("1 a b 1 1").replace(" a ", " 0.1 "))


@pytest.mark.parametrize(("unit", "word"), [("kg", "length"), ("parsnips", "not known")])
def test_wrong_length_unit(read, unit, word):
    with pytest.raises(InputError, match=rf"bed.dump: length unit: .*'{unit}'.*{word}"):
        read(dump(), unit=unit)


@given(
    st.lists(st.tuples(FINITE, FINITE, FINITE, st.floats(1e-6, 0.5)), min_size=1, max_size=20),
    st.sampled_from(list(permutations(("id", "x", "y", "z", "radius", "vx")))),
    st.randoms(use_true_random=False),
)
@settings(max_examples=60, deadline=None)
def test_round_trip(tmp_path_factory, spheres, columns, random):
    values = [
        dict(zip(("x", "y", "z", "radius"), map(repr, row), strict=True))
        | {"id": str(i), "vx": "-"}
        for i, row in enumerate(spheres)
    ]
    rows = [" ".join(row[name] for name in columns) for row in values]
    random.shuffle(rows)
    path = tmp_path_factory.mktemp("dump") / "bed.dump"
    path.write_text(dump(rows, columns=" ".join(columns), box="-1 1\n" * 3))
    bed = read_packing(path)
    np.testing.assert_array_equal(np.c_[bed.centres, bed.radii], spheres)
