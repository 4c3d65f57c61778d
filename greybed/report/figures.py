"""Figures as inline SVG whose colours are the page's own, so that they follow light and dark."""

from __future__ import annotations

import base64
import hashlib
import io
import re
from collections.abc import Mapping
from contextlib import AbstractContextManager
from typing import Any, NamedTuple

import matplotlib
import matplotlib.image
import numpy as np
from markupsafe import Markup, escape
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

# Stand-ins that matplotlib draws with and the page replaces by the variables of its theme.
INK, SOFT, GRID = "#010203", "#010204", "#010205"
SERIES = ("#010301", "#010302", "#010303")
_THEME = {
    INK: "var(--ink)",
    SOFT: "var(--soft)",
    GRID: "var(--grid)",
    **{colour: f"var(--series-{k + 1})" for k, colour in enumerate(SERIES)},
}
_STYLE = {
    "svg.fonttype": "none",  # text stays text: it can be searched and follows the page's font
    "svg.hashsalt": "greybed",  # the same figure has the same ids every time
    "text.parse_math": False,
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 9.5,
    "axes.titlesize": 9.5,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": SOFT,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.formatter.useoffset": False,
    "grid.color": GRID,
    "grid.linewidth": 0.7,
    "xtick.color": SOFT,
    "ytick.color": SOFT,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "legend.frameon": False,
    "legend.fontsize": 8.8,
    "legend.handlelength": 1.6,
    "figure.facecolor": "none",
    "axes.facecolor": "none",
}
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
# Factors below this are a handful of rays in a trace (as in greybed.training.score).
LEAST = 1e-4
# Median of |x| of a normal distribution with unit spread.
_MEDIAN_OF_NORMAL = 0.6745


class Profile(NamedTuple):
    """One curve of :func:`profile_figure`: values of many spheres against their height."""

    label: str
    values: ArrayLike


def style() -> AbstractContextManager[None]:
    """The look of all figures; make and save a figure inside this context."""
    return matplotlib.rc_context(_STYLE)


def new_figure(width: float = 3.8, height: float = 2.9) -> tuple[Any, Any]:
    """Empty figure of this size [inch] and its axes."""
    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.add_subplot()


def to_svg(figure: Any, label: str) -> Markup:
    """The figure as an ``<svg>`` element to place in a page.

    Parameters
    ----------
    figure : matplotlib Figure
        Drawn with the stand-in colours of this module.
    label : str
        What it shows, in words, for those who cannot see it.
    """
    stream = io.StringIO()
    figure.savefig(stream, format="svg", metadata={"Date": None}, dpi=200)
    text = stream.getvalue()
    text = re.sub(r"<metadata>.*?</metadata>", "", text[text.index("<svg") :], flags=re.DOTALL)
    opening = re.match(r"<svg[^>]*>", text)
    box = re.search(r'viewBox="([^"]*)"', text)
    if opening is None or box is None:
        raise RuntimeError("matplotlib wrote an SVG without a viewBox")
    body = text[opening.end() :]
    for colour, variable in _THEME.items():
        body = body.replace(colour, variable)
    body = body.replace("'DejaVu Sans'", "inherit").replace("DejaVu Sans", "inherit")
    body = re.sub(r"font: ([\d.]+px) inherit", r"font-size: \1", body)
    # Several figures share one page, and their ids with it.
    mark = "f" + hashlib.sha256(body.encode()).hexdigest()[:8]
    body = re.sub(r'\bid="', f'id="{mark}-', body)
    body = re.sub(r'href="#', f'href="#{mark}-', body).replace("url(#", f"url(#{mark}-")
    head = f'<svg viewBox="{box.group(1)}" role="img" aria-label="{escape(label)}">'
    return Markup(head + "\n".join(line.rstrip() for line in body.splitlines()))


def png_uri(pixels: NDArray[np.uint8]) -> str:
    """An image (height, width, 3 or 4) as a ``data:`` address."""
    stream = io.BytesIO()
    options = {"optimize": True}
    matplotlib.image.imsave(stream, pixels, format="png", pil_kwargs=options)
    return "data:image/png;base64," + base64.b64encode(stream.getvalue()).decode()


def gradient(colours: ListedColormap, stops: int = 12) -> str:
    """Colour bar as a CSS gradient from left to right."""
    shades = (np.asarray(colours(np.linspace(0.0, 1.0, stops)))[:, :3] * 255).round().astype(int)
    return f"linear-gradient(90deg, {', '.join(f'rgb({r} {g} {b})' for r, g, b in shades)})"


def power_of_ten(exponent: float, _: object = None) -> str:
    """``10⁻³`` for -3; nothing for exponents that are not whole."""
    whole = round(exponent)
    return f"10{str(whole).translate(_SUPERSCRIPT)}" if abs(exponent - whole) < 1e-6 else ""


