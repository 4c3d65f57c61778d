"""Estimates of memory: against measured peaks, and refused where they do not fit."""

from __future__ import annotations

from pathlib import Path

import pytest

import greybed
from greybed.cli import main
from greybed.core import memory
from greybed.core.errors import InputError
from greybed.core.memory import available_memory, check_memory

EXAMPLES = Path(greybed.__file__).parents[1] / "examples"
# Peaks [MB] of single processes, measured; how is in docs/hardening.md.
MEASURED = (
    (memory.PER_GAS_CELL, 64**3, 343),
    (memory.PER_TWO_FLUID_CELL, 512**2, 373),
    (memory.PER_PARTICLE, 40**3, 260),
    (memory.PER_TRACED_SPHERE, 28**3, 305),
)


@pytest.mark.parametrize(("each", "count", "peak"), MEASURED)
def test_an_estimate_is_not_below_a_measured_peak_and_not_far_above(each, count, peak):
    estimate = (memory.LIBRARIES + each * count) / (1 << 20)
    assert 0.95 * peak <= estimate <= 1.6 * peak


def test_what_does_not_fit_is_refused_with_both_numbers_and_a_remedy():
    with pytest.raises(InputError, match=r"needs about 2\.24 GB \(cells: 2\.00 GB\), and 1\.00 GB"):
        check_memory({"cells": 2 * 10**9}, "take fewer", most=10**9)
    lines = check_memory({"cells": 10**8}, "take fewer", most=10**9)
    assert lines[-1] == "memory: about 341 MB of 1.00 GB available"


@pytest.mark.skipif(not Path("/proc/meminfo").exists(), reason="Linux tells its memory")
def test_the_system_tells_what_is_there():
    assert 10**7 < available_memory() < 10**14


def test_a_grid_that_fits_nowhere_is_refused_before_it_is_made(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = (EXAMPLES / "flows" / "channel.toml").read_text()
    Path("case.toml").write_text(text.replace("[4, 1, 32]", "[40000, 1000, 32000]"))
    assert main(["simulate", "case.toml", "--memory", "--out", "out"]) == 2
    said = capsys.readouterr().err
    assert "memory: the run needs about" in said
    assert "are available; take wider cells" in said
    assert not Path("out").exists()


def test_a_trace_tells_its_memory(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("bed.csv").write_text("x [mm],y [mm],z [mm],radius [mm]\n0,0,1,1\n2.5,0,1,1\n")
    assert main(["trace", "bed.csv", "--rays", "10", "--memory", "--quiet", "--out", "out"]) == 0
    assert "memory: 2 spheres: 0 MB" in capsys.readouterr().out
    assert (
        main(
            ["trace", "bed.csv", "--rays", "10", "--memory", "--smooth", "--quiet", "--out", "out"]
        )
        == 2
    )
