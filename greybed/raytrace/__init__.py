"""Monte-Carlo ray tracing of packings: view and exchange factors, each with its standard error."""

from greybed.raytrace.errors import standard_error
from greybed.raytrace.exchange import exchange_factors, exchange_of_rays
from greybed.raytrace.exchange_results import (
    ExchangeFactors,
    ExchangeRows,
    ImagePairs,
    PatchExchange,
    RayShares,
)
from greybed.raytrace.firsthits import first_hits
from greybed.raytrace.macroscopic import (
    RadiativeExchangeFactor,
    breitbach_barthels,
    radiative_exchange_factor,
)
from greybed.raytrace.pairs import PairFactors, pair_factors
from greybed.raytrace.patches import PatchFactors, patch_factors
from greybed.raytrace.smoothing import smoothed
from greybed.raytrace.viewfactors import ViewFactors, view_factors

__all__ = [
    "ExchangeFactors",
    "ExchangeRows",
    "ImagePairs",
    "PairFactors",
    "PatchExchange",
    "PatchFactors",
    "RadiativeExchangeFactor",
    "RayShares",
    "ViewFactors",
    "breitbach_barthels",
    "exchange_factors",
    "exchange_of_rays",
    "first_hits",
    "pair_factors",
    "patch_factors",
    "radiative_exchange_factor",
    "smoothed",
    "standard_error",
    "view_factors",
]
