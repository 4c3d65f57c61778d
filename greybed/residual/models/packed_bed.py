"""Pressure gradient of a packed bed from a drag law of beds."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from greybed.closures.drag import drag_law
from greybed.core.errors import InputError
from greybed.residual.catalogue.drag import NEEDS_GRID, VISCOSITY_LIQUID
from greybed.residual.effect import Array, Effect
from greybed.residual.models.closed_form import LAW_KEYS, ClosedForm, product
from greybed.residual.models.terminal_velocity import GAS
from greybed.residual.study import Table


class PackedBedPressureDrop(ClosedForm):
    """Pressure drop per length [Pa/m]: ``18 mu phi F(phi, Re) U / (eps d^2)``.

    ``Re = rho U d / mu``. Velocity and density are those at the outlet; viscosity is that at
    ``reference_temperature``, 293.15 K unless the study says otherwise.
    """

    name = "packed-bed-pressure-drop"
    response = "pressure_gradient"
    required = (
        "superficial_velocity",
        "particle_diameter",
        "void_fraction",
        "fluid_density",
        "viscosity",
    )
    options = (*LAW_KEYS, "reference_temperature")
    default_law = "ergun"

    def _prepare(self, table: Table, parameters: Mapping[str, float]) -> None:
        self._law = drag_law(self.law, "model.drag")
        if not self._law.bed:
            raise InputError(
                f"model.drag = {self.law!r} is a law of one sphere; for a bed take ergun, "
                "carman-kozeny, bvk, tenneti or koch-hill."
            )
        density = parameters.get("fluid_density")
        if density is None:
            density = float(np.median(table.columns["fluid_density"]))
        self._gas = density < GAS
        self._number("reference_temperature", "temperature", 1.0)

    def catalogue(self) -> tuple[Effect, ...]:
        """Gases thicken when warmed and liquids thin out; liquids do not expand."""
        return tuple(
            VISCOSITY_LIQUID if e.name == VISCOSITY_LIQUID.name and not self._gas else e
            for e in super().catalogue()
        )

    def excluded(self, effect: Effect) -> str | None:
        """Inertia is in every law but Carman and Kozeny's; liquids are not compressible."""
        if effect.name == "inertia" and self._law.name != "carman-kozeny":
            return f"the base law {self._law.name} has it"
        if effect.name == "gas-compressibility" and not self._gas:
            return f"the fluid is a liquid (density above {GAS:g} kg/m3)"
        return None

    def _choose_effects(self, given: set[str]) -> None:
        super()._choose_effects(given)
        self.unavailable = {**self.unavailable, **NEEDS_GRID}

    def complete(self, c: dict[str, Array]) -> dict[str, Array]:
        """The temperature at which the viscosity is stated."""
        self._state_temperature(c)
        return c

    def evaluate(self, columns: dict[str, Array], active: list[tuple[Effect, float]]) -> Array:
        """The law at the bed's Reynolds number, times the factors."""
        c = columns
        solid = 1.0 - c["void_fraction"]
        speed, diameter, viscosity = (
            c["superficial_velocity"],
            c["particle_diameter"],
            c["viscosity"],
        )
        reynolds = c["fluid_density"] * speed * diameter / viscosity
        force = self._law(solid, reynolds)
        if active:
            share = self._law(solid, np.zeros_like(reynolds)) / force
            state = {**c, "reynolds": reynolds, "viscous_share": share}
            force = force * product(state, active)
        return 18.0 * viscosity * solid * force * speed / (c["void_fraction"] * diameter**2)
