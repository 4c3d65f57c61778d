"""Bad input ends in one sentence with place, bound and remedy, exit code 2, and no traceback."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from greybed.cli import main
from greybed.closures import ViewFactorClosure, load
from greybed.closures.viewfactor import limits
from greybed.core import files as files_module
from greybed.training import train

HEADER = "x [mm],y [mm],z [mm],radius [mm]\n"
PACK = "pack --count 20 --fraction 0.2 --sizes mono:1mm --out out"
BARE = 'rays = 200\nemitters = 5\n[[packing]]\nkind = "random"\ncount = 60\nshake = 0\n'
RANDOM = BARE + "fraction = 0.3\n"
# Every verb with --out, up to it.
VERBS = {
    "quickstart": "quickstart --small",
    "info": "info bed.csv",
    "pack": "pack --count 20 --fraction 0.2 --sizes mono:1mm",
    "trace": "trace bed.csv --rays 10 --quiet",
    "dataset": "dataset viewfactor design.toml",
    "train": "train viewfactor data.h5 --epochs 1",
    "check": "check mlp.closure",
    "export": "export mlp.closure --to onnx",
    "simulate": "simulate case.toml --quiet",
}


def refused(words, capsys, message=""):
    """Run a verb that must be refused; gives its sentence."""
    words = words.split() if isinstance(words, str) else list(words)
    try:
        code = main(words)
    except SystemExit as stop:  # argparse
        code = stop.code
        said = capsys.readouterr().err.rstrip("\n")
        assert "\n" not in said
    else:
        said = capsys.readouterr().err
        # A bar may stand before the sentence where work had begun.
        lines = [line for line in re.split(r"[\r\n]", said) if line.strip() and "it/s" not in line]
        lines = [line for line in lines if "%|" not in line]
        assert len(lines) == 1, said
        said = lines[0]
    assert code == 2, said
    assert said.startswith(f"greybed {words[0]}: ")
    assert "Traceback" not in said
    assert re.search(message, said), said
    return said


BEDS = {
    "nocolumn.csv": ("x [mm],y [mm],radius [mm]\n0,0,1\n", "line 1: no column z"),
    "nan.csv": (HEADER + "0,0,0,1\n0,nan,5,1\n", r"line 3: y = nan \[m\] is not finite"),
    "zero.csv": (HEADER + "0,0,0,1\n0,3,5,0\n", r"line 3: radius = 0 \[m\] must be .* above 0"),
    "text.csv": (HEADER + "0,0,0,one\n", "line 2"),
    "units.csv": (HEADER.replace("mm", "kg") + "0,0,0,1\n", "'kg' does not measure a length"),
    "nounits.csv": ("x,y,z,radius\n0,0,0,1\n", "line 1: column x has no unit"),
    "far.csv": (HEADER + "0,0,1e11,1e-6\n", "line 2: .* move the origin"),
    "huge.csv": (HEADER + "0,0,0,1e36\n", "line 2: radius = 1e[+]33 .* check the length unit"),
    "outside.dump": (
        "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n1\nITEM: BOX BOUNDS ff ff ff\n"
        "0 1\n0 1\n0 1\nITEM: ATOMS id x y z radius\n1 0.5 0.5 3 0.1\n",
        r"line 10: z = 3 \[m\] is outside the box \[0, 1\]",
    ),
    "garbage.dump": (bytes(range(256)) * 9, "the first bytes .* are not those of"),
    "garbage.h5": (b"\x89HDF\r\n\x1a\n" + bytes(500), "cut or damaged"),
    "empty.dump": ("", "the file is empty"),
    "empty.h5": ("", "the file is empty"),
}


@pytest.mark.parametrize("name", BEDS)
@pytest.mark.parametrize("verb", ["info {}", "trace {} --rays 9 --out out", "convert {} out.h5"])
def test_beds(name, verb, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    content, message = BEDS[name]
    Path(name).write_bytes(content if isinstance(content, bytes) else content.encode())
    assert name in refused(verb.format(name), capsys, message)
    assert sorted(os.listdir()) == [name]


@pytest.mark.parametrize(
    ("file", "message"),
    [
        ("none.dump", "there is no such file"),
        (".", "this is a folder"),
        ("bed.csv/x.csv", "cannot be read"),
        ("/dev/zero", "not a regular file"),
        ("data.h5", "'greybed-viewfactors' is not 'greybed-packing'"),
        ("factors.h5", "'greybed-view-factors' is not 'greybed-packing'"),
        ("cut.h5", "cut or damaged"),
    ],
)
def test_what_is_no_packing(here, capsys, file, message):
    Path("cut.h5").write_bytes(Path("bed.h5").read_bytes()[:-500])
    refused(["info", file], capsys, message)


def test_a_closure_is_no_packing(here, capsys):
    refused("trace mlp.closure --out out", capsys, "not those of text")


def test_no_permission(here, capsys, monkeypatch):
    def refuse(*args, **options):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("greybed.core.readers.opening.open", refuse, raising=False)
    refused("info bed.csv", capsys, r"bed\.csv: cannot be read \(Permission denied\)")


@pytest.mark.parametrize("file", ["none", ".", "/dev/zero", "bed.h5", "bed.csv", "mlp.closure"])
def test_what_is_no_data_set(here, capsys, file):
    said = refused(f"train viewfactor {file} --out out", capsys)
    assert file in said
    assert not Path("out").exists()


def test_damaged_data_sets(here, capsys):
    whole = Path("data.h5").read_bytes()
    for content in (whole[: len(whole) // 2], b"", whole[:-9]):
        Path("data.h5").write_bytes(content)
        refused("train viewfactor data.h5 --out out", capsys, r"data\.h5: .*(again|another)")
    flipped = bytearray(whole)
    flipped[len(whole) // 2] ^= 1
    Path("data.h5").write_bytes(flipped)
    refused("train viewfactor data.h5 --out out", capsys, r"data\.h5: .* again")


@pytest.mark.parametrize("verb", ["check {}", "export {} --to onnx --out out"])
@pytest.mark.parametrize(
    "file", ["none", ".", "/dev/zero", "data.h5", "bed.csv", "flipped.closure"]
)
def test_what_is_no_closure(here, capsys, verb, file):
    content = bytearray(Path("forest.closure").read_bytes())
    content[len(content) // 2] ^= 4
    Path("flipped.closure").write_bytes(content)
    assert f": {file}: " in refused(verb.format(file), capsys)
    assert not Path("out").exists()


@pytest.mark.parametrize("verb", VERBS)
@pytest.mark.parametrize("place", ["bed.csv/sub", "/proc/greybed", "n" * 300])
def test_folders_that_cannot_be_written(here, capsys, verb, place):
    before = sorted(os.listdir())
    single = verb in ("pack", "dataset")
    out = f"{place}/file.h5" if single else place
    refused([*VERBS[verb].split(), "--out", out], capsys, "cannot write|system refused")
    assert sorted(os.listdir()) == before


@pytest.mark.parametrize("out", ["bed.csv/x.h5", "/proc/greybed/x.h5", "n" * 300 + ".h5"])
def test_convert_to_where_nothing_can_be_written(here, capsys, out):
    refused(["convert", "bed.h5", out], capsys, "cannot write this file|system refused")


@pytest.mark.parametrize("out", ["folder", "folder/", ""])
def test_a_data_set_in_the_place_of_a_folder(here, capsys, out):
    Path("folder").mkdir()
    refused(["dataset", "viewfactor", "design.toml", "--out", out], capsys, "name a file")


def test_no_result_takes_the_place_of_a_device(here, capsys):
    os.mkfifo("pipe.h5")
    refused("convert bed.h5 pipe.h5", capsys, "device")
    assert Path("pipe.h5").is_fifo()


@pytest.mark.parametrize("verb", [v for v in VERBS if v != "quickstart"] + ["convert"])
def test_a_full_disk(here, capsys, monkeypatch, verb):
    def full(source, target):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(files_module.os, "replace", full)
    words = "convert bed.h5 out.h5" if verb == "convert" else VERBS[verb] + " --out out/out"
    if verb in ("pack", "dataset"):
        words += ".h5"
    refused(words, capsys, "No space left on device.* free space")
    assert not [f for f in Path("out").rglob("*") if f.is_file()], "no half file is left"


@pytest.mark.skipif(not Path("/dev/full").is_char_device(), reason="no /dev/full")
def test_standard_output_on_a_full_disk_and_on_a_closed_pipe(here):
    words = [sys.executable, "-m", "greybed", "info", "bed.csv"]
    with open("/dev/full", "w") as full:
        done = subprocess.run(words, stdout=full, stderr=subprocess.PIPE, text=True)
    assert done.returncode == 2
    assert re.fullmatch("greybed info: .*No space left on device.*\n", done.stderr)
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run(words, stdout=write, stderr=subprocess.PIPE, text=True)
    os.close(write)
    assert (done.returncode, done.stderr) == (0, "")


OPTIONS = {
    "pack --fraction 0.2 --sizes mono:1mm --out out --count": "0 -5 1.5 nan 1e30 1000000000000",
    "pack --count 20 --sizes mono:1mm --out out --fraction": "0 -1 1 0.75 1e30 nan inf x 1e-300",
    "pack --count 20 --fraction 0.2 --out out --sizes": "mono:0mm mono:-1mm mono:1 mono:1kg "
    "mono:1e400mm mono:1e-320mm mono:1e300m lognormal:1mm,nan lognormal:1mm,9 uniform:2mm,1mm "
    "discrete:1mm discrete:1mm=nan,2mm=1 foo:1mm mono:1mm,2mm discrete:1mm=0.5,1m=0.5",
    PACK + " --shake": "-1 nan 99999999999999999999",
    PACK + " --seed": "-1 nan 1.5",
    PACK + " --container": "foo",
    PACK + " --container cylinder --container-radius": "0mm -3mm 3 1e30m 0.0001mm nan",
    "trace bed.csv --out out --rays": "0 -1 nan 1.5 1e30 9223372036854775807 99999999999999999999",
    "trace bed.csv --out out --seed": "-1 nan 1.5 9223372036854775808",
    "trace bed.csv --out out --threads": "0 -1 nan 1.5 1e30 10000000",
    "trace bed.csv --out out --max-distance": "-1mm 0mm nan inf x 1kg 1e400mm 3",
    "trace bed.csv --out out --frame": "0 -1 x",
    "trace bed.csv --out out --wall": "cone plane:nan,0,0:0,0,1 plane:0,0,0:0,0,0 "
    "cylinder:0,0,0:0,0,1:inf plane:0,0,9:0,0,1",
    "info bed.csv --length-unit": "mm kg m**m",
    "dataset viewfactor design.toml --out out.h5 --seed": "-1 nan 4294967296",
    "train viewfactor data.h5 --out out --model": "svm",
    "train viewfactor data.h5 --out out --markers": "foo",
    "train viewfactor data.h5 --out out --seed": "-1 nan 4294967296",
    "train viewfactor data.h5 --out out --epochs": "0 -3 nan 1e30 99999999999999999999",
    "train viewfactor data.h5 --out out --name": ". .. a/b /x/y " + "x" * 300,
    "check mlp.closure --exported": "foo , cpp,foo",
    "export mlp.closure --out out --to": "foo , a/b",
    "export mlp.closure --out out --to onnx --name": "a/b .. class 1st é",
    "quickstart --small --out out --seed": "-1 nan 4294967296",
    "simulate case.toml --out out --threads": "0 -1 nan",
    "dataset": "foo",
    "train": "foo",
}


@pytest.mark.parametrize("words", OPTIONS)
def test_options_out_of_range(here, capsys, words):
    for value in OPTIONS[words].split():
        *before, option = words.split()
        given = [f"{option}={value}"] if option.startswith("-") else [option, value, "--out", "out"]
        refused([*before, *given], capsys)
    assert not [f for f in Path("out").rglob("*") if f.is_file()]


def test_too_little_memory_is_one_sentence(here, capsys, monkeypatch):
    def greedy(*args, **options):
        np.empty(2**50)

    monkeypatch.setattr("greybed.core.readers.read_packing", greedy)
    refused("info bed.csv", capsys, r"not enough memory \(Unable to allocate .*fewer spheres")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "packing is missing; give"),
        ("packing = []", r"packing is empty; give at least one \[\[packing\]\]"),
        ("packing = 3", "packing must be a list of tables"),
        (BARE, r"packing\[0\].fraction is missing; give a number"),
        (BARE + "fraction = 0.9", r"fraction = 0\.9 \[-\] must be above 0 and at most 0\.7"),
        (BARE + "fraction = nan", r"fraction = nan \[-\] must be finite"),
        (BARE + 'fraction = "5 mm"', r"fraction: unit 'mm' does not measure"),
        (BARE + "fraction = true", "fraction = True must be"),
        (RANDOM + 'sizes = "mono:0mm"', r"packing\[0\]: radius = 0 \[m\] must"),
        (RANDOM + "sizes = 3", r"packing\[0\].sizes = 3 must be a string"),
        (RANDOM + 'split = "x"', "split = 'x' must be one of"),
        (RANDOM + "foo = 1", r"packing\[0\].foo is not a known key"),
        (RANDOM.replace("60", "19"), r"count = 19 \[-\] must be at least 20"),
        (RANDOM.replace("60", "9" * 15), r"count = 1e\+15 \[-\] must be .* at most 1e\+08"),
        (RANDOM.replace("60", '"60"'), "count = '60' must be a whole number"),
        (RANDOM.replace("200", "99"), r"rays = 99 \[-\] must be at least 100"),
        (RANDOM.replace("200", "1e5"), "rays = 100000.0 must be a whole number"),
        (RANDOM.replace("200", "9" * 18), r"rays = 1e\+18 \[-\] must be"),
        (RANDOM.replace("random", "radom"), "did you mean 'random'"),
        ("seed = 4294967296\n" + RANDOM, "seed = .* must be .* at most"),
        ("rays = [1\n", "not valid TOML"),
    ],
)
def test_designs(tmp_path, monkeypatch, capsys, text, message):
    monkeypatch.chdir(tmp_path)
    Path("design.toml").write_text(text)
    said = refused("dataset viewfactor design.toml --out out.h5", capsys, message)
    assert "design.toml" in said
    assert os.listdir() == ["design.toml"]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("bed.csv", "data.h5", "not 'greybed-packing'"),
        ('"traced"', '"closure"\nclosure = "data.h5"', "data.h5: not a closure artifact"),
        ('"traced"', '"closure"\nclosure = "."', "folder"),
        ("rays = 200", "rays = 0", r"radiation.rays = 0 \[-\] must be at least 1"),
        ("rays = 200", "rays = 1e30", r"rays = 1e\+30 must be a whole number"),
        ("15.0", "nan", r"material.conductivity = nan \[W/m/K\] must be finite"),
        ("[0, 0, 1]", "[0, 0]", "three numbers"),
        ("[0, 0, 1]", "[0, 0, 0]", "wall 'floor': normal .* no length"),
        ("[material]", "[[packing]]", "not valid TOML"),
    ],
)
def test_cases(here, capsys, old, new, message):
    text = Path("case.toml").read_text()
    assert old in text
    Path("case.toml").write_text(text.replace(old, new))
    refused("simulate case.toml --out out", capsys, message)


def test_a_design_and_a_case_exchanged(here, capsys):
    refused("simulate design.toml --out out", capsys, "design.toml: rays is not a known key")
    refused("dataset viewfactor case.toml --out out.h5", capsys, "case.toml: kind is not a known")


def test_a_design_without_a_split_is_told_before_the_packings(here, capsys):
    text = Path("design.toml").read_text().replace('"calibrate"', '"train"')
    Path("design.toml").write_text(text)
    message = r"design\.toml: no \[\[packing\]\] table has split = 'calibrate'"
    refused("dataset viewfactor design.toml --out bare.h5", capsys, message)
    assert not Path("bare.h5").exists()


def test_one_training_packing_gives_finite_closures(here):
    """Its solid fraction never varies: no division by that spread."""
    from greybed.datasets.viewfactor import ViewFactorData, read

    data = read("data.h5")
    keep = data.packing != 1
    columns = {name: column[keep] for name, column in data.columns.items()}
    numbers = np.where(data.packing[keep] > 1, data.packing[keep] - 1, 0)
    one = ViewFactorData(columns, numbers, [data.packings[k] for k in (0, 2, 3)])
    closure = train(one, "mlp", epochs=1)
    assert all(case.passed for case in limits.check_limits(closure, n=2000))
    assert np.isfinite(closure.card["score"]["r2"])


def test_a_dilute_test_split_is_scored(here):
    from greybed.datasets.viewfactor import ViewFactorData, read
    from greybed.training.score import score

    data = read("data.h5")
    columns = {**data.columns, "factor": np.minimum(data.columns["factor"], 9e-4)}
    card = score(load("mlp.closure"), ViewFactorData(columns, data.packing, data.packings))
    assert np.isnan(card["mape_above_1e-2"])
    assert np.isfinite(card["rmse"])


def test_check_of_a_closure_whose_limits_fail_gives_one(here, capsys, monkeypatch):
    class Leaking(ViewFactorClosure):
        def evaluate(self, **markers):
            return 1.001 * super().evaluate(**markers)

    sound = load("mlp.closure")
    leaking = Leaking(sound.markers, sound.predictor, sound.domain, sound.card)
    monkeypatch.setattr("greybed.closures.load_any", lambda path: leaking)
    assert main(["check", "mlp.closure", "--out", "out"]) == 1
    assert "FAIL" in capsys.readouterr().out
    assert json.loads(Path("out/summary.json").read_text())["passed"] is False


def test_a_sphere_given_twice(tmp_path, capsys):
    path = tmp_path / "twice.csv"
    path.write_text(HEADER + "0,0,0,1\n0,0,0,1\n")
    refused(["trace", str(path), "--out", str(tmp_path / "out")], capsys, "the same sphere twice")
