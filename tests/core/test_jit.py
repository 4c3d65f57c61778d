"""Two processes that compile one kernel at once leave no later process the wrong machine code."""

import subprocess
import sys

KERNEL = (
    "from greybed.core.jit import njit\n\n\n@njit(cache=True)\ndef half(x):\n    return x[0] / 2\n"
)
# The worst order of events: both choose a name, the first writes the index and then the second,
# the second writes its machine code and then the first.
COMPILE = """
import sys, time
from pathlib import Path
import numpy as np
from numba.core.caching import IndexDataCacheFile
import shared_kernel

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


def test_kernels_of_two_processes_are_not_mixed_up(tmp_path, monkeypatch):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    (tmp_path / "shared_kernel.py").write_text(KERNEL)

    def start(code, *words):
        command = [sys.executable, "-c", code, *words]
        return subprocess.Popen(
            command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )

    for process in [start(COMPILE, "float64"), start(COMPILE, "int8")]:
        out, err = process.communicate(timeout=120)
        assert process.returncode == 0, err
        assert float(out) == 1.5
    # The second time, whatever the index had lost has been compiled and kept too.
    for _ in range(2):
        process = start(CALL)
        out, err = process.communicate(timeout=120)
        assert process.returncode == 0, err
        assert out.strip() == "[1.5, 1.5]"
