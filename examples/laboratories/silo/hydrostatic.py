"""What the study believes: the floor carries the weight of the fill."""

import numpy as np

GRAVITY = 9.81  # m/s2


def floor_pressure(columns, parameters, amplitudes):
    """Weight over area [Pa]; ``stuck-fill`` takes the share A of it away."""
    area = 0.25 * np.pi * columns["silo_diameter"] ** 2
    pressure = columns["fill_mass"] * GRAVITY / area
    stuck = amplitudes.get("stuck-fill", 0.0)
    return pressure * (1.0 - stuck) if stuck else pressure
