"""A simulation case as a forward model: few runs, an emulator, effects that are switches."""

from __future__ import annotations

import copy
import difflib
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from greybed.core.config import read_toml
from greybed.core.errors import InputError
from greybed.residual.catalogue.particles import NEEDS_ENGINE
from greybed.residual.effect import Array, Columns
from greybed.residual.model import ForwardModel, ModelSpec
from greybed.residual.models.emulator import Emulator, Knob
from greybed.residual.models.particle_runner import ParticleRunner
from greybed.residual.models.runner import Runner, Switch, ThermalRunner
from greybed.residual.study import Table

RUNNERS: dict[str, Callable[[Path, str, Path], Runner]] = {
    ThermalRunner.kind: ThermalRunner,
    ParticleRunner.kind: ParticleRunner,
}
OPTIONS = ("file", "output", "inputs", "transform", "seeds", "cache")
MOST_NEW = 64  # conditions beside those of the table that are worth runs


class CaseModel(ForwardModel):
    """Any simulation case of the project, at the conditions of a measured table.

    Parameters
    ----------
    spec : ModelSpec
        Options ``file``, the case; ``output``, the dotted name of a result (a table of numbers is
        summed); ``inputs``, column or parameter -> dotted key of the case; ``transform``, log or
        linear; ``seeds``, a list: the simulation is repeated with them and its scatter enters the
        noise; ``cache``, a folder (default: ``.greybed_cache`` beside the study).
    table : Table
        Measured rows.
    parameters : mapping of str to float
        Parameters of the study, SI.

    Raises
    ------
    InputError
        For a key, output or effect that the case does not have, or a run that fails at the base.

    Notes
    -----
    For each different condition the case is run at the base, with each effect at a few
    amplitudes, pairs of effects, and each parameter moved, with common random numbers; a
    quadratic emulator in between is exact at the base. Its error at runs that it was not fitted
    to, and the scatter over seeds, are ``noise``.
    """

    name = "case"
    response = ""

    def __init__(self, spec: ModelSpec, table: Table, parameters: Mapping[str, float]) -> None:
        self.spec = spec
        for key in spec.options:
            if key not in OPTIONS:
                near = difflib.get_close_matches(key, OPTIONS, n=1, cutoff=0.5)
                hint = f"did you mean {near[0]!r}?" if near else f"known: {', '.join(OPTIONS)}."
                raise InputError(f"model.{key} is not an option of case; {hint}")
        self.transform = str(spec.options.get("transform", "log"))
        if self.transform not in ("log", "linear"):
            raise InputError(f"model.transform = {self.transform!r} must be 'log' or 'linear'.")
        self.path = Path(spec.folder) / _text(spec, "file")
        self.output = _text(spec, "output")
        self.content = read_toml(self.path)
        self._inputs = self._read_inputs(table, parameters)
        kind = str(self.content.get("kind"))
        if kind not in RUNNERS:
            raise InputError(
                f"{self.path}: kind = {kind!r} is not a case that greybed runs; known are "
                f"{', '.join(RUNNERS)}."
            )
        cache = Path(spec.folder) / str(spec.options.get("cache", ".greybed_cache"))
        self._runner: Runner = RUNNERS[kind](self.path, self.output, cache)
        self._switches: dict[str, Switch] = self._runner.switches()
        self._choose()
        self._columns = [name for name in self._inputs if name in table.columns]
        self._knobs = [
            Knob(name, value, max(0.05 * abs(value), 1e-12))
            for name, value in parameters.items()
            if name in self._inputs
        ]
        self._emulators: dict[tuple[float, ...], Emulator] = {}
        self._base: dict[tuple[float, ...], float] = {}
        self._prepare(table)

    def _read_inputs(self, table: Table, parameters: Mapping[str, float]) -> dict[str, str]:
        inputs = self.spec.options.get("inputs", {})
        if not isinstance(inputs, Mapping):
            raise InputError("model.inputs must be a table: column or parameter = 'key.of.case'.")
        for name, key in inputs.items():
            if name not in table.columns and name not in parameters:
                raise InputError(
                    f"model.inputs.{name} is neither a column nor a parameter; the columns are "
                    f"{', '.join(table.columns)}."
                )
            get(self.content, str(key), f"{self.path}: ")
        return {str(name): str(key) for name, key in inputs.items()}

    def _choose(self) -> None:
        absent = [name for name in NEEDS_ENGINE if name not in self._switches]
        self.effects, self.unavailable = {}, dict.fromkeys(absent, self._runner.lacks)
        for name in self.spec.effects:
            if name not in self._switches:
                raise InputError(
                    f"model.effects.{name} is not a switch of this case; known are "
                    f"{', '.join(self._switches)}."
                )
        for name, switch in self._switches.items():
            reason = switch.excluded(self.content)
            if name in self.spec.effects:
                self.unavailable[name] = "it is in the base model already"
            elif reason:
                self.unavailable[name] = reason
            else:
                self.effects[name] = switch.effect

    def _key(self, columns: Columns, row: int) -> tuple[float, ...]:
        return tuple(float(f"{columns[name][row]:.9g}") for name in self._columns)

    def _with(
        self, key: tuple[float, ...], knobs: Mapping[str, float], effects: Mapping[str, float]
    ) -> dict[str, Any]:
        """The case at a condition, with parameters and effects in place."""
        content = copy.deepcopy(self.content)
        for name, value in zip(self._columns, key, strict=True):
            put(content, self._inputs[name], value)
        for name, value in knobs.items():
            put(content, self._inputs[name], value)
        for name, amplitude in {**self.spec.effects, **effects}.items():
            if amplitude != 0.0:
                self._switches[name].apply(content, amplitude)
        return content

    def _run(
        self, key: tuple[float, ...], knobs: Mapping[str, float], effects: Mapping[str, float]
    ) -> float:
        return self._runner.run(self._with(key, knobs, effects))

    def _prepare(self, table: Table) -> None:
        seeds = [int(s) for s in self.spec.options.get("seeds", ())]
        keys = [self._key(table.columns, i) for i in range(len(table))]
        variance: dict[tuple[float, ...], float] = {}
        for key in dict.fromkeys(keys):
            made = Emulator(self._knobs, list(self.effects.values()), partial(self._run, key))
            self._emulators[key] = made
            error = made.error
            if seeds:
                # the scatter with every effect on: without them there may be nothing random
                on = {effect.name: effect.typical for effect in self.effects.values()}
                full = self._with(key, made.centre(), on)
                runs = [self._runner.run(self._runner.reseed(full, s)) for s in seeds]
                error = float(np.hypot(error, np.std(runs, ddof=1) if len(runs) > 1 else 0.0))
            scale = abs(made.base) if self.transform == "log" else 1.0
            variance[key] = error / max(scale, 1e-300)
        self.noise = np.array([variance[key] for key in keys])

    def predict(
        self,
        columns: Columns,
        parameters: Mapping[str, float],
        amplitudes: Mapping[str, float],
    ) -> Array:
        """See :meth:`ForwardModel.predict`; NaN at conditions that would take many more runs."""
        n = len(next(iter(columns.values())))
        keys = [self._key(columns, i) for i in range(n)]
        new = {key for key in keys if key not in self._emulators and key not in self._base}
        if len(new) > MOST_NEW:
            new = set()
        for key in new:
            centre = {knob.name: knob.value for knob in self._knobs}
            self._base[key] = self._runner.run(self._with(key, centre, {}))
        response = np.full(n, np.nan)
        for key in set(keys):
            if key in self._emulators:
                value = self._emulators[key].value(parameters, amplitudes)
            elif key in self._base:
                # effects go with the nearest condition that has runs for them
                near = min(self._emulators, key=lambda k: _distance(k, key))
                value = self._emulators[near].value(parameters, amplitudes)
                value *= self._base[key] / self._emulators[near].base
            else:
                continue
            response[[i for i, k in enumerate(keys) if k == key]] = value
        return response

    def settings(
        self, parameters: Mapping[str, float], amplitudes: Mapping[str, float]
    ) -> dict[str, Any]:
        """See :meth:`ForwardModel.settings`."""
        table: dict[str, Any] = {"name": self.name, **self.spec.options}
        effects = {**self.spec.effects, **amplitudes}
        if effects:
            table["effects"] = {name: float(value) for name, value in effects.items()}
        return table

    def next_case(
        self, parameters: Mapping[str, float], amplitudes: Mapping[str, float]
    ) -> dict[str, Any]:
        """See :meth:`ForwardModel.next_case`."""
        content = copy.deepcopy(self.content)
        for name, key in self._inputs.items():
            if name in parameters:
                put(content, key, float(parameters[name]))
        for name, amplitude in {**self.spec.effects, **amplitudes}.items():
            self._switches[name].apply(content, amplitude)
        self._runner.relocate(content)
        return content