def _decades(axis: Any) -> None:
    from matplotlib.ticker import FixedLocator, FuncFormatter, MultipleLocator

    axis.set_major_locator(MultipleLocator(1.0))
    axis.set_major_formatter(FuncFormatter(power_of_ten))
    minor = np.add.outer(np.arange(-12, 4), np.log10(np.arange(2, 10))).ravel().tolist()
    axis.set_minor_locator(FixedLocator(minor))


def parity_figure(
    truth: ArrayLike,
    predicted: ArrayLike,
    stderr: ArrayLike | None = None,
    *,
    quantity: str = "view factor F",
    least: float = LEAST,
    name: str = "",
    band: str = "95 % expected",
    xlabel: str | None = None,
    ylabel: str | None = None,
) -> Markup:
    """Predicted against true values, both logarithmic, as a density.

    Parameters
    ----------
    truth, predicted : array_like, shape (n,)
        True and predicted values, in one unit; pairs with a truth below ``least`` are left out.
    stderr : array_like, shape (n,), optional
        Expected standard error of the difference: draws where 95 % should lie.
    quantity : str
        What they are.
    name : str
        Of the closure, for the description.
    band : str
        What ``stderr`` contains, for the legend.
    xlabel, ylabel : str, optional
        Labels other than ``traced`` and ``predicted`` quantity.
    """
    t, p = np.ravel(np.asarray(truth, float)), np.ravel(np.asarray(predicted, float))
    kept = (t >= least) & np.isfinite(p)
    with style():
        figure, axes = new_figure(3.8, 3.6)
        low, high = np.log10(least), 0.0
        if kept.any():
            x = np.log10(t[kept])
            y = np.log10(np.maximum(p[kept], 0.3 * least))
            high = max(float(x.max()), float(y.max())) + 0.06
            low = min(float(x.min()), max(float(y.min()), low - 0.5)) - 0.06
            ink = ListedColormap([(*matplotlib.colors.to_rgb(SERIES[0]), a) for a in _alphas()])
            axes.hexbin(
                x, y, gridsize=44, extent=(low, high, low, high), bins="log", mincnt=1,
                cmap=ink, linewidths=0.0, zorder=2,
            )  # fmt: skip
        axes.plot([low, high], [low, high], color=INK, lw=0.9, zorder=3, label="perfect")
        if stderr is not None and kept.any():
            middle, sigma = binned(t[kept], np.ravel(np.asarray(stderr, float))[kept])
            for sign in (-1.0, 1.0):
                edge = np.maximum(middle + sign * 1.96 * sigma, 1e-3 * middle)
                axes.plot(
                    np.log10(middle), np.log10(edge), color=SERIES[1], lw=1.2, ls=(0, (4, 2)),
                    zorder=4, label=band if sign > 0 else None,
                )  # fmt: skip
        axes.set_xlim(low, high)
        axes.set_ylim(low, high)
        axes.set_aspect("equal")
        _decades(axes.xaxis)
        _decades(axes.yaxis)
        axes.set_xlabel(xlabel or f"traced {quantity}")
        axes.set_ylabel(ylabel or f"predicted {quantity}")
        axes.legend(loc="upper left")
        return to_svg(figure, f"{name} predicted against traced {quantity}, density".strip())


def _alphas() -> Array:
    return np.linspace(0.12, 1.0, 64)


def binned(x: ArrayLike, y: ArrayLike, bins: int = 12, *, log: bool = True) -> tuple[Array, Array]:
    """Median of y in bins of x that have at least 5 values: middles of the bins, medians."""
    middle, quantiles = _quantiles(np.asarray(x, float), np.asarray(y, float), (0.5,), bins, log)
    return middle, quantiles[0]


def _quantiles(
    x: Array, y: Array, shares: tuple[float, ...], bins: int, log: bool
) -> tuple[Array, Array]:
    scale = np.log10(x) if log else x
    if not len(x) or scale.max() == scale.min():
        middle, which = scale[:1], np.zeros(len(x), dtype=int)
    else:
        edges = np.linspace(scale.min(), scale.max(), bins + 1)
        middle = 0.5 * (edges[1:] + edges[:-1])
        which = np.clip(np.digitize(scale, edges) - 1, 0, bins - 1)
    full = [k for k in range(len(middle)) if (which == k).sum() >= min(5, len(x))]
    found = np.array([np.quantile(y[which == k], shares) for k in full]).reshape(-1, len(shares))
    chosen = middle[full]
    return (10.0**chosen if log else chosen), found.T


