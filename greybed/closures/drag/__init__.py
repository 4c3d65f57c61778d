"""Drag laws of spheres, alone and in beds, in one convention."""

from greybed.closures.drag.laws import LAWS, DragLaw, drag_law

__all__ = ["LAWS", "DragLaw", "drag_law"]
