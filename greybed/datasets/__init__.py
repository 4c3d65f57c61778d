"""Generators: packings, lattices, size distributions, view-factor data sets."""
