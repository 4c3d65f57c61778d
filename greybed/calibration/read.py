"""Reads a study of calibration from TOML."""

from __future__ import annotations

import csv
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from greybed.calibration.designs import DESIGNS
from greybed.calibration.experiment import Experiment
from greybed.calibration.experiments import KINDS
from greybed.calibration.experiments.listed import Listed
from greybed.calibration.parameters import Parameter, Space
from greybed.calibration.study import STRATEGIES, SURROGATES, Options, Study, Target
from greybed.core.config import choice, plain, quantity, read_case, rows, tables, whole
from greybed.core.errors import InputError
from greybed.core.units import in_unit, parse_to_base

_COLUMNS = ("at", "value", "sd")


@dataclass(frozen=True, kw_only=True)
class OptionsTable:
    """``[study]``."""

    strategy: str = choice(STRATEGIES, "response-surface")
    surrogate: str = choice(SURROGATES, "gp")
    design: str = choice(DESIGNS, "lhs")
    runs: int = whole(40, at_least=1, at_most=100_000)
    others: int = whole(0, at_least=0, at_most=100_000)
    initial: int = whole(0, at_least=0)
    replicates: int = whole(1, at_least=1, at_most=1000)
    seed: int = whole(1, at_least=0)
    batch: int = whole(1, at_least=1, at_most=1000)
    workers: int = whole(0, at_least=0, at_most=1024)
    scheduler: str | None = None
    attempts: int = whole(3, at_least=1, at_most=100)
    cost_weight: float = quantity("dimensionless", 0.0, at_least=0.0)
    stop: float = quantity("dimensionless", 0.0, at_least=0.0, at_most=1.0)


@dataclass(frozen=True, kw_only=True)
class ParameterTable:
    """``[[parameter]]``."""

    name: str
    value: float | str | None = plain(None)
    low: float | str | None = plain(None)
    high: float | str | None = plain(None)
    log: bool = False
    mean: float | str | None = plain(None)
    sd: float | str | None = plain(None)
    group: int = whole(1, at_least=1)

    @property
    def parameter(self) -> Parameter:
        """The parameter itself."""
        numbers = {k: _si(f"parameter {self.name!r}: {k}", getattr(self, k)) for k in (
            "value", "low", "high", "mean", "sd")}  # fmt: skip
        return Parameter(name=self.name, log=self.log, group=self.group, **numbers)


@dataclass(frozen=True, kw_only=True)
class DataTable:
    """``[[data]]``."""

    experiment: str
    measure: str
    value: float | str | None = plain(None)
    sd: float | str | None = plain(None)
    file: Path | None = None  # a curve: CSV with columns at, value, sd
    correlation: float = quantity("dimensionless", 0.0, at_least=0.0)  # in the unit of ``at``
    single: bool = False


@dataclass(frozen=True, kw_only=True)
class StudyFile:
    """A whole study file."""

    study: OptionsTable = field(default_factory=OptionsTable)
    parameter: tuple[ParameterTable, ...] = rows(ParameterTable)
    experiment: tuple[Listed, ...] = tables("kind", KINDS)
    data: tuple[DataTable, ...] = rows(DataTable)


def _si(place: str, value: Any) -> float | None:
    """A number in base SI, or a string with a unit."""
    if value is None:
        return None
    if isinstance(value, str):
        return parse_to_base(value, place)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise InputError(f"{place} = {value!r} must be a number in SI or a string with a unit.")
    return float(value)


def read_study(path: str | os.PathLike[str]) -> Study:
    """Read and check a study of calibration.

    Parameters
    ----------
    path : path
        TOML file with ``[study]``, ``[[parameter]]``, ``[[experiment]]`` and ``[[data]]``; other
        files are relative to it.

    Returns
    -------
    Study
        Checked: nothing in it needs a simulation to be refused.

    Raises
    ------
    InputError
        In one sentence with file, key, value, bound and remedy.
    """
    path = Path(path)
    content = read_case(path, StudyFile)
    try:
        return _study(path, content)
    except InputError as error:
        said = str(error)
        raise InputError(said if said.startswith(f"{path}:") else f"{path}: {said}") from None


