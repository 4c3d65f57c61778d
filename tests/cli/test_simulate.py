"""``greybed simulate``: files it writes, sources of view factors, refusals in one sentence."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.sparse import csr_matrix

from greybed import closures, raytrace
from greybed.cli import main
from greybed.core import Cone, Cylinder, Disc, InputError, Mesh
from greybed.coupling.case import load_case

EXAMPLE = Path(__file__).parents[2] / "examples" / "heated_bed" / "case.toml"

CASE = """
kind = "thermal-bed"
[packing]
file = "bed.csv"
[[wall]]
name = "floor"
kind = "plane"
normal = [0, 0, 1]
temperature = "500 K"
[[wall]]
name = "side"
kind = "cylinder"
radius = "10 mm"
heat = "adiabatic"
[opening]
temperature = "26.85 degC"
[material]
conductivity = 15.0
density = 7900.0
heat_capacity = "0.5 kJ/kg/K"
emissivity = 0.8
[radiation]
source = "off"
"""

BOUNDED = """
kind = "thermal-bed"
packing.file = "bed.csv"
opening.temperature = 300
radiation.source = "off"
material = {conductivity = 15.0, density = 7900.0, heat_capacity = 500.0}
[[wall]]
name = "floor"
kind = "disc"
normal = [0, 0, 2]
radius = 9e-3
temperature = 500
[[wall]]
name = "hopper"
kind = "cone"
radius = 9e-3
end_radius = "20 mm"
length = 9e-3
temperature = 500
[[wall]]
name = "tube"
kind = "cylinder"
radius = "20 mm"
length = 9e-3
heat = "adiabatic"
"""


@pytest.fixture
def case(tmp_path):
    """Three touching spheres in a column on a plate; the topmost sees the opening best."""
    rows = [f"0,0,{(1 + 2 * i) * 0.999e-3:.9g},1e-3" for i in range(3)]
    (tmp_path / "bed.csv").write_text("\n".join(["x [m],y [m],z [m],radius [m]", *rows]) + "\n")

    def write(text=CASE):
        path = tmp_path / "case.toml"
        path.write_text(text)
        return path

    return write


def made_rows(packing, **options):
    """Exact rows of no real bed, with the attributes that tracer and closure share."""
    n = len(packing)
    factors = csr_matrix(0.1 * (np.eye(n, k=1) + np.eye(n, k=-1)))
    escaped = 1.0 - np.asarray(factors.sum(axis=1)).ravel() - 0.3
    return SimpleNamespace(
        factors=factors,
        wall_factors=np.tile([0.2, 0.1], (n, 1)),
        escaped=escaped,
        areas=packing.areas,
        options=options,
    )


def simulate(path, out, *more):
    code = main(["simulate", str(path), "--out", str(out), "--quiet", *more])
    return code, json.loads((out / "summary.json").read_text()) if code == 0 else None


def test_without_radiation_every_sphere_takes_the_floor_temperature(case, tmp_path, capsys):
    code, summary = simulate(case(), tmp_path / "out")
    assert code == 0
    lines = (tmp_path / "out" / "temperatures.csv").read_text().splitlines()
    assert lines[0] == "x [m],y [m],z [m],radius [m],temperature [K]"
    table = np.array([[float(v) for v in line.split(",")] for line in lines[1:]])
    np.testing.assert_allclose(table[:, -1], 500.0, rtol=1e-9)
    assert summary["lowest_temperature_K"] == pytest.approx(500.0)
    assert summary["converged"] is True
    assert set(summary["provenance"]["inputs"]) == {"case.toml", "bed.csv"}
    assert "temperature [K]" in (tmp_path / "out" / "bed.vtu").read_text()
    assert "heat from floor" in capsys.readouterr().out


def test_traced_and_closure_rows_give_the_same_bed(case, tmp_path, monkeypatch):
    asked = {}

    def view_factors(packing, **options):
        asked.update(options)
        return made_rows(packing)

    def load(path):
        asked["closure"] = path
        return SimpleNamespace(bed_factors=made_rows)

    monkeypatch.setattr(raytrace, "view_factors", view_factors, raising=False)
    monkeypatch.setattr(closures, "load", load, raising=False)
    (tmp_path / "vf.closure").write_text("{}")
    traced = CASE.replace('"off"', '"traced"\nrays = 77\nseed = 3')
    learned = CASE.replace('"off"', '"closure"\nclosure = "vf.closure"')
    first = simulate(case(traced), tmp_path / "a", "--threads", "1")[1]
    second = simulate(case(learned), tmp_path / "b")[1]
    assert (asked["rays"], asked["seed"], asked["threads"]) == (77, 3, 1)
    assert asked["closure"] == tmp_path / "vf.closure"
    assert first["mean_temperature_K"] == second["mean_temperature_K"] < 500.0
    assert first["energy_error"] < 1e-10
    assert first["provenance"]["seed"] == 3
    assert set(second["provenance"]["inputs"]) == {"case.toml", "bed.csv", "vf.closure"}


def test_real_rays_through_the_whole_chain(case, tmp_path):
    top = '[[wall]]\nname = "top"\nkind = "plane"\npoint = [0, 0, 0.007]\nnormal = [0, 0, -1]\n'
    text = CASE.replace("[opening]", top + "temperature = 300\n[opening]")
    traced = case(text.replace('"off"', '"traced"\nrays = 2000'))
    code, summary = simulate(traced, tmp_path / "out")
    assert code == 0
    # 2,000 rays: reciprocity of single factors holds to a few times 0.0756^0.5 / 2000^0.5.
    assert 0.0 < summary["view_factor_imbalance"] < 0.05
    assert summary["energy_error"] < 1e-10
    assert 300.0 < summary["mean_temperature_K"] < 500.0


def test_transient_writes_its_history(case, tmp_path):
    solve = '[solve]\nmode = "transient"\ninitial_temperature = 300\nduration = "0.1 min"\n'
    code, summary = simulate(case(CASE + solve), tmp_path / "out")
    assert code == 0
    assert summary["time_s"] == 6.0
    lines = (tmp_path / "out" / "history.csv").read_text().splitlines()
    assert lines[0].startswith("time [s],mean [K]")
    assert lines[0].endswith("heat of floor [W],heat of side [W]")
    assert float(lines[-1].split(",")[0]) == 6.0
    assert summary["energy_error"] < 1e-10


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "conductivity",
            "conductivty",
            "conductivty is not a known key; did you mean 'conductivity",
        ),
        (
            "conductivity = 15.0",
            "",
            "material.conductivity is missing; give a conductivity [W/m/K]",
        ),
        ('"500 K"', '"500 mm"', "wall[0].temperature"),
        ('"500 K"', "-3", "wall[0].temperature = -3 [K] must be above 0"),
        ('heat = "adiabatic"', "", "wall 'side' has no temperature; give either"),
        ('"500 K"', '"500 K"\nheat = "adiabatic"', "has a temperature and is adiabatic"),
        ("emissivity = 0.8", "emissivity = 1.8", "must be above 0 and at most 1"),
        ('"off"', '"closure"', 'radiation: give closure = "path"'),
        ('"off"', '"off"\n[solve]\nmode = "transient"', "needs duration [s]"),
        ('"off"', '"off"\n[solve]\nduration = 3', "mean nothing"),
        ('"side"', '"floor"', "name 'floor' is used twice"),
        ("bed.csv", "none.csv", "none.csv"),
        ("thermal-bed", "thermal", "did you mean 'thermal-bed'"),
    ],
)
def test_refusals_are_one_sentence(case, tmp_path, capsys, old, new, message):
    path = case(CASE.replace(old, new))
    assert simulate(path, tmp_path / "out")[0] == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


def test_opening_is_needed_where_rays_leave_and_noted_where_none_do(
    case, tmp_path, capsys, monkeypatch
):
    monkeypatch.setattr(raytrace, "view_factors", lambda packing, **_: made_rows(packing))
    text = CASE.replace('"off"', '"traced"')
    table = '[opening]\ntemperature = "26.85 degC"\n'
    assert simulate(case(text.replace(table, "")), tmp_path / "out")[0] == 2
    assert "has no [opening]; give it one" in capsys.readouterr().err
    monkeypatch.undo()
    # Real rays: the unbounded cylinder leaves no opening.
    text = text.replace('"traced"', '"traced"\nrays = 200')
    assert simulate(case(text), tmp_path / "out")[0] == 0
    assert "note: no sphere sees the opening" in capsys.readouterr().out


LID = "v -9 -9 2\nv 9 -9 2\nv 9 9 2\nv -9 9 2\ng a\nf 1 2 3\ng b\nf 1 3 4\n"
LID_TABLE = """[[wall]]
kind = "mesh"
name = "lid"
file = "lid.obj"
unit = "mm"
temperature = 400
"""


def test_bounded_walls_of_a_case(case, tmp_path):
    (tmp_path / "lid.obj").write_text(LID)
    path = case(BOUNDED + LID_TABLE)
    corners = np.array([[-9, -9, 2], [9, -9, 2], [9, 9, 2], [-9, 9, 2]]) * 1e-3
    assert load_case(path).walls == (
        Disc((0, 0, 0), (0, 0, 1), 9e-3, "floor"),
        Cone((0, 0, 0), (0, 0, 1), 9e-3, 0.02, 9e-3, "hopper"),
        Cylinder((0, 0, 0), (0, 0, 1), 0.02, "tube", 9e-3),
        Mesh(corners, [[0, 1, 2], [0, 2, 3]], "lid"),
    )
    code, summary = simulate(path, tmp_path / "out")
    assert code == 0
    # The lid touches the second sphere from below and cools it.
    assert 400.0 < summary["lowest_temperature_K"] < 500.0
    assert set(summary["provenance"]["inputs"]) == {"case.toml", "bed.csv", "lid.obj"}
    (tmp_path / "lid.obj").unlink()
    with pytest.raises(InputError, match="no such file"):
        _ = load_case(path).walls


def test_threads_below_one_are_refused(case, tmp_path, capsys):
    assert simulate(case(), tmp_path / "out", "--threads", "0")[0] == 2
    assert "--threads = 0" in capsys.readouterr().err


def test_the_example_is_a_valid_case():
    from greybed.coupling.case import load_case

    case = load_case(EXAMPLE)
    assert case.packing.file.exists()
    assert [w.name for w in case.walls] == ["floor", "side", "top"]
    assert case.wall[0].temperature == pytest.approx(1073.15)
