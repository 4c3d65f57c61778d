"""The project's own HDF5 packing, version 1: everything a packing holds, to the last digit."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from greybed.core.packing import Packing
from greybed.core.readers.hdf5 import FORMAT, VERSION
from greybed.core.walls import Plane, Wall


def _record(wall: Wall) -> dict[str, object]:
    if isinstance(wall, Plane):
        return {"kind": "plane", "name": wall.name, "point": wall.point, "normal": wall.normal}
    return {
        "kind": "cylinder",
        "name": wall.name,
        "point": wall.point,
        "axis": wall.axis,
        "radius": float(wall.radius),
    }


def write(packing: Packing, path: Path, fields: dict[str, NDArray[np.float64]]) -> None:
    """Write datasets with units and check sums, and the walls as JSON in an attribute.

    Parameters
    ----------
    packing : Packing
        The bed [m].
    path : Path
        Where to write.
    fields : dict
        Empty; this version of the format holds none.
    """
    import h5py

    # File structures since HDF5 1.10 carry check sums, and texts of fixed length need no heap:
    # in a damaged heap the HDF5 library can search for ever.
    with h5py.File(path, "w", libver=("v110", "v110")) as root:
        root.attrs["format"] = np.bytes_(FORMAT)
        root.attrs["version"] = VERSION
        root.attrs["periodic"] = np.array(packing.periodic, dtype=np.uint8)
        root.attrs["walls"] = np.bytes_(json.dumps([_record(wall) for wall in packing.walls]))
        for name, values in (
            ("centres", packing.centres),
            ("radii", packing.radii),
            ("box", packing.box),
        ):
            if values is not None:
                # Check sums: a flipped bit on a disk must not become a moved sphere.
                dataset = root.create_dataset(name, data=values, chunks=True, fletcher32=True)
                dataset.attrs["units"] = np.bytes_("m")
