"""What report pages are made of: sections of text, figures, tables, bars and commands."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, Literal

from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape
from markupsafe import Markup

from greybed.core.files import atomic_path
from greybed.report.figures import power_of_ten

Tone = Literal["", "ok", "good", "bad", "muted"]
NOTHING = "–"


@dataclass(frozen=True)
class Cell:
    """Content of a table cell.

    Attributes
    ----------
    text : str
        What stands there.
    tone : str
        ``ok``, ``good`` (stronger), ``bad`` or ``muted`` for a colour; the words must say it too.
    small : str
        A second, smaller line.
    """

    text: str
    tone: Tone = ""
    small: str = ""


@dataclass(frozen=True)
class Text:
    """A paragraph; ``lead`` is set in bold before the text."""

    kind: ClassVar[str] = "text"
    text: str
    lead: str = ""


@dataclass(frozen=True)
class Figure:
    """An image with what it shows and what to look for; ``markup`` or the address ``uri``."""

    title: str
    caption: str = ""
    markup: Markup = field(default_factory=Markup)
    uri: str = ""


@dataclass(frozen=True)
class ColourBar:
    """What the colours of pictures mean: a CSS gradient, evenly spaced labels, and a name."""

    gradient: str
    labels: tuple[str, ...]
    name: str


@dataclass(frozen=True)
class Figures:
    """Figures side by side, below each other on a narrow screen."""

    kind: ClassVar[str] = "figures"
    items: tuple[Figure, ...]
    bar: ColourBar | None = None


@dataclass(frozen=True)
class Table:
    """Rows of cells; ``words`` are the columns (from 0) with words, aligned to the left."""

    kind: ClassVar[str] = "table"
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    words: tuple[int, ...] = (0,)
    caption: str = ""


@dataclass(frozen=True)
class Bars:
    """Horizontal bars: label, length as a share of the longest, and text."""

    kind: ClassVar[str] = "bars"
    rows: tuple[tuple[str, float, str], ...]


@dataclass(frozen=True)
class Commands:
    """Commands to copy, each with what it does."""

    kind: ClassVar[str] = "commands"
    rows: tuple[tuple[str, str], ...]


Block = Text | Figures | Table | Bars | Commands


@dataclass(frozen=True)
class Section:
    """A heading, a lead sentence, and blocks."""

    anchor: str
    title: str
    lead: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True)
class Verdict:
    """One of the few results that stand at the top: the result, then what it is."""

    value: str
    what: str
    tone: Tone = ""


@dataclass(frozen=True)
class Page:
    """One self-contained HTML page.

    Attributes
    ----------
    title : str
        What was made, in plain words.
    summary : str
        One or two sentences with the outcome.
    verdicts : tuple of Verdict
        The results to remember.
    sections : tuple of Section
        The rest, in order.
    facts : str
        Version, seed, machine.
    """

    title: str
    summary: str
    verdicts: tuple[Verdict, ...]
    sections: tuple[Section, ...]
    facts: str = ""

    def html(self) -> str:
        """The page; every text is escaped, and nothing in it is fetched from elsewhere."""
        return _environment().get_template("page.html").render(page=self)

    def write(self, path: str | os.PathLike[str]) -> Path:
        """Write the page, whole or not at all."""
        with atomic_path(path) as temporary:
            temporary.write_text(self.html(), encoding="utf-8")
        return Path(path)


@cache
def _environment() -> Environment:
    return Environment(
        loader=PackageLoader("greybed.report"),
        autoescape=select_autoescape(["html"]),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def table(
    columns: Sequence[str],
    rows: Sequence[Sequence[Cell | str]],
    *,
    words: Sequence[int] = (0,),
    caption: str = "",
) -> Table:
    """A table of cells or plain texts; ``words`` are the columns aligned to the left."""
    cells = (tuple(c if isinstance(c, Cell) else Cell(c) for c in row) for row in rows)
    return Table(tuple(columns), tuple(cells), tuple(words), caption)


def number(value: Any, digits: int = 3) -> str:
    """A number in few digits: ``0.0123``, ``4,000``, ``1.20×10⁻⁷``; a dash for None."""
    if value is None:
        return NOTHING
    if isinstance(value, int) and not isinstance(value, bool):
        return f"{value:,}"
    x = float(value)
    if not math.isfinite(x):
        return "not a number" if math.isnan(x) else ("∞" if x > 0 else "−∞")
    if x == 0.0:
        return "0"
    exponent = math.floor(math.log10(abs(x)))
    if exponent < -3 or exponent >= 6:
        mantissa, power = f"{x:.{max(digits - 1, 0)}e}".split("e")
        plain = float(mantissa) == 1.0 and math.isclose(x, float(f"1e{power}"))
        text = power_of_ten(int(power)) if plain else f"{mantissa}×{power_of_ten(int(power))}"
    else:
        text = f"{x:,.{max(digits - 1 - exponent, 0)}f}"
    return text.replace("-", "−")


def fixed(value: Any, decimals: int) -> str:
    """A number with so many decimals; a dash for None."""
    if value is None or not math.isfinite(float(value)):
        return number(value)
    return f"{float(value):,.{decimals}f}".replace("-", "−")


def percent(value: Any, digits: int = 2) -> str:
    """A share as a percentage; a dash for None."""
    return NOTHING if value is None else f"{number(100.0 * float(value), digits)} %"


def interval(pair: Any, decimals: int) -> str:
    """``0.95 to 0.97`` of a pair; a dash for None."""
    if pair is None:
        return NOTHING
    low, high = pair
    return f"{fixed(low, decimals)} to {fixed(high, decimals)}"


def duration(seconds: Any) -> str:
    """A time: ``0.4 s``, ``12 s``, ``3 min 5 s``; a dash for None."""
    if seconds is None:
        return NOTHING
    s = float(seconds)
    if s < 59.5:
        return f"{s:.1f} s" if s < 9.95 else f"{s:.0f} s"
    minutes, rest = divmod(round(s), 60)
    if minutes < 60:
        return f"{minutes} min {rest} s"
    return f"{minutes // 60} h {minutes % 60} min"


def count(n: int, noun: str) -> str:
    """``1 bed``, ``2 beds``, ``4,000 spheres``."""
    return f"{n:,} {noun}" + ("" if n == 1 else "s")


def listed(words: Sequence[str]) -> str:
    """``a``, ``a and b``, ``a, b and c``."""
    return " and ".join([*([", ".join(words[:-1])] if len(words) > 1 else []), *words[-1:]])
