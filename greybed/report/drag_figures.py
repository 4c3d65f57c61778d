"""Figures of filtered drag: parity of drift fluxes, kept fraction by solid fraction, a curve."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from greybed.report.figures import INK, SERIES, SOFT, new_figure, style, to_svg
from greybed.training.drag_rows import DragRows

Array = NDArray[np.float64]

_LOOKS = ((SOFT, (0, (1, 1.5))), (SERIES[2], (0, (4, 2))), (SERIES[1], (0, (6, 1.5, 1, 1.5))))


def _medians(x: Array, y: Array, bins: int) -> tuple[Array, Array]:
    """Middles of equally filled bins of x, and quartiles (n, 3) of y there."""
    edges = np.quantile(x, np.linspace(0.0, 1.0, bins + 1))
    which = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, bins - 1)
    full = [k for k in range(bins) if (which == k).sum() >= 5]
    middle = np.array([np.median(x[which == k]) for k in full])
    return middle, np.array([np.quantile(y[which == k], (0.25, 0.5, 0.75)) for k in full])


def drift_parity(rows: DragRows, forces: Mapping[str, Array], main: str) -> Markup:
    """Drift flux along gravity: what models say against what the data say.

    Parameters
    ----------
    rows : DragRows
        The data.
    forces : mapping of (n, 3) arrays
        Of the models, by name.
    main : str
        The one whose middle half is drawn.
    """
    truth = rows.drift(rows.force)[:, 0]
    with style():
        figure, axes = new_figure(4.8, 4.0)
        low, high = np.quantile(truth, (0.003, 0.997))
        axes.plot([low, high], [low, high], color=INK, lw=0.9, zorder=1)
        looks = iter(_LOOKS * 3)
        for name, force in forces.items():
            x, y = _medians(truth, rows.drift(force)[:, 0], 24)
            if name == main:
                axes.fill_between(x, y[:, 0], y[:, 2], color=SERIES[0], alpha=0.2, lw=0)
                axes.plot(x, y[:, 1], color=SERIES[0], lw=2.0, label=name, zorder=4)
            else:
                colour, dashes = next(looks)
                axes.plot(x, y[:, 1], color=colour, lw=1.5, ls=dashes, label=name, zorder=3)
        axes.set_xlim(low, high)
        room = 0.4 * (high - low)
        axes.set_ylim(low - room, high + room)
        axes.set_xlabel("drift flux of the data, over u_t")
        axes.set_ylabel("drift flux of the model, over u_t")
        figure.legend(loc="outside upper left", ncols=1, borderpad=0.0)
        return to_svg(figure, f"Drift flux of {', '.join(forces)} against the data")


def kept_by_fraction(rows: DragRows, forces: Mapping[str, Array]) -> Markup:
    """Median H along gravity by solid fraction, of the data and of models, middle filters."""
    size = rows.markers["filter_size"]
    low, high = np.quantile(size, (0.3, 0.7))
    own = np.flatnonzero(rows.clean & (size >= low) & (size <= high))
    with style():
        figure, axes = new_figure(4.8, 4.0)
        if len(own) > 200:
            some = rows.take(own)
            phi = some.markers["solid_fraction"]
            x, y = _medians(phi, some.kept, 16)
            axes.fill_between(x, y[:, 0], y[:, 2], color=INK, alpha=0.12, lw=0)
            axes.plot(x, y[:, 1], color=INK, lw=1.2, marker="o", ms=3.5, label="data")
            for k, (name, force) in enumerate(forces.items()):
                quotient = force[own, 0] / some.unfiltered[:, 0]
                x, y = _medians(phi, quotient, 16)
                colour = SERIES[(len(forces) - 1 - k) % len(SERIES)]
                axes.plot(x, y[:, 1], color=colour, lw=1.7, label=name)
        axes.set_ylim(0.0, 1.3)
        axes.set_xlabel("solid fraction [-]")
        axes.set_ylabel("fraction kept H [-]")
        figure.legend(loc="outside upper left", ncols=1, borderpad=0.0)
        return to_svg(figure, "Median fraction kept by solid fraction")


def curve(cases: Sequence[float], error: Sequence[float]) -> Markup:
    """Error of H against the number of cases."""
    with style():
        figure, axes = new_figure()
        axes.plot(cases, error, color=SERIES[0], marker="o", lw=1.8)
        axes.set_ylim(0.0, 1.15 * max(error))
        axes.set_xlabel("cases to train on")
        axes.set_ylabel("error of H, rms")
        return to_svg(figure, "error of H against number of training cases")
