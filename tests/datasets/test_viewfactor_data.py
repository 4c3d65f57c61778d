"""View-factor data sets: rows against the trace, thinning, splits, resuming, broken files."""

import numpy as np
import pytest

from greybed.core import InputError
from greybed.core.exact import pair_factor
from greybed.core.sizes import LogNormal
from greybed.datasets import viewfactor
from greybed.datasets.beds import (
    BEDS,
    LatticeBed,
    LayeredBed,
    RandomBed,
    ShearedBed,
    WalledBed,
)
from greybed.datasets.generate import random_packing
from greybed.datasets.tables import exchange_rows_of, wall_rows_of
from greybed.datasets.viewfactor import (
    COLUMNS,
    Design,
    PackingDesign,
    default_design,
    generate,
    reach_of,
    read,
    rows_of,
)
from greybed.raytrace import view_factors

SMALL = Design(
    packing=tuple(
        PackingDesign(fraction=0.3 + 0.1 * k, count=60, shake=20, split=split)
        for k, split in enumerate(("train", "calibrate", "test"))
    ),
    rays=3000,
    emitters=10,
)


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    path = tmp_path_factory.mktemp("data") / "small.h5"
    return generate(SMALL, path), path


def test_rows_add_up_to_the_trace():
    """All images of all pairs in reach, weighted, hold what one row of the trace holds."""
    packing = random_packing(150, 0.5, LogNormal(1e-3, 1.2), seed=3, shake=20)
    columns = rows_of(packing, 150, 4000, seed=5)
    traced = view_factors(packing, rays=4000, seed=5)
    total = (columns["factor"] * columns["weight"]).sum()
    # Thinned rows are faint: their random share moves the sum by a per mille; the reach leaves
    # out pairs expected below 5e-5.
    assert total == pytest.approx(traced.factors.sum(), rel=0.01)
    assert (columns["factor"] <= columns["exact"] + 6 * columns["stderr"]).all()


def test_thinning_looks_at_the_geometry_only():
    packing = random_packing(150, 0.5, LogNormal(1e-3, 1.2), seed=3, shake=20)
    few, many = rows_of(packing, 40, 500, seed=5), rows_of(packing, 40, 5000, seed=5)
    np.testing.assert_array_equal(few["exact"], many["exact"])
    np.testing.assert_array_equal(few["weight"], many["weight"])


def test_reach_holds_what_can_be_seen():
    packing = random_packing(400, 0.4, LogNormal(1e-3, 1.1), seed=1)
    reach = reach_of(packing)
    assert 5e-3 < reach < 30e-3
    assert reach_of(packing, least=1e-3) < reach


def test_round_trip(data):
    made, path = data
    again = read(path)
    assert again.digest == made.digest
    for name in COLUMNS:
        np.testing.assert_array_equal(again.columns[name], made.columns[name])
    assert len(again.exchange) == len(made.exchange) > 1000
    np.testing.assert_array_equal(again.exchange.packing, made.exchange.packing)
    assert [p["split"] for p in again.packings] == ["train", "calibrate", "test"]


def test_splits_are_whole_packings(data):
    made, _ = data
    for split, number in (("train", 0), ("calibrate", 1), ("test", 2)):
        assert set(made.packing[made.in_split(split)]) == {number}


def test_same_seed_same_rows(data, tmp_path):
    assert generate(SMALL, tmp_path / "again.h5").digest == data[0].digest


def test_finished_packings_are_not_made_again(data, tmp_path, monkeypatch):
    """A run that dies in its third packing continues with the third."""
    made: list[int] = []
    real = viewfactor.rows_of

    def failing(packing, emitters, rays, seed):
        if len(made) == 2:
            raise KeyboardInterrupt
        made.append(seed)
        return real(packing, emitters, rays, seed)

    monkeypatch.setattr(viewfactor, "rows_of", failing)
    with pytest.raises(KeyboardInterrupt):
        generate(SMALL, tmp_path / "a.h5")
    assert not (tmp_path / "a.h5").exists()
    made.clear()
    monkeypatch.setattr(viewfactor, "rows_of", lambda *a: (made.append(a[3]), real(*a))[1])
    assert generate(SMALL, tmp_path / "a.h5").digest == data[0].digest
    assert len(made) == 1
    assert not (tmp_path / "a.h5.parts").exists()


def test_default_design_covers_what_it_promises():
    design = default_design()
    fractions = [p.fraction for p in design.packing]
    assert min(fractions) == 0.05
    assert max(fractions) >= 0.64
    assert {p.kind for p in design.packing} == set(BEDS)
    sizes = {p.sizes.split(":")[0] for p in design.packing if p.kind == "random"}
    assert sizes == {"mono", "lognormal", "discrete"}
    assert {p.split for p in design.packing} == {"train", "calibrate", "test"}


