"""What every room shares: packings, walls, errors with remedies, files with provenance."""

from greybed.core.errors import (
    GreybedError,
    InputError,
    OutputError,
    RangeError,
    VerificationError,
)
from greybed.core.packing import Overlaps, Packing
from greybed.core.walls import Cylinder, Plane, Wall

__all__ = [
    "Cylinder",
    "GreybedError",
    "InputError",
    "OutputError",
    "Overlaps",
    "Packing",
    "Plane",
    "RangeError",
    "VerificationError",
    "Wall",
]
