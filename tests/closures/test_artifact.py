"""The artifact: round trip, seal, golden rows, refusals; loads without torch and scikit-learn."""

import subprocess
import sys

import numpy as np
import pytest

from greybed.closures import ViewFactorClosure, artifact, content_hash, load, save
from greybed.closures.viewfactor.limits import random_markers
from greybed.core import InputError, OutputError, VerificationError


def test_round_trip_keeps_every_bit(fitted, tmp_path):
    again = load(save(fitted, tmp_path / "a.closure"))
    m = random_markers(fitted, 500, 3)
    for one, other in zip(fitted.predict(**m), again.predict(**m), strict=True):
        np.testing.assert_array_equal(one, other)
    assert content_hash(again) == content_hash(fitted)


def test_same_closure_same_bytes(fitted, tmp_path):
    a, b = save(fitted, tmp_path / "a.closure"), save(fitted, tmp_path / "b.closure")
    assert a.read_bytes() == b.read_bytes()


def test_any_changed_byte_is_noticed(tmp_path):
    path = save(ViewFactorClosure.untrained(), tmp_path / "a.closure")
    content = path.read_bytes()
    rng = np.random.default_rng(0)
    for at in [0, 5, 20, 60, len(content) - 1, *rng.integers(0, len(content), 100)]:
        changed = bytearray(content)
        changed[at] ^= 1 << int(rng.integers(0, 8))
        path.write_bytes(changed)
        with pytest.raises(InputError, match=r"a\.closure: .*(train|copy|make)"):
            load(path)


@pytest.mark.parametrize("share", [0.0, 0.001, 0.02, 0.5, 0.99])
def test_truncated(tmp_path, share):
    path = save(ViewFactorClosure.untrained(), tmp_path / "a.closure")
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    with pytest.raises(InputError, match=r"a\.closure"):
        load(path)


def test_golden_rows_are_replayed(tmp_path, monkeypatch):
    """A closure that answers otherwise than when it was written does not load."""
    path = save(ViewFactorClosure.untrained(), tmp_path / "a.closure")
    import greybed.closures.viewfactor.visibility as visibility

    monkeypatch.setattr(visibility, "ODDS_BOUND", 4.001)
    with pytest.raises(VerificationError, match=r"golden row \d+ gives .* instead of"):
        load(path)


def test_missing_file_and_folder(tmp_path):
    with pytest.raises(InputError, match="cannot read this artifact"):
        load(tmp_path / "none.closure")
    with pytest.raises(OutputError, match="cannot write this file"):
        save(ViewFactorClosure.untrained(), tmp_path / "absent" / "a.closure")


def test_no_pickle_in_the_archive(tmp_path):
    path = save(ViewFactorClosure.untrained("forest"), tmp_path / "a.closure")
    # An object array would raise here.
    arrays, manifest = artifact._unpack(path)
    assert all(a.dtype != object for a in arrays.values())
    assert manifest["marker_names"][0] == "radius_over_distance"


def test_loads_without_torch_and_sklearn(tmp_path):
    path = save(ViewFactorClosure.untrained("forest"), tmp_path / "a.closure")
    code = (
        "import sys; from greybed.closures import load;"
        f"c = load({str(path)!r});"
        "print(c.evaluate(radius_over_distance=0.5, radius_ratio=1.0, blocked_fraction=0.0,"
        " blockers_per_line=0.0));"
        "bad = {'torch', 'sklearn', 'h5py', 'matplotlib', 'onnx'} & set(sys.modules);"
        "assert not bad, bad"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("0.07558681842")
