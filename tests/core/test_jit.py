"""Processes that compile one kernel at once: it is compiled once, and never mixed up."""

import subprocess
import sys
import time

KERNEL = (
    "from greybed.core.jit import njit\n\n\n@njit(cache=True)\ndef half(x):\n    return x[0] / 2\n"
)
# The worst order of events: both choose a name, the first writes the index and then the second,
# the second writes its machine code and then the first.
COMPILE = """
import contextlib, sys, time
from pathlib import Path
import numpy as np
from numba.core.caching import IndexDataCacheFile
from greybed.core import jit
import shared_kernel

jit._alone = lambda kernel: contextlib.nullcontext()  # as on a disk without locks

kind = sys.argv[1]
first = kind == "float64"
write_index, write_code = IndexDataCacheFile._save_index, IndexDataCacheFile._save_data

def wait_for(event):
    until = time.monotonic() + 60
    while not Path(event).exists() and time.monotonic() < until:
        time.sleep(0.01)

def index(self, overloads):
    Path(f"{kind}.chosen").touch()
    wait_for("int8.chosen" if first else "float64.indexed")
    write_index(self, overloads)
    Path(f"{kind}.indexed").touch()

def code(self, name, data):
    if first:
        wait_for("int8.written")
    write_code(self, name, data)
    Path(f"{kind}.written").touch()

IndexDataCacheFile._save_index = index
IndexDataCacheFile._save_data = code
print(shared_kernel.half(np.array([3], dtype=kind)))
"""
CALL = """
import numpy as np
import shared_kernel
print([float(shared_kernel.half(np.array([3], dtype=kind))) for kind in ("float64", "int8")])
"""


# Slow enough that both processes look for machine code before there is any.
ONCE = """
import sys, time
from pathlib import Path
import numpy as np
from numba.core import event
import shared_kernel

class Tell(event.Listener):
    def on_start(self, told):
        print("compiled")
        Path("compiling").touch()
        time.sleep(1.0)
    def on_end(self, told):
        pass

event.register("numba:compile", Tell())
print(shared_kernel.half(np.array([3.0])))
"""


def start(folder, code, *words):
    command = [sys.executable, "-c", code, *words]
    return subprocess.Popen(
        command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def answer(process):
    out, err = process.communicate(timeout=120)
    assert process.returncode == 0, err
    return out.split()


def test_two_processes_compile_a_kernel_once(tmp_path, monkeypatch):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    (tmp_path / "shared_kernel.py").write_text(KERNEL)
    said = [answer(process) for process in [start(tmp_path, ONCE) for _ in range(2)]]
    assert sorted(said) == [["1.5"], ["compiled", "1.5"]]


def test_a_process_killed_while_it_compiles_holds_nobody_up(tmp_path, monkeypatch):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    (tmp_path / "shared_kernel.py").write_text(KERNEL)
    first = start(tmp_path, ONCE.replace("1.0)", "100)"))
    until = time.monotonic() + 60
    while not (tmp_path / "compiling").exists() and time.monotonic() < until:
        time.sleep(0.01)
    first.kill()
    first.communicate()
    assert answer(start(tmp_path, ONCE)) == ["compiled", "1.5"]


def test_kernels_of_two_processes_are_not_mixed_up(tmp_path, monkeypatch):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    (tmp_path / "shared_kernel.py").write_text(KERNEL)

    for process in [start(tmp_path, COMPILE, kind) for kind in ("float64", "int8")]:
        assert answer(process) == ["1.5"]
    # The second time, whatever the index had lost has been compiled and kept too.
    for _ in range(2):
        assert answer(start(tmp_path, CALL)) == ["[1.5,", "1.5]"]
