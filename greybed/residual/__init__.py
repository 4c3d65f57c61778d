"""Closing the loop with measured data: residual, missing effect, effect in the model, new error."""

from greybed.residual.analysis import diagnose
from greybed.residual.diagnosis import Diagnosis
from greybed.residual.effect import Effect
from greybed.residual.read import read_study
from greybed.residual.study import Noise, Options, Parameter, Study, Table

__all__ = [
    "Diagnosis",
    "Effect",
    "Noise",
    "Options",
    "Parameter",
    "Study",
    "Table",
    "diagnose",
    "read_study",
]
