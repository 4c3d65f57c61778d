"""Runs a case with changes and gives a named output; what is run once is kept."""

from __future__ import annotations

import hashlib
import json
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from greybed._version import __version__
from greybed.core.config import build
from greybed.core.errors import InputError
from greybed.core.files import atomic_path, sha256_of
from greybed.core.packing import Packing
from greybed.core.readers import read_packing
from greybed.coupling.case import ThermalCase, run_case, summary, view_factors
from greybed.coupling.rows import Rows
from greybed.residual.effect import Array, Columns, Effect


@dataclass(frozen=True)
class Switch:
    """An effect of a case: what it is, how the case file turns it on, when it cannot."""

    effect: Effect
    apply: Callable[[dict[str, Any], float], None]
    excluded: Callable[[Mapping[str, Any]], str | None]


class Runner(ABC):
    """One kind of case. DEM and CFD-DEM cases join by a class of their own.

    Parameters
    ----------
    path : Path
        The case file, from which relative paths start.
    output : str
        Dotted name of the result.
    cache : Path
        Folder for results, by the hash of everything that they depend on.
    """

    kind: ClassVar[str]
    paths: ClassVar[tuple[str, ...]]  # dotted keys that name files
    lacks: ClassVar[str] = "the case resolves no contacts in time"

    def __init__(self, path: Path, output: str, cache: Path) -> None:
        self.path, self.output, self.cache = path, output, cache

    @abstractmethod
    def simulate(self, content: dict[str, Any]) -> dict[str, Any]:
        """Run a case; all results by name."""

    @abstractmethod
    def switches(self) -> dict[str, Switch]:
        """Effects that the solver has."""

    @abstractmethod
    def reseed(self, content: dict[str, Any], seed: int) -> dict[str, Any]:
        """The case with another seed."""

    def run(self, content: dict[str, Any]) -> float:
        """The output of a case, from the cache where it was run before.

        Raises
        ------
        InputError
            If there is no such output, or it is not a number.
        """
        entry = self.cache / f"{self._hash(content)}.json"
        try:
            results = json.loads(entry.read_text())
        except (OSError, ValueError):
            results = self.simulate(content)
            try:
                self.cache.mkdir(parents=True, exist_ok=True)
                with atomic_path(entry) as temporary:
                    temporary.write_text(json.dumps(results))
            except OSError:
                pass  # a read-only folder costs time, not results
        return _number(results, self.output, self.path)

    def _hash(self, content: Mapping[str, Any]) -> str:
        files = []
        for key in self.paths:
            part: Any = content
            for name in key.split("."):
                part = part.get(name) if isinstance(part, Mapping) else None
            if isinstance(part, str):
                files.append(sha256_of(self.path.parent / part))
        text = json.dumps([__version__, self.kind, files, content], sort_keys=True, default=str)
        return hashlib.sha256(text.encode()).hexdigest()[:32]

    def relocate(self, content: dict[str, Any]) -> None:
        """Make the paths in a case absolute."""
        for key in self.paths:
            *front, last = key.split(".")
            part: Any = content
            for name in front:
                part = part.get(name, {})
            if isinstance(part.get(last), str):
                part[last] = str((self.path.parent / part[last]).resolve())


def _number(results: Mapping[str, Any], output: str, path: Path) -> float:
    here: Any = results
    for part in output.split("."):
        here = here.get(part) if isinstance(here, Mapping) else None
    if isinstance(here, Mapping) and all(isinstance(v, (int, float)) for v in here.values()):
        here = sum(here.values())
    if isinstance(here, bool) or not isinstance(here, (int, float)) or not math.isfinite(here):
        known = ", ".join(_outputs(results))
        raise InputError(f"{path}: model.output = {output!r} is no number; outputs are {known}.")
    return float(here)


def _outputs(results: Mapping[str, Any], front: str = "") -> list[str]:
    names = []
    for key, value in results.items():
        if isinstance(value, Mapping):
            names += [f"{front}{key}", *_outputs(value, f"{front}{key}.")]
        elif isinstance(value, (int, float)) and not isinstance(value, bool):
            names.append(f"{front}{key}")
    return names


class ThermalRunner(Runner):
    """``kind = "thermal-bed"``: results as ``greybed simulate`` writes them."""

    kind = "thermal-bed"
    paths = ("packing.file", "radiation.closure")

    def __init__(self, path: Path, output: str, cache: Path) -> None:
        super().__init__(path, output, cache)
        self._traced: dict[tuple[Any, ...], tuple[Packing, Rows | None]] = {}

    def simulate(self, content: dict[str, Any]) -> dict[str, Any]:
        """Solve the bed; view factors are traced once for a seed."""
        case = build(ThermalCase, content, self.path)
        r = case.radiation
        key = (r.source, r.rays, r.seed, r.strength, str(r.closure), str(case.walls))
        if key not in self._traced:
            packing = read_packing(case.packing.file, walls=case.walls)
            self._traced[key] = packing, view_factors(case, packing)
        packing, rows = self._traced[key]
        bed, result = run_case(case, packing, rows)
        plain: dict[str, Any] = json.loads(json.dumps(summary(case, bed, result), default=float))
        return plain

    def reseed(self, content: dict[str, Any], seed: int) -> dict[str, Any]:
        """Another seed for the rays."""
        return {**content, "radiation": {**content.get("radiation", {}), "seed": seed}}

    def switches(self) -> dict[str, Switch]:
        """Radiation between the spheres, and a conductivity that falls with temperature."""
        return {
            "radiation": Switch(RADIATION, _radiate, _radiates),
            "solid-conductivity-temperature": Switch(PHONONS, _scatter, _scatters),
        }


def _inside(columns: Columns, amplitude: float) -> Array:
    """The solver has these effects itself."""
    raise AssertionError("effects of a case are switched in the case")


RADIATION = Effect(
    name="radiation",
    law="net radiation between spheres and walls, times A",
    source="view factors of the bed and its stated emissivity; A = 1 is physics",
    group="sigma d T^3 / k",
    theory=1.0,
    spread=0.15,
    low=0.1,
    high=4.0,
    stage="outcome",
    change=_inside,
    switch='radiation.source = "traced", radiation.strength = A',
)
PHONONS = Effect(
    name="solid-conductivity-temperature",
    law="conductivity of the spheres = stated * (T_ref / T)^A",
    source="phonon scattering: 1 / T above the Debye temperature (Eucken, 1911)",
    group="T / T_ref",
    theory=1.0,
    spread=0.3,
    low=0.15,
    high=2.0,
    stage="outcome",
    change=_inside,
    switch="material.conductivity_exponent = A",
)


def _radiate(content: dict[str, Any], amplitude: float) -> None:
    table = content.setdefault("radiation", {})
    if table.get("source", "off") == "off":
        table["source"] = "traced"
    table["strength"] = amplitude


def _radiates(content: Mapping[str, Any]) -> str | None:
    source = content.get("radiation", {}).get("source", "off")
    return None if source == "off" else f"the case has it (radiation.source = {source!r})"


def _scatter(content: dict[str, Any], amplitude: float) -> None:
    content["material"]["conductivity_exponent"] = amplitude


def _scatters(content: Mapping[str, Any]) -> str | None:
    if content.get("material", {}).get("conductivity_exponent", 0.0) != 0.0:
        return "the case has it (material.conductivity_exponent)"
    if content.get("solve", {}).get("mode", "steady") != "steady":
        return "it works in steady cases only"
    return None
