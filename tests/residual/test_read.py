"""Studies and tables: units at the door, labels, and one sentence for everything that is wrong."""

from __future__ import annotations

import numpy as np
import pytest

from greybed.core.errors import InputError
from greybed.residual import read_study
from greybed.residual.table import read_table

CSV = (
    "diameter [mm],viscosity [mPa s],velocity [cm/s],operator,humidity [percent],repeat\n"
    + "".join(
        f"{d},200,{0.1 * d**2:.4f},{w},{30 + d},{k}\n"
        for k, (d, w) in enumerate([(1, "A"), (2, "B"), (3, "A"), (4, "B"), (5, "A"), (6, "B")])
    )
)
STUDY = """
[data]
file = "data.csv"
response = "velocity"
group = ["diameter"]
replicate = "repeat"
labels = ["operator"]
[noise]
relative = "2 percent"
systematic = { diameter = 0.01 }
[model]
name = "terminal-velocity"
drag = "stokes"
[parameters.particle_density]
value = "1.5 g/cm3"
sd = "5 kg/m3"
[parameters.fluid_density]
value = 1100.0
[parameters.viscosity]
value = "200 mPa s"
free = true
[options]
alpha = 0.02
"""


@pytest.fixture
def place(tmp_path):
    (tmp_path / "data.csv").write_text(CSV)
    (tmp_path / "study.toml").write_text(STUDY)
    return tmp_path


def test_a_study_comes_in_si(place):
    study = read_study(place / "study.toml")
    assert study.table.columns["diameter"] == pytest.approx(np.arange(1, 7) * 1e-3)
    assert study.table.columns["velocity"][1] == pytest.approx(0.004)
    assert study.table.columns["humidity"][0] == pytest.approx(0.31)
    assert study.table.labels["operator"] == ("A", "B", "A", "B", "A", "B")
    assert study.table.units["velocity"] == "m/s"
    assert list(study.table.rows) == [2, 3, 4, 5, 6, 7]
    assert study.parameters["particle_density"].value == pytest.approx(1500.0)
    assert study.parameters["particle_density"].sd == pytest.approx(5.0)
    assert study.parameters["viscosity"].free
    assert study.noise.relative == pytest.approx(0.02)
    assert study.model.options == {"drag": "stokes"}
    assert study.options.alpha == 0.02


def test_other_delimiters_comments_and_windows(place):
    text = "﻿# measured in May\r\n" + CSV.replace(",", ";").replace("\n", "\r\n")
    (place / "data.csv").write_bytes(text.encode())
    assert len(read_study(place / "study.toml").table) == 6


def test_numbers_can_be_labels(place):
    (place / "data.csv").write_text(CSV.replace(",A,", ",1,").replace(",B,", ",2,"))
    assert read_study(place / "study.toml").table.labels["operator"][0] == "1"


def test_columns_can_be_left_aside(place):
    text = STUDY.replace('labels = ["operator"]', 'labels = ["operator"]\nignore = ["humidity"]')
    (place / "study.toml").write_text(text)
    assert "humidity" not in read_study(place / "study.toml").table.columns


TABLE_FAULTS = [
    (("[cm/s]", "[cm/x]"), r"line 1: column velocity: unit 'cm/x' is not known"),
    (("[cm/s]", "[kg]"), "does not measure a velocity"),
    (("[cm/s]", ""), "column velocity: the unit is missing; give a velocity in m/s or mm/s"),
    (("velocity [cm/s]", "speed [cm/s]"), "no column velocity; the file has diameter"),
    (("3,200,0.9000", "3,200,nan"), "line 4: column velocity = nan must be finite"),
    (("3,200,0.9000", "3,200,"), "line 4: column velocity is empty; measure it"),
    (("3,200,0.9000", "3,200,fast"), "line 4: column velocity = 'fast' is not a number"),
    (("3,200,0.9000,A,33,2", "3,200,0.9000"), "line 4: 3 cells where the header has 6"),
    (("operator", "diameter [um]"), "column diameter appears twice"),
    ((",A,33,", ",,33,"), "line 4: column operator is empty; write the label"),
    ((CSV[CSV.index("\n") + 1 :], ""), "0 rows follow the header"),
    ((CSV, ""), "is empty; begin with a header"),
    ((CSV[: CSV.index("\n") + 1], ""), "first line holds numbers|3 cells|no column"),
]


@pytest.mark.parametrize(("change", "message"), TABLE_FAULTS)
def test_faults_of_a_table_are_one_sentence(place, change, message):
    old, new = change
    assert old in CSV
    (place / "data.csv").write_text(CSV.replace(old, new, 1))
    with pytest.raises(InputError, match=message) as refusal:
        read_study(place / "study.toml")
    assert "\n" not in str(refusal.value)
    assert "data.csv" in str(refusal.value)


STUDY_FAULTS = [
    (("response =", "respons ="), r"data\.respons is not a known key; did you mean 'response'"),
    (("[noise]", "[nois]"), "nois is not a known key; did you mean 'noise'"),
    (('file = "data.csv"', 'file = "dat.csv"'), r"dat\.csv: cannot read this table"),
    (('"2 percent"', "2.0"), r"noise\.relative = 2 \[-\] must be above 0 and at most 1"),
    (("diameter = 0.01", "diamter = 0.01"), r"systematic\.diamter is no column or parameter"),
    (('"5 kg/m3"', "-5.0"), "sd = -5 must be at least 0"),
    (("free = true", "free = true\nsd = 0.01"), "is free and has an sd"),
    (('"1.5 g/cm3"', '"1.5 g"'), "unit 'g' does not measure a density"),
    (("alpha = 0.02", "alpha = 0.5"), "must be at least 0.0005 and at most 0.2"),
    (("alpha = 0.02", 'holdout = "rows"'), "must be 'group' or 'none'"),
    (('group = ["diameter"]', 'group = ["run"]'), "data.group names 'run'"),
    (('value = "1.5 g/cm3"\n', ""), r"parameters\.particle_density\.value is missing"),
    (("[model]\n", "[model\n"), "not valid TOML"),
    (("value = 1100.0", "value = inf"), "must be finite"),
]


@pytest.mark.parametrize(("change", "message"), STUDY_FAULTS)
def test_faults_of_a_study_are_one_sentence(place, change, message):
    old, new = change
    assert old in STUDY
    (place / "study.toml").write_text(STUDY.replace(old, new, 1))
    with pytest.raises(InputError, match=message) as refusal:
        read_study(place / "study.toml")
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("data", [b"\x00\x01\x02", b"\xff\xfe\x00", b"a,b\n1"])
def test_junk_is_refused(tmp_path, data):
    (tmp_path / "junk.csv").write_bytes(data)
    with pytest.raises(InputError):
        read_table(tmp_path / "junk.csv", "velocity")


def test_a_response_that_cannot_be_is_refused(place):
    from greybed.residual import diagnose

    (place / "data.csv").write_text(CSV.replace("3,200,0.9000", "3,200,-0.9"))
    text = STUDY.replace('[parameters.viscosity]\nvalue = "200 mPa s"\nfree = true\n', "")
    (place / "study.toml").write_text(text)
    with pytest.raises(InputError, match=r"line 4: velocity = -0\.009 \[m/s\] must be above 0"):
        diagnose(read_study(place / "study.toml"))
