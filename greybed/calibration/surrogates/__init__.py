"""Surrogates of a simulation over the unit cube of its parameters, with their errors."""

from greybed.calibration.surrogates.base import Sample, Surrogate
from greybed.calibration.surrogates.feasibility import Feasibility
from greybed.calibration.surrogates.gp import GaussianProcess
from greybed.calibration.surrogates.learners import Forest, Network
from greybed.calibration.surrogates.quadratic import Quadratic

__all__ = [
    "Feasibility",
    "Forest",
    "GaussianProcess",
    "Network",
    "Quadratic",
    "Sample",
    "Surrogate",
]
