"""Every effect: off is off bit by bit, on moves one way, limits vanish, models carry it on."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from greybed.core.errors import InputError
from greybed.residual import Effect, Table
from greybed.residual.catalogue import effects_for, register
from greybed.residual.columns import DIMENSIONS
from greybed.residual.model import ModelSpec
from greybed.residual.models import build

N = 12
RNG = np.random.default_rng(5)


def column(low, high):
    return np.exp(np.linspace(np.log(low), np.log(high), N))


SPHERES = {
    "diameter": column(5e-4, 8e-3),
    "particle_density": np.full(N, 1500.0),
    "fluid_density": np.full(N, 1100.0),
    "viscosity": np.full(N, 0.2),
    "tube_diameter": RNG.uniform(0.05, 0.2, N),
    "sphericity": RNG.uniform(0.5, 0.95, N),
    "turbulence_intensity": RNG.uniform(0.01, 0.3, N),
    "temperature": RNG.uniform(300.0, 330.0, N),
    "mean_free_path": np.full(N, 1e-5),
    "velocity": np.ones(N),
}
BED = {
    "superficial_velocity": column(0.02, 2.0),
    "particle_diameter": RNG.uniform(1e-3, 5e-3, N),
    "void_fraction": RNG.uniform(0.36, 0.45, N),
    "fluid_density": np.full(N, 1.2),
    "viscosity": np.full(N, 1.8e-5),
    "tube_diameter": RNG.uniform(0.03, 0.1, N),
    "sphericity": RNG.uniform(0.5, 0.95, N),
    "fines_fraction": RNG.uniform(0.01, 0.1, N),
    "bed_length": np.full(N, 1.0),
    "outlet_pressure": np.full(N, 1e5),
    "temperature": RNG.uniform(320.0, 600.0, N),
    "pressure_gradient": np.ones(N),
}
HEAT = {
    "temperature": column(320.0, 1300.0),
    "particle_diameter": RNG.uniform(5e-4, 5e-3, N),
    "void_fraction": RNG.uniform(0.36, 0.45, N),
    "solid_conductivity": np.full(N, 3.0),
    "gas_conductivity": np.full(N, 0.03),
    "gas_pressure": column(100.0, 1e5),
    "stress": column(1e4, 1e6),
    "wall_distance": column(5e-4, 2e-2),
    "emissivity": RNG.uniform(0.3, 0.95, N),
    "conductivity": np.ones(N),
}
TABLES = {
    "terminal-velocity": SPHERES,
    "packed-bed-pressure-drop": BED,
    "bed-conductivity": HEAT,
}
# What each effect does to the response as its amplitude grows.
SIGN = {
    ("terminal-velocity", "inertia"): -1,
    ("terminal-velocity", "wall"): -1,
    ("terminal-velocity", "rarefaction"): 1,
    ("terminal-velocity", "shape"): -1,
    ("terminal-velocity", "turbulence"): -1,
    ("terminal-velocity", "viscosity-temperature"): 1,
    ("packed-bed-pressure-drop", "inertia"): 1,
    ("packed-bed-pressure-drop", "wall"): 0,  # viscous part up, inertial part down
    ("packed-bed-pressure-drop", "shape"): 1,
    ("packed-bed-pressure-drop", "polydispersity"): 1,
    ("packed-bed-pressure-drop", "gas-compressibility"): -1,
    ("packed-bed-pressure-drop", "channelling"): -1,
    ("packed-bed-pressure-drop", "viscosity-temperature"): 1,
    ("bed-conductivity", "radiation"): 1,
    ("bed-conductivity", "emissivity"): -1,
    ("bed-conductivity", "solid-conductivity-temperature"): -1,
    ("bed-conductivity", "gas-conductivity-temperature"): 1,
    ("bed-conductivity", "smoluchowski"): -1,
    ("bed-conductivity", "contact-stress"): 1,
    ("bed-conductivity", "wall-voidage"): -1,
}


def model_of(name, columns=None, effects=None, **options):
    columns = columns or TABLES[name]
    spec = ModelSpec(name=name, options=options, effects=effects or {})
    table = Table(columns=columns, units={}, rows=np.arange(N))
    return build(spec, table, {})


def base_for(name, effect):
    """Options and effects of a base on which the effect can act."""
    if (name, effect) == ("packed-bed-pressure-drop", "inertia"):
        return {"drag": "carman-kozeny"}, {}
    if effect == "emissivity":
        return {"exchange": "black"}, {"radiation": 1.0}
    return {}, {}


@pytest.mark.parametrize(("name", "effect"), SIGN)
def test_off_is_exactly_off_and_on_moves_as_it_should(name, effect):
    options, effects = base_for(name, effect)
    model = model_of(name, effects=effects, **options)
    assert effect in model.effects
    base = model.predict(TABLES[name], {}, {})
    assert np.array_equal(base, model.predict(TABLES[name], {}, {effect: 0.0}))
    low, high = (
        model.predict(TABLES[name], {}, {effect: a})
        for a in sorted((model.effects[effect].low, model.effects[effect].high), key=abs)
    )
    sign = SIGN[name, effect]
    if sign:
        assert (sign * (low - base) >= 0.0).all()
        assert (sign * (high - low) > 0.0).all()


def test_every_effect_of_the_catalogue_is_in_the_table_above():
    listed = {(m, e.name) for m in TABLES for e in effects_for(m)}
    assert listed == set(SIGN)


@pytest.mark.parametrize(
    ("name", "effect", "small"),
    [
        ("terminal-velocity", "wall", {"tube_diameter": 1e9}),
        ("terminal-velocity", "rarefaction", {"mean_free_path": 1e-18}),
        ("terminal-velocity", "shape", {"sphericity": 1.0}),
        ("terminal-velocity", "turbulence", {"turbulence_intensity": 0.0}),
        ("terminal-velocity", "inertia", {"viscosity": 1e9}),
        ("packed-bed-pressure-drop", "wall", {"tube_diameter": 1e9}),
        ("packed-bed-pressure-drop", "polydispersity", {"fines_fraction": 0.0}),
        ("packed-bed-pressure-drop", "gas-compressibility", {"outlet_pressure": 1e18}),
        ("bed-conductivity", "radiation", {"particle_diameter": 1e-18}),
        ("bed-conductivity", "smoluchowski", {"gas_pressure": 1e18}),
        ("bed-conductivity", "contact-stress", {"stress": 0.0}),
        ("bed-conductivity", "wall-voidage", {"wall_distance": 10.0}),
    ],
)
def test_effects_vanish_in_their_limit(name, effect, small):
    columns = {**TABLES[name], **{k: np.full(N, v) for k, v in small.items()}}
    model = model_of(name, columns)
    base = model.predict(columns, {}, {})
    on = model.predict(columns, {}, {effect: model.effects[effect].typical})
    assert on == pytest.approx(base, rel=1e-6)


@given(
    d=st.floats(1e-6, 5e-2), rho=st.floats(5.0, 2e4), mu=st.floats(1e-6, 1e3),
    law=st.sampled_from(["stokes", "schiller-naumann", "clift-gauvin", "di-felice"]),
    wall=st.sampled_from([0.0, 2.1]),
)  # fmt: skip
@settings(max_examples=150)
def test_terminal_velocity_balances_the_forces(d, rho, mu, law, wall):
    columns = {
        "diameter": np.array([d]),
        "particle_density": np.array([rho]),
        "fluid_density": np.array([1.2]),
        "viscosity": np.array([mu]),
        "tube_diameter": np.array([10.0 * d]),
        "velocity": np.ones(1),
    }
    spec = ModelSpec(name="terminal-velocity", options={"drag": law})
    model = build(spec, Table(columns=columns, units={}, rows=np.arange(1)), {})
    v = float(model.predict(columns, {}, {"wall": wall})[0])
    from greybed.closures.drag import LAWS

    re = 1.2 * v * d / mu
    # no velocity balances the forces within the law's jump at Re = 1000, of 0.4 %
    if law == "schiller-naumann" and abs(re - 1000.0) < 1e-6:
        return
    drag = 3.0 * np.pi * mu * d * v * float(LAWS[law](0.0, re)) * (1.0 + 0.1 * wall)
    assert drag == pytest.approx((rho - 1.2) * 9.80665 * np.pi * d**3 / 6.0, rel=1e-9)


@pytest.mark.parametrize("name", TABLES)
def test_settings_build_the_same_model(name):
    model = model_of(name)
    amplitudes = {k: e.typical for k, e in list(model.effects.items())[:3]}
    table = model.settings({}, amplitudes)
    again = model_of(name, effects=table["effects"])
    same = again.predict(TABLES[name], {}, {})
    assert np.array_equal(same, model.predict(TABLES[name], {}, amplitudes))
    assert not set(amplitudes) & set(again.effects)


def test_a_user_adds_an_effect_in_ten_lines():
    register(
        Effect(
            name="test-charge",
            law="drag * (1 + A field)",
            source="a test",
            group="field",
            theory=None,
            low=0.1,
            high=10.0,
            columns=("field",),
            stage="factor",
            change=lambda c, amplitude: 1.0 + amplitude * c["field"],
        ),
        "terminal-velocity",
    )
    try:
        model = model_of("terminal-velocity", {**SPHERES, "field": np.full(N, 0.1)})
        on = model.predict({**SPHERES, "field": np.full(N, 0.1)}, {}, {"test-charge": 1.0})
        assert (on < model.predict(SPHERES, {}, {})).all()
        assert "field" in model_of("terminal-velocity").unavailable["test-charge"]
    finally:
        from greybed.residual.catalogue import _EFFECTS

        _EFFECTS["terminal-velocity"].pop()


def test_mean_free_path_follows_from_the_pressure_of_a_gas():
    air = {
        "diameter": np.full(N, 1e-6), "particle_density": np.full(N, 1000.0),
        "fluid_density": np.full(N, 1.184), "viscosity": np.full(N, 1.849e-5),
        "pressure": np.full(N, 101325.0), "velocity": np.ones(N),
    }  # fmt: skip
    model = model_of("terminal-velocity", air)
    path = model.complete({k: v.copy() for k, v in air.items()})["mean_free_path"]
    assert path[0] == pytest.approx(67e-9, rel=0.02)  # air at 25 degC and one atmosphere
    assert "rarefaction" in model.effects


def test_refusals_name_the_remedy():
    with pytest.raises(InputError, match="did you mean 'terminal-velocity'"):
        build(ModelSpec(name="terminal-velocty"), Table(columns={}, units={}, rows=[]), {})
    with pytest.raises(InputError, match=r"needs viscosity; give a column .*parameters.viscosity"):
        model_of("terminal-velocity", {k: v for k, v in SPHERES.items() if k != "viscosity"})
    with pytest.raises(InputError, match=r"model\.drga is not an option .* did you mean 'drag'"):
        model_of("terminal-velocity", drga="stokes")
    with pytest.raises(InputError, match="is a law of one sphere"):
        model_of("packed-bed-pressure-drop", drag="stokes")
    with pytest.raises(InputError, match=r"model\.effects\.wal is not an effect"):
        model_of("terminal-velocity", effects={"wal": 2.1})
    varied = Table(columns=SPHERES, units={}, rows=np.arange(N))
    with pytest.raises(InputError, match="diameter varies from row to row and is a parameter"):
        build(ModelSpec(name="terminal-velocity"), varied, {"diameter": 1e-3})


def test_known_columns_have_known_dimensions():
    from greybed.core.units import DIMENSIONS as UNITS

    assert set(DIMENSIONS.values()) <= set(UNITS)


def test_parameters_that_the_model_does_not_use_are_refused():
    table = Table(columns=SPHERES, units={}, rows=np.arange(N))
    with pytest.raises(InputError, match=r"parameters\.viscosty is not used .* 'viscosity'"):
        build(ModelSpec(name="terminal-velocity"), table, {"viscosty": 0.2})


def test_the_page_of_effects_is_the_catalogue():
    page = (Path(__file__).parents[2] / "docs/effects.md").read_text()
    for model in (*TABLES, "python"):
        for effect in effects_for(model):
            assert f"| `{effect.name}` | {effect.law} |" in page, effect.name
