"""greybed: grey-box closures for particle beds.

Importing the package is cheap; ``greybed.Packing``, ``greybed.read_packing``,
``greybed.write_packing`` and the rooms (``greybed.raytrace``, ``greybed.closures``, ...) load on
first use.
"""

from importlib import import_module
from typing import Any

from greybed._version import __version__

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
