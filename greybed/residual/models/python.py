"""A user's own model: a Python function, and the effects that it can switch."""

from __future__ import annotations

import difflib
import importlib
import os
import sys
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from greybed.core.errors import InputError
from greybed.residual.catalogue import effects_for
from greybed.residual.effect import Array, Columns, Effect
from greybed.residual.model import ForwardModel, ModelSpec, values
from greybed.residual.study import Table

OPTIONS = ("function", "folder", "transform", "candidates", "catalogue")
CANDIDATE = ("theory", "spread", "low", "high", "columns", "law", "source", "group")
HOW = "write it as function(columns, parameters, amplitudes) -> responses, one for each row"

Function = Callable[[Columns, Mapping[str, float], Mapping[str, float]], Any]


class PythonModel(ForwardModel):
    """``function = "module:callable"``, called as ``callable(columns, parameters, amplitudes)``.

    Parameters
    ----------
    spec : ModelSpec
        Options ``function``; ``folder`` to find the module in, relative to the study (which is
        searched first otherwise); ``transform`` log or linear; ``candidates`` (a table for each
        effect that the function can switch); ``catalogue`` (names of shipped effects that
        multiply the response).
    table : Table
        Measured rows.
    parameters : mapping of str to float
        Parameters of the study, SI.

    Raises
    ------
    InputError
        If the function cannot be found or does not answer as it must; at amplitude 0 it must
        give the base bit by bit.
    """

    name = "python"
    response = ""  # whatever the study measures

    def __init__(self, spec: ModelSpec, table: Table, parameters: Mapping[str, float]) -> None:
        self.spec = spec
        _known("model", spec.options, OPTIONS)
        self.transform = str(spec.options.get("transform", "log"))
        if self.transform not in ("log", "linear"):
            raise InputError(f"model.transform = {self.transform!r} must be 'log' or 'linear'.")
        self._function = _find(spec)
        self._label = str(spec.options["function"])
        known = _candidates(spec)
        shipped = {e.name: e for e in effects_for("python")}
        for name in spec.options.get("catalogue", ()):
            _known("model.catalogue", {name: True}, tuple(shipped))
            known[name] = shipped[name]
        self._shipped = {n for n in known if n in shipped and known[n] is shipped[n]}
        _known("model.effects", spec.effects, tuple(known))
        given = {*table.columns, *parameters}
        self.known, self.effects, self.unavailable = known, {}, {}
        for name, effect in known.items():
            lacking = [c for c in effect.columns if c not in given]
            if name in spec.effects:
                self.unavailable[name] = "it is in the base model already"
            elif lacking:
                self.unavailable[name] = f"it needs {' and '.join(lacking)}, not in the table"
            else:
                self.effects[name] = effect
        self._check(table, parameters)

    def _check(self, table: Table, parameters: Mapping[str, float]) -> None:
        base = self._call(table.columns, parameters, {})
        for name in self.effects:
            off = self._call(table.columns, parameters, {name: 0.0})
            if not np.array_equal(base, off, equal_nan=True):
                raise InputError(
                    f"model.function = {self._label!r}: with {name} = 0 it differs from itself "
                    "without; amplitude 0 must switch an effect off exactly."
                )

    def _call(
        self, columns: Columns, parameters: Mapping[str, float], amplitudes: Mapping[str, float]
    ) -> Array:
        n = len(next(iter(columns.values())))
        try:
            answer = self._function(columns, dict(parameters), dict(amplitudes))
            response = np.asarray(answer, dtype=np.float64)
        except Exception as error:
            raise InputError(
                f"model.function = {self._label!r} raised {type(error).__name__} ({error}); {HOW}."
            ) from error
        if response.shape != (n,):
            raise InputError(
                f"model.function = {self._label!r} gave an array of shape {response.shape} for {n} "
                f"rows; {HOW}."
            )
        return response

    def predict(
        self,
        columns: Columns,
        parameters: Mapping[str, float],
        amplitudes: Mapping[str, float],
    ) -> Array:
        """See :meth:`ForwardModel.predict`."""
        on = {**self.spec.effects, **{k: v for k, v in amplitudes.items() if v != 0.0}}
        own = {k: v for k, v in on.items() if k not in self._shipped}
        response = self._call(columns, parameters, own)
        for name in on:
            if name in self._shipped:
                factor = self.known[name].change(values(columns, parameters), on[name])
                assert not isinstance(factor, Mapping)
                response = response * factor
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


def _known(place: str, table: Mapping[str, Any], known: tuple[str, ...]) -> None:
    for key in table:
        if key not in known:
            near = difflib.get_close_matches(str(key), known, n=1, cutoff=0.5)
            said = ", ".join(known) or "none"
            hint = f"did you mean {near[0]!r}?" if near else f"known are {said}."
            raise InputError(f"{place}.{key} is not known to the model python; {hint}")


def _find(spec: ModelSpec) -> Function:
    text = spec.options.get("function")
    if not isinstance(text, str) or text.count(":") != 1:
        raise InputError(
            f"model.function = {text!r} must be 'module:callable', such as 'settling:velocity'."
        )
    module, name = text.split(":")
    folder = os.path.abspath(os.path.join(spec.folder, str(spec.options.get("folder", "."))))
    sys.path.insert(0, folder)
    try:
        importlib.invalidate_caches()
        loaded = sys.modules.get(module)
        origin = os.path.abspath(getattr(loaded, "__file__", None) or "")
        beside = os.path.join(folder, module.replace(".", os.sep) + ".py")
        if loaded is not None and origin != beside and os.path.exists(beside):
            del sys.modules[module]  # another study's module of the same name
        found = getattr(importlib.import_module(module), name)
    except AttributeError:
        raise InputError(
            f"model.function = {text!r}: the module {module} has no {name}; mend the name."
        ) from None
    except Exception as error:
        raise InputError(
            f"model.function = {text!r}: the module cannot be loaded from {folder} "
            f"({type(error).__name__}: {error}); give folder, or mend the module."
        ) from error
    finally:
        sys.path.remove(folder)
    if not callable(found):
        raise InputError(f"model.function = {text!r} is not callable; {HOW}.")
    function: Function = found
    return function


def _candidates(spec: ModelSpec) -> dict[str, Effect]:
    tables = spec.options.get("candidates", {})
    if not isinstance(tables, Mapping):
        raise InputError("model.candidates must hold a table for each effect.")
    found = {}
    for name, table in tables.items():
        place = f"model.candidates.{name}"
        if not isinstance(table, Mapping):
            raise InputError(f"{place} = {table!r} must be a table with low, high and columns.")
        _known(place, table, CANDIDATE)
        for key in ("low", "high"):
            if not isinstance(table.get(key), (int, float)):
                raise InputError(f"{place}.{key} is missing; give the amplitudes that are allowed.")
        theory = table.get("theory")
        try:
            found[name] = Effect(
                name=name,
                law=str(table.get("law", f"as {spec.options['function']} has it")),
                source=str(table.get("source", "the study")),
                group=str(table.get("group", "")),
                theory=None if theory is None else float(theory),
                spread=float(table.get("spread", 0.25)),
                low=float(table["low"]),
                high=float(table["high"]),
                columns=tuple(table.get("columns", ())),
                stage="outcome",
                change=_inside,
            )
        except (TypeError, ValueError) as error:
            raise InputError(f"{place}: {error}; mend it.") from None
    return found


def _inside(columns: Columns, amplitude: float) -> Array:
    """The function itself switches these effects."""
    raise AssertionError("effects of a python model are switched by its function")
