"""What several rooms of tests need and what is dear to make: made once, for all processes."""

from __future__ import annotations

import os

# For processes that tests start, as `make test` does for itself: there is a process a core, small
# matrices gain nothing from more threads, and threads that wait for each other take eight times
# as long.
if "PYTEST_XDIST_WORKER" in os.environ:
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from filelock import FileLock


def once(tmp_path_factory: pytest.TempPathFactory, name: str, make: Callable[[Path], None]) -> Path:
    """Folder that ``make`` fills, shared by all processes of one call of pytest: read only."""
    base = tmp_path_factory.getbasetemp()
    root = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    folder, finished = root / name, root / f"{name}.finished"
    with FileLock(root / f"{name}.lock"):
        if not finished.exists():
            folder.mkdir(exist_ok=True)
            make(folder)
            finished.touch()
    return folder


@pytest.fixture(scope="session", autouse=True)
def compiled_kernels():
    """With several processes, the dearest kernels are compiled first, each by one of them."""
    worker = os.environ.get("PYTEST_XDIST_WORKER", "")
    if worker:
        from tests.kernels import compile_share

        compile_share(int(worker.removeprefix("gw")))


@pytest.fixture(scope="session")
def small_quickstart(tmp_path_factory):
    """What ``greybed quickstart --small --out out`` leaves in ``out``, and what it said."""

    def make(folder: Path) -> None:
        words = [sys.executable, "-m", "greybed", "quickstart", "--small", "--out", "out"]
        done = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=600)
        (folder / "said.txt").write_text(done.stdout)
        assert done.returncode == 0, done.stderr

    return once(tmp_path_factory, "small_quickstart", make)
