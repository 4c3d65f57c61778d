"""``greybed calibrate``: files, restart, exit codes."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from greybed.cli import main

STUDY = """
[study]
runs = 8
others = 6
seed = 1

[[parameter]]
name = "friction"
low = 0.1
high = 0.9

[[parameter]]
name = "rolling_friction"
low = 0.02
high = 0.8

[[experiment]]
name = "heap"
kind = "twin"
twin = "heap"

[[experiment]]
name = "hopper"
kind = "twin"
twin = "hopper"
role = "candidate"
errors = { flow = "5 g/s" }

[[data]]
experiment = "heap"
measure = "angle"
value = "31 deg"
sd = "0.7 deg"
"""


@pytest.fixture
def study(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(STUDY)
    return path


def test_it_writes_all_files_and_goes_on_from_its_store(study, tmp_path, capsys):
    out = tmp_path / "out"
    command = ["calibrate", str(study), "--out", str(out), "--quiet"]
    assert main(command) == 0
    said = capsys.readouterr().out
    assert "open" in said
    assert "14 runs (14 made now, 0 from the store, 0 failed)" in said
    found = json.loads((out / "calibration.json").read_text())
    assert found["directions"]["determined"] == 1
    assert found["next_tests"][0]["name"] == "hopper"
    assert found["parameters"]["friction"]["verdict"] in ("open", "one-sided")
    summary = json.loads((out / "summary.json").read_text())
    assert summary["verb"] == "calibrate"
    assert summary["provenance"]["seed"] == 1
    page = (out / "report.html").read_text()
    for title in ("Isolines and their overlap", "What to measure next", "Error budget"):
        assert title in page
    assert "http://" not in page.replace("http://www.w3.org", "")
    rows = (out / "posterior.csv").read_text().splitlines()
    assert rows[0] == "friction,rolling_friction,log_density"
    assert len(rows) > 1000
    assert main(command) == 0
    assert "(0 made now, 14 from the store" in capsys.readouterr().out
    again = json.loads((out / "calibration.json").read_text())
    assert again["parameters"] == found["parameters"]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('sd = "0.7 deg"', 'sd = "0 deg"', "sd = 0 must be above 0; give the error"),
        ("high = 0.9", "high = 0.05", "low = 0.1 must be below high = 0.05; exchange them"),
        ("high = 0.9\n", "", "has no range; give low and high"),
        ('measure = "angle"', 'measure = "flow"', "cannot produce the measure 'flow'"),
        ("runs = 8", "run = 8", "study.run is not a known key; did you mean 'runs'?"),
    ],
)
def test_bad_input_is_one_sentence_and_exit_code_2(study, tmp_path, capsys, old, new, said):
    study.write_text(STUDY.replace(old, new))
    assert main(["calibrate", str(study), "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert error.startswith("greybed calibrate: ")
    assert said in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


SLOW = """
import time
def run(parameters, seed, settings):
    time.sleep(0.1)
    return {"angle": 20.0 + 20.0 * parameters["friction"] + seed % 7 * 0.05}
"""


def test_an_interrupt_keeps_what_is_finished(tmp_path):
    (tmp_path / "slow.py").write_text(SLOW)
    study = tmp_path / "study.toml"
    study.write_text(
        '[study]\nruns = 400\n[[parameter]]\nname = "friction"\nlow = 0.1\nhigh = 0.9\n'
        '[[experiment]]\nname = "heap"\nkind = "python"\nfunction = "slow:run"\n'
        'measures = { angle = { unit = "deg" } }\n'
        '[[data]]\nexperiment = "heap"\nmeasure = "angle"\nvalue = 30.0\nsd = 0.5\n'
    )
    out = tmp_path / "out"
    command = [sys.executable, "-m", "greybed", "calibrate", str(study), "--out", str(out),
               "--quiet"]  # fmt: skip
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True,
                               cwd=Path(__file__).parents[2])  # fmt: skip
    with process:
        store = out / "runs.sqlite"
        deadline = time.monotonic() + 60.0
        while time.monotonic() < deadline and not (store.exists() and store.stat().st_size > 8192):
            time.sleep(0.05)
        time.sleep(0.6)
        process.send_signal(signal.SIGINT)
        _, error = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "interrupted; what was finished is kept" in error
    import sqlite3

    with sqlite3.connect(store) as file:
        assert file.execute("SELECT COUNT(*) FROM runs").fetchone()[0] >= 1
