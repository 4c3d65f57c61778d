"""An effect that a model may lack: form, amplitude from theory, what it needs, its switch."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

STAGES = ("property", "factor", "path", "outcome")


@dataclass(frozen=True, kw_only=True)
class Effect:
    """One named effect with one amplitude; amplitude 0 switches it off exactly.

    Attributes
    ----------
    name : str
        As reports and ``[model.effects]`` write it, such as ``wall``.
    law : str
        The form in one line, the amplitude written A.
    source : str
        Where form and amplitude are published.
    group : str
        Dimensionless group that governs it.
    theory : float or None
        Amplitude from theory, in the units of ``law``; None where theory gives no number.
    spread : float
        Relative standard deviation of the amplitude about ``theory``: how well theory knows it.
        Without a theory it is not used: every decade between ``low`` and ``high`` is as likely.
    low, high : float
        Amplitudes that physics allows, both ends included, of one sign; an estimate outside is
        reported but never selected.
    columns : tuple of str
        Columns or parameters that it needs besides those of the model.
    stage : str
        ``property``: ``change`` returns the columns that differ, before the law is evaluated.
        ``factor``: ``change`` returns the factor on drag or pressure gradient [-].
        ``path``: ``change`` returns what is added to the conductivity [W/m/K].
        ``outcome``: ``change`` returns the response, from columns that hold it as ``response``.
    change : callable (columns, amplitude) -> array or mapping of arrays
        The physics; must be exactly the identity at amplitude 0. Columns are in SI, each of
        shape (n,); at stage ``factor`` they hold ``reynolds`` and ``viscous_share`` too.
    switch : str
        What switches it on in the project's own code or case files.
    """

    name: str
    law: str
    source: str
    group: str
    theory: float | None
    spread: float = 0.25
    low: float
    high: float
    columns: tuple[str, ...] = ()
    stage: str
    change: Callable[[Columns, float], Array | Columns]
    switch: str = "[model.effects]"

    def __post_init__(self) -> None:
        if self.stage not in STAGES:
            raise ValueError(f"effect {self.name}: stage {self.stage!r} is none of {STAGES}")
        if not (self.low < self.high and self.low * self.high >= 0.0):
            raise ValueError(f"effect {self.name}: low and high must be ordered and of one sign")
        if self.theory is not None and not self.low < self.theory < self.high:
            raise ValueError(f"effect {self.name}: theory must lie between low and high")

    @property
    def typical(self) -> float:
        """Amplitude to begin a fit at: theory, or the middle of the range."""
        if self.theory is not None:
            return self.theory
        small, large = self.sizes
        sign = 1.0 if self.low + self.high > 0.0 else -1.0
        return sign * float(np.sqrt(small * large))

    @property
    def sizes(self) -> tuple[float, float]:
        """Smallest and largest amplitude without sign; a range from 0 begins at a thousandth."""
        small, large = sorted((abs(self.low), abs(self.high)))
        return small if small > 0.0 else 1e-3 * large, large
