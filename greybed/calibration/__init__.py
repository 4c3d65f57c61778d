"""Calibration: measured bulk behaviour -> parameters of a simulation, with the ambiguity stated."""

from greybed.calibration.answer import Answer
from greybed.calibration.calibrate import calibrate
from greybed.calibration.experiment import Experiment, Measure, RunFailed
from greybed.calibration.parameters import Parameter, Space
from greybed.calibration.study import Options, Study, Target

__all__ = [
    "Answer",
    "Experiment",
    "Measure",
    "Options",
    "Parameter",
    "RunFailed",
    "Space",
    "Study",
    "Target",
    "calibrate",
]
