"""A correction of drag by the name that case files use: a published model, a file, shipped."""

from __future__ import annotations

import os

from greybed.closures.artifact import SUFFIX, load_drag
from greybed.closures.drag.filtered.baselines import PublishedDrag, baseline
from greybed.closures.drag.filtered.closure import FilteredDragClosure
from greybed.closures.shipping import PREFIX, model_path


def kept_drag(name: str | os.PathLike[str]) -> FilteredDragClosure | PublishedDrag:
    """The closure or published model of that name.

    Parameters
    ----------
    name : str or path
        One of ``BASELINES``, a ``.closure`` file, or ``shipped:NAME``.

    Raises
    ------
    InputError
        If there is none, or the file holds something else.
    """
    text = os.fspath(name)
    if PREFIX in text or text.endswith(SUFFIX):
        return load_drag(model_path(text))
    # A case file turns relative paths into paths beside it; names of models are no paths.
    return baseline(os.path.basename(text))
