"""Terminal velocity of one sphere: weight less buoyancy against drag."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from greybed.closures.drag import LAWS, drag_law
from greybed.core.errors import InputError
from greybed.residual.catalogue.drag import VISCOSITY_GAS
from greybed.residual.effect import Array, Columns, Effect
from greybed.residual.models.closed_form import LAW_KEYS, ClosedForm, product
from greybed.residual.study import Table

GRAVITY = 9.80665  # m/s2, standard
GAS = 100.0  # kg/m3; a lighter fluid is a gas
ITERATIONS = 60
SETTLED = 1e-13  # relative change of the velocity
WIDE = 60.0  # powers of e about Stokes' velocity within which the velocity is looked for
HALVINGS = 64


class TerminalVelocity(ClosedForm):
    """Speed along the net force, positive for rising spheres too [m/s].

    Solves ``(rho_p - rho_f) g pi d^3 / 6 = 3 pi mu d v F(0, Re)`` times the factors of effects,
    with ``Re = rho_f v d / mu``. Where a law jumps, as Schiller and Naumann's does at Re = 1000,
    no velocity balances the forces of some weights, and the velocity of the jump is returned.
    Viscosity is that at ``reference_temperature``, 293.15 K unless the study says otherwise.
    """

    name = "terminal-velocity"
    response = "velocity"
    required = ("diameter", "particle_density", "fluid_density", "viscosity")
    options = (*LAW_KEYS, "gravity", "reference_temperature")
    default_law = "stokes"

    def _prepare(self, table: Table, parameters: Mapping[str, float]) -> None:
        self._law = drag_law(self.law, "model.drag")
        if not self._law.sphere:
            alone = ", ".join(name for name, law in LAWS.items() if not law.bed)
            raise InputError(
                f"model.drag = {self.law!r} is a law of packed beds without the limit of one "
                f"sphere; take one of {alone}."
            )
        density = parameters.get("fluid_density")
        if density is None:
            density = float(np.median(table.columns["fluid_density"]))
        self._gas = density < GAS
        self._gravity = self._number("gravity", "acceleration", GRAVITY)
        self._number("reference_temperature", "temperature", 1.0)

    def catalogue(self) -> tuple[Effect, ...]:
        """Gases thicken when warmed and liquids thin out."""
        return tuple(
            VISCOSITY_GAS if e.name == VISCOSITY_GAS.name and self._gas else e
            for e in super().catalogue()
        )

    def excluded(self, effect: Effect) -> str | None:
        """Inertia is in every law but Stokes'."""
        if effect.name == "inertia" and self._law.inertia:
            return f"the base law {self._law.name} has it"
        return None

    def derived(self, columns: Columns, parameters: Mapping[str, float]) -> set[str]:
        """The mean free path of a gas follows from its pressure."""
        given = {*columns, *parameters}
        return {"mean_free_path"} if self._gas and "pressure" in given else set()

    def complete(self, c: dict[str, Array]) -> dict[str, Array]:
        """Mean free path by kinetic theory: mu sqrt(pi / (2 p rho))."""
        if "mean_free_path" not in c and self._gas and "pressure" in c:
            root = np.sqrt(np.pi / (2.0 * c["pressure"] * c["fluid_density"]))
            c["mean_free_path"] = c["viscosity"] * root
        self._state_temperature(c)
        return c

    def evaluate(self, columns: dict[str, Array], active: list[tuple[Effect, float]]) -> Array:
        """Secant steps in the logarithm of the velocity, where drag is nearly a straight line."""
        c = columns
        buoyant = np.abs(c["particle_density"] - c["fluid_density"])
        slow = buoyant * self._gravity * c["diameter"] ** 2 / (18.0 * c["viscosity"])
        scale = c["fluid_density"] * c["diameter"] / c["viscosity"]
        nothing = np.zeros_like(slow)

        def excess(x: Array) -> Array:
            state = {**c, "reynolds": scale * np.exp(x)}
            drag = self._law(nothing, state["reynolds"]) * product(state, active)
            return x + np.log(drag) - start

        with np.errstate(all="ignore"):
            start = np.log(slow)
            x, before = start, excess(start)
            new = start - 0.7 * before  # inertia makes the slope somewhat above 1
            for _ in range(ITERATIONS):
                now = excess(new)
                step = np.where(now == before, 0.0, now * (new - x) / (now - before))
                # the slope lies between 0.5 and 4 for every law here, so a longer step is wild
                step = np.clip(step, -2.0 * np.abs(now), 2.0 * np.abs(now))
                x, before = new, now
                new = new - step
                if not np.any(np.abs(step) > SETTLED):
                    break
            settled = np.abs(excess(new)) < 1e-10
            if not settled.all():
                new = np.where(settled, new, _halved(excess, start))
            return np.exp(new)


def _halved(excess: Callable[[Array], Array], start: Array) -> Array:
    """Where the excess changes its sign, also by a jump; NaN where it does not."""
    low, high = start - WIDE, start + WIDE
    known = (excess(low) < 0.0) & (excess(high) > 0.0)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        above = excess(middle) > 0.0
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    return np.where(known, high, np.nan)
