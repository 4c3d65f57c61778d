"""The files of a diagnosis: diagnosis.json, residuals.csv and the model with the effect in it."""

from __future__ import annotations

import csv
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from greybed.core.files import atomic_path, write_json
from greybed.residual.diagnosis import Diagnosis
from greybed.residual.study import Study


def write_diagnosis(folder: Path, study: Study, diagnosis: Diagnosis) -> dict[str, Path]:
    """Write the files that other programs read.

    Parameters
    ----------
    folder : Path
        Existing folder.
    study : Study
        What was asked.
    diagnosis : Diagnosis
        What was found.

    Returns
    -------
    files : dict of str to Path
        ``diagnosis``, ``residuals`` and ``model``; ``case`` where the model is one; grey-box
        terms by name.
    """
    files = {
        "diagnosis": write_json(folder / "diagnosis.json", diagnosis.to_json()),
        "residuals": folder / "residuals.csv",
        "model": folder / "model_with_effect.toml",
    }
    _write_residuals(files["residuals"], study, diagnosis)
    with atomic_path(files["model"]) as temporary, open(temporary, "wb") as stream:
        stream.write(f"# {diagnosis.sentence}\n".encode())
        tomli_w.dump(next_study(folder, study, diagnosis), stream)
    for closure in diagnosis.closures:
        files[closure.name] = closure.save(folder / f"{closure.name}.json")
    if diagnosis.case is not None:
        files["case"] = folder / "case_with_effect.toml"
        with atomic_path(files["case"]) as temporary, open(temporary, "wb") as stream:
            tomli_w.dump(_relative(diagnosis.case, folder.resolve()), stream)
    return files


def _relative(table: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """The table with its absolute paths seen from ``folder``."""
    out: dict[str, Any] = {}
    for key, value in table.items():
        if isinstance(value, Mapping):
            out[key] = _relative(value, folder)
        elif isinstance(value, str) and os.path.isabs(value):
            out[key] = os.path.relpath(value, folder)
        else:
            out[key] = value
    return out


def _write_residuals(path: Path, study: Study, diagnosis: Diagnosis) -> None:
    rows, table = diagnosis.rows, study.table
    unit = table.units.get(study.response, "")
    residual = "residual of log" if diagnosis.transform == "log" else "residual"
    columns: dict[str, Any] = {"line": table.rows}
    for name, values in table.columns.items():
        columns[_header(name, table.units.get(name, ""))] = values
    for name, words in table.labels.items():
        columns[name] = words
    columns[_header("predicted by the base model", unit)] = rows.base
    columns[_header("predicted with the effect", unit)] = rows.with_effect
    columns[_header("predicted held out", unit)] = rows.held_out
    plain = "" if diagnosis.transform == "log" else unit
    columns[_header(f"{residual} before", plain)] = rows.residual_before
    columns[_header(f"{residual} after", plain)] = rows.residual_after
    columns[_header("random sd", plain)] = rows.sd
    reasons = {int(item["row"]): str(item["reason"]) for item in diagnosis.left_out}
    columns["left out because"] = [reasons.get(int(line), "") for line in table.rows]
    with atomic_path(path) as temporary, open(temporary, "w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(columns)
        for row in zip(*columns.values(), strict=True):
            writer.writerow([_cell(value) for value in row])


def _header(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if unit else name


def _cell(value: Any) -> Any:
    if isinstance(value, (float, np.floating)):
        return f"{value:.9g}" if np.isfinite(value) else ""
    return value


def next_study(folder: Path, study: Study, diagnosis: Diagnosis) -> dict[str, Any]:
    """The study with the effect switched on, as its TOML file holds it.

    Measured parameters keep their measured values: the fit's shift is within what was measured,
    and stands in ``diagnosis.json``. Free ones start from the fit.
    """
    data: dict[str, Any] = {"response": study.response}
    if study.table.file is not None:
        data["file"] = os.path.relpath(study.table.file.resolve(), folder.resolve())
    if study.group:
        data["group"] = list(study.group)
    if study.replicate:
        data["replicate"] = study.replicate
    if study.labels:
        data["labels"] = list(study.labels)
    parameters: dict[str, Any] = {}
    for name, item in study.parameters.items():
        entry: dict[str, Any] = {"value": item.value}
        if item.free:
            entry = {"value": diagnosis.parameters[name].after, "free": True}
        elif item.sd > 0.0:
            entry["sd"] = item.sd
        parameters[name] = entry
    noise: dict[str, Any] = {}
    if study.noise.relative is not None:
        noise["relative"] = study.noise.relative
    if study.noise.systematic:
        noise["systematic"] = dict(study.noise.systematic)
    options: dict[str, Any] = {
        "alpha": study.options.alpha,
        "seed": study.options.seed,
        "holdout": study.options.holdout,
    }
    if study.options.candidates is not None:
        on = set(diagnosis.model.get("effects", {}))
        options["candidates"] = [c for c in study.options.candidates if c not in on]
    content: dict[str, Any] = {"data": data}
    if noise:
        content["noise"] = noise
    content["model"] = _paths(dict(diagnosis.model), study, folder)
    if diagnosis.closures:
        old = content["model"].get("terms", [])
        content["model"]["terms"] = [*old, *(f"{c.name}.json" for c in diagnosis.closures)]
    if parameters:
        content["parameters"] = parameters
    content["options"] = options
    return content


def _paths(model: dict[str, Any], study: Study, folder: Path) -> dict[str, Any]:
    """Files that the model names, seen from the folder of the results."""
    base = Path(study.model.folder).resolve()
    if isinstance(model.get("file"), str):
        model["file"] = os.path.relpath(base / model["file"], folder.resolve())
    if "terms" in model:
        model["terms"] = [os.path.relpath(base / t, folder.resolve()) for t in model["terms"]]
    if isinstance(model.get("function"), str):
        model["folder"] = os.path.relpath(base / str(model.get("folder", ".")), folder.resolve())
    return _without_none(model)


def _without_none(table: Mapping[str, Any]) -> dict[str, Any]:
    return {
        key: _without_none(value) if isinstance(value, Mapping) else value
        for key, value in table.items()
        if value is not None
    }
