"""Grey-box closures: exact limits, bounded correction, torch-free evaluation, one file each."""

from greybed.closures.artifact import content_hash, golden_rows, load, save
from greybed.closures.shipping import model_path, shipped, shipped_names
from greybed.closures.viewfactor import ViewFactorClosure, exact_view_factor

__all__ = [
    "ViewFactorClosure",
    "content_hash",
    "exact_view_factor",
    "golden_rows",
    "load",
    "model_path",
    "save",
    "shipped",
    "shipped_names",
]
