"""Spheres and grains settle in OpenFOAM; writes the tables of this folder.

Needs ``icoUncoupledKinematicParcelFoam`` (OpenFOAM 1912, Debian package ``openfoam``); seconds.
Spheres follow ``sphereDrag`` (24 (1 + Re^(2/3) / 6) / Re), grains ``nonSphereDrag`` (Haider and
Levenspiel, 1989) with a sphericity of 0.6, which no table tells. Each row is one particle: its true
diameter is off the nominal one by 1 % (sd), the reading of its velocity by 1 %.
Run: python make_data.py [--out FOLDER]
"""

import argparse
import os
import re
import subprocess
import tempfile
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
COMMAND = "icoUncoupledKinematicParcelFoam"
FLUID, VISCOSITY = 1150.0, 0.010  # kg/m3, Pa s
GLASS, STEEL = 2500.0, 7800.0  # kg/m3
SIZES = (0.3e-3, 0.4e-3, 0.55e-3, 0.75e-3, 1.0e-3, 1.3e-3, 1.7e-3, 2.2e-3, 3.0e-3)  # m
REPEATS = 4
SPREAD, READING = 0.01, 0.01
SPHERICITY = 0.6
HEAD = "FoamFile {{ version 2.0; format ascii; class {0}; object {1}; }}\n"

# name of the table, law, density [kg/m3], nominal diameters [m], seed
TABLES = (
    ("spheres", "sphereDrag", GLASS, SIZES, 1),
    ("spheres_held_out", "sphereDrag", STEEL, (1.5e-3, 2.5e-3), 2),
    ("grains", "grains", GLASS, SIZES, 3),
    ("grains_held_out", "grains", GLASS, (0.65e-3, 1.5e-3, 3.5e-3), 4),
)


def write(folder: Path, name: str, kind: str, text: str) -> None:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(HEAD.format(kind, path.name) + text)


def settle(law: str, density: float, diameters: np.ndarray) -> np.ndarray:
    """Velocity [m/s] of each particle after three seconds, when none is faster any more."""
    drag = f"nonSphereDrag {{ phi {SPHERICITY}; }}" if law == "grains" else "sphereDrag;"
    injections = "".join(
        f"m{k} {{ type manualInjection; massTotal 0; parcelBasisType fixed; nParticle 1; SOI 0;"
        f" positionsFile p{k}; U0 (0 0 0); sizeDistribution {{ type fixedValue;"
        f" fixedValueDistribution {{ value {d!r}; }} }} }}\n"
        for k, d in enumerate(map(float, diameters))
    )
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write(
            folder,
            "system/controlDict",
            "dictionary",
            f"""
application {COMMAND}; startFrom startTime; startTime 0; stopAt endTime; endTime 3; deltaT 1e-3;
writeControl runTime; writeInterval 3; writeFormat ascii; writePrecision 12; timePrecision 6;
""",
        )
        write(
            folder,
            "system/fvSchemes",
            "dictionary",
            """
ddtSchemes { default none; } gradSchemes { default none; } divSchemes { default none; }
laplacianSchemes { default none; } interpolationSchemes { default linear; }
snGradSchemes { default none; }
""",
        )
        write(folder, "system/fvSolution", "dictionary", "solvers { }\n")
        write(
            folder,
            "system/blockMeshDict",
            "dictionary",
            """
scale 1;
vertices ((0 0 -9) (1 0 -9) (1 1 -9) (0 1 -9) (0 0 1) (1 0 1) (1 1 1) (0 1 1));
blocks (hex (0 1 2 3 4 5 6 7) (1 1 4) simpleGrading (1 1 1));
boundary (sides { type patch;
 faces ((0 3 2 1) (4 5 6 7) (0 1 5 4) (1 2 6 5) (2 3 7 6) (3 0 4 7)); });
""",
        )
        write(
            folder,
            "0/U",
            "volVectorField",
            """
dimensions [0 1 -1 0 0]; internalField uniform (0 0 0);
boundaryField { sides { type fixedValue; value uniform (0 0 0); } }
""",
        )
        write(
            folder,
            "constant/g",
            "uniformDimensionedVectorField",
            """
dimensions [0 1 -2 0 0]; value (0 0 -9.80665);
""",
        )
        write(
            folder,
            "constant/transportProperties",
            "dictionary",
            f"rhoInf {FLUID}; transportModel Newtonian; nu {VISCOSITY / FLUID!r};\n",
        )
        write(folder, "constant/turbulenceProperties", "dictionary", "simulationType laminar;\n")
        write(
            folder,
            "constant/kinematicCloudProperties",
            "dictionary",
            f"""
solution {{ active true; coupled false; transient yes; cellValueSourceCorrection off; maxCo 0.3;
 interpolationSchemes {{ rho cell; U cell; mu cell; }} integrationSchemes {{ U Euler; }} }}
constantProperties {{ rho0 {density}; youngsModulus 1e8; poissonsRatio 0.35; }}
subModels {{
 particleForces {{ {drag} gravity; }}
 injectionModels {{ {injections} }}
 dispersionModel none; patchInteractionModel none; surfaceFilmModel none;
 stochasticCollisionModel none; collisionModel none;
}}
cloudFunctions {{ }}
""",
        )
        for k in range(len(diameters)):
            x = 0.1 + 0.8 * k / len(diameters)
            write(folder, f"constant/p{k}", "vectorField", f"(({x!r} 0.5 0.5))\n")
        done = subprocess.run(
            ["bash", "-c", "source /usr/share/openfoam/etc/bashrc >/dev/null 2>&1; "
             f"blockMesh && {COMMAND}"],
            cwd=folder, capture_output=True, text=True, check=False,
            env={**os.environ, "OMP_NUM_THREADS": "1"},
        )  # fmt: skip
        cloud = folder / "3/lagrangian/kinematicCloud"
        if done.returncode or not cloud.exists():
            raise RuntimeError(done.stdout[-2000:] + done.stderr[-2000:])
        speeds = numbers(cloud / "U").reshape(-1, 3)[:, 2]
        sizes = numbers(cloud / "d")
    # parcels come in any order: the diameters, all different, say which is which
    order = np.argsort(np.argsort(diameters))
    found: np.ndarray = -speeds[np.argsort(sizes)][order]
    return found


