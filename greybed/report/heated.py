"""The heated beds of the quickstart: traced view factors beside those of a closure."""

from __future__ import annotations

import time
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed.closures import load
from greybed.closures.artifact import SUFFIX
from greybed.core import Cylinder, Packing, Plane
from greybed.core.readers import read_packing
from greybed.core.writers import write_packing
from greybed.coupling import Material, Rows, ThermalBed
from greybed.raytrace import view_factors
from greybed.report.stages import Result

# name of the bed, file, a plane just above its highest sphere [m]
BEDS = (
    ("monodisperse", "settled_mono_4k.dump", 0.0375),
    ("tridisperse", "settled_tridisperse_6k.dump", 0.0360),
)
# The closure that the heated beds run with.
RUNNING = "viewfactor_mlp_pencil"
CONTAINER_RADIUS = 0.0299  # [m]
WALL_TEMPERATURE = 1073.15  # [K]
TOP_TEMPERATURE = 298.15  # [K]
EMISSIVITY = 0.9  # [-]
# Alumina near 800 degC; its modulus over that of the simulated, softer spheres.
MATERIAL = Material(
    conductivity=8.0,
    density=3900.0,
    heat_capacity=1200.0,
    emissivity=EMISSIVITY,
    stiffness_ratio=6.0e4,
)


def _bed_file(name: str) -> Path:
    return Path(str(files("greybed.datasets").joinpath("packings", name)))


def walled(file: str, top: float, share: float = 1.0) -> Packing:
    """A settled bed in its can, or its lowest share, with a plane for what stands above it."""
    top = share * top
    walls = (
        Cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), CONTAINER_RADIUS, name="side"),
        Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), name="floor"),
        Plane((0.0, 0.0, top), (0.0, 0.0, -1.0), name="top"),
    )
    bed = read_packing(_bed_file(file))
    below = bed.centres[:, 2] + bed.radii < top
    return Packing(bed.centres[below], bed.radii[below], walls=walls)


def heat(folder: Path, name: str, file: str, top: float, seed: int, small: bool) -> Result:
    """Solve one bed twice, with traced factors and with the closure's, and compare."""
    # For tests: less of the bed, fewer rays, and a shorter reach show the way.
    packing = walled(file, top, 0.25 if small else 1.0)
    temperatures = {"side": WALL_TEMPERATURE, "floor": None, "top": TOP_TEMPERATURE}
    rays = 500 if small else 20_000
    solved: dict[str, Any] = {}
    fields: dict[str, NDArray] = {}
    closure = load(folder / (RUNNING + SUFFIX))
    for source in ("traced", "closure"):
        begin = time.perf_counter()
        rows: Any
        extra: dict[str, Any]
        if source == "traced":
            rows = view_factors(packing, rays=rays, seed=seed, show_progress=not small)
            extra = {"rays": rays}
        else:
            reach = 6.0 * float(packing.radii.mean()) if small else None
            rows = closure.bed_factors(packing, reach=reach)
            extra = {"closure": RUNNING, "extrapolated": rows.extrapolated}
        bed = ThermalBed(
            packing, Rows.of(rows, packing), material=MATERIAL,
            wall_temperatures=[temperatures[w.name] for w in packing.walls],
            environment_temperature=TOP_TEMPERATURE,
        )  # fmt: skip
        result = bed.steady()
        t = result.temperatures
        fields[source] = t
        solved[source] = {
            **extra,
            "seconds": time.perf_counter() - begin,
            "mean_K": float(t.mean()),
            "min_K": float(t.min()),
            "max_K": float(t.max()),
            "wall_heat_W": {
                wall.name: {"conduction": float(c), "radiation": float(r)}
                for wall, c, r in zip(
                    packing.walls, result.wall_conduction, result.wall_radiation, strict=True
                )
            },
            "energy_error": float(result.energy_error),
        }
    difference = fields["closure"] - fields["traced"]
    heat = {s: {w: sum(q.values()) for w, q in solved[s]["wall_heat_W"].items()} for s in solved}
    path = folder / f"bed_{name}.vtu"
    write_packing(
        packing,
        path,
        fields={f"temperature {source} [K]": values for source, values in fields.items()},
    )
    results = {
        "bed": name,
        "spheres": len(packing),
        "emissivity": EMISSIVITY,
        "wall_temperatures": {w: t for w, t in temperatures.items() if t is not None},
        **solved,
        "difference": {
            "rms_K": float(np.sqrt((difference**2).mean())),
            "max_K": float(np.abs(difference).max()),
            "span_K": WALL_TEMPERATURE - TOP_TEMPERATURE,
            "flux_relative": {
                w: heat["closure"][w] / heat["traced"][w] - 1.0
                for w in ("side", "top")
            },
        },
    }  # fmt: skip
    return results, {"centres": packing.centres, "radii": packing.radii, **fields}, [path]
