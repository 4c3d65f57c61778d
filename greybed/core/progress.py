"""One progress bar for all long work: what, how far, how long still; on standard error."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def progress(total: int, label: str, *, show: bool = True) -> Iterator[Callable[[int], object]]:
    """Yield a function that advances the bar by so many steps.

    Parameters
    ----------
    total : int
        Number of steps [-].
    label : str
        What is being done.
    show : bool
        Whether to draw; a library call stays silent.
    """
    if not show:
        yield lambda steps: None
        return
    from tqdm import tqdm

    # In a log file a bar that redraws ten times a second is noise: every few seconds is enough.
    interval = 0.2 if sys.stderr.isatty() else 5.0
    with tqdm(
        total=total, desc=label, file=sys.stderr, mininterval=interval, unit_scale=True
    ) as bar:
        yield bar.update
