"""Grey-box closures: exact limits, bounded correction, torch-free evaluation, one file each."""

from greybed.closures.artifact import (
    content_hash,
    golden_rows,
    load,
    load_any,
    load_drag,
    save,
)
from greybed.closures.drag.filtered import FilteredDragClosure
from greybed.closures.shipping import model_path, shipped, shipped_drag, shipped_names
from greybed.closures.viewfactor import ViewFactorClosure, exact_view_factor

__all__ = [
    "FilteredDragClosure",
    "ViewFactorClosure",
    "content_hash",
    "exact_view_factor",
    "golden_rows",
    "load",
    "load_any",
    "load_drag",
    "model_path",
    "save",
    "shipped",
    "shipped_drag",
    "shipped_names",
]
