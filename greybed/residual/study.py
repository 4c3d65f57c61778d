"""A study: measured table, noise, model, parameters and options."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from greybed.residual.model import ModelSpec

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Table:
    """Measured rows in SI.

    Attributes
    ----------
    columns : mapping of str to ndarray, each (n,)
        Numbers in base SI.
    units : mapping of str to str
        Base SI unit of each column, empty for pure numbers.
    labels : mapping of str to tuple of str, each n long
        Words, such as the operator.
    rows : ndarray (n,), int
        Line of the file that each row came from.
    file : Path or None
        The file.
    """

    columns: Mapping[str, Array]
    units: Mapping[str, str]
    labels: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    rows: NDArray[np.int64]
    file: Path | None = None

    def __len__(self) -> int:
        return len(self.rows)


@dataclass(frozen=True, kw_only=True)
class Noise:
    """What is known of the errors; None means: estimate it.

    Attributes
    ----------
    relative : float or None
        Random standard deviation per row, relative [-].
    systematic : mapping of str to float
        Relative standard deviation of a column, shared by the rows of a group [-].
    """

    relative: float | None = None
    systematic: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A number of the model: fixed (no sd), measured (sd) or free.

    Attributes
    ----------
    value, sd : float
        In SI; sd is 0 where the parameter is fixed or free.
    free : bool
        To be calibrated against the data.
    """

    value: float
    sd: float = 0.0
    free: bool = False


@dataclass(frozen=True, kw_only=True)
class Options:
    """How to decide.

    Attributes
    ----------
    alpha : float
        Family-wise level of false alarms, 0.0005 to 0.2 [-].
    seed : int
        Of the bootstrap.
    holdout : str
        ``group``: leave one group out; ``none``: where there are no groups, tenths of the rows.
    candidates : tuple of str or None
        Effects to consider; None takes all that the columns allow.
    """

    alpha: float = 0.01
    seed: int = 1
    holdout: str = "group"
    candidates: tuple[str, ...] | None = None


@dataclass(frozen=True, kw_only=True)
class Study:
    """Everything that one diagnosis needs.

    Attributes
    ----------
    table : Table
        Measured rows.
    response : str
        Column that the model predicts.
    group : tuple of str
        Columns or labels whose combinations make the groups; may be empty.
    replicate : str or None
        Column that counts repeats.
    labels : tuple of str
        Label columns to suspect, such as the operator.
    noise, model, parameters, options
        As their classes say.
    file : Path or None
        The study's file.
    """

    table: Table
    response: str
    group: tuple[str, ...] = ()
    replicate: str | None = None
    labels: tuple[str, ...] = ()
    noise: Noise = field(default_factory=Noise)
    model: ModelSpec
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    options: Options = field(default_factory=Options)
    file: Path | None = None