def test_workers_change_no_bit(data, tmp_path):
    assert generate(SMALL, tmp_path / "two.h5", workers=2).digest == data[0].digest


@pytest.mark.parametrize("split", ["train", "calibrate", "test"])
def test_a_design_without_a_split_is_refused(split):
    left = tuple(p for p in SMALL.packing if p.split != split)
    with pytest.raises(InputError, match=rf"no \[\[packing\]\] table has split = '{split}', so"):
        Design(packing=left)


MADE = {
    "random": RandomBed(fraction=0.3, count=60),
    "walled": WalledBed(fraction=0.3, count=60, container="cylinder"),
    "sheared": ShearedBed(fraction=0.5, count=150, stretch=1.3, sizes="lognormal:1mm,1.2"),
    "layered": LayeredBed(fraction=0.5, upper=0.3, count=160),
    "lattice": LatticeBed(fraction=0.5, lattice="bcc", jitter=1.0, cells=3),
}


@pytest.mark.parametrize("kind", list(BEDS))
def test_kinds_of_packings(kind):
    packing = MADE[kind].packing(3)
    assert packing.overlaps().count == 0
    if kind in ("random", "sheared", "lattice"):
        assert packing.solid_fraction == pytest.approx(MADE[kind].fraction, rel=1e-9)
    if kind == "layered":
        low = packing.centres[:, 2] < 0.375 * packing.edges[2]  # 1 / 0.5 of 1 / 0.5 + 1 / 0.3
        assert low.sum() == 80


def test_shear_leaves_an_oriented_fabric():
    """More touching pairs lie along the direction of compression than along the stretch."""
    packing = ShearedBed(fraction=0.6, count=400, stretch=1.2, sizes="lognormal:1mm,1.3").packing(1)
    pairs, distance = packing.neighbours(2e-5)
    delta = packing.centres[pairs[:, 1]] - packing.centres[pairs[:, 0]]
    delta -= packing.edges * np.round(delta / packing.edges)
    along = ((delta / distance[:, None]) ** 2).mean(axis=0)
    # One third each in an isotropic bed; the error of a mean over some 1000 contacts is 0.01.
    assert along[2] > along[0] + 0.03


def test_exchange_of_touching_spheres():
    """FCC at contact, nearest pairs, against independent reflecting rays: e D = 0.0531 at 0.8."""
    packing = LatticeBed(fraction=0.74, lattice="fcc", cells=3).packing(1)
    c = exchange_rows_of(packing, 16, 60_000, seed=1)
    near = c["radius_over_distance"] > 0.499
    mine = near & (c["emissivity"] == 0.8)
    mean = 0.8 * c["factor"][mine].mean()
    error = 0.8 * np.sqrt((c["stderr"][mine] ** 2).sum()) / mine.sum()
    # The reference carries three digits.
    assert mean == pytest.approx(0.0531, abs=4.0 * error + 0.5e-4)
    # Where e F is exact the rest is what reflections bring: it never lacks.
    direct = (
        c["emissivity"]
        * c["visible_share"]
        * pair_factor(c["radius_over_distance"], c["radius_ratio"])
    )
    assert (c["factor"] >= direct - 6.0 * c["stderr"]).all()


def test_wall_rows_follow_the_trace(tmp_path):
    columns = wall_rows_of(WalledBed(fraction=0.4, count=150).packing(2), 20, 20_000, seed=5)
    assert len(columns["factor"]) > 200
    estimate = columns["wall_share"] * (1.0 - columns["blocked_fraction"])
    # 4096 lines a sphere are off by 0.002 rms, the trace by 0.002.
    assert np.sqrt(np.mean((estimate - columns["factor"]) ** 2)) < 0.006
    assert (columns["factor"] <= columns["exact"] + 6 * columns["stderr"]).all()


@pytest.mark.parametrize("share", [0.0, 0.3, 0.9, 0.999])
def test_truncated(data, tmp_path, share):
    broken = tmp_path / "broken.h5"
    content = data[1].read_bytes()
    broken.write_bytes(content[: int(share * len(content))])
    with pytest.raises(InputError, match=r"broken\.h5: .*(again|make one)"):
        read(broken)


def test_changed_value(data, tmp_path):
    import h5py

    changed = tmp_path / "changed.h5"
    changed.write_bytes(data[1].read_bytes())
    with h5py.File(changed, "r+") as file:
        file["factor"][3] += 0.01
    with pytest.raises(InputError, match=r"changed\.h5: the data do not match their SHA-256"):
        read(changed)


def test_another_hdf5(tmp_path):
    import h5py

    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = 1.0
    with pytest.raises(InputError, match="not a view-factor data set"):
        read(tmp_path / "other.h5")
