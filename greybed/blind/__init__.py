"""Blind tests of the residual analysis: sealed data sets, score card, competitors.

The generator (``truths``, ``worlds``, ``generate``) imports nothing of the analysis and writes the
physics down for itself, so that a mistake in the catalogue cannot hide in the data.
"""
