"""Closures that come with greybed: their names, their files, one call to load them."""

from __future__ import annotations

import os
from importlib.resources import files
from pathlib import Path

from greybed.closures.artifact import SUFFIX, load, load_drag
from greybed.closures.drag.filtered.closure import FilteredDragClosure
from greybed.closures.viewfactor.closure import ViewFactorClosure
from greybed.core import InputError

PREFIX = "shipped:"


def shipped_names() -> tuple[str, ...]:
    """Names of the closures in the package, sorted."""
    folder = files("greybed.closures").joinpath("models")
    return tuple(
        sorted(
            entry.name.removesuffix(SUFFIX)
            for entry in folder.iterdir()
            if entry.name.endswith(SUFFIX)
        )
    )


def model_path(model: str | os.PathLike[str]) -> Path:
    """File of a closure that is named as a path or as ``shipped:NAME``.

    Parameters
    ----------
    model : str or path
        A path, returned as it is, or ``shipped:`` and one of :func:`shipped_names`.

    Raises
    ------
    InputError
        If no closure of that name is in the package.
    """
    text = os.fspath(model)
    # A case file turns relative paths into paths beside it.
    head, found, name = text.rpartition(PREFIX)
    if not found or (head and not head.endswith(os.sep)):
        return Path(text)
    if name not in shipped_names():
        raise InputError(
            f"{PREFIX}{name} is not a closure that comes with greybed; choose one of: "
            f"{', '.join(PREFIX + known for known in shipped_names())}."
        )
    return Path(str(files("greybed.closures").joinpath("models", name + SUFFIX)))


def shipped(name: str = "viewfactor_mlp_pencil") -> ViewFactorClosure:
    """Load a closure that comes with greybed; its golden rows are replayed.

    Parameters
    ----------
    name : str
        One of :func:`shipped_names`, such as ``viewfactor_mlp_pencil`` or ``wallfactor_mlp_wall``.

    Returns
    -------
    ViewFactorClosure
        Its ``card`` says what it was trained on and how far it is off, by regime.

    Raises
    ------
    InputError
        If there is none of that name.

    Examples
    --------
    >>> from greybed.closures import shipped
    >>> float(shipped().evaluate(
    ...     radius_over_distance=0.5, radius_ratio=1.0, blocked_fraction=0.0, blockers_per_line=0.0
    ... ).round(6))
    0.075587
    """
    return load(model_path(PREFIX + name))


def shipped_drag(name: str = "filtered_drag_mlp_plain") -> FilteredDragClosure:
    """Load a closure of filtered drag that comes with greybed, as :func:`shipped` does."""
    return load_drag(model_path(PREFIX + name))
