"""What a host is to compute: a closure with its baseline law, or a law alone."""

from __future__ import annotations

from dataclasses import dataclass

from greybed.closures import FilteredDragClosure, content_hash, load_any, model_path
from greybed.closures.artifact import Closure
from greybed.closures.drag.laws import drag_law
from greybed.closures.term import is_term
from greybed.core.errors import InputError
from greybed.export.metadata import export_name

# Drag laws with a form in the adapters, besides those that the closures' headers bring.
LAWS = ("stokes", "schiller-naumann", "wen-yu", "ergun", "gidaspow", "bvk")
ALONE = "law:"
EXACT = "exact"
DRAG, RADIATION = "drag", "radiation"


@dataclass(frozen=True)
class HostModel:
    """What a host is to compute.

    Attributes
    ----------
    kind : str
        ``drag`` or ``radiation``.
    name : str
        Namespace of the closure's header inside ``greybed``.
    text : str
        The model in words, for logs and comments.
    closure : Closure or None
        None for a law alone.
    law : str
        Drag law, or ``exact`` for the factor of two spheres.
    hash : str
        Content hash of the closure, or ``none``.
    """

    kind: str
    name: str
    text: str
    closure: Closure | None
    law: str
    hash: str

    @property
    def markers(self) -> str:
        """Marker set of a radiation closure; empty without one."""
        if self.closure is None or self.kind != RADIATION:
            return ""
        return self.closure.markers.name


def host_model(text: str, law: str | None = None, name: str | None = None) -> HostModel:
    """The model that a command names.

    Parameters
    ----------
    text : str
        A ``.closure`` file, ``shipped:NAME``, ``law:NAME`` for a drag law alone, or ``law:exact``
        for the exchange of spheres with nothing between them.
    law : str, optional
        Drag law that a closure corrects; that of its training data by default.
    name : str, optional
        Name of the header and its namespace.

    Raises
    ------
    InputError
        For a model that no host can take, with the reason.
    """
    if text.startswith(ALONE):
        if law is not None:
            raise InputError(f"--law is for closures only, {text} is a law itself; leave it out.")
        word = text.removeprefix(ALONE)
        if word == EXACT:
            said = "the factor of two spheres with nothing between them"
            return HostModel(RADIATION, "", said, None, EXACT, "none")
        found = _law(word)
        return HostModel(DRAG, "", f"drag law {found} alone", None, found, "none")
    path = model_path(text)
    if is_term(path):
        raise InputError(
            f"{text} is a grey-box term, which has no place in a host of its own; give a closure "
            "of filtered drag or of view factors."
        )
    closure = load_any(path)
    word = export_name(closure, name)
    said = f"{closure.quantity} {closure.markers.name} {closure.kind}"
    if isinstance(closure, FilteredDragClosure):
        if closure.needs_gradient:
            raise InputError(
                f"{text} needs the gradient of the gas pressure, which hosts do not give it yet; "
                "take a closure with the marker set plain."
            )
        found = _law(law or str(closure.card.get("law", "wen-yu")))
        return HostModel(DRAG, word, said, closure, found, content_hash(closure))
    if closure.quantity != "viewfactor":
        raise InputError(
            f"{text} is a closure of {closure.quantity}; hosts take closures of viewfactor and of "
            "filtereddrag."
        )
    if law is not None:
        raise InputError("--law is for closures of drag only; leave it out.")
    return HostModel(RADIATION, word, said, closure, EXACT, content_hash(closure))


def _law(name: str) -> str:
    found = drag_law(name, "law").name
    if found not in LAWS:
        raise InputError(f"law = {found!r} has no form in hosts; choose one of {', '.join(LAWS)}.")
    return found
