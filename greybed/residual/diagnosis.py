"""The answer of a diagnosis, and how it is written as JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed.closures.term import GreyBoxTerm

Array = NDArray[np.float64]
VERDICTS = ("none", "effect", "ambiguous", "unknown", "suspect-data", "not-identifiable")


@dataclass(frozen=True, kw_only=True)
class FoundEffect:
    """An effect that the model lacks, with its amplitude in the units of its law."""

    name: str
    amplitude: float
    ci95: tuple[float, float]
    theory: float | None
    p_value: float


@dataclass(frozen=True, kw_only=True)
class Dependence:
    """A dependence outside the catalogue: the factor left over is 1 + a covariate^exponent."""

    covariate: str
    exponent: float
    ci95: tuple[float, float]
    window: tuple[float, float]  # of the covariate, SI


@dataclass(frozen=True, kw_only=True)
class Score:
    """A figure with its 95 % interval."""

    value: float
    ci95: tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Errors:
    """Error on held-out rows, none of which helped to choose the effect."""

    metric: str  # such as "rmse of log velocity"
    holdout: str  # such as "leave one group out (9 groups of diameter)"
    base: Score
    recalibrated: Score
    with_effect: Score
    gp_discrepancy: Score
    ratio: Score


@dataclass(frozen=True, kw_only=True)
class Shift:
    """A parameter before and after, the shift in units of its standard deviation."""

    before: float
    after: float
    sd: float  # measured sd; for a free parameter its standard error after the fit
    shift_sd: float
    free: bool


@dataclass(frozen=True, kw_only=True)
class Ranked:
    """One set of effects as an explanation."""

    names: tuple[str, ...]
    amplitudes: tuple[float, ...]
    log_odds: float  # against the best set, natural logarithm, at most 0
    selectable: bool
    remark: str


@dataclass(frozen=True, kw_only=True)
class Rows:
    """What plots and residuals.csv show, each of shape (n,), in the order of the table."""

    measured: Array
    base: Array
    with_effect: Array  # fitted to all rows
    held_out: Array  # predicted without the row's own group; NaN where the row was left out
    residual_before: Array  # in the transformed response
    residual_after: Array
    sd: Array  # random standard deviation in the transformed response
    used: NDArray[np.bool_]
    group: NDArray[np.int64]
    covariates: Mapping[str, Array]
    units: Mapping[str, str]


@dataclass(frozen=True, kw_only=True)
class Diagnosis:
    """What is missing from the model, what it costs, and how sure that is."""

    verdict: str
    sentence: str
    effects: tuple[FoundEffect, ...] = ()
    rivals: tuple[tuple[str, ...], ...] = ()
    experiment: Mapping[str, Any] | None = None
    depends_on: tuple[Dependence, ...] = ()
    closures: tuple[GreyBoxTerm, ...] = ()  # of the dependences, to run and to export
    suspect: Mapping[str, str] | None = None  # {"label": ..., "value": ...}
    error: Errors
    parameters: Mapping[str, Shift] = field(default_factory=dict)
    detectable: Mapping[str, Any] = field(default_factory=dict)
    p_value: float  # that nothing is missing
    alpha: float
    ranking: tuple[Ranked, ...] = ()
    not_identifiable: Mapping[str, str] = field(default_factory=dict)
    unavailable: Mapping[str, str] = field(default_factory=dict)
    noise: Mapping[str, float] = field(default_factory=dict)
    left_out: tuple[Mapping[str, Any], ...] = ()
    remarks: tuple[str, ...] = ()
    transform: str = "log"
    model: Mapping[str, Any] = field(default_factory=dict)  # [model] with the effect switched on
    case: Mapping[str, Any] | None = None  # the simulation case with the effect switched on
    rows: Rows
    seconds: float

    def to_json(self) -> dict[str, Any]:
        """The content of ``diagnosis.json``: all but the rows, numbers finite or null."""
        return {
            name: _plain(getattr(self, name))
            for name in self.__dataclass_fields__
            if name not in ("rows", "model", "case", "closures")
        }


def _plain(value: Any) -> Any:
    if hasattr(value, "__dataclass_fields__"):
        return {name: _plain(getattr(value, name)) for name in value.__dataclass_fields__}
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value
