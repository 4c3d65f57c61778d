"""Runs that are killed, interrupted, doubled, or given other threads: nothing lost, same bits."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from greybed.core import OutputError
from greybed.core.folder_lock import sole_writer
from greybed.report.stages import Stages

DESIGN = "rays = 6000\nemitters = 30\nseed = 4\n" + "".join(
    f'[[packing]]\nkind = "random"\ncount = 200\nshake = 20\nfraction = {fraction}\n'
    f'split = "{split}"\n'
    for fraction, split in zip(
        (0.2, 0.25, 0.3, 0.35, 0.4, 0.45), 2 * ("train", "calibrate", "test"), strict=True
    )
)
DATASET = ("dataset", "viewfactor", "long.toml", "--out", "out/data.h5")

posix = pytest.mark.skipif(os.name != "posix", reason="POSIX signals")


def command(*words):
    return [sys.executable, "-m", "greybed", *map(str, words)]


def start(words, folder, **environment):
    return subprocess.Popen(
        command(*words),
        cwd=folder,
        env={**os.environ, **environment},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        # A shell that runs the tests in the background may have turned Ctrl-C off for them.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


def finish(words, folder, **environment):
    done = subprocess.run(
        command(*words),
        cwd=folder,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    return done


def wait_for(ready, process, seconds=60.0):
    end = time.monotonic() + seconds
    while not ready():
        assert process.poll() is None, process.stderr.read()
        assert time.monotonic() < end
        time.sleep(0.002)


def sha(path):
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


def parts(folder):
    return sorted((folder / "out/data.h5.parts").glob("[!.]*.npz"))


@pytest.fixture(scope="module")
def long_design(tmp_path_factory):
    folder = tmp_path_factory.mktemp("long")
    (folder / "long.toml").write_text(DESIGN)
    finish(DATASET, folder)
    return folder


def times(folder):
    """When each kept part was written, and where."""
    return {path: (path.stat().st_mtime_ns, path.stat().st_ino) for path in parts(folder)}


@posix
def test_a_data_set_that_is_killed_again_and_again_goes_on(
    long_design, tmp_path, monkeypatch, capsys
):
    """At the start, amid the parts, at the last one. While it lives, a second run is refused."""
    from greybed.cli import main

    monkeypatch.chdir(tmp_path)
    shutil.copy(long_design / "long.toml", tmp_path)
    kept = {}
    for done in (0, 2, 5):
        process = start(DATASET, tmp_path)
        wait_for(lambda n=done: len(parts(tmp_path)) >= n and (tmp_path / "out").exists(), process)
        if done == 2:
            process.send_signal(signal.SIGSTOP)
            assert main([*DATASET]) == 2
            said = capsys.readouterr().err
            assert f"out: another run (process {process.pid}) is writing there" in said
        process.kill()
        process.communicate()
        assert not (tmp_path / "out/data.h5").exists() or done == 5
        found = {path: (path.stat().st_mtime_ns, path.stat().st_ino) for path in parts(tmp_path)}
        assert all(found.get(path, stamp) == stamp for path, stamp in kept.items()), "made again"
        kept = found
    finish(DATASET, tmp_path)
    assert sha(tmp_path / "out/data.h5") == sha(long_design / "out/data.h5")
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"data.h5", "summary.json"}


def test_a_part_that_was_cut_is_made_again(long_design, tmp_path, monkeypatch):
    from greybed.cli import main

    monkeypatch.chdir(tmp_path)
    shutil.copy(long_design / "long.toml", tmp_path)
    text = DESIGN.replace("6000", "200").split("[[packing]]")
    Path("short.toml").write_text("[[packing]]".join(text[:4]))
    words = ["dataset", "viewfactor", "short.toml", "--out", "out/data.h5"]
    monkeypatch.setattr(shutil, "rmtree", lambda *args, **options: None)
    assert main(words) == 0
    before = sha("out/data.h5")
    cut = parts(tmp_path)
    assert len(cut) == 3
    cut[0].write_bytes(cut[0].read_bytes()[:999])
    assert main(words) == 0
    assert sha("out/data.h5") == before


@posix
def test_a_killed_training_leaves_no_half_closure(here):
    from greybed.cli import main

    words = ["train", "viewfactor", "data.h5", "--no-curve", "--name", "new", "--out", "out"]
    process = start([*words, "--epochs", 300], here)
    wait_for((here / "out").exists, process)
    time.sleep(0.3)
    process.kill()
    process.communicate()
    assert not (here / "out/new.closure").exists()
    for place in ("out", "undisturbed"):
        assert main([*words[:-1], place, "--epochs", "2"]) == 0
    assert sha("out/new.closure") == sha("undisturbed/new.closure")


@posix
def test_a_killed_quickstart_holds_whole_files_only(tmp_path):
    process = start(("quickstart", "--small", "--out", "out"), tmp_path)
    record = tmp_path / "out/.state/dataset.json"
    wait_for(record.exists, process)
    process.kill()
    process.communicate()
    hashes = json.loads(record.read_text())["files"]
    assert hashes == {"viewfactors.h5": sha(tmp_path / "out/viewfactors.h5")}
    left = {path.name for path in (tmp_path / "out").iterdir() if not path.name.startswith(".")}
    assert "summary.json" not in left
    assert "report.html" not in left


def test_a_stage_whose_record_was_cut_is_done_again(tmp_path):
    calls = []

    def work():
        calls.append(1)
        (tmp_path / "file").write_text("x")
        return {"a": 1}, {}, [tmp_path / "file"]

    def run():
        return Stages(tmp_path, {}, lambda line: None).run("one", "one", work)

    run()
    run()
    assert len(calls) == 1
    for name, content in (("one.npz", b"PK"), ("one.json", b"[]"), ("one.json", b'{"key": 1')):
        (tmp_path / ".state" / name).write_bytes(content)
        assert run()[0] == {"a": 1}
    assert len(calls) == 4


def test_what_follows_a_changed_file_is_done_again(tmp_path):
    calls = []

    def run():
        stages = Stages(tmp_path, {}, lambda line: None)
        for name in "abc":

            def work(name=name):
                calls.append(name)
                (tmp_path / name).write_text(name)
                return {}, {}, [tmp_path / name]

            stages.run(name, name, work)

    run()
    run()
    assert calls == [*"abc"]
    (tmp_path / "b").write_text("changed")
    run()
    assert calls[3:] == ["b"]  # its file is as it was: what follows stands
    (tmp_path / "b").unlink()
    (tmp_path / ".state/c.json").unlink()
    run()
    assert calls[4:] == ["b", "c"]


INTERRUPTS = {
    "info": ("info", "bed.csv"),
    "convert": ("convert", "bed.csv", "out.h5"),
    "pack": ("pack", "--count", 20_000, "--fraction", 0.6, "--sizes", "mono:1mm", "--out", "out"),
    "trace": ("trace", "bed.csv", "--rays", 50_000_000, "--out", "out"),
    "dataset": ("dataset", "viewfactor", "--out", "out/d.h5"),
    "train": ("train", "viewfactor", "data.h5", "--epochs", 9000, "--out", "out"),
    "forest": ("train", "viewfactor", "data.h5", "--model", "forest", "--out", "out"),
    "check": ("check", "mlp.closure", "--exported", "onnx"),
    "export": ("export", "mlp.closure", "--to", "onnx", "--out", "out"),
    "simulate": ("simulate", "case.toml", "--out", "out"),
    "quickstart": ("quickstart", "--small", "--out", "out"),
}


def worked(process):
    """Processor time of a process [s]: where others load the machine, a start takes longer."""
    try:
        stat = Path(f"/proc/{process.pid}/stat").read_text().rsplit(")", 1)[1].split()
    except OSError:  # no Linux, or it has just ended
        time.sleep(1.0)
        return 1.0
    return (int(stat[11]) + int(stat[12])) / os.sysconf("SC_CLK_TCK")


@posix
@pytest.mark.parametrize("verb", INTERRUPTS)
def test_ctrl_c_is_one_sentence(here, verb):
    # Not before the interpreter has read the first lines of greybed: that is Python's to tell.
    for delay in (0.3, 1.0):
        process = start(INTERRUPTS[verb], here)
        while process.poll() is None and worked(process) < delay:
            time.sleep(0.005)
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
        said = process.communicate(timeout=60)[1]
        if process.returncode == 0:  # it was done before
            continue
        # Where it strikes inside Python's own exec of a string, as dataclasses use, the process
        # ends by the signal itself, which a shell shows as 130 too.
        assert process.returncode in (130, -signal.SIGINT), said
        assert "Traceback" not in said
        lines = [s for s in re.split(r"[\r\n]", said) if s.strip() and "%|" not in s]
        if process.returncode == -signal.SIGINT and not lines:
            continue  # the verb was done, the interpreter was about to end
        assert len(lines) == 1, said
        assert re.fullmatch(r"greybed \w+: interrupted; what was finished is kept\.", lines[0])


@posix
def test_ctrl_c_while_libraries_load_waits_for_them():
    from greybed.cli import main as main_function

    module = sys.modules[main_function.__module__]
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    loaded = []

    def load():
        with module._interrupt_later():
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.05)
            loaded.append(True)

    try:
        with pytest.raises(KeyboardInterrupt):
            load()
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)
    assert loaded


# Without any cache Numba compiles; its callbacks swallow the first Ctrl-C.
@posix
def test_ctrl_c_while_numba_compiles(here, tmp_path):
    cache = tmp_path / "cache"
    process = start(("trace", "bed.csv", "--rays", 10, "--out", "out"), here,
                    NUMBA_CACHE_DIR=str(cache))  # fmt: skip
    try:
        process.wait(1.5)
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGINT)
    said = process.communicate(timeout=60)[1]
    assert process.returncode in (0, 130, -signal.SIGINT), said
    assert "Traceback" not in said
    assert "Exception ignored" not in said


def test_a_swallowed_ctrl_c_is_sent_again(monkeypatch):
    from types import SimpleNamespace

    from greybed.cli import main as main_function

    module = sys.modules[main_function.__module__]
    others = []
    hook = module._keep_interrupt(others.append)
    hook(SimpleNamespace(exc_type=ValueError))
    assert len(others) == 1
    caught = False
    # A shell that runs the tests in the background may have turned Ctrl-C off for them.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        hook(SimpleNamespace(exc_type=KeyboardInterrupt))
        for _ in range(500):  # short, for this kind of signal ends no sleep
            time.sleep(0.01)
    except KeyboardInterrupt:
        caught = True
    finally:
        signal.signal(signal.SIGINT, before)
    assert caught


@posix
def test_locks_end_with_their_run(tmp_path):
    lock = tmp_path / ".lock"
    lock.write_text("999999\n")  # as a killed run leaves it
    with sole_writer(lock):
        assert lock.read_text() == f"{os.getpid()}\n"
        with pytest.raises(OutputError, match=rf"process {os.getpid()}\) is writing there"):
            sole_writer(lock).__enter__()
    assert not lock.exists()
    with pytest.raises(ZeroDivisionError), sole_writer(lock):
        raise ZeroDivisionError
    assert not lock.exists()


@posix
def test_many_runs_take_a_lock_in_turn(tmp_path):
    """Each adds one to a number that only the holder may touch; taken over from a kill."""
    code = (
        "import sys, time, pathlib\n"
        "from greybed.core import OutputError\n"
        "from greybed.core.folder_lock import sole_writer\n"
        "number = pathlib.Path('number')\n"
        "for _ in range(40):\n"
        "    while True:\n"
        "        try:\n"
        "            with sole_writer('.lock'):\n"
        "                n = int(number.read_text())\n"
        "                time.sleep(0.0005)\n"
        "                number.write_text(str(n + 1))\n"
        "            break\n"
        "        except OutputError:\n"
        "            time.sleep(0.0005)\n"
    )
    (tmp_path / "number").write_text("0")
    runs = [subprocess.Popen([sys.executable, "-c", code], cwd=tmp_path) for _ in range(3)]
    assert [run.wait(60) for run in runs] == [0, 0, 0]
    assert (tmp_path / "number").read_text() == "120"


CHAIN = (
    "pack --count 150 --fraction 0.5 --sizes lognormal:1mm,1.3 --shake 5 --seed 3 --out o/p.h5",
    "trace o/p.h5 --rays 400 --seed 2 --quiet --out o",
    "dataset viewfactor long.toml --out o/d.h5",
    "train viewfactor o/d.h5 --epochs 2 --no-curve --name mlp --out o",
    "train viewfactor o/d.h5 --model forest --no-curve --name forest --out o",
    "export o/mlp.closure --to cpp,onnx --name mlp --out o",
    "export o/forest.closure --to cpp,onnx --name forest --out o",
)


def test_threads_change_no_bit(tmp_path):
    """The whole chain in fresh processes, on one processor and on all, with one thread and two."""
    split = DESIGN.replace("6000", "1000").split("[[packing]]")
    design = "[[packing]]".join(split[:5])
    code = "from greybed.cli import main\n" + "\n".join(
        f"assert main({words.split()}) == 0" for words in CHAIN
    )
    one = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA")}
    two = {"OMP_NUM_THREADS": "2", "NUMBA_NUM_THREADS": "2", "OPENBLAS_NUM_THREADS": "2"}
    pin = "import os\nif hasattr(os, 'sched_setaffinity'):\n    os.sched_setaffinity(0, {})\n"
    pinned = pin.format("[min(os.sched_getaffinity(0))]") + code
    hashes = []
    for number, (program, environment) in enumerate(((pinned, one), (code, two))):
        folder = tmp_path / str(number)
        folder.mkdir()
        (folder / "long.toml").write_text(design)
        subprocess.run(
            [sys.executable, "-c", program],
            cwd=folder,
            # No compiler: its programs are no results, and compiling takes longest.
            env={**os.environ, **environment, "CXX": "/nowhere/g++"},
            check=True,
            capture_output=True,
        )
        hashes.append({p.name: sha(p) for p in (folder / "o").iterdir() if p.suffix != ".json"})
    assert {"p.h5", "view_factors.h5", "d.h5", "mlp.closure", "forest.closure"} < set(hashes[0])
    assert {"mlp.hpp", "mlp.onnx", "forest.hpp", "forest.onnx"} < set(hashes[0])
    assert hashes[0] == hashes[1]
