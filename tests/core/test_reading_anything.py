"""Files of every kind that are not what they should be: a packing or one sentence, nothing else."""

import random
from pathlib import Path

import pytest
from particle_files import csv, dump, vtk

import greybed
from greybed.core.errors import GreybedError, InputError
from greybed.core.packing import Packing
from greybed.core.readers import read_packing
from greybed.core.walls import Plane
from greybed.core.writers import write_packing

BEDS = sorted((Path(greybed.__file__).parent / "datasets" / "packings").glob("*.dump"))


@pytest.mark.parametrize("path", BEDS, ids=lambda path: path.stem)
def test_example_beds(path):
    bed = read_packing(path)
    assert len(bed) == {"4k": 4000, "6k": 6000}[path.stem.split("_")[-1]]
    assert bed.periodic == (False, False, False)
    # soft spheres at rest: they overlap, by a few per cent of a radius at most
    assert 0.0 < bed.overlaps().largest < 0.05


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("bed.csv", b"", r"the file is empty"),
        ("bed.dump", b"\x00\x01\x02\xff" * 50, r"first bytes .* not those of a LIGGGHTS/LAMMPS"),
        ("bed.csv", b"\x00\x01\x02\xff" * 50, r"first bytes .* not those of text; .*right file"),
        ("bed.h5", b"x [m]\x00", r"not those of a greybed HDF5"),
        ("bed.h5", b"\x89HDF\r\n\x1a\n" + b"\x00" * 100, r"HDF5 content is cut or damaged"),
        ("bed.dump", b"\x1f\x8b\x08\x00", r"gzip-compressed; unpack it first"),
        ("bed.csv", b"PK\x03\x04", r"a zip or spreadsheet file; .*save the sheet as CSV"),
        ("bed.csv", "x [m]".encode("utf-16"), r"UTF-16 text; save it as UTF-8"),
        ("bed.vtu", b'<?xml version="1.0"?>\n<VTKFile>', r"XML, which greybed writes but does not"),
        ("bed.npy", b"\x93NUMPY\x01\x00", r"greybed reads LIGGGHTS/LAMMPS dumps, CSV"),
        ("bed.pkl", b"cos\nsystem\n(S'touch owned'\ntR.", r"no column x"),
        ("bed.h5", b"plain text", r"HDF5 content is cut or damaged"),
        ("bed.vtk", b"plain text", r"neither ASCII nor BINARY"),
    ],
)
def test_not_a_packing(tmp_path, name, content, message):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(InputError, match=message) as caught:
        read_packing(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_missing_folder_and_device(tmp_path):
    with pytest.raises(InputError, match=r"absent\.dump: there is no such file; check the name"):
        read_packing(tmp_path / "absent.dump")
    with pytest.raises(InputError, match=r"this is a folder; give a file inside"):
        read_packing(tmp_path)
    with pytest.raises(InputError, match=r"not a regular file"):
        read_packing("/dev/null")
    with pytest.raises(InputError, match=r"cannot be read"):
        read_packing("bed\x00.csv")


def test_no_permission(tmp_path, monkeypatch):
    path = tmp_path / "bed.csv"
    path.write_text(csv())

    def refuse(*_):
        raise PermissionError(13, "Permission denied")

    # chmod would not stop root, who runs the tests in containers
    monkeypatch.setattr("greybed.core.readers.opening.open", refuse, raising=False)
    with pytest.raises(InputError, match=r"cannot be read \(Permission denied\); change its perm"):
        read_packing(path)


def _hdf5(folder):
    bed = Packing([[0.1] * 3, [0.7] * 3], 0.1, [1] * 3, walls=[Plane((0, 0, 0), (0, 0, 1))])
    return write_packing(bed, folder / "seed.h5").read_bytes()


SEEDS = {
    "bed.dump": lambda _: (dump(flags="pp ff ff") + dump()).encode(),
    "bed.csv": lambda _: csv().encode(),
    "bed.h5": _hdf5,
    "ascii.vtk": lambda _: vtk(dataset="UNSTRUCTURED_GRID"),
    "binary.vtk": lambda _: vtk(binary=True),
}
# what numbers and separators turn into when a file goes wrong
TOKENS = (b"nan", b"-1", b"1e308", b"-1e308", b"1e-320", b"9" * 25, b"", b" ", b"\n", b",", b'"')


def _mutated(content: bytes, rng: random.Random) -> bytes:
    out = bytearray(content)
    for _ in range(rng.choice((1, 1, 2, 8))):
        at = rng.randrange(len(out) + 1) if out else 0
        kind = rng.randrange(5)
        if kind == 0:
            out[at : at + 1] = bytes([rng.randrange(256)])
        elif kind == 1:
            del out[at:]
        elif kind == 2:
            del out[at : at + rng.randrange(1, 40)]
        elif kind == 3:
            out[at : at + rng.randrange(4)] = rng.choice(TOKENS)
        else:
            out[at:at] = out[at : at + rng.randrange(1, 60)]
    return bytes(out)


@pytest.mark.parametrize("name", SEEDS)
def test_mutated_files_never_end_in_a_traceback(tmp_path, name):
    content = SEEDS[name](tmp_path)
    rng = random.Random(20240611)
    path = tmp_path / name
    path.write_bytes(content)
    assert len(read_packing(path)) >= 2
    refused = []
    for _ in range(400):
        path.write_bytes(_mutated(content, rng))
        try:
            bed = read_packing(path)
            assert (bed.radii > 0.0).all()
        except GreybedError as error:
            refused.append(str(error))
    assert len(refused) > 20
    assert not any("\n" in message for message in refused)
