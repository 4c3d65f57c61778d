"""One tiny example of every file that the verbs exchange, made once."""

from __future__ import annotations

import shutil

import pytest

from greybed.cli import main

PACKING = '[[packing]]\nkind = "random"\ncount = 60\nshake = 3\n'
DESIGN = "rays = 1000\nemitters = 10\nseed = 4\n" + "".join(
    f'{PACKING}fraction = {fraction}\nsplit = "{split}"\n'
    for fraction, split in ((0.3, "train"), (0.45, "train"), (0.4, "calibrate"), (0.35, "test"))
)
BED = "x [mm],y [mm],z [mm],radius [mm]\n0,0,1,1\n2.5,0,1,1\n0,2.5,1,1\n0,0,3,1\n"
CASE = """
kind = "thermal-bed"
[packing]
file = "bed.csv"
[[wall]]
name = "floor"
kind = "plane"
normal = [0, 0, 1]
temperature = "500 K"
[opening]
temperature = "26.85 degC"
[material]
conductivity = 15.0
density = 7900.0
heat_capacity = "0.5 kJ/kg/K"
emissivity = 0.8
[radiation]
source = "traced"
rays = 200
"""


@pytest.fixture(scope="session")
def made(tmp_path_factory):
    """Folder with bed.csv, bed.h5, design.toml, case.toml, data.h5, two closures, factors.h5."""
    folder = tmp_path_factory.mktemp("made")
    (folder / "bed.csv").write_text(BED)
    (folder / "design.toml").write_text(DESIGN)
    (folder / "case.toml").write_text(CASE)

    def run(text):
        assert main([word.format(d=folder) for word in text.split()]) == 0

    run("pack --count 60 --fraction 0.4 --sizes mono:1mm --out {d}/bed.h5")
    run("dataset viewfactor {d}/design.toml --out {d}/data.h5")
    run("train viewfactor {d}/data.h5 --epochs 2 --no-curve --name mlp --out {d}")
    run("train viewfactor {d}/data.h5 --model forest --no-curve --name forest --out {d}")
    run("trace {d}/bed.csv --rays 50 --out {d} --quiet")
    (folder / "view_factors.h5").rename(folder / "factors.h5")
    return folder


@pytest.fixture
def here(made, tmp_path, monkeypatch):
    """A fresh copy of all that, as the working folder."""
    folder = tmp_path / "here"
    shutil.copytree(made, folder)
    monkeypatch.chdir(folder)
    return folder
