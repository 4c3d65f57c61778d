"""What every room shares: packings, walls, errors with remedies, files with provenance."""

import os
from pathlib import Path

from greybed.core.errors import (
    GreybedError,
    InputError,
    OutputError,
    RangeError,
    VerificationError,
)
from greybed.core.kernel_cache import refresh
from greybed.core.packing import Overlaps, Packing
from greybed.core.walls import Cone, Cylinder, Disc, Mesh, Plane, Polygon, Wall, box_walls

# Here, for every room comes by before its kernels are called. Where Numba is told of another place,
# what it keeps there is the user's to look after.
if not os.environ.get("NUMBA_CACHE_DIR"):
    refresh(Path(__file__).parents[1])

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
