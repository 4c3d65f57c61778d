"""The shipped forward models against independent calculations, and what they do with bad rows."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from greybed.core.errors import InputError
from greybed.residual import Table
from greybed.residual.catalogue import register
from greybed.residual.catalogue.drag import SPHERE
from greybed.residual.model import ModelSpec
from greybed.residual.models import build

WATER = {"fluid_density": 1000.0, "viscosity": 1e-3}


def model_of(name, columns, parameters=None, **options):
    """The model and its columns as arrays."""
    size = max(np.size(v) for v in columns.values())
    table = {k: np.broadcast_to(np.asarray(v, dtype=float), size) for k, v in columns.items()}
    spec = ModelSpec(name=name, options=options)
    rows = np.arange(size)
    return build(spec, Table(columns=table, units={}, rows=rows), parameters or {}), table


def falling(columns, drag="stokes", effects=None, parameters=None, **options):
    model, table = model_of(
        "terminal-velocity", {"velocity": 1.0, **columns}, parameters, drag=drag, **options
    )
    return model.predict(table, parameters or {}, effects or {})


@pytest.mark.parametrize(
    ("sphere", "drag", "velocity"),
    # fluids 1.3.1, v_terminal(D, rhop, rho, mu, Method=...), solved there by another method
    [
        ({"diameter": 2e-3, "particle_density": 2500.0, **WATER},
         "haider-levenspiel", 0.268693075086765),
        ({"diameter": 70e-6, "particle_density": 2600.0, **WATER},
         "haider-levenspiel", 0.003959187859523043),
        ({"diameter": 5e-6, "particle_density": 1000.0, "fluid_density": 1.2, "viscosity": 1.8e-5},
         "stokes", 0.0007557779336419754),
    ],
)  # fmt: skip
def test_terminal_velocity_against_another_library(sphere, drag, velocity):
    assert falling(sphere, drag)[0] == pytest.approx(velocity, rel=1e-9)


@pytest.mark.parametrize(
    ("effect", "columns", "factor"),
    [
        ("wall", {"tube_diameter": 0.05}, lambda a: 1.0 + a * 3e-3 / 0.05),
        ("turbulence", {"turbulence_intensity": 0.2}, lambda a: 1.0 + a * 0.2),
        ("rarefaction", {"mean_free_path": 1e-4}, lambda a: 1.0 / (1.0 + a * 1e-4 / 1.5e-3)),
        ("shape", {"sphericity": 0.64}, lambda a: ((1.0 + 2.0 / 0.8) / 3.0) ** a),
        ("viscosity-temperature", {"temperature": 303.15}, lambda a: (303.15 / 293.15) ** a),
    ],
)
def test_effects_divide_stokes_velocity(effect, columns, factor):
    sphere = {"diameter": 3e-3, "particle_density": 2500.0, "fluid_density": 1200.0}
    sphere = {**sphere, "viscosity": 0.8, **columns}
    amplitude = -7.0 if effect == "viscosity-temperature" else 0.9
    slow = (2500.0 - 1200.0) * 9.80665 * 9e-6 / (18.0 * 0.8)
    on = falling(sphere, effects={effect: amplitude})[0]
    assert on == pytest.approx(slow / factor(amplitude), rel=1e-12)


def test_inertia_on_stokes_is_schiller_and_naumann():
    sphere = {"diameter": np.geomspace(1e-5, 2e-3, 20), "particle_density": 2500.0, **WATER}
    added = falling(sphere, effects={"inertia": 0.15})
    whole = falling(sphere, "schiller-naumann")
    assert (whole * sphere["diameter"] * 1e6 < 1000.0).all()
    assert added == pytest.approx(whole, rel=1e-12)


def test_wall_of_theory_is_faxens_at_first_order():
    # Faxen: 1 / (1 - 2.104 L + 2.09 L^3 - 0.95 L^5); the second order is 4.4 L^2
    ratio = 0.01
    exact = 1.0 / (1.0 - 2.104 * ratio + 2.09 * ratio**3 - 0.95 * ratio**5)
    wall = next(e for e in SPHERE if e.name == "wall")
    columns = {"diameter": np.array([ratio]), "tube_diameter": np.array([1.0])}
    assert wall.change(columns, wall.theory)[0] == pytest.approx(exact, abs=5.0 * ratio**2)


def test_rising_spheres_have_the_speed_of_falling_ones():
    up, down = falling(
        {"diameter": 1e-3, "particle_density": np.array([900.0, 1100.0]), **WATER},
        "schiller-naumann",
    )
    assert up == pytest.approx(down, rel=1e-12)
    assert up > 0.0


@given(
    weight=st.floats(0.99, 1.01),
    law=st.sampled_from(["schiller-naumann", "wen-yu", "tenneti"]),
)
def test_weights_within_the_jump_of_a_law_get_its_velocity(weight, law):
    # at Re = 1000 the force jumps by 0.4 %: no balance exists there, and none may go missing
    d, mu, rho = 2e-3, 1e-3, 1000.0
    drag = 1.0 + 0.15 * 1000.0**0.687
    v = 1000.0 * mu / (rho * d)
    density = rho + weight * drag * v * 18.0 * mu / (9.80665 * d**2)
    found = falling({"diameter": d, "particle_density": density, **WATER}, law)[0]
    assert found == pytest.approx(v, rel=0.01)
    if 1.0 < weight < 1.0038:
        assert found == pytest.approx(v, rel=1e-12)


def test_gravity_takes_a_unit():
    sphere = {"diameter": 1e-4, "particle_density": 2000.0, **WATER}
    moon = falling(sphere, gravity="1.62 m/s2")
    assert moon / falling(sphere) == pytest.approx(1.62 / 9.80665, rel=1e-12)


def test_a_parameter_does_for_a_column():
    sphere = {"diameter": 1e-4, "particle_density": 2000.0, "fluid_density": 1000.0}
    assert np.array_equal(
        falling(sphere, parameters={"viscosity": 1e-3}), falling({**sphere, "viscosity": 1e-3})
    )


BED = {
    "superficial_velocity": 0.5,
    "particle_diameter": 2e-3,
    "void_fraction": 0.4,
    "fluid_density": 1.2,
    "viscosity": 1.8e-5,
    "pressure_gradient": 1.0,
}


def through(columns=None, effects=None, **options):
    model, table = model_of("packed-bed-pressure-drop", {**BED, **(columns or {})}, **options)
    return model.predict(table, {}, effects or {})


def test_packed_bed_against_another_library():
    # fluids 1.3.1, Ergun(dp=2e-3, voidage=0.4, vs=0.5, rho=1.2, mu=1.8e-5)
    assert through()[0] == pytest.approx(4359.374999999998, rel=1e-12)


def test_inertia_on_carman_is_ergun_but_for_its_constant():
    viscous = 180.0 * 1.8e-5 * 0.5 * 0.36 / (0.064 * 4e-6)
    inertial = 1.75 * 1.2 * 0.25 * 0.6 / (0.064 * 2e-3)
    found = through(effects={"inertia": 1.75 / 18.0}, drag="carman-kozeny")[0]
    assert found == pytest.approx(viscous + inertial, rel=1e-12)


def test_wall_of_a_bed_is_eisfeld_and_schnitzleins():
    # K1 Aw^2 (1-eps)^2 mu U / (eps^3 d^2) + Aw / Bw (1-eps) rho U^2 / (eps^3 d), spheres, with
    # Ergun's 150 for their K1 = 154 and his 1.75 for their 1 / Bw far from walls, 1.32
    ratio, eps = 2e-3 / 0.02, 0.4
    aw = 1.0 + 2.0 / (3.0 * (1.0 / ratio) * (1.0 - eps))
    bw = (1.15 * ratio**2 + 0.87) ** 2
    viscous = 150.0 * aw**2 * (1 - eps) ** 2 * 1.8e-5 * 0.5 / (eps**3 * 4e-6)
    inertial = 1.75 * 0.87**2 * aw / bw * (1 - eps) * 1.2 * 0.25 / (eps**3 * 2e-3)
    found = through({"tube_diameter": 0.02}, {"wall": 2.0 / 3.0})[0]
    assert found == pytest.approx(viscous + inertial, rel=1e-12)


def test_compressible_gas_obeys_the_difference_of_squares():
    length, outlet = 20.0, 1e5
    gradient = through()[0]
    inlet = brentq(
        lambda p: p**2 - outlet**2 - 2.0 * outlet * gradient * length, outlet, 1e7, xtol=1e-8
    )
    columns = {"bed_length": length, "outlet_pressure": outlet}
    found = through(columns, {"gas-compressibility": 1.0})[0]
    # brentq stops at 1e-8 Pa of a drop of 6e4 Pa
    assert found == pytest.approx((inlet - outlet) / length, rel=1e-11)


def test_fines_shift_sauters_diameter():
    # surface per volume of a mixture of coarse d and fines d / 6, by volume
    fines = 0.08
    sauter = 1.0 / ((1.0 - fines) / 2e-3 + fines * 6.0 / 2e-3)
    found = through({"fines_fraction": fines}, {"polydispersity": 5.0})[0]
    assert found == pytest.approx(through({"particle_diameter": sauter})[0], rel=1e-12)


def test_channels_shorten_the_flow_in_the_bed():
    found = through(effects={"channelling": 0.2})[0]
    assert found == pytest.approx(through({"superficial_velocity": 0.4})[0], rel=1e-12)


def test_liquids_are_not_compressible_and_clusters_need_a_grid():
    columns = {**BED, "fluid_density": 1000.0, "bed_length": 1.0, "outlet_pressure": 1e5}
    model, _ = model_of("packed-bed-pressure-drop", columns)
    assert "liquid" in model.unavailable["gas-compressibility"]
    assert "cell_size" in model.unavailable["clustering"]


HOT = {
    "temperature": np.array([400.0, 800.0, 1200.0]),
    "particle_diameter": 3e-3,
    "void_fraction": 0.4,
    "conductivity": 1.0,
}
PAIR = {"solid_conductivity": 3.0, "gas_conductivity": 0.03}


def conducted(columns=None, effects=None, **options):
    model, table = model_of("bed-conductivity", {**HOT, **(columns or {})}, PAIR, **options)
    return model.predict(table, PAIR, effects or {})


@pytest.mark.parametrize(("emissivity", "exchange"), [(None, 1.0), (0.5, 1.0 / 3.0)])
def test_radiation_adds_damkoehlers_term(emissivity, exchange):
    columns = {} if emissivity is None else {"emissivity": emissivity}
    added = conducted(columns, {"radiation": 0.8}) - conducted(columns)
    law = 4.0 * 0.8 * 5.670374419e-8 * 3e-3 * HOT["temperature"] ** 3 * exchange
    assert added == pytest.approx(law, rel=1e-9)  # the difference of nearby numbers loses digits


def test_conductivities_follow_the_temperature_from_their_reference():
    options = {"reference_temperature": 400.0}
    gas = conducted(effects={"gas-conductivity-temperature": 0.8}, **options)
    solid = conducted(effects={"solid-conductivity-temperature": 1.0}, **options)
    base = conducted()
    assert gas[0] == base[0]
    assert solid[0] == base[0]
    assert (np.diff(gas) > 0.0).all()
    assert (np.diff(solid) < 0.0).all()


def test_gas_stops_conducting_at_low_pressure():
    thin, dense = (conducted({"gas_pressure": p}, {"smoluchowski": 8e-5})[0] for p in (1e-3, 1e7))
    assert thin < 0.05 * conducted()[0]
    assert dense == pytest.approx(conducted()[0], rel=1e-5)


def test_at_a_wall_there_is_gas_only():
    assert conducted({"wall_distance": 0.0}, {"wall-voidage": 1.0}) == pytest.approx(0.03)


@pytest.mark.parametrize(
    ("call", "name", "bad"),
    [
        (falling, "diameter", -1e-3),
        (falling, "viscosity", 0.0),
        (falling, "particle_density", 1000.0),  # weightless
        (falling, "fluid_density", np.nan),
        (through, "void_fraction", 1.2),
        (through, "superficial_velocity", -0.1),
        (conducted, "temperature", 0.0),
        (conducted, "void_fraction", -0.1),
    ],
)
def test_rows_that_cannot_be_are_nan_and_spoil_no_others(call, name, bad):
    good = {
        falling: {"diameter": 1e-3, "particle_density": 1500.0, **WATER},
        through: BED,
        conducted: {**HOT, "temperature": 500.0},
    }[call]
    found = call({**good, name: np.array([good[name], bad, good[name]])})
    assert np.isnan(found).tolist() == [False, True, False]
    assert found[0] == found[2]


def test_refusals_of_options():
    sphere = {"diameter": 1e-3, "particle_density": 1500.0, **WATER}
    with pytest.raises(InputError, match="packed beds without the limit of one sphere; take one"):
        falling(sphere, "ergun")
    with pytest.raises(InputError, match=r"model\.gravity = -1 must be above 0"):
        falling(sphere, gravity=-1.0)
    with pytest.raises(InputError, match=r"model\.gravity: unit 'kg' does not measure"):
        falling(sphere, gravity="1.62 kg")
    with pytest.raises(InputError, match=r"model\.reference_temperature = True must be a number"):
        conducted(reference_temperature=True)
    with pytest.raises(InputError, match="did you mean 'python'"):
        register(SPHERE[0], "pyton")
