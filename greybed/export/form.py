"""What an export needs to know of a closure or a term, in whatever language it is written."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from numpy.typing import NDArray

from greybed.closures.markers import Marker
from greybed.export.metadata import Quantity
from greybed.export.tables import Table


@dataclass(frozen=True)
class Field:
    """A physical number that a host hands over.

    Attributes
    ----------
    name : str
        With its unit, such as ``distance_m``.
    meaning, unit : str
        In words, and in brackets.
    chain : str
        Derivative of the answer for it, in C++, of those for the markers, ``of[k]``.
    """

    name: str
    meaning: str
    unit: str
    chain: str = ""


@dataclass(frozen=True)
class Form:
    """One closure or term as its exports see it.

    Attributes
    ----------
    name : str
        Namespace and stem of the files.
    facts : dict of str
        What every form says of itself: hash, versions, licence, citation, markers.
    quantity : Quantity
        What it gives.
    kind : str
        ``mlp``, ``forest`` or ``term``.
    unit : str
        Of the markers; "-" but for terms.
    markers : sequence of Marker
        In their order.
    outputs : tuple of str
        Numbers of a golden row, in their order.
    inputs : tuple of Field
        Physical numbers, in the order of the C++ ``Inputs``.
    golden : (n, n_markers) and (n, n_outputs) float
        Rows to replay.
    tables : list of Table
        Constants of the header.
    body : str
        Template of what belongs to the quantity.
    context : dict
        What that template needs besides.
    """

    name: str
    facts: dict[str, str]
    quantity: Quantity
    kind: str
    markers: Sequence[Marker]
    outputs: tuple[str, ...]
    inputs: tuple[Field, ...]
    golden: tuple[NDArray, NDArray]
    tables: list[Table]
    body: str
    context: dict[str, Any] = field(default_factory=dict)
    unit: str = "-"

    @property
    def n_answers(self) -> int:
        """Numbers that ``eval`` gives, without the standard error."""
        return max(1, sum(name != "stderr" for name in self.outputs))
