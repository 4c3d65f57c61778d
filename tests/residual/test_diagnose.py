"""The verdicts, each on data that call for it, and on the measured data that ship as examples."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic import spheres

from greybed.core.errors import InputError
from greybed.residual import diagnose, read_study

EXAMPLES = Path(__file__).parents[2] / "examples"
# Folds repeat the whole analysis, for the error on held-out rows alone.
verdict_only = pytest.mark.usefixtures("three_folds")


def names(found):
    return {effect.name for effect in found.effects}


@verdict_only
def test_nothing_missing_is_said_with_what_would_have_been_seen():
    found = diagnose(spheres(1))
    assert found.verdict == "none"
    assert found.p_value > 0.01
    assert set(found.detectable["effects"]) >= {"wall", "inertia", "shape"}
    # 60 rows of 2 %: an effect of some per cent is within reach, a tenth of a per cent is not
    assert 0.002 < found.detectable["relative"] < 0.03


@verdict_only
def test_what_is_called_detectable_is_detected():
    found = diagnose(spheres(2))
    amplitude = found.detectable["effects"]["shape"]["amplitude"]
    seen = [diagnose(spheres(s, effects={"shape": amplitude})).verdict for s in range(40, 46)]
    # Nine in ten are promised: fewer than four of six come by chance once in sixty times.
    assert sum(verdict != "none" for verdict in seen) >= 4


@verdict_only
@pytest.mark.parametrize("name", ["wall", "inertia", "shape", "viscosity-temperature"])
def test_one_effect_is_named_with_its_amplitude(name):
    amplitude = {"wall": 2.3, "inertia": 0.14, "shape": 1.1, "viscosity-temperature": -7.0}[name]
    found = diagnose(spheres(3, effects={name: amplitude}))
    assert found.verdict == "effect"
    assert names(found) == {name}
    (effect,) = found.effects
    assert effect.amplitude == pytest.approx(amplitude, rel=0.25)
    assert effect.p_value < 1e-3
    assert found.error.with_effect.value < 0.03 < found.error.base.value
    assert found.model["effects"] == {name: effect.amplitude}


@verdict_only
def test_two_effects_are_both_named():
    found = diagnose(spheres(4, n=100, effects={"wall": 2.1, "shape": 1.0}))
    assert (found.verdict, names(found)) == ("effect", {"wall", "shape"})


@verdict_only
def test_the_next_run_of_the_model_with_the_effect_misses_nothing():
    study = spheres(5, effects={"wall": 2.1})
    found = diagnose(study)
    again = diagnose(replace(study, model=replace(study.model, effects=found.model["effects"])))
    assert again.verdict == "none"
    assert again.unavailable["wall"] == "it is in the base model already"


@verdict_only
def test_what_follows_an_unknown_covariate_is_unknown_with_its_power():
    def humidity(rng, n):
        return {"humidity": np.exp(rng.uniform(0.0, 2.7, n))}

    found = diagnose(
        spheres(6, n=100, columns=humidity, factor=lambda c: 1.0 + 0.05 * c["humidity"])
    )
    assert found.verdict == "unknown"
    assert [d.covariate for d in found.depends_on] == ["humidity"]
    assert found.depends_on[0].exponent == pytest.approx(1.0, abs=0.2)


@verdict_only
def test_an_operator_who_reads_high_makes_the_data_suspect():
    def operators(rng, n):
        return {"operator": tuple(rng.choice(["Ada", "Ben", "Cleo"], n))}

    study = spheres(7, labels=operators)
    high = np.array([w == "Ben" for w in study.table.labels["operator"]])
    velocity = study.table.columns["velocity"] * np.where(high, 1.08, 1.0)
    columns = {**study.table.columns, "velocity": velocity}
    found = diagnose(replace(study, table=replace(study.table, columns=columns)))
    assert found.verdict == "suspect-data"
    assert found.suspect == {"label": "operator", "value": "Ben"}


@verdict_only
def test_scatter_beyond_what_is_stated_is_something_not_recorded():
    found = diagnose(spheres(8, n=80, noise=0.05, stated=0.015))
    assert found.verdict == "unknown"
    assert found.depends_on == ()
    assert "not written down" in found.sentence


@verdict_only
def test_one_parameter_that_absorbs_everything_leaves_nothing_identifiable():
    study = spheres(9, only_diameter=True, free=True)
    shape = replace(study.options, candidates=("shape",))
    columns = {**study.table.columns, "sphericity": np.full(60, 0.8)}
    found = diagnose(replace(study, options=shape, table=replace(study.table, columns=columns)))
    assert found.verdict == "not-identifiable"
    assert "shape" in found.not_identifiable


@pytest.mark.parametrize("group", [60, 30])
def test_groups_too_few_to_leave_out_fall_back_on_rows(group):
    found = diagnose(spheres(21, n=60, group=group))
    assert "of the rows" in found.error.holdout


def test_a_group_with_one_row_is_a_group():
    found = diagnose(spheres(22, n=21, group=5))
    assert "5 groups" in found.error.holdout
    assert np.isfinite(found.error.with_effect.value)


def test_groups_that_differ_are_no_effect():
    alarms = [
        diagnose(spheres(s, n=40, group=5, group_noise=0.04)).verdict for s in range(100, 110)
    ]
    assert alarms.count("none") >= 9


@verdict_only
def test_the_same_study_gives_the_same_answer():
    study = spheres(10, n=30, effects={"wall": 2.0})
    study = replace(study, options=replace(study.options, candidates=("wall", "shape")))
    first, second = (diagnose(study).to_json() for _ in range(2))
    first.pop("seconds"), second.pop("seconds")
    assert json.dumps(first) == json.dumps(second)


@verdict_only
def test_a_wild_row_is_left_out_and_named():
    study = spheres(11)
    velocity = study.table.columns["velocity"].copy()
    velocity[17] *= 1.5
    columns = {**study.table.columns, "velocity": velocity}
    found = diagnose(replace(study, table=replace(study.table, columns=columns)))
    assert found.verdict == "none"
    assert [item["row"] for item in found.left_out] == [19]


@verdict_only
def test_rows_at_which_the_model_fails_are_left_out_and_named():
    study = spheres(12)
    density = study.table.columns["particle_density"].copy()
    density[3] = 1150.0  # no weight under buoyancy, no velocity
    columns = {**study.table.columns, "particle_density": density}
    found = diagnose(replace(study, table=replace(study.table, columns=columns)))
    assert [item["row"] for item in found.left_out] == [5]
    assert "no number" in found.left_out[0]["reason"]


def test_held_out_errors_do_not_know_their_rows():
    """A response of pure noise has nothing to hold out: no fit may beat its own scatter."""
    study = spheres(13, n=30, noise=0.1)
    found = diagnose(study)
    assert found.error.with_effect.value >= 0.9 * found.error.base.value


def test_measured_spheres_lack_wall_and_inertia():
    found = diagnose(read_study(EXAMPLES / "settling_spheres/study.toml"))
    assert (found.verdict, names(found)) == ("effect", {"wall", "inertia"})
    assert found.error.base.value == pytest.approx(0.234, abs=0.001)
    assert found.error.with_effect.value <= 0.036
    for effect in found.effects:
        assert effect.ci95[0] <= effect.theory <= effect.ci95[1]
        assert effect.amplitude == pytest.approx(effect.theory, rel=0.15)


def test_measured_spheres_without_their_viscosity_are_ambiguous():
    found = diagnose(read_study(EXAMPLES / "settling_spheres/study_free_viscosity.toml"))
    assert found.verdict == "ambiguous"
    assert {name for rival in found.rivals for name in rival} == {"wall", "inertia"}
    assert found.experiment["separation_sd"] > 2.0
    assert set(found.experiment["conditions"]) >= {"diameter", "tube_diameter"}


@pytest.mark.parametrize("body", ["sphere", "disk"])
def test_standard_drag_coefficients_get_no_invented_effect(body):
    found = diagnose(read_study(EXAMPLES / f"sphere_disk_drag/study_{body}.toml"))
    assert found.verdict in ("none", "unknown")
    assert found.effects == ()


def test_nothing_is_missing_from_a_silo_with_smooth_walls():
    # the other laboratories: tests/examples/test_laboratories.py
    found = diagnose(read_study(EXAMPLES / "laboratories/silo/study_smooth.toml"))
    assert found.verdict == "none"
    assert found.effects == ()


def test_a_model_for_another_response_is_refused():
    study = replace(spheres(14), response="diameter")
    with pytest.raises(InputError, match="predicts velocity"):
        diagnose(study)


def test_unknown_candidates_are_refused():
    study = spheres(15)
    with pytest.raises(InputError, match=r"options\.candidates names 'wal'"):
        diagnose(replace(study, options=replace(study.options, candidates=("wal",))))


def test_more_free_parameters_than_rows_can_carry_are_refused():
    study = spheres(16, n=5, free=True)
    density = {"particle_density": 1400.0, "fluid_density": 1150.0}
    columns = {k: v for k, v in study.table.columns.items() if k not in density}
    parameters = {
        **study.parameters,
        **{
            name: replace(study.parameters["viscosity"], value=value)
            for name, value in density.items()
        },
    }
    with pytest.raises(InputError, match="need at least 6"):
        diagnose(replace(study, table=replace(study.table, columns=columns), parameters=parameters))
