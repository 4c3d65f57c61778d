"""Monte-Carlo ray tracing of packings: view factors, each with its standard error."""

from greybed.raytrace.errors import standard_error
from greybed.raytrace.firsthits import first_hits
from greybed.raytrace.viewfactors import ViewFactors, view_factors

__all__ = ["ViewFactors", "first_hits", "standard_error", "view_factors"]
