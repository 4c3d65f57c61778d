"""Samples of a run over time as CSV."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from greybed.core.files import atomic_path


def write_history(path: str | os.PathLike[str], rows: Sequence[Mapping[str, float]]) -> Path:
    """Write one line for each sample, whole or not at all.

    Parameters
    ----------
    path : path
        ``.csv`` file to write.
    rows : sequence of dicts
        Samples with the same names, units in them.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    with atomic_path(path) as part, open(part, "w") as stream:
        stream.write(",".join(rows[0]) + "\n")
        for row in rows:
            stream.write(",".join(f"{value:.9g}" for value in row.values()) + "\n")
    return Path(path)