def _text(spec: ModelSpec, key: str) -> str:
    value = spec.options.get(key)
    if not isinstance(value, str) or not value:
        raise InputError(f"model.{key} is missing; give it as a string.")
    return value


def _distance(first: tuple[float, ...], second: tuple[float, ...]) -> float:
    return sum(abs(a - b) / max(abs(a), abs(b), 1e-300) for a, b in zip(first, second, strict=True))


def get(content: Any, key: str, place: str = "") -> Any:
    """Value at a dotted key; an entry of a list is found by its name, or its number from 0 on.

    Raises
    ------
    InputError
        If there is none.
    """
    here = content
    for part in key.split("."):
        if isinstance(here, list):
            named = [
                item for item in here if isinstance(item, Mapping) and item.get("name") == part
            ]
            at = int(part) if part.isdigit() and int(part) < len(here) else None
            here = named[0] if named else None if at is None else here[at]
        elif isinstance(here, Mapping):
            here = here.get(part)
        else:
            here = None
        if here is None:
            raise InputError(f"{place}there is no {key} (stops at {part!r}); mend the key.")
    return here


def put(content: dict[str, Any], key: str, value: float) -> None:
    """Set the value at a dotted key that exists."""
    *front, last = key.split(".")
    target: Any = get(content, ".".join(front)) if front else content
    target[int(last) if isinstance(target, list) else last] = value
