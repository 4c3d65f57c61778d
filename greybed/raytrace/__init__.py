"""Monte-Carlo ray tracing of packings: view factors, each with its standard error."""

from greybed.raytrace.errors import standard_error
from greybed.raytrace.firsthits import first_hits
from greybed.raytrace.pairs import PairFactors, pair_factors
from greybed.raytrace.smoothing import smoothed
from greybed.raytrace.viewfactors import ViewFactors, view_factors

__all__ = [
    "PairFactors",
    "ViewFactors",
    "first_hits",
    "pair_factors",
    "smoothed",
    "standard_error",
    "view_factors",
]
