"""Any forward model with grey-box terms on its response."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from greybed.closures.term import GreyBoxTerm, load_term
from greybed.core.errors import InputError
from greybed.residual.effect import Array, Columns
from greybed.residual.model import ForwardModel, values


class WithTerms(ForwardModel):
    """``[model] terms = ["term.json"]``: the response times the factor of each term.

    Parameters
    ----------
    model : ForwardModel
        What is multiplied; its effects stay switchable.
    files : list of str
        Saved terms, relative to ``folder``.
    folder : str
        Folder of the study.
    """

    name = "with terms"

    def __init__(self, model: ForwardModel, files: list[str], folder: str, known: set[str]) -> None:
        self._model, self._files = model, files
        self.response, self.transform = model.response, model.transform
        self.effects, self.unavailable = model.effects, model.unavailable
        self.noise = model.noise
        self.terms: list[GreyBoxTerm] = [load_term(Path(folder) / file) for file in files]
        for file, term in zip(files, self.terms, strict=True):
            if term.covariate not in known:
                raise InputError(
                    f"model.terms: {file} needs the column {term.covariate}; give it or remove "
                    "the term."
                )

    def predict(
        self,
        columns: Columns,
        parameters: Mapping[str, float],
        amplitudes: Mapping[str, float],
    ) -> Array:
        """See :meth:`ForwardModel.predict`."""
        response = self._model.predict(columns, parameters, amplitudes)
        merged = values(columns, parameters)
        for term in self.terms:
            response = response * term.evaluate(merged[term.covariate])
        return response

    def settings(
        self, parameters: Mapping[str, float], amplitudes: Mapping[str, float]
    ) -> dict[str, Any]:
        """See :meth:`ForwardModel.settings`."""
        return {**self._model.settings(parameters, amplitudes), "terms": list(self._files)}

    def next_case(
        self, parameters: Mapping[str, float], amplitudes: Mapping[str, float]
    ) -> dict[str, Any] | None:
        """See :meth:`ForwardModel.next_case`; a case has no place for a term on its output."""
        return self._model.next_case(parameters, amplitudes)
