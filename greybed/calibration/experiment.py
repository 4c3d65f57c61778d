"""What a virtual experiment is: parameters and a seed in, named measures out."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

Kind = Literal["scalar", "signal"]
# A scalar, or a profile or time signal as two lists of equal length: places or times, and values.
Value = float | list[list[float]]
# Key of a result that is no measure: work that a run takes, in steps or any other unit.
COST = "cost"


class RunFailed(Exception):
    """A run that has no results: the message says why."""


@dataclass(frozen=True, kw_only=True)
class Measure:
    """What an experiment can be compared by.

    Attributes
    ----------
    name : str
        As data name it.
    unit : str
        Of scalars and of the values of signals, empty for pure numbers.
    kind : str
        ``scalar``, or ``signal`` for profiles and time signals.
    what : str
        In words.
    takes : tuple of str or None
        Parameters that it can respond to; None for all that the experiment takes.
    """

    name: str
    unit: str = ""
    kind: Kind = "scalar"
    what: str = ""
    takes: tuple[str, ...] | None = None


def named(*measures: Measure) -> Mapping[str, Measure]:
    """Measures by their names."""
    return {measure.name: measure for measure in measures}


class Experiment(ABC):
    """A test that is simulated: a small object that processes can be given.

    Attributes
    ----------
    name : str
        As the study names it.
    measures : mapping of str to Measure
        What it gives.
    takes : tuple of str or None
        Parameters that it knows; None for any.
    scale_invariant : bool
        Whether its measures stay when particles and vessel grow together, so that it may be run
        with larger particles in a larger vessel.
    relative_cost : float
        Work of a run against the other experiments of the study [-].
    """

    name: str
    measures: Mapping[str, Measure]
    takes: tuple[str, ...] | None = None
    scale_invariant: bool = False
    relative_cost: float = 1.0

    @abstractmethod
    def run(self, values: Mapping[str, float], seed: int) -> dict[str, Value]:
        """Run it once.

        Parameters
        ----------
        values : mapping of str to float
            All parameters of the study [SI].
        seed : int
            Of the replicate.

        Returns
        -------
        results : dict
            A value for each measure, and, if known, ``cost``.

        Raises
        ------
        RunFailed
            If it cannot be finished; any other exception counts as that, too.
        """

    @abstractmethod
    def identity(self) -> Any:
        """All that decides its results beside parameters and seed, as plain values for JSON."""

    def responds(self, measure: str, parameter: str) -> bool:
        """Whether a measure can respond to a parameter."""
        takes = self.measures[measure].takes
        if takes is None:
            takes = self.takes
        return takes is None or parameter in takes
