"""Drag laws of spheres, alone and in beds, in one convention."""

from greybed.closures.drag.law import DragLaw
from greybed.closures.drag.laws import LAWS, drag_law
from greybed.closures.drag.sizes import MIXTURES, mixture_factor, sauter_mean

__all__ = ["LAWS", "MIXTURES", "DragLaw", "drag_law", "mixture_factor", "sauter_mean"]
