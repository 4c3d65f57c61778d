"""Monte-Carlo ray tracing of packings: view and exchange factors, each with its standard error."""

from greybed.raytrace.exchange import (
    ExchangeFactors,
    ExchangeRows,
    ImagePairs,
    RayShares,
    exchange_factors,
    exchange_of_rays,
)
from greybed.raytrace.firsthits import first_hits
from greybed.raytrace.viewfactors import ViewFactors, standard_error, view_factors

__all__ = [
    "ExchangeFactors",
    "ExchangeRows",
    "ImagePairs",
    "RayShares",
    "ViewFactors",
    "exchange_factors",
    "exchange_of_rays",
    "first_hits",
    "standard_error",
    "view_factors",
]
