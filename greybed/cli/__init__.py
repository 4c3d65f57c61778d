"""The ``greybed`` command: one file per verb, loaded only when that verb runs."""

from greybed.cli.main import main

__all__ = ["main"]
