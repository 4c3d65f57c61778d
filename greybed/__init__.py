"""greybed: grey-box closures for particle beds.

Importing the package is cheap; ``greybed.Packing``, ``greybed.read_packing``,
``greybed.write_packing`` and the rooms (``greybed.raytrace``, ``greybed.closures``, ...) load on
first use.
"""

import os
from importlib import import_module
from pathlib import Path
from typing import Any

from greybed._kernel_cache import refresh
from greybed._version import __version__

# Where Numba is told of another place, what it keeps there is the user's to look after.
if not os.environ.get("NUMBA_CACHE_DIR"):
    refresh(Path(__file__).parent)

_NAMES = {
    "Packing": "greybed.core",
    "read_packing": "greybed.core.readers",
    "write_packing": "greybed.core.writers",
}
_ROOMS = ("core", "raytrace", "closures", "coupling", "export", "datasets", "training", "report")

__all__ = ["__version__", *_NAMES, *_ROOMS]


def __getattr__(name: str) -> Any:
    if name in _NAMES:
        return getattr(import_module(_NAMES[name]), name)
    if name in _ROOMS:
        return import_module(f"greybed.{name}")
    raise AttributeError(f"module 'greybed' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
