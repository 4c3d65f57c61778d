"""Viscosity of the liquid from its flow through a capillary (Hagen and Poiseuille).

Run: python viscosity.py
"""

import csv
from pathlib import Path

import numpy as np

RADIUS, RADIUS_SD = 0.75e-3, 0.005e-3  # m
LENGTH, LENGTH_SD = 0.1, 0.5e-3  # m
HEADS, HEAD_SD = (0.526, 0.520), 1e-3  # m, at the start and at the end
DENSITY = 1147.6  # kg/m3
GRAVITY = 9.81  # m/s2


def viscosity() -> tuple[float, float]:
    """Viscosity and its standard deviation [Pa s]."""
    with open(Path(__file__).with_name("viscosity.csv")) as stream:
        rows = list(csv.reader(stream))[1:]
    volume, time = np.array(rows, dtype=float).T * np.array([[1e-6], [1.0]])
    (rate, _), covariance = np.polyfit(time, volume, 1, cov=True)
    head = float(np.mean(HEADS))
    value = np.pi * DENSITY * GRAVITY * head * RADIUS**4 / (8.0 * rate * LENGTH)
    shares = (
        np.sqrt(covariance[0, 0]) / rate,
        4.0 * RADIUS_SD / RADIUS,
        LENGTH_SD / LENGTH,
        HEAD_SD / head,
    )
    return float(value), float(value * np.sqrt(np.sum(np.square(shares))))


if __name__ == "__main__":
    value, sd = viscosity()
    print(f"{1e3 * value:.1f} +- {1e3 * sd:.1f} mPa s")
