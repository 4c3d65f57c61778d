"""The page of a diagnosis: verdict, errors before and after, residuals, rivals, limits."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from greybed._version import __version__
from greybed.report.elements import (
    NOTHING,
    Block,
    Cell,
    Figure,
    Figures,
    Page,
    Section,
    Text,
    Tone,
    Verdict,
    count,
    duration,
    number,
    percent,
    table,
)
from greybed.report.residual_figures import (
    error_bars_figure,
    parity_before_after,
    ranking_figure,
    residual_figure,
    rivals_figure,
)
from greybed.residual import Diagnosis, Study
from greybed.residual.diagnosis import Score

MOST_FIGURES = 8
TONES: dict[str, Tone] = {
    "none": "good",
    "effect": "good",
    "ambiguous": "muted",
    "unknown": "muted",
    "suspect-data": "bad",
    "not-identifiable": "muted",
}
TITLES = {
    "none": "Nothing is missing",
    "effect": "A named effect is missing",
    "ambiguous": "Something is missing; the data cannot tell what",
    "unknown": "Something outside the catalogue is missing",
    "suspect-data": "The data are suspect",
    "not-identifiable": "These data cannot show the effects",
}


def write_page(study: Study, found: Diagnosis, path: str | os.PathLike[str]) -> Path:
    """Write the report of a diagnosis.

    Parameters
    ----------
    study : Study
        What was asked.
    found : Diagnosis
        The answer.
    path : path
        HTML file.

    Returns
    -------
    Path
        The file; self-contained.
    """
    sections = (
        _errors(found),
        _effects(found),
        _rivals(found),
        _detectable(found),
        _residuals(study, found),
        _ranking(found),
        _budget(found),
        _not_judged(found),
    )
    name = study.file.name if study.file else "study"
    page = Page(
        f"{TITLES[found.verdict]}: {study.model.name}",
        found.sentence,
        _verdicts(study, found),
        tuple(section for section in sections if section is not None),
        f"greybed {__version__} · {name} · seed {study.options.seed} · "
        f"{count(len(study.table), 'row')} · {duration(found.seconds)}",
    )
    return page.write(path)


def _verdicts(study: Study, found: Diagnosis) -> tuple[Verdict, ...]:
    error = found.error
    chance = "p ≤ " if found.p_value <= 1.5e-3 else "p = "
    return (
        Verdict(found.verdict, "verdict", TONES[found.verdict]),
        Verdict(
            f"{number(error.base.value)} → {number(error.with_effect.value)}",
            f"{error.metric} on rows that helped with nothing: {error.holdout}",
        ),
        Verdict(
            f"{chance}{number(found.p_value, 2)}",
            "chance that a complete model shows as much structure by accident (family-wise over "
            f"all candidates; called missing at {number(found.alpha, 2)})",
        ),
    )


def _score(score: Score) -> list[Cell | str]:
    low, high = score.ci95
    return [number(score.value), f"{number(low)} to {number(high)}"]


def _errors(found: Diagnosis) -> Section:
    error = found.error
    rows: list[list[Cell | str]] = [
        ["base model as given", *_score(error.base)],
        ["base model, parameters fitted anew", *_score(error.recalibrated)],
        ["base model and a Gaussian process over the residual", *_score(error.gp_discrepancy)],
        ["model with what was found", *_score(error.with_effect)],
        ["ratio of the last to the first", *_score(error.ratio)],
    ]
    shifts: list[list[Cell | str]] = [
        [
            name.replace("_", " "),
            number(s.before, 4),
            number(s.after, 4),
            "calibrated" if s.free else "measured",
            number(s.sd, 2),
            number(s.shift_sd, 2),
        ]
        for name, s in found.parameters.items()
    ]
    blocks: list[Block] = [
        Figures((Figure("Errors on held-out rows", "", error_bars_figure(found)),)),
        table(("model", error.metric, "95 %"), rows),
    ]
    if shifts:
        blocks.append(
            table(
                ("parameter", "before [SI]", "after [SI]", "it was", "sd", "shift in sd"),
                shifts,
                words=(0, 3),
                caption="Parameters before and after.",
            )
        )
    lead = (
        f"Every figure is for rows that were not used to choose or to fit: {error.holdout}; "
        "intervals come from resampled groups."
    )
    return Section("errors", "Error before and after", lead, tuple(blocks))


def _effects(found: Diagnosis) -> Section | None:
    blocks: list[Block] = []
    if found.effects:
        rows: list[list[Cell | str]] = [
            [
                e.name,
                number(e.amplitude),
                f"{number(e.ci95[0])} to {number(e.ci95[1])}",
                number(e.theory),
                number(e.p_value, 2),
            ]
            for e in found.effects
        ]
        blocks.append(
            table(("effect", "amplitude", "95 % from the data alone", "theory", "p"), rows)
        )
    if found.depends_on:
        rows = [
            [
                d.covariate.replace("_", " "),
                number(d.exponent),
                f"{number(d.ci95[0])} to {number(d.ci95[1])}",
                f"{number(d.window[0])} to {number(d.window[1])}",
            ]
            for d in found.depends_on
        ]
        blocks.append(
            table(("covariate", "exponent", "95 %", "window in which it shows [SI]"), rows)
        )
        blocks.append(
            Text(
                "This is a description, not a cause: the factor left over is 1 + a zⁿ. It can be "
                "run like an effect inside the window, and should be replaced by one."
            )
        )
    if found.suspect:
        blocks.append(
            Text(
                f"Rows with {found.suspect['label']} = {found.suspect['value']} are off together.",
                "Suspect.",
            )
        )
    if not blocks:
        return None
    return Section("found", "What was found", found.sentence, tuple(blocks))


def _rivals(found: Diagnosis) -> Section | None:
    if not found.rivals:
        return None
    blocks: list[Block] = []
    trial = found.experiment
    if trial:
        rows: list[list[Cell | str]] = [
            [
                name.replace("_", " "),
                f"{number(c['value'])} {c['unit']}".strip(),
                f"{number(c['in_data'][0])} to {number(c['in_data'][1])}",
            ]
            for name, c in trial["conditions"].items()
        ]
        blocks.append(Figures((Figure("At the proposed conditions", "", rivals_figure(found)),)))
        blocks.append(table(("condition", "measure at", "in these data [SI]"), rows))
        blocks.append(
            Text(
                f"There the rivals lie {number(trial['separation_sd'], 2)} standard deviations "
                "apart.",
                "The experiment that decides.",
            )
        )
    names = "; ".join(" + ".join(r) for r in found.rivals)
    lead = f"Within a factor 20 of each other in odds: {names}."
    return Section("rivals", "What the data cannot tell apart", lead, tuple(blocks))


def _detectable(found: Diagnosis) -> Section | None:
    effects = found.detectable.get("effects")
    if not effects:
        return None
    log = found.transform == "log"
    rows: list[list[Cell | str]] = [
        [
            name,
            number(item["amplitude"]),
            number(item["theory"]),
            percent(item["relative"]) if log else number(item["relative"]),
        ]
        for name, item in sorted(effects.items(), key=lambda pair: pair[1]["relative"])
    ]
    lead = "An effect of this size would have been called missing nine times in ten."
    block = table(("effect", "smallest amplitude", "theory", "rms change of the response"), rows)
    return Section("detectable", "What would have been seen", lead, (block,))


def _residuals(study: Study, found: Diagnosis) -> Section:
    unit = study.table.units.get(study.response, "")
    figures = [
        Figure("Predicted against measured", "", parity_before_after(found, study.response, unit))
    ]
    first = [d.covariate for d in found.depends_on]
    names = sorted(found.rows.covariates, key=lambda name: name not in first)
    for name in names[:MOST_FIGURES]:
        figures.append(
            Figure(f"Residual against {name.replace('_', ' ')}", "", residual_figure(found, name))
        )
    lead = "A complete model leaves a band without a course; the grey band is ± 2 random errors."
    more = len(names) - MOST_FIGURES
    blocks: list[Block] = [Figures(tuple(figures))]
    if more > 0:
        blocks.append(Text(f"{more} more covariates are in residuals.csv."))
    return Section("residuals", "Residuals before and after", lead, tuple(blocks))


def _ranking(found: Diagnosis) -> Section | None:
    if len(found.ranking) < 2:
        return None
    rows: list[list[Cell | str]] = [
        [
            Cell(" + ".join(r.names) or "nothing", "" if r.selectable else "muted"),
            ", ".join(number(a) for a in r.amplitudes) or NOTHING,
            number(r.log_odds),
            Cell(r.remark or "selectable", "" if r.selectable else "muted"),
        ]
        for r in found.ranking
    ]
    lead = (
        "Every set was fitted with its parameters and noise; the odds weigh the fit, what theory "
        "says of the amplitudes, and how many effects it takes."
    )
    return Section(
        "ranking",
        "Candidates",
        lead,
        (
            Figures((Figure("Odds", "", ranking_figure(found)),)),
            table(("set", "amplitudes", "log odds", "remark"), rows, words=(0, 3)),
        ),
    )


def _budget(found: Diagnosis) -> Section:
    noise = found.noise
    rows: list[list[Cell | str]] = [
        ["random, per row", number(noise.get("random"))],
        ["stated", number(noise.get("stated_random"))],
        ["shared in a group, beyond what was stated", number(noise.get("group"))],
        ["systematic, from the stated errors of columns", number(noise.get("systematic"))],
    ]
    blocks: list[Block] = [table(("standard deviation", found.error.metric[8:]), rows)]
    blocks += [Text(remark) for remark in found.remarks]
    return Section(
        "noise", "Noise and remarks", "What the residual was weighed against.", tuple(blocks)
    )


def _not_judged(found: Diagnosis) -> Section | None:
    rows: list[list[Cell | str]] = [
        [name, "not identifiable", reason] for name, reason in found.not_identifiable.items()
    ]
    rows += [[name, "not a candidate", reason] for name, reason in found.unavailable.items()]
    blocks: list[Block] = []
    if rows:
        blocks.append(table(("effect", "", "why"), rows, words=(0, 1, 2)))
    if found.left_out:
        left: list[list[Any]] = [[str(i["row"]), str(i["reason"])] for i in found.left_out]
        blocks.append(table(("line", "left out because"), left, words=(1,)))
    if not blocks:
        return None
    return Section("limits", "What was not judged", "", tuple(blocks))
