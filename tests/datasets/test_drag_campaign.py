"""Filtered-drag data sets: kept on the way, the same in one piece or many, refused where wrong."""

import dataclasses
import json
import time

import numpy as np
import pytest

from greybed.cli.main import main
from greybed.closures.drag import drag_law
from greybed.core.errors import InputError
from greybed.datasets import drag_campaign
from greybed.datasets.drag_campaign import OutOfTimeError, generate, run_case
from greybed.datasets.drag_design import DragDesign, FlowDesign
from greybed.datasets.filtered_drag import read_filtered_drag

SMALL = FlowDesign(
    name="a", kind="two-fluid", diameter=75e-6, particle_density=1500.0, solid_fraction=0.2,
    cells=(12, 16, 1), develop=0.2, apart=0.05, samples=3,
)  # fmt: skip
DESIGN = DragDesign(case=(SMALL,), filters=(1, 2, 4), each=60)


def test_rows_in_pieces_are_those_of_one_piece(tmp_path, monkeypatch):
    whole = run_case(SMALL, DESIGN, tmp_path / "whole").rows if make(tmp_path / "whole") else {}
    monkeypatch.setattr(drag_campaign, "KEEP", 0.0)
    make(tmp_path / "pieces")
    pieces = 0
    while True:
        try:
            rows = run_case(SMALL, DESIGN, tmp_path / "pieces", until=time.monotonic()).rows
            break
        except OutOfTimeError:
            pieces += 1
    assert pieces > 10
    for name in whole:
        np.testing.assert_array_equal(rows[name], whole[name], err_msg=name)


def make(folder):
    folder.mkdir()
    return True


def test_a_filter_of_one_cell_keeps_all_drag_of_the_law(tmp_path):
    data, left = generate(DESIGN, tmp_path)
    assert not left
    rows = data.filter_cells == 1
    phi, slip = data.solid_fraction[rows], data.slip[rows]
    re = (1.0 - phi) * 1.2 * 75e-6 * np.sqrt((slip**2).sum(axis=1)) / 1.8e-5
    beta = 18.0 * 1.8e-5 * (1.0 - phi) * phi * drag_law("wen-yu")(phi, re) / 75e-6**2
    np.testing.assert_allclose(data.drag_force[rows], beta[:, None] * slip, rtol=1e-12)
    # The box stands still on the whole: gas pushes as much as the weight pulls, so the pressure
    # gradient with its mean is there.
    weight = 9.81 * (0.2 * 1500.0 + 0.8 * 1.2)
    assert data.pressure_gradient[rows, 1].mean() == pytest.approx(-weight, rel=0.2)
    assert data.cases[0].stop > data.cases[0].start > 0.0


def test_the_verb_goes_on_and_tells_what_is_left(tmp_path, capsys):
    case = "\n".join(
        f'[[case]]\nname = "{name}"\nkind = "two-fluid"\ndiameter = "75 um"\n'
        f'particle_density = "1500 kg/m3"\nsolid_fraction = 0.2\ncells = [12, 16, 1]\n'
        "develop = 0.1\napart = 0.05\nsamples = 2\n"
        for name in ("a", "b")
    )
    (tmp_path / "design.toml").write_text(f"filters = [2, 4]\neach = 50\n{case}")
    command = ["dataset", "drag", str(tmp_path / "design.toml"), "--out", str(tmp_path / "d.h5")]
    assert main([*command, "--case", "b"]) == 0
    assert [c.name for c in read_filtered_drag(tmp_path / "d.h5").cases] == ["b"]
    assert json.loads((tmp_path / "summary.json").read_text())["unfinished"] == ["a"]
    assert main(command) == 0
    data = read_filtered_drag(tmp_path / "d.h5")
    assert [c.name for c in data.cases] == ["a", "b"]
    assert set(data.filter_cells) == {2, 4}
    assert "greybed train drag" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"filters": (0,)}, "smaller than a cell"),
        ({"case": (SMALL, SMALL)}, "two cases are called 'a'"),
        ({"case": ()}, "at least one"),
    ],
)
def test_designs_that_make_no_sense_are_refused(change, words):
    with pytest.raises(InputError, match=words):
        dataclasses.replace(DESIGN, **change)


def test_filters_too_wide_for_a_box_are_refused(tmp_path):
    with pytest.raises(InputError, match="narrower filter"):
        generate(dataclasses.replace(DESIGN, filters=(8,)), tmp_path)
    with pytest.raises(InputError, match="no case is called"):
        generate(DESIGN, tmp_path, names=["other"])


def test_a_case_that_ends_before_its_first_sample_gives_no_rows(tmp_path):
    short = dataclasses.replace(SMALL, most_steps=10)
    with pytest.raises(InputError, match="before its first sample"):
        generate(dataclasses.replace(DESIGN, case=(short,)), tmp_path)
