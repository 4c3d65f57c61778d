"""The catalogue of named effects, by the model that they act in; users add their own."""

from __future__ import annotations

import difflib

from greybed.core.errors import InputError
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

    Raises
    ------
    InputError
        If there is no such model.
    """
    if model not in _EFFECTS:
        near = difflib.get_close_matches(str(model), _EFFECTS, n=1, cutoff=0.5)
        hint = f"did you mean {near[0]!r}?" if near else f"known are {', '.join(_EFFECTS)}."
        raise InputError(f"effect {effect.name}: {model!r} is not a known model; {hint}")
    known = _EFFECTS[model]
    known[:] = [e for e in known if e.name != effect.name] + [effect]


__all__ = ["effects_for", "register"]
