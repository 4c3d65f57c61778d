"""Strict TOML cases: tables into frozen dataclasses, unknown keys refused, units at the door."""

from __future__ import annotations

import dataclasses
import difflib
import math
import os
import re
import tomllib
import types
from collections.abc import Mapping
from dataclasses import MISSING
from pathlib import Path
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

from greybed.core.errors import InputError

T = TypeVar("T")
_FLOATS = 10**300  # integers below fit in a float
LARGEST = 1 << 22  # bytes of a file; a case has a few thousand
# Tables within tables, as dotted keys; no case has more than four, and reading so many takes time
# that grows with their square.
_DEEP = re.compile(rb"(?<![\w-])(?:[\"']?[\w-]++[\"']?[ \t]*+\.[ \t]*+){64}")


def quantity(
    dimension: str,
    default: Any = MISSING,
    *,
    above: float = -math.inf,
    at_least: float = -math.inf,
    at_most: float = math.inf,
) -> Any:
    """Field of a case: a number in base SI, or a string with a unit.

    Parameters
    ----------
    dimension : str
        A key of ``greybed.core.units.DIMENSIONS``.
    default : float or None, optional
        Without it the key is required; None makes it optional.
    above, at_least, at_most : float
        Bounds in base SI; the number must always be finite.
    """
    bounds = {"above": above, "at_least": at_least, "at_most": at_most}
    return dataclasses.field(default=default, metadata={"dimension": dimension, **bounds})


def vector(dimension: str, default: Any = MISSING) -> Any:
    """Field of a case: three quantities of one dimension, in base SI or with units."""
    return dataclasses.field(default=default, metadata={"dimension": dimension, "size": 3})


def whole(default: Any = MISSING, *, at_least: float = -math.inf, at_most: float = math.inf) -> Any:
    """Field of a case: a whole number between bounds [-]."""
    return dataclasses.field(default=default, metadata={"at_least": at_least, "at_most": at_most})


def choice(options: tuple[str, ...], default: Any = MISSING) -> Any:
    """Field of a case: one word out of ``options``."""
    return dataclasses.field(default=default, metadata={"options": options})


def tables(key: str, variants: Mapping[str, type], default: Any = MISSING) -> Any:
    """Field of a case: a list of tables, each read as the variant that its ``key`` names."""
    return dataclasses.field(default=default, metadata={"key": key, "variants": dict(variants)})


def rows(kind: type, default: Any = MISSING) -> Any:
    """Field of a case: a list of tables of one dataclass."""
    return dataclasses.field(default=default, metadata={"rows": kind})


def words(default: Any = MISSING) -> Any:
    """Field of a case: a list of strings."""
    return dataclasses.field(default=default, metadata={"words": True})


def counts(default: Any = MISSING) -> Any:
    """Field of a case: three whole numbers from 1, one for each axis [-]."""
    return dataclasses.field(default=default, metadata={"counts": True})


def wholes(default: Any = MISSING) -> Any:
    """Field of a case: a list of whole numbers [-]."""
    return dataclasses.field(default=default, metadata={"wholes": True})


def plain(default: Any = MISSING) -> Any:
    """Field of a case: any value as it stands; who uses it checks it."""
    return dataclasses.field(default=default, metadata={"plain": True})


@dataclasses.dataclass(frozen=True)
class _Place:
    """Where a value stands: file and dotted key."""

    file: Path
    key: str = ""

    def __str__(self) -> str:
        return f"{self.file}: {self.key}" if self.key else f"{self.file}"

    def at(self, name: str) -> _Place:
        return _Place(self.file, f"{self.key}.{name}" if self.key else name)


