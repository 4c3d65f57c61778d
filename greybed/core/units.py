"""Units at the door: numbers with a unit in, base SI out; pint is loaded only when it is needed."""

from __future__ import annotations

import re
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.core.errors import InputError

# dimension -> (base SI unit, units to suggest in an error)
DIMENSIONS = {
    "length": ("m", "m, mm or um"),
    "area": ("m**2", "m2 or mm2"),
    "volume": ("m**3", "m3 or mm3"),
    "time": ("s", "s, ms or min"),
    "mass": ("kg", "kg or g"),
    "temperature": ("K", "K or degC"),
    "velocity": ("m/s", "m/s or mm/s"),
    "angular velocity": ("rad/s", "rad/s or rpm"),
    "mass flow": ("kg/s", "kg/s, g/s or kg/h"),
    "stiffness": ("N/m", "N/m or kN/m"),
    "acceleration": ("m/s**2", "m/s2"),
    "density": ("kg/m**3", "kg/m3 or g/cm3"),
    "force": ("N", "N or mN"),
    "pressure": ("Pa", "Pa, kPa or bar"),
    "pressure gradient": ("Pa/m", "Pa/m or kPa/m"),
    "viscosity": ("Pa*s", "Pa s or mPa s"),
    "power": ("W", "W or mW"),
    "heat flux": ("W/m**2", "W/m2 or kW/m2"),
    "conductivity": ("W/m/K", "W/m/K"),
    "heat capacity": ("J/kg/K", "J/kg/K or kJ/kg/K"),
    "angle": ("rad", "deg or rad"),
    "dimensionless": ("", "percent, or no unit"),
}