def numbers(path: Path) -> np.ndarray:
    """Numbers of a list that OpenFOAM wrote."""
    text = path.read_text()
    inner = re.search(r"\n\d+\s*\((.*)\)", text[text.index("}") :], re.S)
    if inner is None:
        raise RuntimeError(f"no list in {path}: {text[-500:]}")
    return np.array(re.sub(r"[()]", " ", inner[1]).split(), dtype=float)


def table(path: Path, law: str, density: float, sizes: tuple[float, ...], seed: int) -> None:
    rng = np.random.default_rng(seed)
    nominal = np.repeat(sizes, REPEATS)
    true = nominal * np.exp(SPREAD * rng.standard_normal(len(nominal)))
    read = settle(law, density, true) * np.exp(READING * rng.standard_normal(len(nominal)))
    with open(path, "w") as stream:
        stream.write("diameter [mm],repeat,particle_density [kg/m3],velocity [mm/s]\n")
        for k, (d, v) in enumerate(zip(nominal, read, strict=True)):
            stream.write(f"{1e3 * d:g},{k % REPEATS + 1},{density:g},{1e3 * v:.5g}\n")


def curve(folder: Path) -> None:
    """Means of ``spheres.csv`` as ``greybed calibrate`` reads them.

    Their error: the scatter of a row (1.8 %: readings and diameters, v ~ d^1.5) over the root of
    the repeats, and 1 % for the 0.5 % of the nominal diameter.
    """
    rows = [line.split(",") for line in (folder / "spheres.csv").read_text().splitlines()[1:]]
    with open(folder / "spheres_curve.csv", "w") as stream:
        stream.write("at [m],value [m/s],sd [m/s]\n")
        for size in SIZES:
            mean = 1e-3 * np.mean([float(r[3]) for r in rows if r[0] == f"{1e3 * size:g}"])
            error = mean * np.hypot(0.018 / np.sqrt(REPEATS), 0.01)
            stream.write(f"{size:g},{mean:.5g},{error:.3g}\n")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=HERE)
    wanted = parser.parse_args()
    for name, *rest in TABLES:
        table(wanted.out / f"{name}.csv", *rest)
    curve(wanted.out)
