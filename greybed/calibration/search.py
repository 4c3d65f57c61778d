"""A search under way: the study, the campaign of runs, and how strategies ask for runs."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed.calibration.metamodel import Metamodel
from greybed.calibration.runs import Campaign, Job
from greybed.calibration.store import Outcome
from greybed.calibration.study import Study

Array = NDArray[np.float64]

# From this many runs on, hyperparameters are looked for anew only after a tenth more of them.
_ALWAYS_TUNE = 40


@dataclass
class Search:
    """What strategies work with.

    Attributes
    ----------
    study : Study
        What is asked.
    campaign : Campaign
        Makes the runs and keeps them.
    notes : list of str
        What the report should say about how runs were chosen.
    extra : dict
        Results of a strategy itself, such as an ANOVA table.
    trace : list of dict
        State after each fit: runs, best point.
    axes : tuple of int or None
        Axes that responses depend on, where a screening has found them.
    """

    study: Study
    campaign: Campaign
    notes: list[str] = field(default_factory=list)
    extra: dict[str, Any] = field(default_factory=dict)
    trace: list[dict[str, Any]] = field(default_factory=list)
    axes: tuple[int, ...] | None = None
    model: Metamodel | None = None
    _tuned_at: int = 0

    @property
    def left(self) -> int:
        """Runs that may still be made [-]."""
        return self.study.options.runs - self.campaign.spent

    def job(self, experiment: str, u: Array, replicate: int = 0) -> Job:
        """The run of an experiment at a point of the cube."""
        return Job(experiment, tuple(self.study.space.named(u).items()), replicate)

    def make(self, wanted: Iterable[tuple[str, Array, int]]) -> list[Outcome]:
        """Finish runs (experiment, point, replicate), as many as are left."""
        jobs = [self.job(*item) for item in wanted][: max(self.left, 0)]
        return self.campaign.make(jobs)

    def everywhere(self, points: Array, replicates: int = 1) -> list[Outcome]:
        """Run all calibration experiments at points; only whole points while runs last."""
        names = self.study.with_role("calibration")
        each = len(names) * replicates
        points = points[: max(self.left // each, 0)]
        return self.make((n, u, r) for u in points for n in names for r in range(replicates))

    def fit(self, *, anew: bool = False) -> Metamodel:
        """Surrogates of all runs so far; ``anew`` forgets where earlier fits ended."""
        runs = self.campaign.spent
        tune = runs <= _ALWAYS_TUNE or runs >= 1.1 * self._tuned_at
        if tune:
            self._tuned_at = runs
        before = None if anew else self.model
        self.model = Metamodel(
            self.study, self.campaign.finished, before, tune=tune or anew, axes=self.axes
        )
        return self.model

    def first_points(self) -> int:
        """Points of the first design [-]."""
        o = self.study.options
        if o.initial:
            return o.initial
        each = len(self.study.with_role("calibration")) * o.replicates
        return max(min(max(6, 3 * len(self.study.space)), o.runs // each), 1)
