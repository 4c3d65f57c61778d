"""Two runs in one folder: the second is refused at once, whatever the verbs are."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

import greybed
from greybed.cli import main
from greybed.core import folder_lock
from greybed.core.errors import OutputError
from greybed.core.folder_lock import LOCK, locked_folder

pytestmark = pytest.mark.skipif(os.name != "posix", reason="locks of POSIX systems")

ROOT = Path(greybed.__file__).parents[1]
EXAMPLES = ROOT / "examples"
BED = "x [mm],y [mm],z [mm],radius [mm]\n0,0,1,1\n2.5,0,1,1\n0,2.5,1,1\n0,0,3,1\n"

# Every verb that writes into a folder, on an input that it would take.
VERBS = {
    "info": "info bed.csv --out out",
    "pack": "pack --count 60 --fraction 0.3 --sizes mono:1mm --out out/bed.h5",
    "trace": "trace bed.csv --rays 10 --quiet --out out",
    "dataset": "dataset viewfactor --out out/data.h5",
    "train": "train viewfactor data.h5 --out out",
    "check": "check shipped:viewfactor_mlp_pencil --out out",
    "export": "export shipped:viewfactor_mlp_pencil --to cpp --out out",
    "host": "host openfoam law:beetstra --out out",
    "thermal bed": "simulate {e}/heated_bed/case.toml --out out",
    "particles": "simulate {e}/particles/hopper.toml --out out",
    "gas": "simulate {e}/flows/channel.toml --out out",
    "two-fluid": "simulate {e}/flows/clusters.toml --out out",
    "campaign": "campaign {e}/campaign/campaign.toml --out out",
    "calibrate": "calibrate {e}/calibration/twin.toml --out out",
    "diagnose": "diagnose {e}/settling_spheres/study.toml --out out",
    "blindtest": "blindtest --sets 1 --out out",
    "quickstart": "quickstart --small --out out",
    "doctor": "doctor --out out",
}


@pytest.mark.parametrize("verb", VERBS)
def test_a_folder_that_is_held_is_refused(verb, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(folder_lock, "PATIENCE", 0.0)
    Path("bed.csv").write_text(BED)
    # Its data, which would take long to make, are not what is asked for.
    monkeypatch.setattr("greybed.datasets.viewfactor.read", lambda path: None)
    with locked_folder("out"):
        before = sorted(Path("out").iterdir())
        assert main(VERBS[verb].format(e=EXAMPLES).split()) == 2
        said = capsys.readouterr().err
        assert f"out: another run (process {os.getpid()}) is writing there; wait for its" in said
        assert sorted(Path("out").iterdir()) == before
    assert not (Path("out") / LOCK).exists()


def test_a_killed_holder_frees_the_folder_and_its_rests_are_swept(tmp_path):
    code = (
        "import os, signal\n"
        "from greybed.core.files import atomic_path\n"
        "from greybed.core.folder_lock import locked_folder\n"
        "with locked_folder('.'), atomic_path('data.h5') as part:\n"
        "    part.write_text('half')\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=False)
    (tmp_path / f".other.{os.getpid()}.part.h5").write_text("of a process that lives")
    left = {path.name for path in tmp_path.iterdir()}
    assert len(left) == 3
    assert "data.h5" not in left
    with locked_folder(tmp_path):
        assert {p.name for p in tmp_path.iterdir()} == {LOCK, f".other.{os.getpid()}.part.h5"}


def test_a_run_waits_for_one_that_is_ending(tmp_path):
    code = (
        "import sys, time\n"
        "from greybed.core.folder_lock import locked_folder\n"
        "with locked_folder('.'):\n"
        "    print('held', flush=True)\n"
        "    time.sleep(0.3)\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code], cwd=tmp_path, stdout=subprocess.PIPE, text=True
    ) as other:
        assert other.stdout.readline() == "held\n"
        with pytest.raises(OutputError, match=f"process {other.pid}"), locked_folder(tmp_path, 0.0):
            pass
        with locked_folder(tmp_path, 20.0):
            assert other.wait() == 0


def test_a_file_system_without_locks_is_told(tmp_path, monkeypatch, capsys):
    import fcntl

    def refuse(*_):
        raise OSError(37, "No locks available")

    monkeypatch.setattr(fcntl, "flock", refuse)
    with locked_folder(tmp_path):
        assert "has no locks (No locks available)" in capsys.readouterr().err


@pytest.mark.skipif(sys.platform != "linux", reason="Linux tells children of a parent's end")
def test_programs_end_with_a_killed_run(tmp_path):
    code = (
        "import os, signal, subprocess\n"
        "from greybed.core.processes import ending_with_parent\n"
        "child = subprocess.Popen(['sleep', '60'], preexec_fn=ending_with_parent())\n"
        "print(child.pid, flush=True)\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    begin = time.monotonic()
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, stdout=subprocess.PIPE, text=True, check=False,
        timeout=60,
    )  # fmt: skip
    # Its pipe was the child's too: that the read has ended at once says that the child has.
    assert int(done.stdout) > 0
    assert time.monotonic() - begin < 30.0
