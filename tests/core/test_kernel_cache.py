"""Kernels are compiled anew when anything that they were made from has changed."""

import os
import subprocess
import sys

import pytest

from greybed.core.kernel_cache import refresh

INNER = "from numba import njit\n\n\n@njit(cache=True)\ndef two():\n    return 2.0\n"
OUTER = (
    "from numba import njit\n\nfrom pack.inner import (\n    two,\n)\n\n\n"
    "@njit(cache=True)\ndef twice(x):\n    return two() * x\n"
)
ALONE = "from numba import njit\n\n\n@njit(cache=True)\ndef one():\n    return 1.0\n"


@pytest.fixture
def package(tmp_path):
    folder = tmp_path / "pack"
    folder.mkdir()
    texts = {"__init__": "", "inner": INNER, "outer": OUTER, "alone": ALONE}
    for name, text in texts.items():
        (folder / f"{name}.py").write_text(text)
    return folder


def kept(package):
    return {path.name.split(".")[0] for path in package.glob("__pycache__/*.nbi")}


def run(package):
    words = "from pack.outer import twice; from pack.alone import one; print(twice(3.0) + one())"
    env = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"}
    done = subprocess.run(
        [sys.executable, "-c", words], cwd=package.parent, capture_output=True, text=True, env=env,
        check=True,
    )  # fmt: skip
    return float(done.stdout)


def test_a_kernel_is_not_older_than_what_it_imports(package):
    refresh(package)
    assert run(package) == 7.0
    assert kept(package) == {"inner", "outer", "alone"}
    assert refresh(package) == []
    (package / "inner.py").write_text(INNER.replace("2.0", "20.0"))
    # Numba itself goes on with the old number.
    assert run(package) == 7.0
    assert refresh(package) == ["pack.inner", "pack.outer"]
    assert kept(package) == {"alone"}
    assert run(package) == 61.0
    assert refresh(package) == []


def test_kernels_of_unknown_origin_are_made_anew(package):
    run(package)
    assert kept(package)
    assert refresh(package) == ["pack.alone", "pack.inner", "pack.outer"]
    assert kept(package) == set()
    (package / "__pycache__" / "kernels.json").write_text("{")
    assert refresh(package) == ["pack.alone", "pack.inner", "pack.outer"]
    assert refresh(package) == []


def test_edits_that_change_no_word_keep_kernels(package):
    refresh(package)
    run(package)
    os.utime(package / "alone.py", ns=(1, 1))
    assert refresh(package) == []
    assert "outer" in kept(package)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_that_cannot_be_written_is_left_alone(package):
    package.chmod(0o500)
    try:
        assert refresh(package) == []
    finally:
        package.chmod(0o700)
