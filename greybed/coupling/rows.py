"""Rows of view factors of a bed and their balance, as the thermal bed takes them."""

from greybed.core.rows import Rows, balanced

__all__ = ["Rows", "balanced"]
