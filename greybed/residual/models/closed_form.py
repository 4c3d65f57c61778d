"""Models that are a formula: columns and parameters merged, effects applied stage by stage."""

from __future__ import annotations

import difflib
import math
from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from greybed.core.errors import InputError
from greybed.core.units import parse_quantity
from greybed.residual.catalogue import effects_for
from greybed.residual.columns import DIMENSIONS
from greybed.residual.effect import Array, Columns, Effect
from greybed.residual.model import ForwardModel, ModelSpec, values
from greybed.residual.study import Table

LAW_KEYS = ("drag", "law", "base")


class ClosedForm(ForwardModel):
    """Base of the shipped closed-form models.

    Parameters
    ----------
    spec : ModelSpec
        The table ``[model]``.
    table : Table
        Measured rows.
    parameters : mapping of str to float
        Parameters of the study, SI.

    Raises
    ------
    InputError
        For an unknown option or effect, or a quantity that is neither column nor parameter.
    """

    required: ClassVar[tuple[str, ...]]
    options: ClassVar[tuple[str, ...]] = LAW_KEYS
    default_law: ClassVar[str]

    def __init__(self, spec: ModelSpec, table: Table, parameters: Mapping[str, float]) -> None:
        self.spec = spec
        self._check_options()
        given = {**dict.fromkeys(table.columns, True), **dict.fromkeys(parameters, True)}
        for name in self.required:
            if name not in given:
                raise self._missing(name, table, parameters)
        known = {*DIMENSIONS, *(c for e in effects_for(self.name) for c in e.columns)}
        for name in parameters:
            if name not in known:
                near = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
                said = ", ".join(self.required)
                hint = f"did you mean {near[0]!r}?" if near else f"it takes {said}."
                raise InputError(f"parameters.{name} is not used by {self.name}; {hint}")
        for name in parameters:
            column = table.columns.get(name)
            if column is not None and np.ptp(column) > 1e-9 * np.max(np.abs(column)):
                raise InputError(
                    f"{table.file or 'table'}: {name} varies from row to row and is a parameter "
                    f"too; remove the column or [parameters.{name}]."
                )
        if self.response not in table.columns:
            raise InputError(
                f"{table.file or 'table'}: the model {self.name} predicts {self.response}, and "
                f"there is no such column; the file has {', '.join(table.columns)}."
            )
        self._prepare(table, parameters)
        self._choose_effects({*given, *self.derived(table.columns, parameters)})

    def _check_options(self) -> None:
        for key in self.spec.options:
            if key not in self.options:
                near = difflib.get_close_matches(key, self.options, n=1, cutoff=0.5)
                known = ", ".join(self.options) or "none"
                hint = f"did you mean {near[0]!r}?" if near else f"known are {known}."
                raise InputError(f"model.{key} is not an option of {self.name}; {hint}")
        laws = [key for key in LAW_KEYS if key in self.spec.options]
        if len(laws) > 1:
            raise InputError(f"model.{laws[0]} and model.{laws[1]} name the same thing; give one.")

    def _number(self, key: str, dimension: str, default: float) -> float:
        """An option above 0, given in SI or as text with a unit."""
        value = self.spec.options.get(key, default)
        if isinstance(value, str):
            value = parse_quantity(value, dimension, f"model.{key}")
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise InputError(f"model.{key} = {value!r} must be a number in SI or text with a unit.")
        if not 0.0 < value < math.inf:
            raise InputError(f"model.{key} = {value:g} must be above 0 and finite; mend it.")
        return float(value)

    def _state_temperature(self, c: dict[str, Array]) -> None:
        """Put the temperature at which properties are stated beside the columns."""
        if "reference_temperature" in self.spec.options:
            stated = self._number("reference_temperature", "temperature", 0.0)
            c["reference_temperature"] = np.full(len(c[self.required[0]]), stated)

    def _missing(self, name: str, table: Table, parameters: Mapping[str, float]) -> InputError:
        return InputError(
            f"{table.file or 'table'}: the model {self.name} needs {name}; give a column of that "
            f"name or [parameters.{name}]; the columns are {', '.join(table.columns)}."
        )

    @property
    def law(self) -> str:
        """Name of the base law."""
        for key in LAW_KEYS:
            if key in self.spec.options:
                return str(self.spec.options[key])
        return self.default_law

    def _choose_effects(self, given: set[str]) -> None:
        known = {effect.name: effect for effect in self.catalogue()}
        for name, amplitude in self.spec.effects.items():
            if name not in known:
                near = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
                hint = f"did you mean {near[0]!r}?" if near else f"known are {', '.join(known)}."
                raise InputError(f"model.effects.{name} is not an effect of {self.name}; {hint}")
            lacking = [c for c in known[name].columns if c not in given]
            if lacking:
                raise InputError(
                    f"model.effects.{name} = {amplitude:g} needs {lacking[0]}; give a column or "
                    f"[parameters.{lacking[0]}], or remove the effect."
                )
        self.known = known
        self.effects = {}
        self.unavailable = {}
        for name, effect in known.items():
            lacking = [c for c in effect.columns if c not in given]
            reason = self.excluded(effect)
            if name in self.spec.effects:
                self.unavailable[name] = "it is in the base model already"
            elif reason:
                self.unavailable[name] = reason
            elif lacking:
                self.unavailable[name] = f"it needs {' and '.join(lacking)}, not in the table"
            else:
                self.effects[name] = effect

    def catalogue(self) -> tuple[Effect, ...]:
        """Effects that act in this model."""
        return effects_for(self.name)

    def excluded(self, effect: Effect) -> str | None:
        """Why an effect cannot act on this base; None where it can."""
        return None

    def derived(self, columns: Columns, parameters: Mapping[str, float]) -> set[str]:
        """Quantities that the model works out from those given."""
        return set()

    def _prepare(self, table: Table, parameters: Mapping[str, float]) -> None:
        """Look at the table once."""

    @abstractmethod
    def evaluate(self, columns: dict[str, Array], active: list[tuple[Effect, float]]) -> Array:
        """Response from complete columns; ``active`` holds the effects of later stages."""

    def predict(
        self,
        columns: Columns,
        parameters: Mapping[str, float],
        amplitudes: Mapping[str, float],
    ) -> Array:
        """See :meth:`ForwardModel.predict`."""
        with np.errstate(all="ignore"):
            c = values(columns, parameters)
            good = np.logical_and.reduce([c[name] > 0.0 for name in self.required])
            if "void_fraction" in c:
                good &= c["void_fraction"] < 1.0
            response = self._respond(self.complete(c), amplitudes)
            return np.where(good & np.isfinite(response) & (response > 0.0), response, np.nan)

    def _respond(self, c: dict[str, Array], amplitudes: Mapping[str, float]) -> Array:
        """Effects in the order of their stages, and the law between them."""
        on = {**self.spec.effects, **{k: v for k, v in amplitudes.items() if v != 0.0}}
        later = []
        outcomes = []
        for name, amplitude in on.items():
            effect = self.known[name]
            if effect.stage == "property":
                changed = effect.change(c, amplitude)
                assert isinstance(changed, Mapping)
                c.update(changed)
            elif effect.stage == "outcome":
                outcomes.append((effect, amplitude))
            else:
                later.append((effect, amplitude))
        response = self.evaluate(c, later)
        for effect, amplitude in outcomes:
            changed = effect.change({**c, "response": response}, amplitude)
            assert not isinstance(changed, Mapping)
            response = changed
        return response

    def complete(self, c: dict[str, Array]) -> dict[str, Array]:
        """Add what the model derives from the columns."""
        return c

    def settings(
        self, parameters: Mapping[str, float], amplitudes: Mapping[str, float]
    ) -> dict[str, Any]:
        """See :meth:`ForwardModel.settings`."""
        effects = {**self.spec.effects, **amplitudes}
        table: dict[str, Any] = {"name": self.name, **self.spec.options}
        if effects:
            table["effects"] = {name: float(value) for name, value in effects.items()}
        return table


def product(columns: Columns, active: list[tuple[Effect, float]]) -> Array | float:
    """Product of the factors."""
    total: Array | float = 1.0
    for effect, amplitude in active:
        if effect.stage == "factor":
            changed = effect.change(columns, amplitude)
            assert not isinstance(changed, Mapping)
            total = total * changed
    return total
