"""Figures of a diagnosis: residuals against covariates, parity, rankings, unnamed dependences."""

from __future__ import annotations

from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray

from greybed.report.figures import GRID, INK, SERIES, SOFT, new_figure, style, to_svg
from greybed.residual import Diagnosis

Array = NDArray[np.float64]

BEFORE, AFTER, OTHER = SERIES
WIDE = 10.0  # ratio of a covariate's ends from which its axis is logarithmic


def _named(name: str, unit: str) -> str:
    return f"{name.replace('_', ' ')} [{unit}]" if unit else name.replace("_", " ")


def _plain_ticks(axis: Any) -> None:
    """Few ticks on a logarithmic axis, written as plain numbers."""
    axis.set_major_locator(LogLocator(base=10.0, subs=(1.0, 2.0, 5.0), numticks=6))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def residual_figure(found: Diagnosis, covariate: str) -> Markup:
    """Residual against one covariate, before and after, with the band of the random error."""
    rows = found.rows
    x = rows.covariates[covariate]
    used = rows.used
    with style():
        figure, axes = new_figure()
        axes.axhline(0.0, color=SOFT, linewidth=0.8)
        sd = float(np.nanmedian(rows.sd))
        axes.axhspan(-2.0 * sd, 2.0 * sd, color=GRID, alpha=0.5, linewidth=0.0)
        for values, colour, label, marker in (
            (rows.residual_before, BEFORE, "base model", "o"),
            (rows.residual_after, AFTER, "with the effect", "s"),
        ):
            axes.plot(
                x[used],
                values[used],
                marker,
                color=colour,
                markersize=3.2,
                alpha=0.65,
                markeredgewidth=0.0,
                label=label,
            )
        if not used.all():
            axes.plot(
                x[~used],
                rows.residual_before[~used],
                "x",
                color=SOFT,
                markersize=5.0,
                label="left out",
            )
        if (x > 0.0).all() and x.max() > WIDE * x.min():
            axes.set_xscale("log")
            _plain_ticks(axes.xaxis)
        axes.set_xlabel(_named(covariate, rows.units.get(covariate, "")))
        axes.set_ylabel("residual of the logarithm" if found.transform == "log" else "residual")
        axes.legend(loc="best")
        return to_svg(figure, f"residual against {covariate}")


def parity_before_after(found: Diagnosis, response: str, unit: str) -> Markup:
    """Predicted against measured; with the effect, each row predicted without its own group."""
    rows = found.rows
    used = rows.used & np.isfinite(rows.held_out)
    with style():
        figure, axes = new_figure()
        everything = np.concatenate([rows.measured[used], rows.base[used], rows.held_out[used]])
        ends = [float(np.nanmin(everything)), float(np.nanmax(everything))]
        axes.plot(ends, ends, color=SOFT, linewidth=0.9)
        for values, colour, label, marker in (
            (rows.base, BEFORE, "base model", "o"),
            (rows.held_out, AFTER, "with the effect, held out", "s"),
        ):
            axes.plot(
                rows.measured[used],
                values[used],
                marker,
                color=colour,
                markersize=3.2,
                alpha=0.65,
                markeredgewidth=0.0,
                label=label,
            )
        if ends[0] > 0.0 and ends[1] > WIDE * ends[0]:
            axes.set_xscale("log")
            axes.set_yscale("log")
            _plain_ticks(axes.xaxis)
            _plain_ticks(axes.yaxis)
        axes.set_xlabel(f"measured {_named(response, unit)}")
        axes.set_ylabel(f"predicted {_named(response, unit)}")
        axes.legend(loc="best")
        return to_svg(figure, "predicted against measured")


def ranking_figure(found: Diagnosis) -> Markup:
    """Log odds of the sets that were weighed, the best at the top."""
    ranked = [r for r in found.ranking if np.isfinite(r.log_odds)][:10]
    if not ranked:
        return Markup()
    floor = -12.0
    with style():
        figure, axes = new_figure(width=5.6, height=0.55 + 0.3 * len(ranked))
        for k, item in enumerate(ranked):
            value = max(item.log_odds, floor)
            axes.plot(
                [floor, value],
                [k, k],
                color=AFTER if item.selectable else GRID,
                linewidth=7.0,
                solid_capstyle="butt",
            )
            cut = "" if item.log_odds >= floor else "beyond the axis: "
            axes.text(value + 0.15, k, f"{cut}{item.log_odds:.1f}", va="center", color=INK, size=8)
        axes.axvline(-np.log(20.0), color=SOFT, linewidth=0.8, linestyle=":")
        axes.set_yticks(range(len(ranked)))
        axes.set_yticklabels([" + ".join(r.names) or "nothing" for r in ranked])
        axes.invert_yaxis()
        axes.set_xlim(floor, 1.6)
        axes.set_xlabel("log odds against the best (dotted: 1 in 20)")
        axes.grid(axis="y", visible=False)
        return to_svg(figure, "candidate explanations by log odds")


def error_bars_figure(found: Diagnosis) -> Markup:
    """Held-out errors of the base model, its recalibration, a Gaussian process, and the effect."""
    error = found.error
    bars = (
        ("base model", error.base),
        ("recalibrated", error.recalibrated),
        ("Gaussian process", error.gp_discrepancy),
        ("with the effect", error.with_effect),
    )
    with style():
        figure, axes = new_figure(width=5.6, height=1.9)
        for k, (_, score) in enumerate(bars):
            colour = AFTER if k == 3 else BEFORE if k == 0 else OTHER
            axes.plot(list(score.ci95), [k, k], color=colour, linewidth=1.4)
            axes.plot([score.value], [k], "o", color=colour, markersize=5.5)
            axes.text(score.ci95[1], k - 0.16, f" {score.value:.3g}", color=INK, size=8)
        axes.set_yticks(range(len(bars)))
        axes.set_yticklabels([name for name, _ in bars])
        axes.invert_yaxis()
        axes.set_ylim(len(bars) - 0.5, -0.7)
        axes.set_xlim(left=0.0)
        axes.margins(x=0.1)
        axes.set_xlabel(f"{error.metric}, held out, with 95 % interval")
        return to_svg(figure, "held-out errors")


def rivals_figure(found: Diagnosis) -> Markup:
    """What each rival predicts at the conditions that tell them apart."""
    trial = found.experiment
    if not trial:
        return Markup()
    with style():
        predictions = trial["predictions"]
        figure, axes = new_figure(width=5.6, height=0.8 + 0.32 * len(predictions))
        for k, item in enumerate(predictions):
            centre, sd = item["response"], item["sd"]
            colour = SERIES[k % len(SERIES)]
            axes.plot([centre - 2 * sd, centre + 2 * sd], [k, k], color=colour, linewidth=1.6)
            axes.plot([centre], [k], "o", color=colour, markersize=6.0)
        axes.set_yticks(range(len(predictions)))
        axes.set_yticklabels([" + ".join(item["effects"]) for item in predictions])
        axes.set_ylim(len(predictions) - 0.5, -0.5)
        axes.set_xlabel(_named("predicted response", trial["unit"]) + ", ± 2 sd")
        return to_svg(figure, "predictions of the rivals at the proposed conditions")
