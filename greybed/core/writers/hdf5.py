"""The project's own HDF5 packing, version 1: everything a packing holds, to the last digit."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from greybed.core.packing import Packing
from greybed.core.readers.hdf5 import FORMAT, VERSION
from greybed.core.records import record
from greybed.core.walls import Mesh
from greybed.core.writers.hdf5_stream import written_hdf5


def write(packing: Packing, path: Path, fields: dict[str, NDArray[np.float64]]) -> None:
    """Write datasets with units and check sums, the walls as JSON, meshes as datasets.

    Parameters
    ----------
    packing : Packing
        The bed [m].
    path : Path
        Where to write.
    fields : dict
        Empty; this version of the format holds none.
    """

    # File structures since HDF5 1.10 carry check sums, and texts of fixed length need no heap:
    # in a damaged heap the HDF5 library can search for ever.
    with written_hdf5(path, libver=("v110", "v110")) as root:
        root.attrs["format"] = np.bytes_(FORMAT)
        root.attrs["version"] = VERSION
        root.attrs["periodic"] = np.array(packing.periodic, dtype=np.uint8)
        root.attrs["walls"] = np.bytes_(json.dumps([record(w) for w in packing.walls]))
        lengths = [("centres", packing.centres), ("radii", packing.radii), ("box", packing.box)]
        for k, wall in enumerate(packing.walls):
            if isinstance(wall, Mesh):
                lengths.append((f"wall_{k}_vertices", wall.vertices))
                root.create_dataset(
                    f"wall_{k}_faces", data=wall.faces, chunks=True, fletcher32=True
                )
        for name, values in lengths:
            if values is not None:
                # Check sums: a flipped bit on a disk must not become a moved sphere.
                dataset = root.create_dataset(name, data=values, chunks=True, fletcher32=True)
                dataset.attrs["units"] = np.bytes_("m")