# What is typed most, as pint would convert it to the last bit: loading pint takes a second.
USUAL = {
    "length": {"mm": 1e-3, "um": 1e-6, "µm": 1e-6, "cm": 1e-2},
    "area": {"m2": 1.0, "mm2": 1e-6},
    "volume": {"m3": 1.0, "mm3": 1e-9},
    "time": {"ms": 1e-3, "us": 1e-6, "min": 60.0, "h": 3600.0},
    "mass": {"g": 1e-3},
    "velocity": {"m s-1": 1.0, "mm/s": 1e-3, "cm/s": 1e-2},
    "mass flow": {"g/s": 1e-3},
    "stiffness": {"kN/m": 1e3},
    "acceleration": {"m/s2": 1.0, "m s-2": 1.0},
    "density": {"kg/m3": 1.0, "kg m-3": 1.0},
    "force": {"mN": 1e-3},
    "pressure": {"kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "bar": 1e5},
    "viscosity": {"Pa s": 1.0, "mPa s": 1e-3},
    "power": {"mW": 1e-3, "kW": 1e3},
    "heat flux": {"W/m2": 1.0, "kW/m2": 1e3},
    "conductivity": {"W m-1 K-1": 1.0},
    "heat capacity": {"J kg-1 K-1": 1.0, "kJ/kg/K": 1e3},
    "angle": {"deg": np.pi / 180.0},
    "dimensionless": {"percent": 0.01, "%": 0.01},
}
ZERO_CELSIUS = 273.15  # [K]

_WORD = r"[A-Za-zµμΩ°%_]+"
_POWER = r"(?:(?:\*\*|\^)?[+-]?\d{1,2})?"
# Products and quotients of unit names with short powers and nothing else: pint would also work
# out towers of powers, which a file could use to keep it busy for ever.
_UNIT = re.compile(rf"\s*{_WORD}{_POWER}(?:\s*[*/·]?\s*{_WORD}{_POWER})*\s*")
_FACTOR = re.compile(rf"({_WORD})(?:\*\*|\^)?([+-]?\d{{1,2}})")
_QUANTITY = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*")
_LONGEST = 40


@cache
def _registry() -> Any:
    import pint

    return pint.UnitRegistry(cache_folder=None)


def _shown(text: str) -> str:
    return repr(text if len(text) <= _LONGEST else text[:_LONGEST] + "...")


def to_si(values: ArrayLike, unit: str, dimension: str, where: str) -> NDArray[np.float64]:
    """Convert numbers to base SI.

    Parameters
    ----------
    values : array_like, any shape
        Numbers in ``unit``; any value, NaN and infinity pass through.
    unit : str
        Unit such as ``mm``, ``m/s``, ``m s-1``, ``kg/m3`` or ``degC``.
    dimension : str
        What the numbers are: a key of ``DIMENSIONS``, such as ``length``.
    where : str
        Place named in an error: file, line, column, or option.

    Returns
    -------
    converted : ndarray, shape of ``values``
        The numbers in the base SI unit of ``dimension``.

    Raises
    ------
    InputError
        If the unit is missing, unknown, or of another dimension.

    Examples
    --------
    >>> to_si([1.5, 20.0], "mm", "length", "option --sizes")
    array([0.0015, 0.02  ])
    """
    base, advice = DIMENSIONS[dimension]
    array = np.array(values, dtype=np.float64)
    text = unit.strip()
    if text == base:
        return array
    if text in USUAL.get(dimension, {}):
        with np.errstate(over="ignore", invalid="ignore"):
            return np.asarray(array * USUAL[dimension][text])
    if dimension == "temperature" and text in ("degC", "°C"):
        return np.asarray(array + ZERO_CELSIUS)
    if not text:
        raise InputError(f"{where}: the unit is missing; give a {dimension} in {advice}.")
    unknown = f"{where}: unit {_shown(text)} is not known; give a {dimension} in {advice}."
    if len(text) > _LONGEST or not _UNIT.fullmatch(text):
        raise InputError(unknown)
    import pint

    plain = _FACTOR.sub(r"\1**\2", text.replace("·", "*"))
    try:
        registry = _registry()
        with np.errstate(over="ignore", invalid="ignore"):
            quantity = registry.Quantity(array, registry.parse_units(plain)).to(base)
        return np.asarray(quantity.magnitude, dtype=np.float64)
    except pint.DimensionalityError:
        raise InputError(
            f"{where}: unit {_shown(text)} does not measure a {dimension}; give it in {advice}."
        ) from None
    except (
        pint.PintError,
        AssertionError,  # pint's own, of a text that is no unit
        ArithmeticError,
        AttributeError,
        LookupError,
        SyntaxError,
        TypeError,
        ValueError,
    ):
        raise InputError(unknown) from None


def parse_quantity(text: str, dimension: str, where: str = "value") -> float:
    """Read one number with its unit, as typed on a command line.

    Parameters
    ----------
    text : str
        Number and unit, such as ``1.5 mm`` or ``20 degC``; the unit may be left out only where
        ``dimension`` is ``dimensionless``.
    dimension : str
        A key of ``DIMENSIONS``.
    where : str
        Place named in an error, such as ``--radius``.

    Returns
    -------
    value : float
        The number in the base SI unit of ``dimension``.

    Raises
    ------
    InputError
        If the text is not a number with a unit of that dimension, or the number is not finite.

    Examples
    --------
    >>> parse_quantity("1.5 mm", "length")
    0.0015
    """
    _, advice = DIMENSIONS[dimension]
    match = _QUANTITY.fullmatch(text)
    if match is None:
        raise InputError(
            f"{where}: {_shown(text)} is not a number with a unit; give a {dimension} in {advice}."
        )
    number = float(match[1])
    if not match[2] and dimension != "dimensionless":
        raise InputError(
            f"{where}: {_shown(text)} has no unit; give a {dimension} in {advice}, such as "
            f"'{match[1]} {advice.split(',')[0].split(' or ')[0]}'."
        )
    value = float(to_si(number, match[2], dimension, where))
    if not np.isfinite(value):
        raise InputError(f"{where}: {_shown(text)} is not finite; give a finite {dimension}.")
    return value


def to_base(values: ArrayLike, unit: str, where: str) -> tuple[NDArray[np.float64], str]:
    """Convert numbers of any dimension to base SI.

    Parameters
    ----------
    values : array_like, any shape
        Numbers in ``unit``.
    unit : str
        Any unit; empty or ``-`` for pure numbers.
    where : str
        Place named in an error.

    Returns
    -------
    converted : ndarray, shape of ``values``
        Numbers in base SI.
    base : str
        Their unit, such as ``kg/m/s2``; empty for pure numbers.

    Raises
    ------
    InputError
        If the unit is not known.
    """
    array = np.array(values, dtype=np.float64)
    text = unit.strip()
    if text in ("", "-", "1"):
        return array, ""
    unknown = f"{where}: unit {_shown(text)} is not known; write it like mm, m/s or kg/m3."
    if len(text) > _LONGEST or not _UNIT.fullmatch(text):
        raise InputError(unknown)
    import pint

    plain = _FACTOR.sub(r"\1**\2", text.replace("·", "*"))
    try:
        registry = _registry()
        quantity = registry.Quantity(array, registry.parse_units(plain))
        known = (base for name, (base, _) in DIMENSIONS.items() if name not in ("angle", ""))
        same = (b for b in known if b and quantity.check(registry.parse_units(b)))
        base = next(same, None)
        quantity = quantity.to_base_units() if base is None else quantity.to(base)
    except (
        pint.PintError,
        ArithmeticError,
        AttributeError,
        LookupError,
        SyntaxError,
        TypeError,
        ValueError,
    ):
        raise InputError(unknown) from None
    shown = f"{quantity.units:~C}" if base is None else base
    return np.asarray(quantity.magnitude, dtype=np.float64), shown.replace("**", "")


def parse_to_base(text: str, where: str = "value") -> float:
    """Read one number with any unit into base SI.

    Raises
    ------
    InputError
        If the text is not a finite number with a known unit.
    """
    match = _QUANTITY.fullmatch(text)
    if match is None:
        raise InputError(
            f"{where}: {_shown(text)} is not a number with a unit; write it like '1.5 mm'."
        )
    value = float(to_base(float(match[1]), match[2], where)[0])
    if not np.isfinite(value):
        raise InputError(f"{where}: {_shown(text)} is not finite; give a finite number.")
    return value


def in_unit(value: Any, unit: str, where: str = "value") -> float:
    """A number in ``unit``, from one that stands in it or a string with a unit of its own.

    Parameters
    ----------
    value : float or str
        As in a file: ``0.6`` is in ``unit`` [unit], ``"34 deg"`` is converted.
    unit : str
        The unit that is wanted, empty for pure numbers.
    where : str
        Place named in an error.

    Raises
    ------
    InputError
        If it is no finite number, or its unit measures something else.
    """
    if isinstance(value, str):
        match = _QUANTITY.fullmatch(value)
        if match is None:
            raise InputError(
                f"{where}: {_shown(value)} is not a number with a unit; write it like '1.5 mm'."
            )
        found, base = to_base(float(match[1]), match[2], where)
        one, wanted = to_base(1.0, unit, where)
        if base != wanted and match[2]:
            raise InputError(
                f"{where}: unit {_shown(match[2])} does not measure the same as "
                f"{unit or 'a number'}; give it in {unit or 'pure numbers'}."
            )
        value = float(found) / float(one) if match[2] else float(match[1])
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise InputError(f"{where} = {value!r} must be a number [{unit or '-'}].")
    if not np.isfinite(value):
        raise InputError(f"{where} = {value} [{unit or '-'}] must be finite; mend it.")
    return float(value)
