"""Filtered drag of coarse grids as the fraction kept of a drag law: closures, published models."""

from greybed.closures.drag.filtered.baselines import BASELINES, PublishedDrag, baseline
from greybed.closures.drag.filtered.closure import (
    DragPrediction,
    DragSlopes,
    FilteredDragClosure,
)
from greybed.closures.drag.filtered.features import MARKER_SETS
from greybed.closures.drag.filtered.force import FilteredForce, KeptDrag, filtered_force
from greybed.closures.drag.filtered.gate import Gate
from greybed.closures.drag.filtered.markers import drag_markers, frame_of
from greybed.closures.drag.filtered.materials import Material

__all__ = [
    "BASELINES",
    "MARKER_SETS",
    "DragPrediction",
    "DragSlopes",
    "FilteredDragClosure",
    "FilteredForce",
    "Gate",
    "KeptDrag",
    "Material",
    "PublishedDrag",
    "baseline",
    "drag_markers",
    "filtered_force",
    "frame_of",
]
