"""What every ``[[experiment]]`` of a study has, and the kinds that stand for others."""

from __future__ import annotations

import difflib
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from greybed.calibration.experiment import Experiment, Measure
from greybed.calibration.experiments.case import CaseExperiment
from greybed.calibration.experiments.command import CommandExperiment
from greybed.calibration.experiments.python import PythonExperiment
from greybed.calibration.study import ROLES
from greybed.calibration.twins import (
    DrawDownTwin,
    DropTwin,
    DrumTwin,
    FunnelTwin,
    HeapTwin,
    HopperTwin,
)
from greybed.core.config import choice, plain, quantity, whole
from greybed.core.errors import InputError

TWINS: dict[str, Any] = {
    "draw-down": DrawDownTwin, "heap": HeapTwin, "hopper": HopperTwin, "drop": DropTwin,
    "funnel": FunnelTwin, "drum": DrumTwin,
}  # fmt: skip
_MEASURE = ("unit", "kind", "what", "takes", "source")


@dataclass(frozen=True, kw_only=True)
class Listed(ABC):
    """Keys of every ``[[experiment]]``."""

    name: str
    role: str = choice(ROLES, "calibration")
    group: int = whole(0, at_least=0)  # of parameters, in a sequential calibration; 0: all
    effort: float = quantity("dimensionless", 1.0, above=0.0)  # cost of the real test [-]
    relative_cost: float = quantity("dimensionless", 1.0, above=0.0)  # of a simulation [-]
    errors: Mapping[str, Any] | None = plain(
        None
    )  # of a candidate: measure -> error that it would have

    @abstractmethod
    def experiment(self, folder: Path) -> Experiment:
        """The experiment itself; ``folder`` is where relative paths start."""

    def files(self) -> tuple[Path, ...]:
        """Files that it names."""
        return ()


COMMON = tuple(f.name for f in fields(Listed))


def measures_of(
    name: str, table: Any, needs_source: bool
) -> tuple[dict[str, Measure], dict[str, str]]:
    """Measures of ``[experiment.measures]`` and their sources."""
    place = f"experiment {name!r}: measures"
    if not isinstance(table, Mapping) or not table:
        raise InputError(f'{place} must be a table, such as angle = {{ unit = "deg" }}.')
    made: dict[str, Measure] = {}
    sources: dict[str, str] = {}
    for key, entry in table.items():
        entry = {"source": entry} if isinstance(entry, str) else entry
        if not isinstance(entry, Mapping):
            raise InputError(f"{place}.{key} = {entry!r} must be a table with unit and kind.")
        for word in entry:
            if word not in _MEASURE:
                near = difflib.get_close_matches(str(word), _MEASURE, n=1, cutoff=0.5)
                hint = f"did you mean {near[0]!r}?" if near else f"known: {', '.join(_MEASURE)}."
                raise InputError(f"{place}.{key}.{word} is not a known key; {hint}")
        source = str(entry.get("source", ""))
        kind = entry.get("kind", "signal" if source.startswith("history.") else "scalar")
        if kind not in ("scalar", "signal"):
            raise InputError(f"{place}.{key}.kind = {kind!r} must be 'scalar' or 'signal'.")
        if needs_source and not source:
            raise InputError(
                f"{place}.{key}.source is missing; give 'results.KEY' or 'history.COLUMN'."
            )
        takes = entry.get("takes")
        made[str(key)] = Measure(
            name=str(key), unit=str(entry.get("unit", "")), kind=kind,
            what=str(entry.get("what", "")), takes=None if takes is None else tuple(takes),
        )  # fmt: skip
        sources[str(key)] = source
    return made, sources


def _words(name: str, key: str, value: Any) -> tuple[str, ...] | None:
    if value is None:
        return None
    if not isinstance(value, list) or not all(isinstance(v, str) for v in value):
        raise InputError(f"experiment {name!r}: {key} = {value!r} must be a list of strings.")
    return tuple(value)


@dataclass(frozen=True, kw_only=True)
class PythonTable(Listed):
    """``kind = "python"``."""

    function: str
    measures: Mapping[str, Any] = plain()
    parameters: tuple[str, ...] | None = plain(None)
    settings: Mapping[str, Any] | None = plain(None)

    def experiment(self, folder: Path) -> Experiment:
        """See :meth:`Listed.experiment`."""
        measures, _ = measures_of(self.name, self.measures, False)
        takes = _words(self.name, "parameters", self.parameters)
        return PythonExperiment(self.name, self.function, measures, folder, takes, self.settings)


@dataclass(frozen=True, kw_only=True)
class CommandTable(Listed):
    """``kind = "command"``."""

    command: tuple[str, ...] = plain()
    measures: Mapping[str, Any] = plain()
    parameters: tuple[str, ...] | None = plain(None)
    settings: Mapping[str, Any] | None = plain(None)
    limit: float = quantity("time", 3600.0, above=0.0)  # [s]

    def experiment(self, folder: Path) -> Experiment:
        """See :meth:`Listed.experiment`."""
        measures, _ = measures_of(self.name, self.measures, False)
        takes = _words(self.name, "parameters", self.parameters)
        words = _words(self.name, "command", self.command) or ()
        return CommandExperiment(
            self.name, words, measures, folder, takes, self.settings, self.limit
        )


@dataclass(frozen=True, kw_only=True)
class CaseTable(Listed):
    """``kind = "case"``."""

    file: Path
    inputs: Mapping[str, Any] = plain()
    measures: Mapping[str, Any] = plain()

    def experiment(self, folder: Path) -> Experiment:
        """See :meth:`Listed.experiment`."""
        measures, sources = measures_of(self.name, self.measures, True)
        if not isinstance(self.inputs, Mapping):
            raise InputError(
                f"experiment {self.name!r}: inputs must be a table: parameter = ['key.of.case']."
            )
        inputs = {
            str(k): _words(self.name, f"inputs.{k}", [v] if isinstance(v, str) else v) or ()
            for k, v in self.inputs.items()
        }
        return CaseExperiment(self.name, self.file, inputs, measures, sources)

    def files(self) -> tuple[Path, ...]:
        """See :meth:`Listed.files`."""
        return (self.file,)


@dataclass(frozen=True, kw_only=True)
class TwinTable(Listed):
    """``kind = "twin"``: an analytic stand-in, to try a study before it costs anything."""

    twin: str = choice(tuple(TWINS))
    noise: float = quantity("dimensionless", 1.0, at_least=0.0)  # of replicates [-]

    def experiment(self, folder: Path) -> Experiment:
        """See :meth:`Listed.experiment`."""
        made: Experiment = TWINS[self.twin](self.name, noise=self.noise)
        return made
