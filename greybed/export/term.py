"""A grey-box term as a form to export: one number in, a factor out."""

from __future__ import annotations

import re

import numpy as np

from greybed._version import __version__
from greybed.closures.markers import Marker
from greybed.closures.term import GreyBoxTerm
from greybed.export.form import Field, Form
from greybed.export.metadata import LICENCE, Quantity, cited


def covariate(term: GreyBoxTerm) -> str:
    """Its covariate as an identifier."""
    return re.sub(r"\W+", "_", term.covariate)


def term_form(term: GreyBoxTerm, name: str) -> Form:
    """The form of a grey-box term."""
    z, unit = covariate(term), term.unit or "-"
    suffix = "_" + re.sub(r"\W+", "_", unit).strip("_") if term.unit else ""
    meaning = f"what {term.response} is found to depend on"
    low, high = (float(x) for x in term.window)
    window = f"{low:.6g} to {high:.6g} [{unit}]"
    limit = f"{z} is 0" if term.exponent > 0.0 else f"{z} grows without bound"
    quantity = Quantity(
        f"factor on {term.response}, a function of {z}",
        "factor",
        (
            f"factor = (1 + added)^{'+1' if term.side > 0 else '-1'},",
            f"added = {term.amplitude:.6g} ({z} / {term.reference:.6g})^{term.exponent:.6g}.",
            f"It describes a residual and names no cause; fitted from {window}.",
            f"It is exactly 1 where {limit}.",
        ),
    )
    hash_ = term.content_hash()
    facts = {
        "name": name,
        "quantity": f"{quantity.title} [-]",
        "kind": "term",
        "response": term.response,
        "greybed_version": __version__,
        "hash": hash_,
        "dataset_hash": str(term.card.get("data_sha256", "")),
        "licence": LICENCE,
        "citation": cited(term.card, quantity.title, hash_),
        f"marker_{z}": f"{meaning} [{unit}], fitted from {window}",
    }
    values, factors = term.golden_rows()
    open_ = term.exponent < 0.0
    return Form(
        name,
        facts,
        quantity,
        "term",
        (Marker(z, meaning, 0.0, np.inf, low_open=open_),),
        ("factor",),
        (Field(z + suffix, meaning, unit),),
        (values[:, None], factors[:, None]),
        [],
        "term.hpp",
        {
            "amplitude": repr(float(term.amplitude)),
            "reference": repr(float(term.reference)),
            "exponent": repr(float(term.exponent)),
            "side": term.side,
            "low": repr(low),
            "high": repr(high),
            "limit": limit,
        },
        unit,
    )
