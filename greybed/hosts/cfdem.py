"""CFDEMcoupling as a host: text of a force model, neither compiled nor run here."""

from __future__ import annotations

from pathlib import Path

from greybed.core.errors import InputError
from greybed.hosts.model import DRAG, HostModel
from greybed.hosts.writing import write_adapter


def generate(model: HostModel, folder: Path) -> list[str]:
    """Write the text.

    Raises
    ------
    InputError
        If the model is not one of drag.
    """
    if model.kind != DRAG:
        raise InputError(f"the host cfdem takes models of drag only, not {model.text}.")
    files = {
        "greybed_drag.hpp": "common/greybed_drag.hpp",
        "GreybedDrag.H": "cfdem/GreybedDrag.H",
        "GreybedDrag.C": "cfdem/GreybedDrag.C",
    }
    return write_adapter(model, "CFDEMcoupling", folder, files)
