"""Figures of a calibration: isoline bands and their overlap, posterior, error budget, advice."""

from __future__ import annotations

from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from greybed.calibration import Answer, Study
from greybed.calibration.isolines import WIDTH, Bands
from greybed.report.figures import GRID, INK, SERIES, SOFT, new_figure, style, to_svg

Array = NDArray[np.float64]

FIRST, SECOND, THIRD = SERIES


def _label(name: str) -> str:
    return name.replace("_", " ")


def _place(study: Study, bands: Bands, axes: Any, found: Answer) -> None:
    """Axes of a plane of two parameters, with the best set in it."""
    names = study.space.names
    i, j = bands.axes
    axes.set_xlabel(_label(names[i]))
    axes.set_ylabel(_label(names[j]))
    for k, set_scale in ((i, axes.set_xscale), (j, axes.set_yscale)):
        if study.space.free[k].log:
            set_scale("log")
    axes.plot([found.best[names[i]]], [found.best[names[j]]], "o", color=INK, markersize=4.5)
    axes.set_xlim(float(bands.x[0]), float(bands.x[-1]))
    axes.set_ylim(float(bands.y[0]), float(bands.y[-1]))


def band_figure(study: Study, found: Answer, bands: Bands, label: str, unit: str) -> Markup:
    """Isolines of one measure, and the band in which it is within its errors."""
    with style():
        figure, axes = new_figure(3.3, 2.9)
        axes.contourf(bands.x, bands.y, bands.pulls[label], [-1.0, WIDTH], colors=[GRID])
        if label in bands.values:
            values = bands.values[label]
            if np.ptp(values) > 0.0:
                lines = axes.contour(bands.x, bands.y, values, 8, colors=[FIRST], linewidths=0.9)
                axes.clabel(lines, fontsize=7.5, fmt="%.3g", colors=[INK])
        axes.contour(bands.x, bands.y, bands.pulls[label], [WIDTH], colors=[INK], linewidths=0.9)
        _place(study, bands, axes, found)
        axes.grid(visible=False)
        return to_svg(figure, f"isolines of {label} {unit}")


