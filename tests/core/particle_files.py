"""Small particle files for the reader tests, written independently of greybed's own writers."""

import numpy as np

HEADER = (
    "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n{n}\nITEM: BOX BOUNDS {flags}\n{box}"
    "ITEM: ATOMS {columns}\n"
)
BOX = "0 1\n0 1\n0 2\n"
ROWS = ("3 0.1 0.2 0.3 0.05", "1 0.5 0.5 1.5 0.1", "2 0.9 0.8 0.7 0.02")
"""Three spheres: id x y z radius; the first row is in line 10 of a dump."""


def dump(
    rows=ROWS, *, columns="id x y z radius", n=None, flags="ff ff ff", box=BOX, end="\n"
) -> str:
    head = HEADER.format(n=len(rows) if n is None else n, flags=flags, box=box, columns=columns)
    return head + "\n".join(rows) + end


def csv(rows=("100,200,300,50", "500,500,1500,100"), header="x [mm],y [mm],z [mm],radius [mm]"):
    return "\n".join((header, *rows)) + "\n"


CENTRES = np.array([[0.1, 0.2, 0.3], [0.5, 0.5, 1.5], [0.9, 0.8, 0.7]])
RADII = np.array([0.05, 0.1, 0.02])


def vtk(
    *, binary=False, dataset="POLYDATA", real="double", centres=CENTRES, radii=RADII, name="radius"
) -> bytes:
    """Legacy VTK as VTK's own writer lays it out: cells, a scalar, then a field of two arrays."""
    n = len(centres)
    kind = {"float": ">f4", "double": ">f8"}[real]

    def numbers(values, code):
        if binary:
            return np.asarray(values).astype(code).tobytes() + b"\n"
        return (" ".join(f"{v!r}" for v in np.ravel(values).tolist()) + "\n").encode()

    cells = np.stack([np.ones(n, int), np.arange(n)], axis=1)
    out = b"# vtk DataFile Version 3.0\nspheres\n" + (b"BINARY" if binary else b"ASCII") + b"\n"
    out += f"DATASET {dataset}\nPOINTS {n} {real}\n".encode() + numbers(centres, kind)
    if dataset == "POLYDATA":
        out += f"VERTICES {n} {2 * n}\n".encode() + numbers(cells, ">i4")
    else:
        out += f"CELLS {n} {2 * n}\n".encode() + numbers(cells, ">i4")
        out += f"CELL_TYPES {n}\n".encode() + numbers(np.ones(n, int), ">i4")
    out += f"POINT_DATA {n}\nSCALARS density {real} 1\nLOOKUP_TABLE default\n".encode()
    out += numbers(np.ones(n), kind)
    out += f"FIELD FieldData 2\nv 3 {n} {real}\n".encode() + numbers(np.zeros((n, 3)), kind)
    return out + f"{name} 1 {n} {real}\n".encode() + numbers(radii, kind)
