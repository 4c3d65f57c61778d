"""What the analysis asks of a forward model: parameters and amplitudes in, responses out."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from greybed.residual.effect import Columns, Effect

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class ModelSpec:
    """The table ``[model]`` of a study.

    Attributes
    ----------
    name : str
        One of the shipped models.
    options : mapping
        The model's own keys, such as ``drag``.
    effects : mapping of str to float
        Effects that are part of the base model, with their amplitudes.
    folder : str
        Folder that relative paths start from.
    """

    name: str
    options: Mapping[str, Any] = field(default_factory=dict)
    effects: Mapping[str, float] = field(default_factory=dict)
    folder: str = "."


class ForwardModel(ABC):
    """A model of one response, with switchable effects.

    Attributes
    ----------
    name : str
        As ``[model]`` names it.
    response : str
        Column that it predicts.
    transform : str
        ``log``: effects multiply, errors are relative. ``linear``: effects and errors add.
    effects : mapping of str to Effect
        Candidates whose columns are there and that the base does not hold already.
    unavailable : mapping of str to str
        Effects that cannot be candidates, with the reason.
    noise : ndarray or None
        Standard deviation of the model's own scatter, in the transformed response, such as of a
        simulation over its seeds [-].
    """

    name: ClassVar[str]
    response: str
    transform: str = "log"
    effects: Mapping[str, Effect]
    unavailable: Mapping[str, str]
    noise: Array | None = None

    @abstractmethod
    def predict(
        self,
        columns: Columns,
        parameters: Mapping[str, float],
        amplitudes: Mapping[str, float],
    ) -> Array:
        """Responses, shape (n,), in SI; NaN for a row at which the model fails.

        Parameters
        ----------
        columns : mapping of str to ndarray, each (n,)
            Conditions of the rows in SI, at least those that the model was built with.
        parameters : mapping of str to float
            All parameters of the study in SI; one of a column's name replaces that column.
        amplitudes : mapping of str to float
            Effects to switch on, on top of those of the base; absent or 0 is off.
        """

    @abstractmethod
    def settings(
        self, parameters: Mapping[str, float], amplitudes: Mapping[str, float]
    ) -> dict[str, Any]:
        """The table ``[model]`` with the effects switched on: what the next run uses."""

    def next_case(
        self, parameters: Mapping[str, float], amplitudes: Mapping[str, float]
    ) -> dict[str, Any] | None:
        """A case file with the effects switched on, paths absolute; None where there is none."""
        return None


def values(columns: Columns, parameters: Mapping[str, float]) -> dict[str, Array]:
    """Columns with the parameters in place, each of shape (n,)."""
    size = len(next(iter(columns.values())))
    merged = {name: np.asarray(column, dtype=np.float64) for name, column in columns.items()}
    merged.update({name: np.full(size, value) for name, value in parameters.items()})
    return merged
