"""The page of one trained closure: score, errors by regime, calibration, learning curve, card."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from greybed.closures import ViewFactorClosure
from greybed.closures.card import UNITS, regime_name
from greybed.closures.viewfactor.limits import LimitCase
from greybed.datasets.viewfactor import ViewFactorData
from greybed.report import figures
from greybed.report.elements import (
    Block,
    Cell,
    Figure,
    Figures,
    Page,
    Section,
    Verdict,
    fixed,
    interval,
    number,
    percent,
    table,
)
from greybed.report.laws import laws_section

MOST_POINTS = 20_000
# Nominal shares of intervals at which the calibration is looked at, and their half-widths.
NOMINAL = ((0.50, 0.6745), (0.6827, 1.0), (0.80, 1.2816), (0.90, 1.6449), (0.95, 1.96),
           (0.99, 2.5758))  # fmt: skip


def render_model(
    closure: ViewFactorClosure,
    data: ViewFactorData,
    cases: Sequence[LimitCase],
    path: str | os.PathLike[str],
    *,
    name: str,
) -> Path:
    """Write the page of a closure.

    Parameters
    ----------
    closure : ViewFactorClosure
        Trained, with its card; ``card["learning_curve"]`` is drawn where it is there.
    data : ViewFactorData
        Rows for its markers, with a split ``test``.
    cases : sequence of LimitCase
        Its limiting cases.
    path : path
        HTML file to write.
    name : str
        Of the closure.
    """
    card = closure.card
    score = card["score"]
    rows = np.flatnonzero(data.in_split("test") & (data.columns["factor"] > 1e-4))
    rows = rows[:: max(1, len(rows) // MOST_POINTS)]
    c = {key: column[rows] for key, column in data.columns.items()}
    p = closure.predict(**{key: c[key] for key in closure.marker_names})
    failed = [case for case in cases if not case.passed]
    sections = (
        _accuracy(name, c, p.view_factor, p.stderr, card),
        _uncertainty(c, p.view_factor, p.stderr, score),
        *_learning(card.get("learning_curve") or ()),
        laws_section(cases, "Largest deviation over random markers."),
        _card(card),
    )
    page = Page(
        f"{name}: {UNITS.get(closure.quantity, closure.quantity)}",
        "Trained on ray-traced packings and scored on whole packings that it has not seen. Where "
        "an exact law is known the closure obeys it by its form, whatever its weights.",
        (
            Verdict(
                f"R² {fixed(score['r2'], 4)}",
                f"95 %: {interval(score['r2_ci95'], 4)}, on {score['packings']} packings never "
                f"trained on; ray noise alone caps it at {fixed(score['r2_noise'], 4)}",
            ),
            Verdict(
                f"{number(score['rmse_own'])} off, rms",
                f"the closure's own error in F; the rays' noise, {number(score['noise'])}, is "
                "taken out",
            ),
            Verdict(
                f"{percent(score['coverage95'], 3)} covered",
                "held-out factors inside the stated intervals of 95 %",
            ),
            Verdict(
                f"✗ {len(failed)} limits fail" if failed else "✓ All limits hold",
                f"{len(cases)} exact laws",
                "bad" if failed else "good",
            ),
        ),
        sections,
        f"greybed {card.get('greybed', '')} · seed {card.get('seed', '')} · data "
        f"{str(card.get('data_sha256', ''))[:16]}",
    )
    return page.write(path)


def _accuracy(
    name: str,
    c: Mapping[str, NDArray],
    predicted: NDArray,
    stderr: NDArray,
    card: Mapping[str, Any],
) -> Section:
    arrays = {"truth": c["factor"], "predicted": predicted, "stderr": stderr}
    rows = [
        [
            regime_name(row), number(row["rows"]), number(row["rmse"]), percent(row["relative"]),
            number(row["bias"], 2), percent(row["coverage95"], 3),
        ]
        for row in card.get("regimes", ())
    ]  # fmt: skip
    blocks: list[Block] = [
        Figures(
            (
                Figure(
                    "Predicted against traced",
                    "A stronger colour means more rows. Between the dashed lines 95 % should lie, "
                    "by the closure's own error and the noise of the rays.",
                    figures.parity_figure(
                        c["factor"], predicted, np.hypot(stderr, c["stderr"]), name=name
                    ),
                ),
                Figure(
                    "Error by size of the factor",
                    "Solid: typical relative error. Dotted: one in ten is worse. On the left the "
                    "truth itself is uncertain.",
                    figures.error_figure({name: arrays}),
                ),
            )
        ),
        table(
            ("Regime", "rows", "own error, rms", "of the mean factor", "bias", "95 % hold"),
            rows,
            caption="Held-out rows with F above 10⁻⁴; the rays' noise is taken out of the error.",
        ),
    ]
    return Section(
        "accuracy",
        "How close it comes",
        "Measured on packings that were in no part of the training.",
        tuple(blocks),
    )


def _uncertainty(
    c: Mapping[str, NDArray], predicted: NDArray, stderr: NDArray, score: Mapping[str, Any]
) -> Section:
    ratio = np.abs(predicted - c["factor"]) / np.hypot(stderr, c["stderr"])
    w = c["weight"]
    rows = [
        [percent(share, 3), percent(float(np.average(ratio <= width, weights=w)), 3)]
        for share, width in NOMINAL
    ]
    return Section(
        "uncertainty",
        "How honest its error bars are",
        "The closure's own error was fitted on the packings of the split 'calibrate', on which "
        "its factors were not. The right column should repeat the left one.",
        (
            table(("interval of", "holds, held-out rows"), rows),
            table(
                ("flag", "share"),
                [["outside the training data (extrapolates)", percent(score["extrapolated"])]],
            ),
        ),
    )


def _learning(points: Sequence[Mapping[str, Any]]) -> tuple[Section, ...]:
    if len(points) < 2:
        return ()
    rows = [
        [number(p["packings"]), number(p["rows"]), number(p["rmse"]), fixed(p["r2"], 5)]
        for p in points
    ]
    figure = Figure(
        "Own error against packings",
        "A curve that still falls at its right end says: more packings would help.",
        curve_figure([p["packings"] for p in points], [p["rmse"] for p in points]),
    )
    lead = "The same fit on growing random parts of the training packings, scored on the same rows."
    columns = ("training packings", "rows", "own error, rms", "R²")
    return (
        Section(
            "learning", "What more data bring", lead, (Figures((figure,)), table(columns, rows))
        ),
    )


def curve_figure(packings: Sequence[int], rmse: Sequence[float]) -> Markup:
    """Error against number of packings, both logarithmic where no error is zero."""
    with figures.style():
        figure, axes = figures.new_figure()
        axes.plot(packings, rmse, color=figures.SERIES[0], marker="o", lw=1.8)
        axes.set_xscale("log")
        # Noise is subtracted, so an own error below it comes out as zero.
        if min(rmse) > 0.0:
            axes.set_yscale("log")
        axes.set_xticks(list(packings), [str(n) for n in packings])
        axes.minorticks_off()
        low, high = min(rmse), max(rmse)
        ticks = np.linspace(low, high, 3) if high > low else [low]
        axes.set_yticks(ticks, [number(float(t), 2) for t in ticks])
        axes.set_xlabel("training packings")
        axes.set_ylabel("own error of F, rms")
        return figures.to_svg(figure, "error against number of training packings")


def _card(card: Mapping[str, Any]) -> Section:
    packings = card.get("packings", {})
    fractions = card.get("solid_fractions") or [float("nan")]
    facts: list[list[Cell | str]] = [
        ["data set (SHA-256)", str(card.get("data_sha256", ""))],
        ["packings", ", ".join(f"{n} to {split}" for split, n in packings.items())],
        ["kinds", ", ".join(card.get("kinds", ()))],
        ["sizes", "; ".join(card.get("sizes", ()))],
        ["solid fractions", f"{min(fractions):g} to {max(fractions):g}"],
        ["rows fitted", number(card.get("rows"))],
        *(
            [name, f"{number(float(low))} to {number(float(high))}"]
            for name, (low, high) in card.get("ranges", {}).items()
        ),
    ]
    known: list[list[Cell | str]] = [
        ["other shapes than spheres", "neither the exact law nor the markers hold"],
        ["markers outside the ranges above", "flagged as extrapolation, never clipped"],
        ["row sums", "not one by themselves; closure.factors(packing) balances them"],
        ["surfaces below an emissivity of one", "the factors are geometry; see exchange factors"],
    ]
    return Section(
        "card",
        "Model card",
        "Where it comes from, where it holds, where it does not.",
        (
            table(("what", "value"), facts, words=(0, 1)),
            table(("not covered", "what happens"), known, words=(0, 1)),
        ),
    )
