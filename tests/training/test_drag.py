"""Training of filtered drag on made-up data whose law is known."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest

from greybed.cli.main import main
from greybed.closures import load_drag
from greybed.closures.drag import drag_law
from greybed.closures.drag.filtered import Gate, Material, limits
from greybed.closures.drag.filtered.limits import check_limits
from greybed.core.errors import InputError
from greybed.datasets.filtered_drag import (
    DragCase,
    FilteredDrag,
    read_filtered_drag,
    write_filtered_drag,
)
from greybed.training.drag import drag_curve, folds_of, train_drag
from greybed.training.drag_rows import drag_rows
from greybed.training.drag_score import force_of, r_squared, score_of, two_constants

GATE = Gate()
AIR = {
    "gas_density": 1.3,
    "gas_viscosity": 1.8e-5,
    "gravity": 9.81,
    "gravity_axis": (0.0, -1.0, 0.0),
}


def case_of(k, rng):
    return DragCase(
        name=f"run {k}", source="two-fluid", dimension=2,
        diameter=float(rng.uniform(60e-6, 150e-6)),
        particle_density=float(rng.uniform(900.0, 2500.0)), mean_solid_fraction=0.2, cell=3e-4,
        box=(0.01, 0.04, 3e-4), law="wen-yu", packing=0.63, restitution=0.9, seed=k, start=0.1,
        stop=0.3, **AIR,
    )  # fmt: skip


def made_up(cases=8, rows=600, seed=0, pressure=0.0, noise=0.02):
    """Rows whose H is exp(-G (1 + 4 phi)) along and half of that in ln across, with noise.

    ``pressure`` of the force is the gradient's instead.
    """
    rng = np.random.default_rng(seed)
    law, parts, listed = drag_law("wen-yu"), [], []
    for k in range(cases):
        case = case_of(k, rng)
        listed.append(case)
        m = Material(
            case.diameter, case.particle_density, case.gas_density, case.gas_viscosity, case.gravity
        )
        u_t = m.terminal_velocity
        phi = rng.uniform(0.0, 0.6, rows)
        slip = u_t * np.stack(
            [rng.normal(0, 0.5, rows), rng.normal(1.0, 0.6, rows), np.zeros(rows)], axis=1
        )
        cells = rng.choice([2, 4, 8, 16], rows)
        size = cells * case.cell
        speed = np.sqrt((slip**2).sum(axis=1))
        f = law(phi, (1 - phi) * case.gas_density * case.diameter * speed / case.gas_viscosity)
        beta = 18.0 * case.gas_viscosity * (1 - phi) * phi * f / case.diameter**2
        gate = GATE(phi, size / m.length)
        along = np.exp(-gate * (1.0 + 4.0 * phi) * rng.lognormal(0.0, noise, rows))
        across = np.exp(-0.5 * gate * (1.0 + 4.0 * phi))
        force = beta[:, None] * slip * np.stack([across, along, across], axis=1)
        fall = m.weight * phi[:, None] * rng.normal([0.0, 1.0, 0.0], 0.4, (rows, 3))
        force = (1.0 - pressure) * force + pressure * (1 - phi)[:, None] * fall
        gradient = -fall - case.gas_density * 9.81 * np.array([0.0, 1.0, 0.0])
        nothing = np.zeros((rows, 3))
        parts.append(
            {
                "solid_fraction": phi, "slip": slip, "pressure_gradient": gradient,
                "drag_force": force, "drift_velocity": nothing, "scalar_variance": np.zeros(rows),
                "solids_stress": nothing, "gas_stress": nothing, "filter_size": size,
                "filter_cells": cells, "case": np.full(rows, k),
            }
        )  # fmt: skip
    columns = {name: np.concatenate([p[name] for p in parts]) for name in parts[0]}
    return FilteredDrag(**columns, cases=tuple(listed))


@pytest.fixture(scope="module")
def data():
    return made_up()


@pytest.fixture(scope="module")
def trained(data):
    return train_drag(data, "mlp", "plain", epochs=30, seed=1)


def test_a_known_law_is_found_on_cases_that_were_held_out(trained):
    closure, _, _ = trained
    score, random = closure.card["score"], closure.card["random_rows"]
    assert score["cases"] == 8
    assert score["drift_r2"] > 0.97
    assert score["kept_r2"] > 0.95
    # Cases differ in nothing that the markers do not say.
    assert abs(random["kept_r2"] - score["kept_r2"]) < 0.03
    for guess in closure.card["guesses"]:
        assert guess["kept_rms"] > 2.0 * score["kept_rms"], guess["name"]


def test_both_directions_are_learnt(trained):
    closure, rows, _ = trained
    p = closure.predict(**rows.of(closure.markers))
    gate = GATE(rows.markers["solid_fraction"], rows.markers["filter_size"])
    lost = gate * (1.0 + 4.0 * rows.markers["solid_fraction"])
    assert r_squared(np.exp(-lost), p.kept_along) > 0.98
    # Half as much in the logarithm, where there is some slip across to teach it.
    fast = rows.markers["slip_across"] > 0.5
    assert r_squared(np.exp(-0.5 * lost[fast]), p.kept_across[fast]) > 0.95


def test_intervals_hold_what_they_say(trained):
    assert 0.9 < trained[0].card["coverage95"] <= 1.0


def test_limits_hold_after_training_and_the_card_says_the_convention(trained, tmp_path):
    closure, _, _ = trained
    for case in check_limits(closure, n=4000):
        assert case.passed, (case.name, case.error)
    assert closure.card["convention"] == "fraction kept"
    assert closure.card["numbers"] <= 2000
    assert closure.card["law"] == "wen-yu"


def test_same_seed_same_bits():
    few = made_up(cases=3, rows=300)
    one, two = (
        train_drag(few, "mlp", "plain", epochs=3, seed=1, random_rows=False)[0] for _ in range(2)
    )
    for name, array in one.predictor.arrays().items():
        np.testing.assert_array_equal(array, two.predictor.arrays()[name])


def test_a_forest_finds_it_too(data):
    closure, _, _ = train_drag(data, "forest", "plain", random_rows=False)
    assert closure.card["score"]["kept_r2"] > 0.9
    assert closure.card["score"]["drift_r2"] > 0.9
    for case in check_limits(closure, n=4000):
        assert case.passed, (case.name, case.error)
    with pytest.raises(InputError, match="a forest has no linear part"):
        train_drag(data, "forest", "linear")


@pytest.mark.parametrize("markers", ["linear", "full"])
def test_force_of_the_gradient_is_found(markers):
    data = made_up(cases=5, pressure=0.6, noise=0.0)
    closure, rows, forces = train_drag(data, "mlp", markers, epochs=20, random_rows=False)
    assert closure.card["score"]["drift_r2"] > 0.93
    # It is the fits without a row's case that are scored; the one that comes out has seen all.
    assert score_of(rows, force_of(closure, rows))["drift_r2"] > 0.93
    assert np.isfinite(forces["closure"]).all()


def test_two_constants_of_a_two_constant_law():
    rows = drag_rows(made_up(cases=3, rows=200))
    mixed = dataclasses.replace(rows, force=0.2 * rows.unfiltered + 0.7 * rows.pull)
    a, b = two_constants(mixed)
    assert (a, b) == pytest.approx((0.2, 0.7), rel=1e-10)


def test_rows_are_without_units(data):
    rows = drag_rows(data)
    case = data.cases[3]
    m = Material(case.diameter, case.particle_density, case.gas_density, case.gas_viscosity)
    own = np.flatnonzero(data.case == 3)
    mine = rows.take(np.flatnonzero(rows.case == 3))
    np.testing.assert_allclose(
        mine.slip[:, 0], data.slip[own, 1][data.solid_fraction[own] > 0] / m.terminal_velocity,
        rtol=1e-12,
    )  # fmt: skip
    # Drift is what the quotient of forces leaves of the slip.
    drift = rows.drift(rows.force)[:, 0]
    wanted = rows.markers["solid_fraction"] * rows.slip[:, 0] * (rows.kept - 1.0)
    np.testing.assert_allclose(drift, wanted, atol=1e-12)
    assert r_squared(drift, drift) == 1.0


def test_bias_of_the_summed_force_is_that_of_the_sum(data):
    rows = drag_rows(data)
    assert score_of(rows, 0.9 * rows.force)["force_bias"] == pytest.approx(-0.1, rel=1e-12)
    # What one row lacks another may have: it says nothing of single rows.
    swapped = np.concatenate([rows.force[1:], rows.force[:1]])
    assert score_of(rows, swapped)["force_bias"] == pytest.approx(0.0, abs=1e-12)


def test_folds_never_split_a_case():
    group = np.repeat(np.arange(7), 13)
    fold = folds_of(group, 3)
    assert len(np.unique(fold)) == 5
    for k in range(7):
        assert len(np.unique(fold[group == k])) == 1


def test_more_cases_help_or_do_no_harm(data):
    points = drag_curve(data, "mlp", "plain", shares=(0.25, 1.0), epochs=15)
    assert points[0]["cases"] < points[1]["cases"]
    assert points[1]["kept_r2"] > points[0]["kept_r2"] - 0.02


def test_what_cannot_be_trained_is_refused(data):
    few = made_up(cases=2)
    with pytest.raises(InputError, match="has 2 cases of different flows, at least 3"):
        train_drag(few)
    lost = dataclasses.replace(data, convention="fraction lost")
    with pytest.raises(InputError, match=r"counts drag as 'fraction lost'.*kept = 1 - lost"):
        train_drag(lost)
    cells = data.filter_cells.copy()
    cells[5] = 0
    with pytest.raises(InputError, match=r"row 5: a filter of .* is smaller than a cell"):
        train_drag(dataclasses.replace(data, filter_cells=cells))
    with pytest.raises(InputError, match="has 60 rows with particles, at least 500"):
        train_drag(made_up(cases=3, rows=20))
    with pytest.raises(InputError, match=r"epochs = 0 \[-\]"):
        train_drag(data, epochs=0)


def test_files_give_the_same_rows_and_notice_changes(tmp_path):
    data = made_up(cases=3, rows=50)
    path = write_filtered_drag(tmp_path / "a.h5", data)
    again = read_filtered_drag(path)
    assert again.digest == data.digest
    assert again.cases == data.cases
    np.testing.assert_allclose(again.drag_force, data.drag_force, rtol=1e-6)
    other = write_filtered_drag(
        tmp_path / "lost.h5", dataclasses.replace(data, convention="fraction lost")
    )
    with pytest.raises(InputError, match="'fraction lost' and must be 'fraction kept'"):
        read_filtered_drag(other)
    with pytest.raises(InputError, match="cannot read this data set"):
        read_filtered_drag(tmp_path / "none.h5")


def test_from_the_command_line(tmp_path, capsys, monkeypatch):
    # The verbs draw a million random places.
    monkeypatch.setattr(limits, "check_limits", lambda *a, n=0, **k: check_limits(*a, n=3000, **k))
    path = write_filtered_drag(tmp_path / "a.h5", made_up(cases=4, rows=400))
    out = tmp_path / "out"
    assert main(["train", "drag", str(path), "--epochs", "8", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "fraction kept of drag" in said
    name = "filtered_drag_mlp_plain"
    closure = load_drag(out / f"{name}.closure")
    assert closure.card["data_sha256"]
    summary = json.loads((out / "summary.json").read_text())
    assert summary["convention"] == "fraction kept"
    assert summary["guesses"][0]["name"] == "none"
    assert all(summary["limits"].values())
    page = (out / f"{name}.html").read_text()
    for words in ("fraction kept", "two constants", "What the data say", "Model card"):
        assert words in page
    assert main(["check", str(out / f"{name}.closure")]) == 0
    assert main(["info", str(out / f"{name}.closure")]) == 0
    assert "fraction kept" in capsys.readouterr().out
    wrong = ["train", "drag", str(path), "--markers", "pencil", "--out", str(out)]
    assert main(wrong) == 2
    assert "--markers pencil is not for drag" in capsys.readouterr().err


def test_twins_of_a_flow_are_held_out_together():
    from greybed.datasets.filtered_drag import shipped_filtered_drag
    from greybed.training.drag import flows_of

    data = shipped_filtered_drag()
    flow = flows_of(data)
    names = [case.name for case in data.cases]
    twins = {flow[names.index(name)] for name in ("fcc-15", "fcc-15-fine", "fcc-15-wide")}
    assert len(twins) == 1
    assert len(np.unique(flow)) == len(names) - 2
