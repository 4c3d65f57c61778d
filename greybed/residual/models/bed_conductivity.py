"""Effective conductivity of a bed of spheres in a stagnant gas."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from greybed.closures.conductivity import zehner_schluender
from greybed.core.errors import InputError
from greybed.residual.effect import Array, Effect
from greybed.residual.models.closed_form import LAW_KEYS, ClosedForm
from greybed.residual.study import Table


class BedConductivity(ClosedForm):
    """Effective conductivity [W/m/K]: Zehner and Schluender's cell, without radiation.

    Conductivities are those at ``reference_temperature``, 300 K unless the study says otherwise.
    """

    name = "bed-conductivity"
    response = "conductivity"
    required = (
        "temperature",
        "particle_diameter",
        "void_fraction",
        "solid_conductivity",
        "gas_conductivity",
    )
    options = (*LAW_KEYS, "reference_temperature", "exchange")
    default_law = "zehner-schluender"

    def _prepare(self, table: Table, parameters: Mapping[str, float]) -> None:
        name = self.law.strip().lower().replace("_", "-").replace("ü", "ue")
        if name not in ("zehner-schluender", "zbs", "zehner-bauer-schluender"):
            raise InputError(
                f"model.base = {self.law!r} is not a known law; take zehner-schluender."
            )

        exchange = self.spec.options.get("exchange", "grey")
        if exchange not in ("grey", "black"):
            raise InputError(f"model.exchange = {exchange!r} must be 'grey' or 'black'.")
        self._black = exchange == "black"
        self._number("reference_temperature", "temperature", 1.0)

    def excluded(self, effect: Effect) -> str | None:
        """Emissivity is an effect of its own only where the base radiates as if black."""
        if effect.name == "emissivity" and not self._black:
            return "radiation takes the emissivity up itself, unless exchange = 'black'"
        if effect.name == "emissivity" and "radiation" not in self.spec.effects:
            return "the base has no radiation for it to act on"
        return None

    def complete(self, c: dict[str, Array]) -> dict[str, Array]:
        """Radiative exchange: by the emissivity where one is given, 1 for black spheres."""
        size = len(c["temperature"])
        if "emissivity" in c and not self._black:
            c["exchange"] = 1.0 / (2.0 / c["emissivity"] - 1.0)
        else:
            c["exchange"] = np.ones(size)
        self._state_temperature(c)
        return c

    def evaluate(self, columns: dict[str, Array], active: list[tuple[Effect, float]]) -> Array:
        """The cell, and what runs beside it."""
        c = columns
        total = zehner_schluender(
            c["solid_conductivity"], c["gas_conductivity"], c["void_fraction"]
        )
        for effect, amplitude in active:
            changed = effect.change(c, amplitude)
            assert not isinstance(changed, Mapping)
            total = total + changed if effect.stage == "path" else total * changed
        return total
