"""Exact view factor of two free spheres; it lives in core, for the tracer needs it too."""

from greybed.core.exact import NODES, TOUCHING, exact_view_factor, pair_factor, quadrature

__all__ = ["NODES", "TOUCHING", "exact_view_factor", "pair_factor", "quadrature"]
