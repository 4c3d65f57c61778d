"""Training: data set -> fit -> artifact -> score card."""

from greybed.training.score import score
from greybed.training.viewfactor import train

__all__ = ["score", "train"]
