"""Exchange factors on disk: the same bits back, in blocks as in one call; refusals."""

from __future__ import annotations

import json

import h5py
import numpy as np
import pytest

from greybed.cli.main import main
from greybed.core import InputError, Packing, box_walls
from greybed.core.writers import write_packing
from greybed.datasets import exchanging
from greybed.datasets.exchange_file import read_exchange, write_exchange
from greybed.datasets.exchanging import ExchangeSettings, exchange_in_blocks
from greybed.datasets.tracing import STATE
from greybed.raytrace import exchange_factors

ROWS = ("wall_factors", "wall_stderr", "escaped", "areas", "spread", "emissivity")
SETTINGS = ExchangeSettings((0.3, 0.9), 200, 5, (0.5, 0.4, 0.3, 0.2, 0.1, 1.0), 0.2, 0.1, 300)


@pytest.fixture(scope="module")
def bed():
    centres = 0.1 + 0.2 * np.stack(np.meshgrid(*[np.arange(3)] * 3), -1).reshape(-1, 3)
    return Packing(centres, 0.08, walls=box_walls((0, 0, 0), (0.6, 0.6, 0.6)))


def whole(bed):
    return exchange_factors(
        bed, [0.3, 0.9], rays=200, seed=5, wall_emissivity=SETTINGS.wall_emissivity, specular=0.2,
        wall_specular=0.1, wall_rays=300,
    )  # fmt: skip


def same(found, wanted):
    assert len(found) == len(wanted)
    for a, b in zip(found, wanted, strict=True):
        for name in ROWS:
            np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)
            if name != "spread":
                of = getattr(a.patches, name), getattr(b.patches, name)
                np.testing.assert_array_equal(*of, err_msg=name)
        for name in ("factors", "stderr"):
            assert (getattr(a, name) != getattr(b, name)).nnz == 0
            assert (getattr(a.patches, name) != getattr(b.patches, name)).nnz == 0
        np.testing.assert_array_equal(a.wall_exchange, b.wall_exchange)
        assert (a.rays, a.seed, a.cut) == (b.rays, b.seed, b.cut)


def test_blocks_and_file_keep_every_bit(bed, tmp_path, monkeypatch):
    monkeypatch.setattr(exchanging, "PATHS_PER_BLOCK", 1_000)
    results, found = exchange_in_blocks(bed, tmp_path, SETTINGS)
    assert found == 0
    same(results, whole(bed))
    blocks = sorted(tmp_path.glob(f"{STATE}/*/*.npz"))
    assert len(blocks) == 6
    blocks[0].unlink()
    blocks[1].write_bytes(blocks[1].read_bytes()[:99])
    again, found = exchange_in_blocks(bed, tmp_path, SETTINGS)
    assert found == 27 - 10
    same(again, results)
    path = write_exchange(tmp_path / "d.h5", bed, again)
    stored = read_exchange(path)
    same(stored.results, results)
    stored.check(bed)
    with pytest.raises(InputError, match="belong to another packing"):
        stored.check(Packing(bed.centres, 0.07, walls=bed.walls))
    again = write_exchange(tmp_path / "e.h5", bed, results)
    assert again.read_bytes() == path.read_bytes()


def test_the_verb(bed, tmp_path, capsys):
    file = write_packing(bed, tmp_path / "bed.h5")
    words = ["trace", str(file), "--rays", "200", "--seed", "5", "--out", str(tmp_path), "--quiet"]
    optics = ["--specular", "0.2", "--wall-specular", "0.1", "--wall-rays", "300"]
    walls = ["--wall-emissivity", ",".join(map(str, SETTINGS.wall_emissivity))]
    assert main([*words, "--emissivity", "0.3,0.9", *optics, *walls]) == 0
    same(read_exchange(tmp_path / "exchange_factors.h5").results, whole(bed))
    said = json.loads((tmp_path / "summary.json").read_text())
    assert [one["emissivity"] for one in said["sets"]] == [0.3, 0.9]
    assert not list(tmp_path.glob(STATE))
    for extra, sentence in (
        (["--specular", "0.2"], "--specular needs --emissivity"),
        (["--emissivity", "0.5", "--smooth"], "--smooth is for view factors only"),
        (["--emissivity", "0.5", "--device", "cuda"], "leave out --emissivity"),
        (["--emissivity", "0.5,hot"], "'0.5,hot' is no list of numbers"),
        (["--emissivity", "0.5", "--wall-emissivity", "1,1"], "2 wall emissivities for 6 walls"),
        (["--emissivity", "1.5"], "1.5 [-] is outside"),
    ):
        capsys.readouterr()
        assert main([*words, *extra]) == 2
        assert sentence in capsys.readouterr().err


def test_damaged_and_foreign_files(bed, tmp_path):
    path = write_exchange(tmp_path / "d.h5", bed, whole(bed))
    with pytest.raises(InputError, match="27 spheres and 6 walls do not belong to 1 spheres"):
        write_exchange(tmp_path / "x.h5", Packing([[0, 0, 0]], 1.0), whole(bed))
    cut = tmp_path / "cut.h5"
    cut.write_bytes(path.read_bytes()[:3000])
    with pytest.raises(InputError, match="cut or damaged"):
        read_exchange(cut)
    with h5py.File(path, "a") as root:
        root["set_1/factors/indices"][0] = 27
    with pytest.raises(InputError, match="rows that do not fit"):
        read_exchange(path)
    with h5py.File(path, "a") as root:
        del root["set_1/patches/areas"]
        root["set_1/factors/indices"][0] = 0
    with pytest.raises(InputError, match="'areas' is missing"):
        read_exchange(path)
    with pytest.raises(InputError, match="is not 'greybed-exchange-factors'"):
        read_exchange(write_packing(bed, tmp_path / "bed.h5"))
