"""Reads a study: TOML with its table, noise, model, parameters and options."""

from __future__ import annotations

import difflib
import math
import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from greybed.core.config import read_toml
from greybed.core.errors import InputError
from greybed.core.units import parse_quantity, parse_to_base
from greybed.residual.columns import DIMENSIONS
from greybed.residual.model import ModelSpec
from greybed.residual.study import Noise, Options, Parameter, Study, Table
from greybed.residual.table import read_table

TABLES = ("data", "noise", "model", "parameters", "options")
KEYS = {
    "data": ("file", "response", "group", "replicate", "labels", "ignore"),
    "noise": ("relative", "systematic"),
    "parameter": ("value", "sd", "free"),
    "options": ("alpha", "seed", "holdout", "candidates"),
}
LOWEST_ALPHA, HIGHEST_ALPHA = 0.0005, 0.2
LARGEST_NOISE = 1.0  # relative; beyond it nothing was measured


def read_study(path: str | os.PathLike[str]) -> Study:
    """Read a study and its table.

    Parameters
    ----------
    path : path
        TOML file with ``[data]``, ``[model]`` and, as needed, ``[noise]``, ``[parameters.NAME]``
        and ``[options]``; the table's path is relative to it.

    Returns
    -------
    study : Study
        In base SI.

    Raises
    ------
    InputError
        For a key that is unknown or missing, or a value with a wrong type, unit or bound.
    """
    path = Path(path)
    content = read_toml(path)
    _known(f"{path}", content, TABLES)
    data = _table(path, content, "data", required=True)
    model = _table(path, content, "model", required=True)
    noise = _table(path, content, "noise")
    options = _table(path, content, "options")
    for name, table in (("data", data), ("noise", noise), ("options", options)):
        _known(f"{path}: {name}", table, KEYS[name])
    response = _word(path, data, "data", "response")
    group = _words(path, data, "data", "group")
    labels = _words(path, data, "data", "labels")
    replicate = data.get("replicate")
    if replicate is not None and not isinstance(replicate, str):
        raise InputError(f"{path}: data.replicate = {replicate!r} must be a column's name.")
    file = path.parent / _word(path, data, "data", "file")
    counters = [replicate] if replicate else []
    rows = read_table(file, response, labels, counters)
    for name in group:
        if name not in rows.columns and name not in rows.labels:
            have = ", ".join([*rows.columns, *rows.labels])
            raise InputError(f"{path}: data.group names {name!r}; {file} has the columns {have}.")
    rows = _without(path, rows, _words(path, data, "data", "ignore"), {response, *group, *labels})
    parameters = _parameters(path, _table(path, content, "parameters"))
    return Study(
        table=rows,
        response=response,
        group=group,
        replicate=replicate,
        labels=labels,
        noise=_noise(path, noise, {*rows.columns, *parameters}),
        model=_model(path, model),
        parameters=parameters,
        options=_options(path, options),
        file=path,
    )


def _known(place: str, table: Mapping[str, Any], known: tuple[str, ...]) -> None:
    for key in table:
        if key not in known:
            near = difflib.get_close_matches(key, known, n=1, cutoff=0.5)
            hint = f"did you mean {near[0]!r}?" if near else f"known are {', '.join(known)}."
            mark = "." if ": " in place else ": "
            raise InputError(f"{place}{mark}{key} is not a known key; {hint}")


def _table(
    path: Path, content: Mapping[str, Any], key: str, required: bool = False
) -> Mapping[str, Any]:
    if key not in content:
        if required:
            raise InputError(f"{path}: the table [{key}] is missing; give it.")
        return {}
    table = content[key]
    if not isinstance(table, Mapping):
        raise InputError(f"{path}: {key} = {table!r} must be a table; write it as [{key}].")
    return table


def _word(path: Path, table: Mapping[str, Any], place: str, key: str) -> str:
    if key not in table:
        raise InputError(f"{path}: {place}.{key} is missing; give a string.")
    if not isinstance(table[key], str) or not table[key]:
        raise InputError(f"{path}: {place}.{key} = {table[key]!r} must be a string in quotes.")
    return str(table[key])


def _words(path: Path, table: Mapping[str, Any], place: str, key: str) -> tuple[str, ...]:
    value = table.get(key, [])
    if isinstance(value, str):
        value = [value]
    if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
        raise InputError(f"{path}: {place}.{key} = {value!r} must be a list of names in quotes.")
    return tuple(value)


def _quantity(place: str, name: str, value: Any, spread: bool = False) -> float:
    """A number in SI, or a string with a unit; ``spread`` for differences of temperature."""
    dimension = DIMENSIONS.get(name)
    if isinstance(value, str):
        if spread and dimension == "temperature":
            value = value.replace("degC", "K").replace("°C", "K")
        if dimension is None:
            return parse_to_base(value, place)
        return parse_quantity(value, dimension, place)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise InputError(f"{place} = {value!r} must be a number in SI or a string with a unit.")
    if not math.isfinite(value):
        raise InputError(f"{place} = {value} must be finite; mend it.")
    return float(value)


