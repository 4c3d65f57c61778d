"""The catalogue of named effects, by the model that they act in; users add their own."""

from __future__ import annotations

from greybed.residual.catalogue import drag, heat, particles
from greybed.residual.effect import Effect

_EFFECTS: dict[str, list[Effect]] = {
    "terminal-velocity": list(drag.SPHERE),
    "packed-bed-pressure-drop": list(drag.BED),
    "bed-conductivity": list(heat.BED),
    "python": list(particles.CLOSED),
    "case": [],
}


def effects_for(model: str) -> tuple[Effect, ...]:
    """Effects of the catalogue that act in a model."""
    return tuple(_EFFECTS.get(model, ()))


def register(effect: Effect, model: str) -> None:
    """Add an effect, or replace the one of that name, for the rest of the process.

    Parameters
    ----------
    effect : Effect
        The effect.
    model : str
        Name of the forward model that it acts in.
    """
    known = _EFFECTS.setdefault(model, [])
    known[:] = [e for e in known if e.name != effect.name] + [effect]


__all__ = ["effects_for", "register"]