def read_toml(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read a TOML file.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    content : dict
        Its tables as plain values.

    Raises
    ------
    InputError
        If it cannot be opened or is not TOML (with line and column).
    """
    try:
        with open(path, "rb") as stream:
            content = stream.read(LARGEST + 1)  # a device may never end
    except (OSError, ValueError) as error:  # a name that holds a null is a ValueError
        reason = getattr(error, "strerror", None) or error
        place = str(path).replace("\0", "\\0")
        raise InputError(f"{place}: cannot read this case ({reason}); check the path.") from None
    if len(content) > LARGEST:
        raise InputError(
            f"{path}: a case of more than {LARGEST} bytes is none; give large tables as files."
        )
    try:
        if _DEEP.search(content):
            raise RecursionError
        return tomllib.loads(content.decode())
    except RecursionError:
        raise InputError(
            f"{path}: not valid TOML (lists or tables within one another without end); mend the "
            "file."
        ) from None
    except ValueError as error:  # also of Unicode, and of numbers with thousands of digits
        raise InputError(f"{path}: not valid TOML ({error}); mend the file there.") from None


def read_case(path: str | os.PathLike[str], kind: type[T]) -> T:
    """Read a TOML file into the frozen dataclass ``kind``.

    Parameters
    ----------
    path : path
        The file.
    kind : dataclass
        Fields made by :func:`quantity`, :func:`vector`, :func:`whole`, :func:`choice`,
        :func:`tables`, :func:`rows`, :func:`words`, :func:`counts`, :func:`plain`, or plain ones of
        type str, bool, int, Path (relative to the file), or a dataclass.

    Returns
    -------
    case : kind
        With numbers in base SI.

    Raises
    ------
    InputError
        For a key that is unknown or missing, a wrong type, unit or bound.
    """
    return build(kind, read_toml(path), path)


def build(kind: type[T], table: Mapping[str, Any], file: str | os.PathLike[str]) -> T:
    """Turn a table into the frozen dataclass ``kind``; ``file`` is for messages and relative paths.

    Raises
    ------
    InputError
        As :func:`read_case`.
    """
    return _table(kind, table, _Place(Path(file)))


def _table(kind: type[T], table: Any, place: _Place) -> T:
    if not isinstance(table, Mapping):
        raise InputError(f"{place} = {table!r} must be a table; write it as [{place.key}].")
    fields = {f.name: f for f in dataclasses.fields(kind)}  # type: ignore[arg-type]
    hints = get_type_hints(kind)
    for name in table:
        if name not in fields:
            near = difflib.get_close_matches(name, fields, n=1, cutoff=0.5)
            advice = f"did you mean {near[0]!r}?" if near else f"known are {', '.join(fields)}."
            raise InputError(f"{place.at(name)} is not a known key; {advice}")
    values = {}
    for name, field in fields.items():
        if name in table:
            values[name] = _value(table[name], hints[name], field.metadata, place.at(name))
        elif field.default is MISSING and field.default_factory is MISSING:
            raise InputError(f"{place.at(name)} is missing; give {_wanted(hints[name], field)}.")
    try:
        return kind(**values)
    except InputError as error:
        raise InputError(f"{place}: {error}") from None


def _wanted(hint: Any, field: dataclasses.Field[Any]) -> str:
    """What a required key takes, for the message that it is missing."""
    if "plain" in field.metadata:
        return "its value"
    if "options" in field.metadata:
        return "one of " + ", ".join(map(repr, field.metadata["options"]))
    if "dimension" in field.metadata:
        dimension = field.metadata["dimension"]
        word = "number" if dimension == "dimensionless" else dimension
        what = "three numbers" if "size" in field.metadata else f"a {word}"
        return f"{what}{_unit(dimension)}"
    if "rows" in field.metadata:
        return "a list of tables"
    if "words" in field.metadata:
        return "a list of strings"
    if "counts" in field.metadata:
        return "three whole numbers"
    if "variants" in field.metadata:
        return f"[[{field.name}]] tables"
    if dataclasses.is_dataclass(hint):
        return f"the table [{field.name}]"
    kinds = {str: "a string", bool: "true or false", int: "a whole number", Path: "a path"}
    return kinds[hint]


def _value(value: Any, hint: Any, rules: Mapping[str, Any], place: _Place) -> Any:
    if get_origin(hint) in (Union, types.UnionType):  # X | None: TOML has no null, so take X
        hint = next(h for h in get_args(hint) if h is not types.NoneType)
    if "plain" in rules:
        return value
    if "variants" in rules:
        return _variants(value, rules["key"], rules["variants"], place)
    if "rows" in rules:
        return _rows(value, rules["rows"], place)
    if "words" in rules:
        items = _typed(value, list, 'a list of strings, like ["a", "b"]', place)
        return tuple(
            _typed(v, str, "a string in quotes", place.at(str(i))) for i, v in enumerate(items)
        )
    if "counts" in rules:
        return _counts(value, place)
    if "wholes" in rules:
        listed = isinstance(value, list) and all(type(n) is int for n in value)
        if not listed or not value:
            raise InputError(f"{place} = {value!r} must be a list of whole numbers, like [4, 8].")
        return tuple(value)
    if "options" in rules:
        return _choice(value, rules["options"], place)
    if "size" in rules:
        return _vector(value, rules["dimension"], place)
    if "dimension" in rules:
        return _bounded(_number(value, rules["dimension"], place), rules, place)
    if dataclasses.is_dataclass(hint):
        return _table(hint, value, place)  # type: ignore[arg-type]
    if hint is bool:
        return _typed(value, bool, "true or false", place)
    if hint is int:
        if isinstance(value, bool):
            raise InputError(f"{place} = {value!r} is not a whole number; give one.")
        return _bounded(_typed(value, int, "a whole number", place), rules, place)
    if hint is str:
        return _typed(value, str, "a string in quotes", place)
    if hint is Path:
        return place.file.parent / _typed(value, str, "a path in quotes", place)
    raise TypeError(f"{place}: no rule reads a field of type {hint}")


def _typed(value: Any, kind: type[T], what: str, place: _Place) -> T:
    if not isinstance(value, kind):
        raise InputError(f"{place} = {value!r} must be {what}.")
    return value


def _unit(dimension: str) -> str:
    from greybed.core.units import DIMENSIONS

    unit = DIMENSIONS[dimension][0].replace("**", "")
    return f" [{unit or '-'}]"


def _number(value: Any, dimension: str, place: _Place) -> float:
    if isinstance(value, str):
        from greybed.core.units import parse_quantity

        return parse_quantity(value, dimension, str(place))
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise InputError(
            f"{place} = {value!r} must be a {dimension}: a number{_unit(dimension)} or a string "
            "with a unit."
        )
    try:
        number = float(value)
    except OverflowError:  # an integer of more than 308 digits
        number = math.inf
    if not math.isfinite(number):
        raise InputError(f"{place} = {value}{_unit(dimension)} must be finite; mend it.")
    return number


def _bounded(value: Any, rules: Mapping[str, Any], place: _Place) -> Any:
    above = rules.get("above", -math.inf)
    low, high = rules.get("at_least", -math.inf), rules.get("at_most", math.inf)
    if value > above and low <= value <= high:
        return value
    limits = [f"above {above:g}"] if above > -math.inf else []
    limits += [f"at least {low:g}"] if low > -math.inf else []
    limits += [f"at most {high:g}"] if high < math.inf else []
    unit = _unit(rules["dimension"]) if "dimension" in rules else " [-]"
    shown = f"{value:g}" if abs(value) < _FLOATS else value
    raise InputError(f"{place} = {shown}{unit} must be {' and '.join(limits)}; mend it.")


def _choice(value: Any, options: tuple[str, ...], place: _Place) -> str:
    if value in options:
        return str(value)
    near = difflib.get_close_matches(str(value), options, n=1, cutoff=0.5)
    hint = f"; did you mean {near[0]!r}?" if near else "."
    raise InputError(f"{place} = {value!r} must be one of {', '.join(map(repr, options))}{hint}")


def _vector(value: Any, dimension: str, place: _Place) -> tuple[float, float, float]:
    if not isinstance(value, list) or len(value) != 3:
        raise InputError(f"{place} = {value!r} must be three numbers, like [0.0, 0.0, 1.0].")
    x, y, z = (_number(v, dimension, place) for v in value)
    return x, y, z


def _counts(value: Any, place: _Place) -> tuple[int, int, int]:
    whole = isinstance(value, list) and all(type(n) is int and n >= 1 for n in value)
    if not whole or len(value) != 3:
        raise InputError(f"{place} = {value!r} must be three whole numbers from 1, like [8, 8, 1].")
    x, y, z = value
    return x, y, z


def _rows(value: Any, kind: type[T], place: _Place) -> tuple[T, ...]:
    if not isinstance(value, list):
        raise InputError(f"{place} must be a list of tables; write each one as [[{place.key}]].")
    return tuple(
        _table(kind, item, _Place(place.file, f"{place.key}[{i}]")) for i, item in enumerate(value)
    )


def _variants(value: Any, key: str, variants: Mapping[str, type], place: _Place) -> tuple[Any, ...]:
    if not isinstance(value, list):
        raise InputError(f"{place} must be a list of tables; write each one as [[{place.key}]].")
    items: list[Any] = []
    for i, item in enumerate(value):
        here = _Place(place.file, f"{place.key}[{i}]")
        word = item.get(key) if isinstance(item, Mapping) else None
        if word is None:
            raise InputError(
                f"{here.at(key)} is missing; give one of {', '.join(map(repr, variants))}."
            )
        kind = variants[_choice(word, tuple(variants), here.at(key))]
        items.append(_table(kind, {k: v for k, v in item.items() if k != key}, here))
    return tuple(items)
