"""Section of a model's page: the laws that hold by construction, with what was measured."""

from __future__ import annotations

from collections.abc import Sequence

from greybed.closures.viewfactor.limits import LimitCase
from greybed.report.elements import Cell, Section, number, table


def laws_section(cases: Sequence[LimitCase], lead: str) -> Section:
    """Table of limiting cases, each with its largest deviation and its bound."""
    rows: list[list[Cell | str]] = [
        [
            case.name, number(case.error, 2), number(case.bound, 2),
            Cell("✓ holds", "good") if case.passed else Cell("✗ fails", "bad"),
        ]
        for case in cases
    ]  # fmt: skip
    laws = table(("Law", "deviation", "bound", "verdict"), rows, words=(0, 3))
    return Section("limits", "Limits that hold by construction", lead, (laws,))
