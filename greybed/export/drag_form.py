"""Filtered drag as a form to export: numbers of its features, gate and force."""

from __future__ import annotations

from typing import Any

from greybed.closures import FilteredDragClosure, golden_rows
from greybed.closures.drag.filtered import features as shape
from greybed.closures.drag.filtered.closure import (
    LOG_BOUND,
    PARCEL_RATE,
    SHARE_BOUND,
    SPREAD_BOUND,
)
from greybed.closures.drag.filtered.force import FADE
from greybed.export.form import Field, Form
from greybed.export.metadata import QUANTITIES, describe
from greybed.export.tables import learnt_context, learnt_tables

OUTPUTS = ("kept_along", "kept_across", "share", "stderr")
# Numbers of the features, by the names that the template has for them.
SMALL = {
    "dilute": shape.DILUTE,
    "filter": shape.SMALL_FILTER,
    "across": shape.SMALL_ACROSS,
    "slip2": shape.SMALL_SLIP2,
    "fraction": shape.SMALL_FRACTION,
    "ratio": shape.SMALL_RATIO,
    "slip_bend": shape.SLIP_BEND,
    "gradient_bend": shape.GRADIENT_BEND,
}
_AXES = ("x", "y", "z")
# Rows of the test program and of the C interface, flat.
INPUTS = (
    Field("diameter_m", "diameter of the particles", "m"),
    Field("particle_density_kg_m3", "density of the particles", "kg m-3"),
    Field("gas_density_kg_m3", "density of the gas", "kg m-3"),
    Field("gas_viscosity_pa_s", "viscosity of the gas", "Pa s"),
    *(Field(f"gravity_{a}_m_s2", "gravity", "m s-2") for a in _AXES),
    Field("solid_fraction", "solid fraction, filtered", "-"),
    *(
        Field(f"slip_{a}_m_s", "velocity of the gas less that of the solids", "m s-1")
        for a in _AXES
    ),
    *(Field(f"pressure_gradient_{a}_pa_m", "pressure gradient", "Pa m-1") for a in _AXES),
    Field("filter_size_m", "edge of the filter", "m"),
    Field("drag_factor", "F of the drag law", "-"),
    Field("drag_steep", "Re dF/dRe of the drag law", "-"),
    Field("parcels", "diameter of a parcel over that of its particles", "-"),
)


def drag_form(closure: FilteredDragClosure, name: str) -> Form:
    """The form of a closure of filtered drag.

    Raises
    ------
    InputError
        If it holds numbers that are not finite, or its network has no layer between.
    """
    chosen = closure.markers
    context: dict[str, Any] = {
        **learnt_context(closure.predictor, closure.domain),
        "convention": "fraction kept",
        "with_material": True,
        "n_before": 7,
        "n_material": 18,
        "law": closure.card.get("law", "of none, for it is untrained"),
        "features": [(label, "") for label in chosen.feature_names],
        "gradient": chosen.marked,
        "pressure": chosen.pressure,
        "outputs_raw": chosen.outputs,
        "gate": {k: repr(v) for k, v in vars(closure.gate).items()},
        "small": {k: repr(v) for k, v in SMALL.items()},
        "log_bound": repr(LOG_BOUND),
        "spread_bound": repr(SPREAD_BOUND),
        "share_bound": repr(SHARE_BOUND),
        "parcel_rate": repr(PARCEL_RATE),
        "fade": repr(FADE),
    }
    return Form(
        name,
        describe(closure, name),
        QUANTITIES[closure.quantity],
        closure.kind,
        chosen.markers,
        OUTPUTS,
        INPUTS,
        golden_rows(closure),
        learnt_tables(closure.predictor, closure.domain),
        "drag.hpp",
        context,
    )
