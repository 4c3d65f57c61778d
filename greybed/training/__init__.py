"""Training: data set -> fit -> artifact -> score card."""

from greybed.training.curve import learning_curve
from greybed.training.regimes import regimes
from greybed.training.score import score
from greybed.training.viewfactor import train

__all__ = ["learning_curve", "regimes", "score", "train"]