def overlap_figure(study: Study, found: Answer, bands: Bands) -> Markup:
    """Where how many of the measures fit within their errors."""
    with style():
        figure, axes = new_figure(3.8, 3.2)
        worst = np.max(list(bands.pulls.values()), axis=0)
        for k, (_, pull) in enumerate(bands.pulls.items()):
            colour = SERIES[k % len(SERIES)]
            axes.contour(
                bands.x, bands.y, pull, [WIDTH], colors=[colour], linewidths=1.0,
                linestyles=["-", "--", ":"][k // len(SERIES) % 3],
            )  # fmt: skip
        if worst.min() < WIDTH:
            axes.contourf(bands.x, bands.y, worst, [-1.0, WIDTH], colors=[INK], alpha=0.55)
        _place(study, bands, axes, found)
        for k, label in enumerate(bands.pulls):
            axes.plot([], [], color=SERIES[k % len(SERIES)], label=_label(label.split(".")[-1]),
                      linestyle=["-", "--", ":"][k // len(SERIES) % 3])  # fmt: skip
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=2)
        axes.grid(visible=False)
        return to_svg(figure, "overlap of the bands of all measures")


def posterior_figure(study: Study, found: Answer) -> Markup:
    """Marginal posteriors over the prior ranges, one below the other."""
    names = study.space.names
    n = len(names)
    with style():
        figure, axes = new_figure(4.4, 0.7 + 0.45 * n)
        ticks = np.linspace(0.0, 1.0, 80)
        ends = found.posterior.interval()
        for k in range(n):
            x = found.posterior.points[:, k]
            width = max(0.9 * float(x.std()) * len(x) ** -0.2, 0.012)
            sample = x[:: max(1, len(x) // 2000)]
            # Mirrored at the ends, where a density would otherwise fall off.
            density = sum(
                np.exp(-0.5 * ((ticks[:, None] - s) / width) ** 2).sum(axis=1)
                for s in (sample, -sample, 2.0 - sample)
            )
            density = np.asarray(density) / np.max(density)
            base = n - 1 - k
            axes.fill_between(ticks, base, base + 0.8 * density, color=FIRST, alpha=0.35,
                              linewidth=0.0)  # fmt: skip
            axes.plot(ends[k], [base, base], color=FIRST, linewidth=3.0, solid_capstyle="butt")
            axes.plot([found.best_point[k]], [base], "o", color=INK, markersize=4.5)
            low, high = (study.space.values(np.full((1, n), v))[0, k] for v in (0.0, 1.0))
            axes.text(-0.02, base + 0.3, f"{low:.3g}", ha="right", va="center", size=8)
            axes.text(1.02, base + 0.3, f"{high:.3g}", ha="left", va="center", size=8)
        axes.set_yticks([n - 1 - k + 0.3 for k in range(n)])
        axes.set_yticklabels([_label(name) for name in names])
        axes.tick_params(axis="y", pad=34, length=0)
        axes.set_xticks([])
        axes.set_xlim(0.0, 1.0)
        axes.set_ylim(-0.15, n)
        axes.grid(visible=False)
        axes.spines["left"].set_visible(False)
        axes.set_xlabel("share of the range")
        return to_svg(figure, "posterior of every parameter")


def pair_figure(study: Study, found: Answer, axes_of: tuple[int, int]) -> Markup:
    """Samples of the posterior in the plane of two parameters."""
    i, j = axes_of
    names = study.space.names
    values = study.space.values(found.posterior.points)
    step = max(1, len(values) // 1500)
    with style():
        figure, axes = new_figure(3.6, 3.1)
        level = found.posterior.level()
        inside = found.posterior.density >= level
        for mask, colour, label in (
            (~inside, GRID, "outside it"), (inside, FIRST, "90 % region"),
        ):  # fmt: skip
            rows = values[mask][::step]
            axes.plot(rows[:, i], rows[:, j], ".", color=colour, markersize=2.5, label=label)
        axes.plot([found.best[names[i]]], [found.best[names[j]]], "o", color=INK, markersize=5,
                  label="best set")  # fmt: skip
        full = study.space.values(np.array([np.zeros(len(names)), np.ones(len(names))]))
        axes.set_xlim(full[0, i], full[1, i])
        axes.set_ylim(full[0, j], full[1, j])
        for k, set_scale in ((i, axes.set_xscale), (j, axes.set_yscale)):
            if study.space.free[k].log:
                set_scale("log")
        axes.set_xlabel(_label(names[i]))
        axes.set_ylabel(_label(names[j]))
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=2, markerscale=1.6)
        return to_svg(figure, f"posterior of {names[i]} and {names[j]}")


def budget_figure(found: Answer) -> Markup:
    """Shares of measurement, replicates and surrogates in the error of each measure."""
    rows = found.budget
    with style():
        figure, axes = new_figure(5.2, 0.9 + 0.32 * len(rows))
        for k, b in enumerate(rows):
            left = 0.0
            for share, colour in (
                (b.measurement, FIRST), (b.replicates, SECOND), (b.surrogate, THIRD),
            ):  # fmt: skip
                axes.barh(k, 100.0 * share, left=100.0 * left, color=colour, height=0.62)
                left += share
        axes.set_yticks(range(len(rows)))
        axes.set_yticklabels([_label(b.label) for b in rows])
        axes.invert_yaxis()
        axes.set_xlim(0.0, 100.0)
        axes.set_xlabel("share of the variance [%]")
        for colour, label in ((FIRST, "measurement"), (SECOND, "replicates"), (THIRD, "surrogate")):
            axes.plot([], [], color=colour, linewidth=6, label=label)
        axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
        axes.grid(axis="y", visible=False)
        return to_svg(figure, "error budget of every measure")


def sensitivity_figure(study: Study, found: Answer) -> Markup:
    """Total Sobol indices of every measure, as a table of squares."""
    labels, names = list(found.sobol_total), study.space.names
    with style():
        figure, axes = new_figure(1.8 + 0.75 * len(names), 1.1 + 0.34 * len(labels))
        for r, label in enumerate(labels):
            for c in range(len(names)):
                share = float(np.clip(found.sobol_total[label][c], 0.0, 1.0))
                axes.barh(r, 0.92 * share, left=c, height=0.6, color=FIRST,
                          alpha=0.45, linewidth=0.0)  # fmt: skip
                axes.text(c + 0.04, r, f"{share:.2f}", ha="left", va="center", size=8, color=INK)
        axes.set_xticks(np.arange(len(names)) + 0.46)
        axes.set_xticklabels([_label(n) for n in names], rotation=20, ha="right")
        axes.set_yticks(range(len(labels)))
        axes.set_yticklabels([_label(label) for label in labels])
        axes.set_xlim(0.0, len(names))
        axes.invert_yaxis()
        axes.set_xticks(np.arange(len(names) + 1), minor=True)
        axes.grid(visible=False)
        axes.grid(axis="x", which="minor", color=GRID, linewidth=0.7)
        axes.tick_params(which="minor", length=0)
        return to_svg(figure, "total Sobol indices")


def advice_figure(found: Answer) -> Markup:
    """Expected information of tests for their cost."""
    rows = found.next_tests[:8]
    with style():
        figure, axes = new_figure(5.0, 0.8 + 0.32 * len(rows))
        for k, test in enumerate(rows):
            axes.barh(k, test.per_cost, color=SOFT if test.repeat else FIRST, height=0.6)
        axes.set_yticks(range(len(rows)))
        axes.set_yticklabels([_label(t.name) + (" once more" if t.repeat else "") for t in rows])
        axes.invert_yaxis()
        axes.set_xlabel("expected information for the cost [nat]")
        axes.grid(axis="y", visible=False)
        return to_svg(figure, "expected information of tests that could be made next")


def curve_figure(study: Study, found: Answer, label: str) -> Markup:
    """A measured curve with its error, and the runs' curves nearest to it."""
    emulator = next(e for e in found.model.emulators if e.response.label == label)
    r = emulator.response
    assert r.at is not None
    assert r.curve is not None
    assert r.sd is not None
    results = found.model.rows[r.experiment].results
    order = sorted(range(len(results)), key=lambda k: r.rmse(results[k][r.measure]))
    unit = study.experiments[r.experiment].measures[r.measure].unit
    with style():
        figure, axes = new_figure(4.2, 2.9)
        for k in order[::-1][:: max(1, len(order) // 25)]:
            axes.plot(r.at, r.whitened(results[k][r.measure]) * r.sd + r.curve, color=GRID,
                      linewidth=0.8)  # fmt: skip
        best = r.whitened(results[order[0]][r.measure]) * r.sd + r.curve
        axes.plot(r.at, best, color=FIRST, linewidth=1.6, label="nearest run")
        axes.fill_between(r.at, r.curve - WIDTH * r.sd, r.curve + WIDTH * r.sd, color=SECOND,
                          alpha=0.3, linewidth=0.0)  # fmt: skip
        axes.plot(r.at, r.curve, color=INK, linewidth=1.0, label="measured, ± 2 sd")
        axes.set_ylabel(f"{_label(r.measure)} [{unit or '-'}]")
        axes.set_xlabel("time or place")
        axes.legend(loc="best")
        return to_svg(figure, f"curve of {label}")
