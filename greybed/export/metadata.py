"""What every exported form says of itself: name, versions, hashes, licence, its markers."""

from __future__ import annotations

import re
from dataclasses import dataclass
from math import isinf
from typing import Any

from greybed._version import __version__
from greybed.closures import content_hash
from greybed.closures.artifact import Closure
from greybed.closures.markers import Marker
from greybed.closures.term import GreyBoxTerm
from greybed.core import InputError

LICENCE = "BSD-3-Clause"


@dataclass(frozen=True)
class Quantity:
    """What a closure gives, in words for those who only have the exported form.

    Attributes
    ----------
    title : str
        The number and its symbol.
    output : str
        Name of the number in tables and graphs.
    law : tuple of str
        The formula and what its parts are, a line each.
    """

    title: str
    output: str
    law: tuple[str, ...]


QUANTITIES = {
    "viewfactor": Quantity(
        "view factor F_ij from sphere i to sphere j",
        "view_factor",
        (
            "F_ij = F_exact(r_i, r_j, d) V,   V = 1 - gate (1 - v),   0 < v < 1",
            "F_exact is the unobstructed factor; v is learnt; gate is exactly 0, so V = 1, where",
            "nothing stands between the spheres.",
        ),
    ),
    "wallfactor": Quantity(
        "view factor F_iw from sphere i to a wall",
        "wall_factor",
        (
            "F_iw = wall_share V,   V = 1 - gate (1 - v),   0 < v < 1",
            "wall_share is the unobstructed factor, the wall's solid angle over 4 pi (exact for a",
            "sphere that the wall's plane does not cut); v is learnt; gate is exactly 0, so V = 1,",
            "where nothing stands before the wall.",
        ),
    ),
    "exchange": Quantity(
        "exchange factor D_ij from sphere i to sphere j",
        "exchange_factor",
        (
            "D_ij = e F_ij + (1 - e) K_ij,   K_ij = v r_j^2 / (r_i^2 + r_j^2),   0 < v < 1",
            "F_ij = visible_share F_exact(r_i, r_j, d) is what reaches j directly, F_exact the",
            "unobstructed factor; K is what j absorbs of reflected light; v is learnt.",
        ),
    ),
    "filtereddrag": Quantity(
        "filtered drag, as the fraction kept of the drag law on a coarse grid",
        "kept_along",
        (
            "F = (1 - share) beta [H_along g g + H_across (I - g g)] slip + share P,",
            "ln H = gate bounded(model),   P = -eps (grad p - rho_g g)",
            "beta is that of the drag law at the filtered fields; H is the fraction that is kept;",
            "the gate is exactly 0, so H = 1, for no particles, packed particles and filters of",
            "size 0; the share is 0 but for closures with a linear part.",
        ),
    ),
}

# Words of C++20 that would break the namespace of a header; identifiers with __ are refused too.
_RESERVED = """
    alignas alignof and and_eq asm auto bitand bitor bool break case catch char char8_t char16_t
    char32_t class compl concept const consteval constexpr constinit const_cast continue co_await
    co_return co_yield decltype default delete do double dynamic_cast else enum explicit export
    extern false float for friend goto if inline int long mutable namespace new noexcept not not_eq
    nullptr operator or or_eq private protected public register reinterpret_cast requires return
    short signed sizeof static static_assert static_cast struct switch template this thread_local
    throw true try typedef typeid typename union unsigned using virtual void volatile wchar_t while
    xor xor_eq std greybed"""


def export_name(subject: Closure | GreyBoxTerm, name: str | None = None) -> str:
    """Name of an export: ``name`` if it is an identifier, else one made from the closure or term.

    Raises
    ------
    InputError
        If ``name`` is no identifier in C++.
    """
    if name is None:
        if not isinstance(subject, GreyBoxTerm):
            return f"{subject.quantity}_{subject.markers.name}_{subject.kind}"
        name = re.sub(r"\W+", "_", subject.name)
    sound = re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,99}", name) and "__" not in name
    if not sound or name in _RESERVED.split():
        raise InputError(
            f"the name {name!r} cannot be a namespace in C++; use letters, digits and single "
            "underscores, a letter first, such as 'bed_closure'."
        )
    return name


def allowed(marker: Marker) -> str:
    """The range of a marker, as text."""
    opening = "(" if marker.low_open else "["
    return f"{opening}{marker.low:g}, {marker.high:g}{')' if isinf(marker.high) else ']'}"


def dataset_hash(closure: Closure) -> str:
    """SHA-256 of the training data set as the card has it, or an empty string."""
    return str(closure.card.get("data_sha256", ""))


def cited(card: dict[str, Any], title: str, hash_: str) -> str:
    """How to cite a closure: as its card says, else as made with greybed, by title and hash."""
    usual = f"the greybed developers, greybed {__version__}: {title}, SHA-256 {hash_[:16]}"
    return str(card.get("citation", usual))


def describe(closure: Closure, name: str) -> dict[str, str]:
    """Plain strings that travel with every exported form."""
    return {
        "name": name,
        "quantity": f"{QUANTITIES[closure.quantity].title} [-]",
        "kind": closure.kind,
        "marker_set": closure.markers.name,
        "greybed_version": __version__,
        "hash": content_hash(closure),
        "dataset_hash": dataset_hash(closure),
        "licence": LICENCE,
        "citation": cited(
            closure.card,
            f"{QUANTITIES[closure.quantity].title}, {closure.kind}, {closure.markers.name} markers",
            content_hash(closure),
        ),
        **{
            f"marker_{marker.name}": f"{marker.meaning} [-], in {allowed(marker)}"
            for marker in closure.markers.markers
        },
    }