def _study(path: Path, content: StudyFile) -> Study:
    names = [table.name for table in content.experiment]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputError(f"experiment {twice[0]!r} is there twice; give each its own name.")
    space = Space([table.parameter for table in content.parameter])
    experiments: dict[str, Experiment] = {}
    for table in content.experiment:
        made = table.experiment(path.parent)
        if made is not table:
            made.relative_cost = table.relative_cost
        experiments[table.name] = made
    targets = tuple(_target(path, table, experiments) for table in content.data)
    labels = [t.label for t in targets]
    again = sorted({label for label in labels if labels.count(label) > 1})
    if again:
        raise InputError(f"data of {again[0]} are there twice; put them into one mean with its sd.")
    o = content.study
    return Study(
        space=space,
        experiments=experiments,
        roles={table.name: table.role for table in content.experiment},
        targets=targets,
        stages={t.name: t.group for t in content.experiment if t.group},
        planned=_planned(content.experiment, experiments),
        efforts={t.name: t.effort for t in content.experiment},
        options=Options(**{name: getattr(o, name) for name in OptionsTable.__dataclass_fields__}),
        file=path,
        inputs=tuple(
            [t.file for t in content.data if t.file is not None]
            + [file for t in content.experiment for file in t.files()]
        ),
    )


def _planned(listed: tuple[Listed, ...], experiments: Mapping[str, Experiment]) -> dict[str, float]:
    """Errors that measures of candidates would have, by label."""
    planned = {}
    for table in listed:
        if table.role != "candidate":
            continue
        me = f"experiment {table.name!r}"
        if not isinstance(table.errors, Mapping) or not table.errors:
            raise InputError(
                f"{me} is a candidate and has no errors; give the sd that each of its measures "
                'would have, such as errors = { angle = "1 deg" }.'
            )
        for name, value in table.errors.items():
            known = experiments[table.name].measures
            if name not in known:
                raise InputError(
                    f"{me}: errors.{name} is no measure of it; it gives {', '.join(known)}."
                )
            error = in_unit(value, known[name].unit, f"{me}: errors.{name}")
            if error <= 0.0:
                raise InputError(f"{me}: errors.{name} = {error:g} must be above 0.")
            planned[f"{table.name}.{name}"] = error
    return planned


def _target(path: Path, table: DataTable, experiments: Mapping[str, Experiment]) -> Target:
    me = f"data of {table.experiment}.{table.measure}"
    if table.experiment not in experiments:
        raise InputError(
            f"data name the experiment {table.experiment!r}; there are {', '.join(experiments)}."
        )
    known = experiments[table.experiment].measures
    if table.measure not in known:
        raise InputError(
            f"experiment {table.experiment!r} cannot produce the measure {table.measure!r}; it "
            f"gives {', '.join(known)}."
        )
    unit = known[table.measure].unit
    if table.file is not None:
        at, value, sd = _curve(table.file)
        return Target(
            experiment=table.experiment, measure=table.measure, value=value, sd=sd, at=at,
            correlation=table.correlation, single=table.single,
        )  # fmt: skip
    for key in ("value", "sd"):
        if getattr(table, key) is None:
            raise InputError(
                f"{me} have no {key}; give it, or a file with the columns at, value and sd."
            )
    number = in_unit(table.value, unit, f"{me}: value")
    error = in_unit(table.sd, unit, f"{me}: sd")
    return Target(
        experiment=table.experiment, measure=table.measure, value=np.array([number]),
        sd=np.array([error]), single=table.single,
    )  # fmt: skip


def _curve(file: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Columns at, value, sd of a CSV table, in the units of the measure."""
    try:
        with open(file, newline="") as stream:
            table = list(csv.reader(stream))
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{file}: cannot read this curve ({reason}); check the path.") from None
    header = [name.split("[")[0].strip() for name in table[0]] if table else []
    if tuple(header) != _COLUMNS:
        raise InputError(
            f"{file}: line 1 must name the columns at, value, sd (units in brackets may follow); "
            f"it has {', '.join(header) or 'none'}."
        )
    numbers = []
    for line, row in enumerate(table[1:], start=2):
        try:
            numbers.append([float(word) for word in row])
        except ValueError:
            raise InputError(f"{file}: line {line} is not three numbers; mend it.") from None
        if len(row) != len(_COLUMNS):
            raise InputError(f"{file}: line {line} is not three numbers; mend it.")
    if len(numbers) < 3:
        raise InputError(f"{file}: {len(numbers)} rows follow the header; a curve needs 3.")
    at, value, sd = np.array(numbers).T
    return at, value, sd
