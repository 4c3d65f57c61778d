"""Columns and parameters that the shipped models know, with their dimensions."""

from __future__ import annotations

# column or parameter -> key of greybed.core.units.DIMENSIONS
DIMENSIONS = {
    "diameter": "length",
    "particle_diameter": "length",
    "tube_diameter": "length",
    "mean_free_path": "length",
    "bed_length": "length",
    "wall_distance": "length",
    "fill_height": "length",
    "silo_diameter": "length",
    "cell_size": "length",
    "velocity": "velocity",
    "superficial_velocity": "velocity",
    "impact_velocity": "velocity",
    "particle_density": "density",
    "fluid_density": "density",
    "viscosity": "viscosity",
    "temperature": "temperature",
    "reference_temperature": "temperature",
    "pressure": "pressure",
    "outlet_pressure": "pressure",
    "gas_pressure": "pressure",
    "stress": "pressure",
    "pressure_gradient": "pressure gradient",
    "conductivity": "conductivity",
    "solid_conductivity": "conductivity",
    "gas_conductivity": "conductivity",
    "void_fraction": "dimensionless",
    "sphericity": "dimensionless",
    "turbulence_intensity": "dimensionless",
    "fines_fraction": "dimensionless",
    "emissivity": "dimensionless",
}
