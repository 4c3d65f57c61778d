"""Runs by LIGGGHTS: files, streams, failures, stops. Skipped where no ``liggghts`` is installed."""

from __future__ import annotations

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from liggghts_cases import HEAD, SOME, pack, planes, theirs

from greybed.cli.main import main
from greybed.core.errors import InputError
from greybed.dem.case import load_particle_case
from greybed.dem.liggghts import LiggghtsRun
from greybed.dem.liggghts.deck import DECK

pytestmark = pytest.mark.skipif(
    shutil.which("liggghts") is None, reason="liggghts is not installed (apt-get install liggghts)"
)


def test_the_verb_writes_what_our_engine_writes(tmp_path):
    path = tmp_path / "case.toml"
    path.write_text(
        HEAD.format(**SOME).replace("[law]", "frames = 0.02\n[law]") + planes() + pack(10)
    )
    for engine in ("greybed", "liggghts"):
        words = ["simulate", str(path), "--out", str(tmp_path / engine), "--quiet"]
        assert main([*words, "--engine", engine]) == 0
    own, their = (
        {str(p.relative_to(tmp_path / engine)) for p in (tmp_path / engine).rglob("*")}
        for engine in ("greybed", "liggghts")
    )
    left = {name for name in their if name.split("/")[0] == "liggghts"}
    assert {"liggghts/in.liggghts", "liggghts/start.data", "liggghts/log.liggghts"} <= left
    # Frames of our engine are taken at looks.
    files = [{n for n in names if not n.startswith("frames/")} for names in (own, their - left)]
    assert files[0] - files[1] == {"checkpoint.npz"}
    assert files[1] <= files[0]
    frames = {f"frames/frame_{step:010d}.vtu" for step in (0, 2000, 4000)}
    assert frames <= their
    assert not list((tmp_path / "liggghts" / "liggghts").glob("*.bin"))
    summary = [
        json.loads((tmp_path / engine / "summary.json").read_text())
        for engine in ("greybed", "liggghts")
    ]
    assert summary[1]["engine"] == "liggghts"
    assert "3.8" in summary[1]["engine_version"]
    assert summary[1]["ranks"] == 1
    assert summary[1]["particle_steps_per_second"] > 0.0
    for name in ("particles", "steps", "time_step_s", "mass_kg", "height_m"):
        assert summary[0][name] == pytest.approx(summary[1][name], rel=1e-6)
    with open(tmp_path / "liggghts" / "history.csv") as stream:
        assert len(list(csv.DictReader(stream))) == 6


STREAM = """
[[particles]]
kind = "stream"
material = "glass"
sizes = "{sizes}"
rate = 0.02
mass = 0.004
lower = [0.002, 0.002, 0.03]
upper = [0.018, 0.018, 0.05]
velocity = [0, 0, -0.5]
[[particles]]
kind = "pack"
material = "glass"
sizes = "mono:1mm"
count = 30
at = 0.1
lower = [0, 0, 0.06]
upper = [0.02, 0.02, 0.08]
"""


@pytest.mark.parametrize("sizes", ["mono:1.2mm", "uniform:1mm,1.4mm", "discrete:1mm=0.5,1.4mm=0.5"])
def test_a_stream_brings_its_mass_at_its_rate_with_its_sizes(tmp_path, sizes):
    path = tmp_path / "case.toml"
    path.write_text(
        HEAD.format(**{**SOME, "duration": 0.3}) + planes() + STREAM.format(sizes=sizes)
    )
    run = theirs(tmp_path, path)
    sim, history = run.simulation, run.tally.history
    pack = 30 * 4.0 / 3.0 * np.pi * 1e-9 * 2500
    largest = 2500 * 4.0 / 3.0 * np.pi * 1.4e-3**3
    # LIGGGHTS ends with the look (200 steps) in which the mass is full.
    assert sim.masses.sum() - pack == pytest.approx(0.004, abs=200 * 1e-5 * 0.02 + largest)
    time = np.array([row["time [s]"] for row in history])
    mass = np.array([row["mass [kg]"] for row in history]) - pack * (time > 0.1)
    early = (time > 0.02) & (time < 0.16)
    # A particle weighs 3 % of what comes in the time.
    assert np.polyfit(time[early], mass[early], 1)[0] == pytest.approx(0.02, rel=0.06)
    radii = sim.radii
    if sizes.startswith("mono"):
        assert set(np.round(radii, 9)) == {1.2e-3, 1e-3}
    if sizes.startswith("discrete"):
        mine = np.sort(radii)
        assert set(np.round(mine, 9)) == {1e-3, 1.4e-3}
        share = (mine[mine > 1.2e-3] ** 3).sum() * 2500 * 4 / 3 * np.pi / 0.004
        assert share == pytest.approx(0.5, abs=0.15)  # random: a hundred particles
    if sizes.startswith("uniform"):
        assert radii.min() >= 1e-3 - 1e-9
        assert radii.max() <= 1.4e-3 + 1e-9
        assert len(np.unique(np.round(radii, 8))) > 10


def test_the_engine_says_why_it_stopped(tmp_path):
    path = tmp_path / "case.toml"
    path.write_text(HEAD.format(**SOME) + planes() + pack(10))
    run = LiggghtsRun(load_particle_case(path), {}, tmp_path / "work")
    text = run.deck.text.replace("pair_coeff * *", "pair_coeff * * nonsense")
    object.__setattr__(run.deck, "text", text)
    with pytest.raises(
        InputError, match=r"LIGGGHTS stopped with exit code 1: ERROR: .*; its log is"
    ):
        list(run.go_on())


def test_a_particle_that_leaves_the_bounds_stops_the_run(tmp_path):
    text = HEAD.format(**{**SOME, "duration": 0.2}) + pack(5)
    text += "\n[bounds]\nlower = [-1, -1, -0.01]\nupper = [1, 1, 1]\n"
    path = tmp_path / "case.toml"
    path.write_text(text)
    run = LiggghtsRun(load_particle_case(path), {}, tmp_path / "work")
    with pytest.raises(InputError, match="outside the bounds"):
        list(run.go_on())


@pytest.mark.parametrize("way", [signal.SIGINT, signal.SIGTERM])
def test_a_stopped_run_leaves_no_process_and_no_half_results(tmp_path, way):
    path = tmp_path / "case.toml"
    path.write_text(HEAD.format(**{**SOME, "duration": 500.0}) + planes() + pack(40))
    words = [sys.executable, "-m", "greybed", "simulate", str(path), "--out", str(tmp_path / "out")]
    child = subprocess.Popen([*words, "--engine", "liggghts", "--quiet"], stderr=subprocess.PIPE)
    history = tmp_path / "out" / "history.csv"
    until = time.monotonic() + 300  # the first run compiles
    while not history.exists() and time.monotonic() < until:
        time.sleep(0.1)
    child.send_signal(way)
    child.communicate(timeout=120)
    assert child.returncode == (130 if way == signal.SIGINT else 143)
    assert not (tmp_path / "out" / "summary.json").exists()
    assert not list((tmp_path / "out").glob("*.part*"))
    work = (tmp_path / "out" / "liggghts").resolve()
    assert (work / DECK).exists()
    for entry in os.listdir("/proc"):
        if entry.isdigit():
            try:
                assert os.readlink(f"/proc/{entry}/cwd") != str(work)
            except OSError:
                continue
