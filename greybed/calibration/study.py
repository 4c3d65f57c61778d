"""A study of calibration: parameters, experiments with their roles, measured data, strategy."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from greybed.calibration.experiment import Experiment
from greybed.calibration.parameters import Space
from greybed.core.errors import InputError

Array = NDArray[np.float64]

ROLES = ("calibration", "candidate", "validation", "process")
STRATEGIES = ("response-surface", "direct-cma", "direct-bayes", "sequential", "screening")
SURROGATES = ("gp", "quadratic", "forest", "mlp")


@dataclass(frozen=True, kw_only=True)
class Target:
    """A measured number or curve with its error.

    Attributes
    ----------
    experiment, measure : str
        What was measured.
    value : ndarray (k,)
        The numbers, in the unit of the measure; one of a scalar.
    sd : ndarray (k,)
        Their standard deviations.
    at : ndarray (k,) or None
        Places or times of a curve.
    correlation : float
        Distance along ``at`` over which errors of a curve are alike; 0 for independent ones.
    single : bool
        The value is of one test, whose own scatter ``sd`` does not hold: that of the simulation's
        replicates is added.
    """

    experiment: str
    measure: str
    value: Array
    sd: Array
    at: Array | None = None
    correlation: float = 0.0
    single: bool = False

    def __post_init__(self) -> None:
        me = f"data of {self.experiment}.{self.measure}"
        if not (self.value.shape == self.sd.shape == np.shape(self.value.ravel())):
            raise InputError(f"{me}: value and sd must be equally long; mend them.")
        if not np.isfinite(self.value).all():
            raise InputError(f"{me}: a value is not finite; mend it.")
        if not (np.isfinite(self.sd) & (self.sd > 0.0)).all():
            worst = float(np.min(self.sd))
            raise InputError(
                f"{me}: sd = {worst:g} must be above 0; give the error of the measurement, such as "
                "the standard deviation of repeats."
            )
        if self.at is not None and (self.at.shape != self.value.shape or len(self.at) < 3):
            raise InputError(
                f"{me}: a curve needs at least 3 places, values and sds, as many each."
            )
        if self.at is not None and not (np.diff(self.at) > 0.0).all():
            raise InputError(f"{me}: the places of a curve must increase; sort them.")

    @property
    def label(self) -> str:
        """Experiment and measure."""
        return f"{self.experiment}.{self.measure}"

    @property
    def covariance(self) -> Array:
        """Of the measurement, shape (k, k)."""
        if self.at is None or self.correlation <= 0.0:
            return np.diag(self.sd**2)
        apart = np.abs(self.at[:, None] - self.at) / self.correlation
        return np.asarray(np.outer(self.sd, self.sd) * np.exp(-apart))


@dataclass(frozen=True, kw_only=True)
class Options:
    """How a study is run.

    Attributes
    ----------
    strategy, surrogate, design : str
        Names, as in the documentation.
    runs : int
        Runs to spend on the experiments that are fitted to [-].
    others : int
        Runs of each candidate, process and validation experiment; 0 for three to a parameter and
        four more [-].
    initial : int
        Points of the first design; 0 for a number by the parameters [-].
    replicates : int
        Seeds at each point of the first design [-].
    seed : int
        Of everything that is drawn.
    batch : int
        Runs that are chosen together [-].
    workers : int
        Processes; 0 runs in this one [-].
    scheduler : str or None
        As of :func:`greybed.core.clusters.client_of`: an address, ``local``, a file of Slurm jobs.
    attempts : int
        Seeds that are tried where a run fails [-].
    cost_weight : float
        Weight of the logarithm of a run's work in the choice of the best set [-].
    stop : float
        The search ends before its runs are spent where surrogate errors are less than this share
        of the variance of every measure; 0 spends all [-].
    """

    strategy: str = "response-surface"
    surrogate: str = "gp"
    design: str = "lhs"
    runs: int = 40
    others: int = 0
    initial: int = 0
    replicates: int = 1
    seed: int = 1
    batch: int = 1
    workers: int = 0
    scheduler: str | None = None
    attempts: int = 3
    cost_weight: float = 0.0
    stop: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Study:
    """Everything that one calibration needs.

    Attributes
    ----------
    space : Space
        Parameters.
    experiments : mapping of str to Experiment
        By name.
    roles : mapping of str to str
        ``calibration``, ``candidate`` (a test that could be made next), ``validation`` (data that
        are not used to fit) or ``process`` (what the parameters are for).
    targets : tuple of Target
        Measured data, of calibration and validation experiments.
    stages : mapping of str to int
        Group of parameters that an experiment is for, in a sequential calibration; those that
        are not named are for all groups.
    planned : mapping of str to float
        Error that a measure of a candidate would have, by ``experiment.measure``.
    efforts : mapping of str to float
        Cost of making a real test again or for the first time, 1 by default [-].
    options : Options
        How.
    file : Path or None
        The study's file.
    inputs : tuple of Path
        Other files that it names.

    Raises
    ------
    InputError
        Where nothing could come out of it.
    """

    space: Space
    experiments: Mapping[str, Experiment]
    roles: Mapping[str, str]
    targets: tuple[Target, ...]
    stages: Mapping[str, int] = field(default_factory=dict)
    planned: Mapping[str, float] = field(default_factory=dict)
    efforts: Mapping[str, float] = field(default_factory=dict)
    options: Options = field(default_factory=Options)
    file: Path | None = None
    inputs: tuple[Path, ...] = ()

    def __post_init__(self) -> None:
        for target in self.targets:
            self._check_target(target)
        if not any(self.roles[t.experiment] == "calibration" for t in self.targets):
            raise InputError(
                "no data belong to an experiment with role 'calibration'; give [[data]] with "
                "measure, value and sd."
            )
        for name, role in self.roles.items():
            if role in ("calibration", "validation") and not self.targets_of(name):
                raise InputError(
                    f"experiment {name!r} has the role {role!r} and no data; give some, or make it "
                    "a 'candidate'."
                )
        for parameter in self.space.names:
            self._check_parameter(parameter)
        self._check_options()

    def _check_target(self, target: Target) -> None:
        if target.experiment not in self.experiments:
            raise InputError(
                f"data name the experiment {target.experiment!r}; there are "
                f"{', '.join(self.experiments)}."
            )
        experiment = self.experiments[target.experiment]
        if target.measure not in experiment.measures:
            raise InputError(
                f"experiment {target.experiment!r} cannot produce the measure {target.measure!r}; "
                f"it gives {', '.join(experiment.measures)}."
            )
        kind = experiment.measures[target.measure].kind
        if (kind == "signal") != (target.at is not None):
            how = "a file with at, value and sd" if kind == "signal" else "one value and sd"
            raise InputError(f"data of {target.label} are of a {kind}; give {how}.")
        if not any(experiment.responds(target.measure, name) for name in self.space.names):
            raise InputError(
                f"the measure {target.label} responds to no free parameter "
                f"({', '.join(self.space.names)}); remove its data, or free a parameter that moves "
                "it."
            )

    def _check_parameter(self, parameter: str) -> None:
        for name, experiment in self.experiments.items():
            if self.roles[name] != "process" and any(
                experiment.responds(measure, parameter) for measure in experiment.measures
            ):
                return
        raise InputError(
            f"parameter {parameter!r} reaches no experiment; fix it with a value, or add an "
            "experiment that responds to it."
        )

    def _check_options(self) -> None:
        o = self.options
        points = len(self.space) + 2
        least = points * len(self.with_role("calibration")) * o.replicates
        if o.strategy != "screening" and o.runs < least:
            raise InputError(
                f"runs = {o.runs} [-] must be at least {least}: two points more than there are "
                "free parameters, for each replicate and experiment that is fitted to."
            )
        if o.initial and not points <= o.initial:
            raise InputError(f"initial = {o.initial} [-] must be at least {points}, or 0.")
        if not math.isfinite(o.cost_weight) or o.cost_weight < 0.0:
            raise InputError(f"cost_weight = {o.cost_weight:g} [-] must be at least 0.")

    def targets_of(self, experiment: str) -> tuple[Target, ...]:
        """Data of an experiment."""
        return tuple(t for t in self.targets if t.experiment == experiment)

    def with_role(self, *roles: str) -> tuple[str, ...]:
        """Names of experiments with these roles, in the study's order."""
        return tuple(name for name in self.experiments if self.roles[name] in roles)