def _without(path: Path, table: Table, ignored: tuple[str, ...], needed: set[str]) -> Table:
    """The table without the columns that the study leaves aside."""
    for name in ignored:
        if name in needed:
            raise InputError(f"{path}: data.ignore names {name!r}, which the study uses; pick one.")
        if name not in table.columns and name not in table.labels:
            have = ", ".join([*table.columns, *table.labels])
            raise InputError(f"{path}: data.ignore names {name!r}; the columns are {have}.")
    return replace(
        table,
        columns={k: v for k, v in table.columns.items() if k not in ignored},
        labels={k: v for k, v in table.labels.items() if k not in ignored},
    )


def _parameters(path: Path, tables: Mapping[str, Any]) -> dict[str, Parameter]:
    found = {}
    for name, table in tables.items():
        place = f"{path}: parameters.{name}"
        if isinstance(table, (int, float, str)) and not isinstance(table, bool):
            table = {"value": table}
        if not isinstance(table, Mapping):
            raise InputError(f"{place} = {table!r} must be a table with value, and sd or free.")
        _known(place, table, KEYS["parameter"])
        if "value" not in table:
            raise InputError(f"{place}.value is missing; give a number to start from.")
        value = _quantity(f"{place}.value", name, table["value"])
        free = table.get("free", False)
        if not isinstance(free, bool):
            raise InputError(f"{place}.free = {free!r} must be true or false.")
        sd = _quantity(f"{place}.sd", name, table.get("sd", 0.0), spread=True)
        if sd < 0.0:
            raise InputError(f"{place}.sd = {sd:g} must be at least 0; mend it.")
        if free and sd > 0.0:
            raise InputError(
                f"{place} is free and has an sd; a measured parameter has an sd, one to be "
                "calibrated is free: remove one of the two."
            )
        found[name] = Parameter(value=value, sd=sd, free=free)
    return found


def _noise(path: Path, table: Mapping[str, Any], known: set[str]) -> Noise:
    relative = table.get("relative")
    if relative is not None:
        relative = _share(f"{path}: noise.relative", relative)
    systematic = table.get("systematic", {})
    if not isinstance(systematic, Mapping):
        raise InputError(
            f"{path}: noise.systematic = {systematic!r} must be a table, such as "
            "{ diameter = 0.01 }."
        )
    shares = {}
    for name, value in systematic.items():
        if name not in known:
            raise InputError(
                f"{path}: noise.systematic.{name} is no column or parameter; known are "
                f"{', '.join(sorted(known))}."
            )
        shares[name] = _share(f"{path}: noise.systematic.{name}", value)
    return Noise(relative=relative, systematic=shares)


def _share(place: str, value: Any) -> float:
    number = (
        parse_quantity(value, "dimensionless", place)
        if isinstance(value, str)
        else _quantity(place, "", value)
    )
    if not 0.0 < number <= LARGEST_NOISE:
        raise InputError(
            f"{place} = {number:g} [-] must be above 0 and at most {LARGEST_NOISE:g}; it is "
            "relative: 2 % is 0.02."
        )
    return number


def _model(path: Path, table: Mapping[str, Any]) -> ModelSpec:
    name = _word(path, table, "model", "name")
    effects = table.get("effects", {})
    if not isinstance(effects, Mapping):
        raise InputError(f"{path}: model.effects = {effects!r} must be a table of amplitudes.")
    amplitudes = {
        key: _quantity(f"{path}: model.effects.{key}", "", value) for key, value in effects.items()
    }
    options = {key: value for key, value in table.items() if key not in ("name", "effects")}
    return ModelSpec(name=name, options=options, effects=amplitudes, folder=str(path.parent))


def _options(path: Path, table: Mapping[str, Any]) -> Options:
    alpha = _quantity(f"{path}: options.alpha", "", table.get("alpha", 0.01))
    if not LOWEST_ALPHA <= alpha <= HIGHEST_ALPHA:
        raise InputError(
            f"{path}: options.alpha = {alpha:g} [-] must be at least {LOWEST_ALPHA:g} and at most "
            f"{HIGHEST_ALPHA:g}; 0.01 is usual."
        )
    seed = table.get("seed", 1)
    if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
        raise InputError(f"{path}: options.seed = {seed!r} must be a whole number from 0.")
    holdout = table.get("holdout", "group")
    if holdout not in ("group", "none"):
        raise InputError(f"{path}: options.holdout = {holdout!r} must be 'group' or 'none'.")
    candidates = table.get("candidates")
    if candidates is not None:
        candidates = _words(path, table, "options", "candidates")
    return Options(alpha=alpha, seed=seed, holdout=holdout, candidates=candidates)
