"""One group of parameters after another, each with the tests that are made for it.

The order that experts recommend (Katterfeld et al. 2019, as told in source paper 001): what single
particles show first (density, stiffness, restitution, friction on walls), then sliding and rolling
friction from bulk tests, cohesion last. Parameters of other groups stay at their best values so
far, and at the middle of their ranges before that. What is left of the runs goes to all groups
together, so that the answer holds the trade-offs between them, too.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from greybed.calibration.best import best_point
from greybed.calibration.parameters import Parameter, Space
from greybed.calibration.search import Search
from greybed.calibration.strategies.surface import refine, response_surface
from greybed.calibration.study import Study
from greybed.core.errors import InputError

# Share of the runs that the groups get; the rest is for all of them together.
_GROUPS = 0.6


def sequential(search: Search) -> None:
    """Calibrate the groups of a study's parameters in their order.

    Raises
    ------
    InputError
        If a group has no experiment that responds to it, or too few runs.
    """
    study = search.study
    groups = sorted({p.group for p in study.space.free})
    at = dict(zip(study.space.names, study.space.values(np.full(len(study.space), 0.5))[0].tolist(),
                  strict=True))  # fmt: skip
    share = int(_GROUPS * study.options.runs / len(groups))
    for group in groups:
        stage = _stage(study, group, at, share)
        part = Search(stage, replace(search.campaign, finished=[], made=0, found=0, seconds=0.0))
        response_surface(part)
        model = part.fit()
        best = stage.space.named(best_point(model, study.options.seed))
        names = stage.space.names
        at.update({name: best[name] for name in names})
        search.campaign.finished += part.campaign.finished
        search.campaign.made += part.campaign.made
        search.campaign.found += part.campaign.found
        search.campaign.seconds += part.campaign.seconds
        found = ", ".join(f"{name} = {best[name]:.4g}" for name in names)
        search.notes.append(
            f"Group {group}: {found}, from {part.campaign.spent} runs of "
            f"{', '.join(stage.with_role('calibration'))}."
        )
    refine(search)


def _stage(study: Study, group: int, at: dict[str, float], runs: int) -> Study:
    """The study of one group: its parameters free, the others fixed."""
    parameters = [
        p if p.free and p.group == group
        else p if not p.free
        else Parameter(name=p.name, value=float(f"{at[p.name]:.12g}"))
        for p in study.space.parameters
    ]  # fmt: skip
    space = Space(parameters)
    names = [
        name
        for name in study.with_role("calibration")
        if study.stages.get(name, group) == group
        and any(
            study.experiments[name].responds(t.measure, p)
            for t in study.targets_of(name)
            for p in space.names
        )
    ]
    if not names:
        raise InputError(
            f"group {group} ({', '.join(space.names)}) has no experiment with data that respond to "
            "it; change the groups, or add data."
        )
    least = len(space) + 2
    if runs < least * len(names):
        raise InputError(
            f"group {group} has {runs} runs for {len(names)} experiments and needs "
            f"{least * len(names)}; raise runs."
        )
    return Study(
        space=space,
        experiments={name: study.experiments[name] for name in names},
        roles=dict.fromkeys(names, "calibration"),
        targets=tuple(
            t for t in study.targets
            if t.experiment in names
            and any(study.experiments[t.experiment].responds(t.measure, p) for p in space.names)
        ),
        options=replace(study.options, strategy="response-surface", runs=runs, initial=0),
    )  # fmt: skip
