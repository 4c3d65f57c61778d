"""Effective thermal conductivity of beds of spheres."""

from greybed.closures.conductivity.laws import STEFAN_BOLTZMANN, zehner_schluender

__all__ = ["STEFAN_BOLTZMANN", "zehner_schluender"]
