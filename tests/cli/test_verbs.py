"""Every verb as a process on tiny inputs: exit code, summary with provenance, light start-up."""

from __future__ import annotations

import hashlib
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from greybed._version import __version__
from greybed.cli import main
from greybed.cli.main import VERBS
from greybed.export import find_compiler

HEAVY = ("torch", "sklearn", "numba", "scipy", "h5py", "matplotlib", "onnx", "onnxruntime", "pint")
# verb -> words, where summary.json stands, inputs whose hashes it states, files beside it
RUNS = {
    "info": ("info bed.csv --out out", "out", ["bed.csv"], []),
    "pack": (
        "pack --count 30 --fraction 0.3 --sizes mono:1mm --seed 3 --out out/bed.h5",
        "out", [], ["bed.h5"],
    ),
    "trace": (
        "trace bed.csv --rays 50 --seed 3 --out out",
        "out", ["bed.csv"], ["view_factors.h5"],
    ),
    "dataset": (
        "dataset viewfactor design.toml --seed 3 --out out/data.h5",
        "out", ["design.toml"], ["data.h5"],
    ),
    "train": (
        "train viewfactor data.h5 --epochs 1 --no-curve --seed 3 --out out",
        "out", ["data.h5"], ["viewfactor_mlp_pencil.closure", "viewfactor_mlp_pencil.html"],
    ),
    "check": ("check forest.closure --exported onnx --out out", "out", ["forest.closure"], []),
    "export": (
        "export forest.closure --to onnx --name bed --out out",
        "out", ["forest.closure"], ["bed.onnx"],
    ),
    "simulate": (
        "simulate case.toml --quiet --out out",
        "out", ["case.toml", "bed.csv"], ["temperatures.csv", "bed.vtu"],
    ),
}  # fmt: skip
SEEDED = ("pack", "trace", "dataset", "train")


def process(words, folder, **environment):
    return subprocess.run(
        [sys.executable, "-W", "error", "-m", "greybed", *words],
        cwd=folder,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=120,
    )


@pytest.mark.parametrize("verb", RUNS)
def test_a_verb_writes_its_summary(here, verb):
    words, place, inputs, files = RUNS[verb]
    done = process(words.split(), here, NUMBA_NUM_THREADS="1", OMP_NUM_THREADS="1")
    assert done.returncode == 0, done.stderr
    assert "Warning" not in done.stderr
    assert "Traceback" not in done.stderr
    folder = here / place
    assert {path.name for path in folder.iterdir()} == {"summary.json", *files}
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["verb"].split()[0] == verb
    provenance = summary["provenance"]
    assert provenance["greybed"] == __version__
    assert {"python", "numpy"} <= set(provenance)
    assert provenance.get("inputs", {}) == {
        name: hashlib.sha256((here / name).read_bytes()).hexdigest() for name in inputs
    }
    if verb in SEEDED:
        assert provenance["seed"] == 3


def test_convert_writes_the_file_alone(here):
    done = process("convert bed.csv out.vtu".split(), here)  # noqa: SIM905
    assert (done.returncode, done.stderr) == (0, "")
    assert (here / "out.vtu").stat().st_size > 500


@pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")
def test_what_a_verb_says_comes_next_works(here, capsys):
    """A new user types the line that was printed."""
    assert main(RUNS["train"][0].split()) == 0
    follow = re.search(r"^next: greybed (.*)$", capsys.readouterr().out, re.MULTILINE)
    assert main(follow[1].split()) == 0
    assert capsys.readouterr().out.rstrip().endswith("all hold")


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_explains_itself_with_an_example(verb):
    done = process([verb, "--help"], Path.cwd())
    assert done.returncode == 0
    assert re.search(rf"^\s*(example: )?greybed {verb} ", done.stdout, re.MULTILINE | re.IGNORECASE)


def loaded_by(code):
    done = subprocess.run(
        [
            sys.executable,
            "-c",
            f"import sys\n{code}\nprint([m for m in {HEAVY} if m in sys.modules])",
        ],
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.splitlines()[-1]


def test_import_and_help_load_nothing_heavy():
    assert loaded_by("import greybed, greybed.cli, greybed.core") == "[]"
    run = "from greybed.cli import main\ntry:\n    main({})\nexcept SystemExit:\n    pass"
    assert loaded_by(run.format("['--help']")) == "[]"
    assert loaded_by(run.format("[]")) == "[]"
    for verb in VERBS:
        if verb != "quickstart":
            assert loaded_by(run.format([verb, "--help"])) == "[]", verb
