import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import greybed
from greybed.cli import main
from greybed.cli.info import describe
from greybed.core.packing import Packing
from greybed.core.readers import read_packing

BED = Path(greybed.__file__).parent / "datasets" / "packings" / "settled_mono_4k.dump"


def write(path, text="x [mm],y [mm],z [mm],radius [mm]\n0,0,0,1\n2,0,0,1\n5,0,0,1\n"):
    path.write_text(text)
    return str(path)


def test_describe_counts_by_hand():
    """Three in a row on a periodic line of 6: touching, overlapping by 0.1, free."""
    bed = Packing([[1, 1, 1], [3, 1, 1], [4.9, 1, 1]], 1.0, [6.5, 4, 4], (True, False, False))
    results = describe(bed)
    assert results["spheres"] == 3
    assert results["overlapping_pairs"] == 1
    assert results["largest_overlap_relative"] == pytest.approx(0.1)
    assert results["coordination_mean"] == pytest.approx(4 / 3)
    assert (results["coordination_min"], results["coordination_max"]) == (1, 2)
    assert results["solid_fraction_of_box"] == pytest.approx(4 * np.pi / (6.5 * 16))
    json.dumps(results)


def test_touching_is_relative_to_the_smaller_radius():
    gap = 5e-4
    for small, neighbours in ((1.0, 1), (0.1, 0)):
        bed = Packing([[0, 0, 0], [1 + small + gap, 0, 0]], [1.0, small])
        assert describe(bed)["coordination_max"] == neighbours


def test_info_prints_and_writes(tmp_path, capsys):
    assert main(["info", str(BED), "--out", str(tmp_path / "run")]) == 0
    text = capsys.readouterr().out
    for part in ("4000", "0.0015 m, all equal", "box z", "0.0785 of the box", "coordination"):
        assert part in text
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["verb"] == "info"
    assert summary["spheres"] == 4000
    assert BED.name in summary["provenance"]["inputs"]


def test_info_of_a_bed_without_box(tmp_path, capsys):
    assert main(["info", write(tmp_path / "bed.csv")]) == 0
    text = capsys.readouterr().out
    assert "extent x" in text
    assert "of the box" not in text


def test_length_unit_applies_to_the_input(tmp_path, capsys):
    out = tmp_path / "bed.csv"
    assert main(["convert", str(BED), str(out), "--length-unit", "mm"]) == 0
    np.testing.assert_allclose(read_packing(out).radii, 1.5e-6, rtol=1e-15)
    text = capsys.readouterr().out
    assert "4000 spheres" in text
    assert "left out, for .csv does not hold them: box; .h5 keeps all" in text


@pytest.mark.parametrize("suffix", [".csv", ".h5"])
def test_convert_keeps_the_spheres(tmp_path, suffix):
    out = tmp_path / f"bed{suffix}"
    assert main(["convert", str(BED), str(out)]) == 0
    before, after = read_packing(BED), read_packing(out)
    np.testing.assert_array_equal(before.centres, after.centres)
    np.testing.assert_array_equal(before.radii, after.radii)
    assert (after.box is None) == (suffix == ".csv")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["info", "{d}/absent.dump"], "greybed info: .*absent.dump: there is no such file"),
        (["info", "{d}"], "this is a folder"),
        (["info", "{d}/bed.csv", "--length-unit", "mm"], "states its own units"),
        (["info", str(BED), "--length-unit", "kg"], "length unit: unit 'kg' does not measure"),
        (["info", str(BED), "--frame", "3"], r"frame = 3 does not exist; the file has 1"),
        (["info", "{d}/bed.csv", "--out", "{d}/bed.csv"], "cannot write to this folder"),
        (["convert", "{d}/bed.csv", "{d}/bed.csv"], "this is the input file itself"),
        (["convert", "{d}/bed.csv", "{d}/bed.xyz"], "no writer for the extension '.xyz'"),
        (["convert", "{d}/bed.csv", "{d}/bed.csv/bed.h5"], "cannot write this file"),
    ],
)
def test_one_sentence_and_exit_code_2(tmp_path, capsys, words, message):
    write(tmp_path / "bed.csv")
    assert main([word.format(d=tmp_path) for word in words]) == 2
    streams = capsys.readouterr()
    assert streams.err.count("\n") == 1
    assert re.search(message, streams.err)


def test_the_door_stays_light():
    code = (
        "import sys, greybed.core.readers, greybed.core.writers, greybed.cli.info, "
        "greybed.cli.convert; print([m for m in ('h5py', 'pint', 'trimesh', 'scipy', 'torch') "
        "if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
