"""The page of a calibration: verdict, posterior, bands, errors, sensitivities, advice."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from greybed._version import __version__
from greybed.calibration import Answer, Study
from greybed.calibration.isolines import WIDTH, bands
from greybed.report.calibration_figures import (
    advice_figure,
    band_figure,
    budget_figure,
    curve_figure,
    overlap_figure,
    pair_figure,
    posterior_figure,
    sensitivity_figure,
)
from greybed.report.elements import (
    Block,
    Cell,
    Commands,
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

TONES: dict[str, Tone] = {"determined": "good", "one-sided": "muted", "open": "bad"}
MOST_BANDS = 8
Row = list[Cell | str]


def write_page(study: Study, found: Answer, path: str | os.PathLike[str]) -> Path:
    """Write the report of a calibration.

    Parameters
    ----------
    study : Study
        What was asked.
    found : Answer
        The answer.
    path : path
        HTML file.

    Returns
    -------
    Path
        The file; self-contained.
    """
    sections = (
        _parameters(study, found),
        _bands(study, found),
        _directions(found),
        _advice(study, found),
        _fit(study, found),
        _budget(study, found),
        _sensitivities(study, found),
        _transfer(found),
        _notes(found),
    )
    name = study.file.name if study.file else "study"
    page = Page(
        _title(found),
        found.sentence,
        _verdicts(found),
        tuple(section for section in sections if section is not None),
        f"greybed {__version__} · {name} · {study.options.strategy} · seed {study.options.seed} · "
        f"{count(found.runs, 'run')} · {duration(found.seconds)}",
    )
    return page.write(path)


def _title(found: Answer) -> str:
    if not found.fits:
        return "No parameter set fits the data"
    if found.open_directions:
        return f"{count(len(found.open_directions), 'direction')} left open by the data"
    return "The data determine the parameters"


def _verdicts(found: Answer) -> tuple[Verdict, ...]:
    n = len(found.directions)
    known = n - len(found.open_directions)
    first = Verdict(
        f"{known} of {n}", "directions of the parameters that the data determine",
        "good" if known == n else "muted",
    )  # fmt: skip
    p = found.p_value
    second = Verdict(
        "fits" if found.fits else "does not fit",
        f"χ² {number(found.chi2)} for {number(found.freedom, 2)} degrees of freedom"
        + (f", p = {number(p, 2)}" if p is not None else "; too few data to test it"),
        "good" if found.fits else "bad",
    )
    worst = min(found.quality, key=lambda q: q.cop)
    third = Verdict(
        f"CoP {number(worst.cop)}",
        f"lowest coefficient of prognosis of a surrogate, ± {number(worst.cop_sd, 1)} "
        f"({worst.label.replace('_', ' ')})",
    )
    return first, second, third


def _parameters(study: Study, found: Answer) -> Section:
    ends = found.posterior.interval()
    low, high = (study.space.values(ends[:, k][None])[0] for k in range(2))
    rows: list[Row] = [
        [
            v.name.replace("_", " "),
            number(found.best[v.name], 4),
            f"{number(low[k])} to {number(high[k])}",
            Cell(v.word, TONES[v.word]),
            percent(v.shrink),
        ]
        for k, v in enumerate(found.verdicts)
    ]
    pair = _pair(found)
    figures = [Figure("Posterior over the ranges", "Bar: 90 %. Dot: best set.",
                      posterior_figure(study, found))]  # fmt: skip
    if pair is not None:
        figures.append(Figure("The two that matter most", "", pair_figure(study, found, pair)))
    blocks: list[Block] = [
        table(("parameter", "best [SI]", "90 % [SI]", "verdict", "sd of that before"), rows,
              words=(0, 3)),
        Figures(tuple(figures)),
    ]  # fmt: skip
    if study.space.fixed:
        fixed = ", ".join(f"{k.replace('_', ' ')} {number(v)}" for k, v in
                          study.space.fixed.items())  # fmt: skip
        blocks.append(Text(f"{fixed}.", "Fixed:"))
    if found.cheapest is not None:
        named, share = found.cheapest
        words = ", ".join(f"{n.replace('_', ' ')} {number(named[n])}" for n in study.space.names)
        blocks.append(
            Text(
                f"{words}: χ² is larger by less than 1, and a run takes {percent(share)} of the "
                "work.",
                "As good and cheaper:",
            )
        )
    p = found.posterior
    lead = (
        f"{count(len(p.points), 'sample')} of the posterior, worth {number(round(p.effective))} "
        f"independent ones; R-hat {number(float(p.r_hat.max()), 4)} at most; "
        f"{count(p.modes(), 'connected part')} in the 90 % region."
    )
    return Section("parameters", "Parameters", lead, tuple(blocks))


def _pair(found: Answer) -> tuple[int, int] | None:
    """The two parameters that the calibration measures respond to most."""
    own = [e.response.label for e in found.model.emulators]
    total = np.sum([found.sobol_total[label] for label in own], axis=0)
    if len(total) < 2:
        return None
    first, second = sorted(int(k) for k in np.argsort(-total, kind="stable")[:2])
    return first, second


def _bands(study: Study, found: Answer) -> Section | None:
    pair = _pair(found)
    if pair is None:
        return None
    made = bands(found.model, found.best_point, pair)
    pictures = [
        Figure("Overlap of all measures",
               f"Lines: ± {WIDTH:g} sd of each measure; dark: all of them fit.",
               overlap_figure(study, found, made))
    ]  # fmt: skip
    for emulator in found.model.emulators[:MOST_BANDS]:
        r = emulator.response
        unit = study.experiments[r.experiment].measures[r.measure].unit
        title = f"{r.label.replace('_', ' ')}" + (f" [{unit}]" if unit else "")
        pictures.append(Figure(title, "", band_figure(study, found, made, r.label, unit)))
    o = found.overlap
    rows: list[Row] = [
        [label.replace("_", " "), percent(o.alone[label]), percent(o.without[label])]
        for label in o.alone
    ]
    rows.append([Cell("all of them", "ok"), percent(o.together), ""])
    others = "" if len(found.directions) == 2 else ", the other parameters at the best set"
    lead = (
        f"A band is where a measure lies within {WIDTH:g} standard deviations of measurement and "
        f"surrogate together{others}."
    )
    return Section(
        "bands",
        "Isolines and their overlap",
        lead,
        (
            Figures(tuple(pictures)),
            table(
                ("measure", "share of the ranges where it fits", "where all others fit"), rows,
                caption="Counted over all parameters. What a measure cuts away is the difference "
                "of the last column to the share of all of them.",
            ),
        ),
    )  # fmt: skip


def _directions(found: Answer) -> Section:
    rows: list[Row] = [
        [
            d.words.replace("_", " "),
            Cell("determined", "good") if d.determined else Cell("open", "bad"),
            number(d.information),
            percent(d.left),
        ]
        for d in found.directions
    ]
    lead = (
        "Combinations of parameters, in units of their prior widths, by what the data tell about "
        "them near the best set. An open one can be moved along without the measures noticing."
    )
    return Section(
        "directions",
        "What the data determine",
        lead,
        (
            table(("direction", "verdict", "information", "variance left"), rows, words=(0, 1)),
            *(Text(v.sentence) for v in found.verdicts),
        ),
    )


def _advice(study: Study, found: Answer) -> Section | None:
    if not found.next_tests:
        return None
    names = study.space.names
    rows: list[Row] = []
    for t in found.next_tests:
        most = int(np.argmin(t.left))
        rows.append([
            t.name.replace("_", " ") + (" once more" if t.repeat else ""),
            ", ".join(m.replace("_", " ") for m in t.measures),
            number(t.information), number(t.per_cost),
            f"{names[most].replace('_', ' ')}: {percent(float(t.left[most]))} of its sd",
        ])  # fmt: skip
    return Section(
        "next",
        "What to measure next",
        found.limits,
        (
            Figures((Figure("Information for the cost", "", advice_figure(found)),)),
            table(("test", "measures", "information [nat]", "for its cost", "narrows most"), rows,
                  words=(0, 1, 4)),
        ),
    )  # fmt: skip


def _fit(study: Study, found: Answer) -> Section:
    rows: list[Row] = []
    for c in found.checks:
        curve = not np.isfinite(c.predicted_sd)
        rows.append([
            Cell(c.label.replace("_", " "), small="held out" if c.held_out else ""),
            "curve" if curve else f"{number(c.measured, 4)} ± {number(c.sd, 2)}",
            f"off by {number(c.measured, 2)} rms" if curve
            else f"{number(c.predicted, 4)} ± {number(c.predicted_sd, 2)}",
            Cell(number(c.pull, 2), "bad" if c.p < 0.01 else ""),
            number(c.p, 2),
        ])  # fmt: skip
    blocks: list[Block] = [
        table(("measure", "measured", "predicted", "difference in sd", "p"), rows)
    ]
    curves = [e.response.label for e in found.model.emulators if e.response.shapes is not None]
    if curves:
        blocks.append(
            Figures(tuple(
                Figure(label.replace("_", " "), "Grey: other runs.",
                       curve_figure(study, found, label)) for label in curves
            ))
        )  # fmt: skip
    if not found.fits:
        blocks.append(
            Text(
                "No parameter set reaches the data within the errors, so the intervals above mean "
                "little. Either errors are larger than stated, or the model lacks something: "
                "measure over a range of one condition and let greybed diagnose look for it.",
                "It does not fit.",
            )
        )
        blocks.append(
            Commands((("greybed diagnose STUDY.toml --out DIR", "which effect is missing"),))
        )
    held = [c for c in found.checks if c.held_out]
    lead = (
        "Measured values against what the posterior predicts; differences in all errors together."
        + (" Held-out experiments were not used to fit." if held else "")
    )
    return Section("fit", "Measured and predicted", lead, tuple(blocks))


def _budget(study: Study, found: Answer) -> Section:
    rows: list[Row] = [
        [b.label.replace("_", " "), percent(b.measurement), percent(b.replicates),
         percent(b.surrogate), number(b.total)]
        for b in found.budget
    ]  # fmt: skip
    quality: list[Row] = [
        [q.label.replace("_", " "), f"{number(q.cop)} ± {number(q.cop_sd, 1)}", number(q.ceiling),
         number(q.noise), number(q.runs)]
        for q in found.quality
    ]  # fmt: skip
    return Section(
        "errors",
        "Error budget",
        "Variances over the posterior. Errors of a measurement are those that the study states.",
        (
            Figures((Figure("Where the error comes from", "", budget_figure(found)),)),
            table(("measure", "measurement", "replicates", "surrogate", "sd"), rows),
            table(
                ("surrogate", "CoP", "ceiling by scatter", "sd of a replicate", "points"),
                quality,
                caption="CoP: 1 − SSE / SST of points left out, with its standard error. The "
                "ceiling is what the scatter of replicates leaves possible.",
            ),
        ),
    )


def _sensitivities(study: Study, found: Answer) -> Section:
    names = study.space.names
    columns = ("measure", *(n.replace("_", " ") for n in names))
    rows: list[Row] = [
        [label.replace("_", " "), *(number(float(v), 2) for v in found.pearson[label])]
        for label in found.pearson
    ]
    blocks: list[Block] = [
        Figures((Figure("Total Sobol indices", "Share of a measure's variance over the ranges "
                        "that goes when a parameter is known.",
                        sensitivity_figure(study, found)),)),
        table(columns, rows, caption="Pearson correlations over the runs."),
    ]  # fmt: skip
    for label, anova in found.extra.get("anova", {}).items():
        lines: list[Row] = [
            [r.source.replace("_", " "), number(r.effect), number(r.squares), str(r.freedom),
             number(r.f, 3) if np.isfinite(r.f) else "", number(r.p, 2) if np.isfinite(r.p) else ""]
            for r in anova
        ]  # fmt: skip
        blocks.append(
            table(
                ("source", "effect", "sum of squares", "freedom", "F", "p"), lines,
                caption=f"Analysis of variance of {label.replace('_', ' ')}, two-level design.",
            )
        )  # fmt: skip
    return Section("sensitivities", "Sensitivities", "What the measures respond to.", tuple(blocks))


def _transfer(found: Answer) -> Section | None:
    if not found.transfers:
        return None
    rows: list[Row] = []
    for t in found.transfers:
        rows.append([
            t.label.replace("_", " "), percent(t.covered),
            f"{number(t.interval[0])} to {number(t.interval[2])}",
            f"{number(t.before[0])} to {number(t.before[1])}",
            ", ".join(f"{k.split('.')[-1].replace('_', ' ')} {number(v, 2)}"
                      for k, v in t.cosine.items()),
        ])  # fmt: skip
    return Section(
        "transfer",
        "Does it carry over?",
        "A process needs only what it responds to: an open parameter does no harm where the "
        "process ignores it.",
        (
            table(
                ("process", "sensitivity covered", "90 % now", "90 % before", "cosines"), rows,
                words=(0, 4),
                caption="Covered: share of the squared slope at the best set that lies in "
                "determined directions. Cosines: of the correlations with the parameters, between "
                "the process and each measure.",
            ),
        ),
    )  # fmt: skip


def _notes(found: Answer) -> Section:
    blocks = tuple(Text(note) for note in found.notes)
    lead = (
        f"{count(found.runs, 'run')}: {found.made} made now in {duration(found.run_seconds)}, "
        f"{found.found} from the store, {found.failed} failed."
    )
    return Section("runs", "Runs", lead, blocks)
