"""Disks that are full or read-only: one sentence, exit code 2, and no half file under its name."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import tempfile
from contextlib import contextmanager
from pathlib import Path

import pytest

import greybed
from greybed.cli import main
from greybed.core import files
from greybed.core.errors import OutputError
from greybed.core.files import atomic_path

pytestmark = pytest.mark.skipif(os.name != "posix", reason="limits of POSIX systems")

EXAMPLES = Path(greybed.__file__).parents[1] / "examples"
BED = "x [mm],y [mm],z [mm],radius [mm]\n0,0,1,1\n2.5,0,1,1\n0,2.5,1,1\n0,0,3,1\n"
CASE = """
kind = "thermal-bed"
packing.file = "bed.csv"
material = {conductivity = 15.0, density = 7900.0, heat_capacity = 500.0, emissivity = 0.8}
radiation.source = "traced"
radiation.rays = 50
opening.temperature = "300 K"
[[wall]]
name = "floor"
kind = "plane"
normal = [0, 0, 1]
temperature = "500 K"
"""
GAS = (EXAMPLES / "flows" / "channel.toml").read_text()
GAS = GAS.replace("[4, 1, 32]", "[4, 1, 8]").replace('"1.5 s"', '"0.2 s"')
DESIGN = "rays = 100\nemitters = 3\nseed = 4\n" + "".join(
    f'[[packing]]\nkind = "random"\ncount = 30\nshake = 1\nfraction = 0.2\nsplit = "{split}"\n'
    for split in ("train", "calibrate", "test")
)
VERBS = {
    "info": "info bed.csv --out out",
    "convert": "convert bed.csv out/bed.vtu",
    "convert to HDF5": "convert bed.csv out/bed.h5",
    "convert to a mesh": "convert bed.csv out/bed.stl",
    "pack": "pack --count 60 --fraction 0.3 --sizes mono:1mm --out out/bed.h5",
    "trace": "trace bed.csv --rays 50 --quiet --out out",
    "dataset": "dataset viewfactor design.toml --out out/data.h5",
    "export": "export shipped:viewfactor_mlp_pencil --to cpp --out out",
    "host": "host cfdem law:wen-yu --out out",
    "thermal bed": "simulate case.toml --quiet --out out",
    "particles": "simulate bounce.toml --quiet --out out",
    "gas": "simulate gas.toml --quiet --out out",
}
# Bytes that a file may have.
LIMITS = (0, 3000)


@contextmanager
def no_file_larger_than(size):
    """As a full disk: a write beyond it fails with an OSError (EFBIG instead of ENOSPC)."""
    import resource

    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def _set_up():
    Path("bed.csv").write_text(BED)
    Path("case.toml").write_text(CASE)
    Path("gas.toml").write_text(GAS)
    Path("design.toml").write_text(DESIGN)
    for name in ("bounce.toml", "start.csv"):
        shutil.copy(EXAMPLES / "campaign" / name, ".")
    Path("out").mkdir()


def _hashes():
    return {
        str(p): hashlib.sha256(p.read_bytes()).hexdigest()
        for p in Path("out").rglob("*")
        if p.is_file() and not p.name.startswith(".")
    }


@pytest.mark.parametrize("verb", VERBS)
def test_a_full_disk_leaves_whole_files_only(verb, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    _set_up()
    words = VERBS[verb].split()
    assert main(words) == 0
    whole = _hashes()
    capsys.readouterr()
    for limit in LIMITS:
        shutil.rmtree("out")
        Path("out").mkdir()
        with no_file_larger_than(limit):
            code = main(words)
        said = capsys.readouterr().err
        largest = max(Path(name).stat().st_size for name in _hashes()) if _hashes() else 0
        assert largest <= limit
        # Where the limit was below nothing that is written, nothing may have gone wrong.
        if code == 0:
            assert set(_hashes()) == set(whole)
            continue
        assert code == 2, said
        assert "Traceback" not in said
        last = said.strip().splitlines()[-1]  # after the progress bar, where there is one
        assert re.match(r"greybed \w+: .*\(File too large\); .*free space", last), said
        for name, found in _hashes().items():
            # Times stand in summaries; parts of a run that goes on are gone at its end.
            assert found == whole.get(name, found) or name.endswith(".json"), name
        assert not list(Path("out").rglob(".*.part*"))


def test_a_full_temporary_folder_too():
    with tempfile.TemporaryDirectory() as folder, no_file_larger_than(10):
        target = Path(folder) / "a.txt"
        with pytest.raises(OutputError, match="File too large"), atomic_path(target) as part:
            part.write_bytes(b"x" * 11)
        assert list(Path(folder).iterdir()) == []


def test_a_name_that_cannot_be_taken_over(tmp_path, monkeypatch):
    def refuse(*_):
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr(files.os, "replace", refuse)
    with pytest.raises(OutputError, match="Read-only"), atomic_path(tmp_path / "a.txt") as part:
        part.write_text("x")
    assert list(tmp_path.iterdir()) == []
