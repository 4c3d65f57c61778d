import numpy as np
import pytest

from greybed.core.errors import InputError
from greybed.core.units import USUAL, parse_quantity, to_si


@pytest.mark.parametrize(
    ("text", "dimension", "expected"),
    [
        ("1.5 mm", "length", 1.5e-3),
        ("1.5mm", "length", 1.5e-3),
        ("-2e3 um", "length", -2e-3),
        ("3 m", "length", 3.0),
        ("20 degC", "temperature", 293.15),
        ("2 m s-1", "velocity", 2.0),
        ("2500 kg/m3", "density", 2500.0),
        ("2.5 g/cm^3", "density", 2500.0),
        ("1 kW/m**2", "heat flux", 1000.0),
        ("180 deg", "angle", np.pi),
        ("40 percent", "dimensionless", 0.4),
        ("0.4", "dimensionless", 0.4),
    ],
)
def test_quantity(text, dimension, expected):
    # a few roundings in pint's factors
    assert parse_quantity(text, dimension) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1.5", r"--r: '1\.5' has no unit; .*'1\.5 m'"),
        ("1.5 kg", r"--r: unit 'kg' does not measure a length; .*mm"),
        ("1.5 furlungs", r"--r: unit 'furlungs' is not known; .*mm"),
        ("abc", r"--r: 'abc' is not a number"),
        ("1e999 m", r"--r: '1e999 m' is not finite"),
        ("1 m**9**9**9**9", r"is not known"),
        ("1 (m)", r"is not known"),
        ("1 mm𝟛", r"is not known"),  # a digit that pint takes for no number
        ("1 m0", r"is not known"),
        ("1 __import__('os')", r"is not known"),
        ("1 " + "m*" * 50 + "m", r"is not known"),
        ("nan m", r"is not a number"),
    ],
)
def test_quantity_refused(text, message):
    with pytest.raises(InputError, match=message):
        parse_quantity(text, "length", "--r")


def test_metres_pass_without_a_digit_changed():
    values = np.random.default_rng(1).random((4, 3))
    np.testing.assert_array_equal(to_si(values, " m ", "length", "here"), values)


def test_conversion_never_warns_on_overflow():
    assert np.isinf(to_si([1e308], "km", "length", "here")).all()


@pytest.mark.parametrize(("dimension", "unit"), [(d, u) for d in USUAL for u in USUAL[d]])
def test_usual_units_are_what_pint_has(dimension, unit, monkeypatch):
    rng = np.random.default_rng(0)
    values = rng.normal(size=500) * 10.0 ** rng.integers(-300, 300, 500)
    values = np.concatenate([values, [0.0, -0.0, np.nan, np.inf, 1e308]])
    known = to_si(values, unit, dimension, "here")
    monkeypatch.setitem(USUAL, dimension, {})
    np.testing.assert_array_equal(known, to_si(values, unit, dimension, "here"))


def test_celsius_is_what_pint_has():
    import pint

    values = np.random.default_rng(0).uniform(-300.0, 3000.0, 500)
    registry = pint.UnitRegistry()
    wanted = registry.Quantity(values, "degC").to("K").magnitude
    for unit in ("degC", "°C"):
        np.testing.assert_array_equal(to_si(values, unit, "temperature", "here"), wanted)
