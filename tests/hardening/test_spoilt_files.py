"""A few spoilt files of every format; ``benchmarks/hardening.py fuzz`` reads 10,000 of each."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hardening import fuzz_one
from hardening_targets import TARGETS

from greybed.core.config import LARGEST, read_toml
from greybed.core.errors import InputError

# Their whole files take seconds to make.
SLOW = {"data set, view factors", "exchange_factors.h5"}

pytestmark = pytest.mark.skipif(os.name != "posix", reason="alarms of POSIX systems")


@pytest.mark.parametrize("name", [name for name in TARGETS if name not in SLOW])
def test_a_spoilt_file_loads_or_is_refused_in_one_sentence(name, tmp_path):
    found = fuzz_one(name, 25, 20261128, tmp_path, limits=False)
    assert found["loaded"] + found["refused"] == 25, found
    assert found["faults"] == []


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a = " + "[" * 5000, "within one another"),
        ("a" + ".a" * 5000 + " = 1", "within one another"),
        ("a = " + "9" * 5000, "not valid TOML"),
        ("# " + "x" * LARGEST, "more than"),
    ],
)
def test_a_case_of_endless_depth_or_size(text, said, tmp_path):
    path = tmp_path / "case.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=said):
        read_toml(path)


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="has no such device")
def test_a_device_without_end():
    with pytest.raises(InputError, match="more than"):
        read_toml("/dev/zero")


def test_a_message_stays_one_line_of_bounded_length():
    said = str(InputError("a\nb" + "x" * 100_000 + "the remedy."))
    assert len(said) < 2000
    assert said.startswith("a bx")
    assert said.endswith("the remedy.")
    assert "\n" not in said
