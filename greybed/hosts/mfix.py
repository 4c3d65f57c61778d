"""MFIX as a host: text of a drag routine, compile-checked, never run with MFIX."""

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
        raise InputError(f"the host mfix takes models of drag only, not {model.text}.")
    files = {
        "greybed_drag.hpp": "common/greybed_drag.hpp",
        "usr_drag.f": "mfix/usr_drag.f",
        "greybed_mfix.cpp": "mfix/greybed_mfix.cpp",
    }
    return write_adapter(model, "MFIX", folder, files)
