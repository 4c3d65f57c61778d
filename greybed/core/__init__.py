"""What every room shares: packings, walls, errors with remedies, files with provenance."""

from greybed.core.errors import (
    GreybedError,
    InputError,
    OutputError,
    RangeError,
    VerificationError,
)
from greybed.core.packing import Overlaps, Packing
from greybed.core.walls import Cone, Cylinder, Disc, Mesh, Plane, Polygon, Wall, box_walls

__all__ = [
    "Cone",
    "Cylinder",
    "Disc",
    "GreybedError",
    "InputError",
    "Mesh",
    "OutputError",
    "Overlaps",
    "Packing",
    "Plane",
    "Polygon",
    "RangeError",
    "VerificationError",
    "Wall",
    "box_walls",
]
