"""Forward models by name; each is loaded when it is asked for."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import replace
from importlib import import_module

from greybed.core.errors import InputError
from greybed.residual.model import ForwardModel, ModelSpec
from greybed.residual.study import Table

MODELS = {
    "terminal-velocity": ("terminal_velocity", "TerminalVelocity"),
    "packed-bed-pressure-drop": ("packed_bed", "PackedBedPressureDrop"),
    "bed-conductivity": ("bed_conductivity", "BedConductivity"),
    "case": ("case", "CaseModel"),
    "python": ("python", "PythonModel"),
}


def build(spec: ModelSpec, table: Table, parameters: Mapping[str, float]) -> ForwardModel:
    """Make the forward model of a study.

    Parameters
    ----------
    spec : ModelSpec
        The table ``[model]``.
    table : Table
        Measured rows.
    parameters : mapping of str to float
        Parameters of the study in SI.

    Returns
    -------
    model : ForwardModel
        Ready to predict these rows.

    Raises
    ------
    InputError
        For a model, option, column or parameter that is unknown or missing.
    """
    if spec.name not in MODELS:
        near = difflib.get_close_matches(spec.name, MODELS, n=1, cutoff=0.5)
        hint = f"did you mean {near[0]!r}?" if near else f"known are {', '.join(MODELS)}."
        raise InputError(f"model.name = {spec.name!r} is not a known model; {hint}")
    module, kind = MODELS[spec.name]
    found = getattr(import_module(f"greybed.residual.models.{module}"), kind)
    files = spec.options.get("terms", [])
    if not isinstance(files, list) or not all(isinstance(file, str) for file in files):
        raise InputError(f"model.terms = {files!r} must be a list of files in quotes.")
    own = {key: value for key, value in spec.options.items() if key != "terms"}
    model: ForwardModel = found(replace(spec, options=own), table, parameters)
    if files:
        from greybed.residual.models.terms import WithTerms

        model = WithTerms(model, files, spec.folder, {*table.columns, *parameters})
    return model


__all__ = ["MODELS", "build"]
