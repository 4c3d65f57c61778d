"""``greybed pack`` as a process: files, summary, refusals, the same bits as the library."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from greybed.core.readers import read_packing
from greybed.datasets.generate import CylinderContainer, Discrete, random_packing


def pack(*words, folder, **environment):
    return subprocess.run(
        [sys.executable, "-m", "greybed", "pack", *map(str, words)],
        cwd=folder,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=120,
    )


def test_a_folder_gets_the_packing_and_its_summary(tmp_path):
    sizes = "discrete:1mm=0.3,1.5mm=0.35,2mm=0.35"
    words = f"--count 400 --fraction 0.5 --container cylinder --shake 3 --seed 2 --sizes {sizes}"
    result = pack(
        *words.split(),
        *("--container-radius", "12mm", "--out", "bed"),
        folder=tmp_path,
        NUMBA_NUM_THREADS="1",
    )
    assert result.returncode == 0, result.stderr
    assert "400 spheres, solid fraction 0.500000, 0 overlaps" in result.stdout
    summary = json.loads((tmp_path / "bed/summary.json").read_text())
    assert summary["verb"] == "pack"
    assert summary["solid_fraction_requested"] == 0.5
    assert summary["solid_fraction_reached"] == pytest.approx(0.5, abs=1e-12)
    assert summary["overlapping_pairs"] == 0
    assert summary["largest_wall_overlap_relative"] == 0.0
    assert summary["provenance"]["seed"] == 2
    assert summary["seconds"] > 0.0
    packing = read_packing(tmp_path / "bed/packing.h5")
    assert [wall.name for wall in packing.walls] == ["cylinder", "floor", "lid"]
    again = random_packing(
        400,
        0.5,
        Discrete((1e-3, 1.5e-3, 2e-3), (0.3, 0.35, 0.35)),
        container=CylinderContainer(radius=12e-3),
        seed=2,
        shake=3,
    )
    # One thread there, all threads here, and HDF5 in between.
    np.testing.assert_array_equal(packing.centres, again.centres)
    np.testing.assert_array_equal(packing.radii, again.radii)


def test_a_csv_file_with_a_note(tmp_path):
    words = "--count 50 --fraction 0.4 --sizes mono:1.5mm --out beds/bed.csv"
    result = pack(*words.split(), folder=tmp_path)
    assert result.returncode == 0, result.stderr
    assert ".csv keeps no box" in result.stdout
    assert len(read_packing(tmp_path / "beds/bed.csv")) == 50
    assert (tmp_path / "beds/summary.json").exists()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("--fraction", "0.8"), "solid fraction = 0.8 [-] exceeds 0.7405"),
        (("--sizes", "mono:1.5"), "has no unit"),
        (("--container-radius", "5mm"), "no meaning for --container periodic"),
        (("--out", "bed.xyz"), "no writer for the extension '.xyz'"),
        (("--count", "-3"), "spheres = -3 [-] must be at least 1"),
    ],
)
def test_refusals_are_one_sentence_and_exit_code_2(tmp_path, capsys, monkeypatch, change, message):
    from greybed.cli.main import main

    monkeypatch.chdir(tmp_path)
    words = ["pack", "--count", "50", "--fraction", "0.4", "--sizes", "mono:1.5mm", "--out", "bed"]
    assert main([*words, *change]) == 2
    printed = capsys.readouterr().err
    assert message in printed
    assert "Traceback" not in printed
    assert not list(tmp_path.rglob("packing.h5"))
