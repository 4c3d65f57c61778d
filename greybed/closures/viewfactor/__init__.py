"""View factors between spheres: the exact law, dimensionless markers, the closure."""

from greybed.closures.viewfactor.closure import Prediction, ViewFactorClosure
from greybed.closures.viewfactor.markers import PairMarkers, pair_markers
from greybed.closures.viewfactor.neighbourhood import Neighbourhood, neighbourhood
from greybed.closures.viewfactor.visibility import MARKER_SETS, MarkerSet
from greybed.core.exact import exact_view_factor

__all__ = [
    "MARKER_SETS",
    "MarkerSet",
    "Neighbourhood",
    "PairMarkers",
    "Prediction",
    "ViewFactorClosure",
    "exact_view_factor",
    "neighbourhood",
    "pair_markers",
]