def error_figure(
    closures: Mapping[str, Mapping[str, ArrayLike]],
    against: str = "truth",
    *,
    xlabel: str = "traced view factor F",
    least: float = LEAST,
    log: bool = True,
    bins: int = 10,
) -> Markup:
    """Relative error by regime: the typical (median) error and the worst tenth of each closure.

    Parameters
    ----------
    closures : mapping
        Closure -> arrays ``truth``, ``predicted``, ``against`` and, to draw what the noise of the
        truth alone would give, its standard error ``truth_stderr``.
    against : str
        Array along the horizontal axis.
    xlabel : str
        Its name and unit.
    least : float
        Truths below this are left out.
    log : bool
        Whether the horizontal axis is logarithmic.
    bins : int
        Bins along it [-].
    """
    from matplotlib.ticker import FuncFormatter, LogLocator

    with style():
        figure, axes = new_figure(4.8, 3.6)
        marks, floor = "os^", None
        for k, (name, given) in enumerate(closures.items()):
            a = {key: np.ravel(np.asarray(value, float)) for key, value in given.items()}
            kept = a["truth"] >= least
            truth = a["truth"][kept]
            error = np.abs(a["predicted"][kept] - truth) / truth
            if not len(truth):
                continue
            colour, mark = SERIES[k % len(SERIES)], marks[k % len(marks)]
            x, (typical, worst) = _quantiles(a[against][kept], error, (0.5, 0.9), bins, log)
            axes.plot(x, typical, color=colour, marker=mark, ms=4.5, lw=1.6, label=name)
            axes.plot(x, worst, color=colour, lw=1.0, ls=(0, (1, 1.5)))
            if "truth_stderr" in a:
                noise = _MEDIAN_OF_NORMAL * a["truth_stderr"][kept] / truth
                floor = binned(a[against][kept], noise, bins, log=log)
        if floor is not None:
            axes.plot(*floor, color=SOFT, lw=1.2, ls=(0, (5, 2)), label="ray noise alone")
        axes.plot([], [], color=SOFT, lw=1.0, ls=(0, (1, 1.5)), label="one pair in ten is worse")
        axes.set_yscale("log")
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{100 * v:g} %"))
        axes.yaxis.set_minor_formatter(FuncFormatter(lambda v, _: ""))
        if log:
            axes.set_xscale("log")
            axes.xaxis.set_major_formatter(FuncFormatter(lambda v, _: power_of_ten(np.log10(v))))
            axes.xaxis.set_minor_formatter(FuncFormatter(lambda v, _: ""))
        axes.set_xlabel(xlabel)
        axes.set_ylabel("relative error")
        figure.legend(loc="outside upper left", ncols=2, borderpad=0.0)
        return to_svg(figure, f"Relative error of {', '.join(closures)} against {xlabel}")


def profile_figure(
    height: ArrayLike, profiles: list[Profile], *, xlabel: str, ylabel: str = "height [mm]",
    bins: int = 18,
) -> Markup:  # fmt: skip
    """Mean of each profile by layer of the bed, with the spread (5 to 95 %) of the first one."""
    z = np.asarray(height, dtype=np.float64)
    looks: list[dict[str, Any]] = [
        {"lw": 3.2, "alpha": 0.55},
        {"lw": 1.5, "ls": (0, (4, 1.5))},
        {"lw": 1.5, "ls": ":"},
    ]
    with style():
        figure, axes = new_figure()
        for k, (label, values) in enumerate(profiles):
            v = np.asarray(values, dtype=np.float64)
            colour = SERIES[k % len(SERIES)]
            middle, (low, mid, high) = _quantiles(z, v, (0.05, 0.5, 0.95), bins, log=False)
            if k == 0:
                axes.fill_betweenx(
                    middle, low, high, color=colour, alpha=0.15, lw=0, label="9 of 10 spheres"
                )
            axes.plot(mid, middle, color=colour, label=label, **looks[k % len(looks)])
        axes.set_xlabel(xlabel)
        axes.set_ylabel(ylabel)
        axes.legend(loc="best")
        names = ", ".join(profile.label for profile in profiles)
        return to_svg(figure, f"{xlabel} along the height: {names}")


def difference_figure(
    height: ArrayLike, difference: ArrayLike, *, xlabel: str, ylabel: str = "height [mm]"
) -> Markup:
    """Difference of every sphere against its height, with the median of each layer."""
    z, d = np.asarray(height, dtype=np.float64), np.asarray(difference, dtype=np.float64)
    with style():
        figure, axes = new_figure()
        axes.axvline(0.0, color=SOFT, lw=1.0)
        # A cloud of thousands of dots is smaller as pixels; blue shows on light and on dark.
        axes.scatter(d, z, s=3.0, color="#2f86c9", alpha=0.45, lw=0, rasterized=True)
        middle, (mid,) = _quantiles(z, d, (0.5,), 18, log=False)
        axes.plot(mid, middle, color=SERIES[1], lw=2.0, label="median of the layer")
        reach = 1.08 * float(np.abs(d).max(initial=0.0)) or 1.0
        axes.set_xlim(-reach, reach)
        axes.set_xlabel(xlabel)
        axes.set_ylabel(ylabel)
        axes.legend(loc="best")
        return to_svg(figure, f"{xlabel} of every sphere along the height")
