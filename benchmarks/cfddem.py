"""Gas and particles: seconds per simulated second against OpenFOAM's DPMFoam, one core each.

python benchmarks/cfddem.py [--time 0.02] [--parts]

The bed of examples/fluidised_bed: 9,240 spheres, 12 x 1 x 26 cells, air at 0.9 m/s, from the same
settled places at rest. Both get the same gas step (--step), density, size, stiffness and friction;
DPMFoam takes its own law of contacts (pairSpringSliderDashpot, 12 steps for a contact); both take
Ergun and Wen & Yu's drag. Compiling and reading are not in the clock. Times are of the
processor, so that other programs that run meanwhile count little. --parts tells how much of ours is
neither particles nor gas alone.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from greybed.coupling.gas_particles import GasParticles
from greybed.dem.checkpoint import restore, save

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "examples/fluidised_bed"))
import khawaja  # noqa: E402

TUTORIAL = Path("/usr/share/doc/openfoam-examples/examples/lagrangian/DPMFoam/Goldschmidt")
FOAM = "/usr/share/openfoam"  # of Debian's package, which needs no more of an environment


def settled(work: Path):
    """The settled bed, made once."""
    sim, kept = khawaja.particles(threads=1), work / "settled.npz"
    if kept.exists():
        restore(sim, kept)
    else:
        sim.run(khawaja.SETTLE)
        save(sim, kept)
    return sim


def timed(both: GasParticles, steps: int, count: int) -> dict[str, float]:
    """Processor seconds of so many gas steps, of all and of its parts."""
    spent = {"particles": 0.0, "gas": 0.0}
    run, step = both.simulation.run, both.gas.step

    def clock(name, inner):
        def call(*args, **named):
            begun = time.process_time()
            result = inner(*args, **named)
            spent[name] += time.process_time() - begun
            return result

        return call

    both.simulation.run = clock("particles", run)
    both.gas.step = clock("gas", step)
    begun = time.process_time()
    for _ in range(count):
        both.step(steps)
    spent["all"] = time.process_time() - begun
    both.simulation.run, both.gas.step = run, step
    return spent


def ours(work: Path, gas_step: float, span: float) -> dict[str, float]:
    both = khawaja.with_gas(settled(work), "gidaspow")
    steps = max(1, round(gas_step / both.simulation.time_step))
    both.step(steps)  # compiles
    sim = both.simulation
    restore(sim, work / "settled.npz")
    both = khawaja.with_gas(sim, "gidaspow")
    count = round(span / (steps * sim.time_step))
    spent = timed(both, steps, count)
    spent["height"] = 2.0 * float(sim.centres[:, 2].mean())
    return spent


def dictionary(name: str, body: str, kind: str = "dictionary") -> str:
    return f"FoamFile {{ version 2.0; format ascii; class {kind}; object {name}; }}\n{body}\n"


def write_case(case: Path, centres: np.ndarray, gas_step: float, span: float) -> None:
    """DPMFoam's tutorial with our bed in it."""
    shutil.copytree(TUTORIAL, case)
    shutil.rmtree(case / "0")
    (case / "0").mkdir()
    for old in case.glob("constant/kinematicCloudPositions*"):
        old.unlink()
    x, y, z = khawaja.SIZE
    corners = [(a, b, c) for c in (0, z) for a, b in ((0, 0), (x, 0), (x, y), (0, y))]
    points = " ".join(f"({a} {b} {c})" for a, b, c in corners)
    nx, ny, nz = khawaja.CELLS
    (case / "system/blockMeshDict").write_text(
        dictionary(
            "blockMeshDict",
            f"""
scale 1;
vertices ({points});
blocks ( hex (0 1 2 3 4 5 6 7) ({nx} {ny} {nz}) simpleGrading (1 1 1) );
boundary (
 top {{ type wall; faces ((4 5 6 7)); }}
 bottom {{ type wall; faces ((0 1 2 3)); }}
 walls {{ type wall; faces ((0 3 7 4) (1 2 6 5)); }}
 frontAndBack {{ type wall; faces ((0 1 5 4) (3 2 6 7)); }}
);""",
        )
    )
    control = (case / "system/controlDict").read_text()
    for key, value in (("endTime", span), ("deltaT", gas_step), ("writeInterval", span)):
        control = re.sub(rf"(?m)^{key}\s.*;", f"{key} {value};", control)
    control = re.sub(r"(?m)^writeFormat.*;", "writeFormat ascii;", control)
    (case / "system/controlDict").write_text(control)
    cloud = (case / "constant/kinematicCloudProperties").read_text()
    cloud = cloud.replace("rho0            2526;", f"rho0 {khawaja.SEED.density};")
    cloud = cloud.replace("value   0.0025;", f"value {khawaja.D};")
    cloud = cloud.replace("maxInteractionDistance  0.0025;", f"maxInteractionDistance {khawaja.D};")
    cloud = re.sub(r"youngsModulus(\s+)1e8;", r"youngsModulus 1e6;", cloud)
    cloud = re.sub(r"poissonsRatio(\s+)0.\d+;", r"poissonsRatio 0.3;", cloud)
    (case / "constant/kinematicCloudProperties").write_text(cloud)
    (case / "constant/transportProperties").write_text(
        dictionary(
            "transportProperties",
            "continuousPhase air; rho.air 1.2; transportModel Newtonian; nu 1.5e-05;",
        )
    )
    places = "\n".join("({:.9g} {:.9g} {:.9g})".format(*c) for c in centres)
    (case / "constant/kinematicCloudPositions").write_text(
        dictionary("kinematicCloudPositions", f"(\n{places}\n)", "vectorField")
    )
    (case / "0/p").write_text(
        dictionary(
            "p",
            """dimensions [0 2 -2 0 0 0 0];
internalField uniform 0;
boundaryField {
 "(walls|bottom|frontAndBack)" { type fixedFluxPressure; phi phi.air; value $internalField; }
 top { type fixedValue; value $internalField; } }""",
            "volScalarField",
        )
    )
    (case / "0/U.air").write_text(
        dictionary(
            "U.air",
            f"""dimensions [0 1 -1 0 0 0 0];
internalField uniform (0 0 0);
boundaryField {{
 walls {{ type noSlip; }}
 frontAndBack {{ type slip; }}
 top {{ type pressureInletOutletVelocity; phi phi.air; inletValue uniform (0 0 0);
  value uniform (0 0 0); }}
 bottom {{ type interstitialInletVelocity; inletVelocity uniform (0 0 {khawaja.SPEED});
  value uniform (0 0 {khawaja.SPEED}); phi phi.air; alpha alpha.air; }} }}""",
            "volVectorField",
        )
    )


def theirs(centres: np.ndarray, gas_step: float, span: float) -> dict[str, float]:
    """DPMFoam's own clock, less that of its first step, which injects the spheres."""
    with tempfile.TemporaryDirectory() as folder:
        case = Path(folder) / "case"
        write_case(case, centres, gas_step, span)
        plain = {**os.environ, "WM_PROJECT_DIR": FOAM}
        done = subprocess.run(
            ["bash", "-c", "blockMesh > mesh.log && DPMFoam > run.log"],
            cwd=case, env=plain, check=False,
        )  # fmt: skip
        log = (case / "run.log").read_text() if (case / "run.log").exists() else ""
        if done.returncode:
            raise SystemExit(f"DPMFoam failed:\n{log[-2000:]}")
        clock = [float(t) for t in re.findall(r"ExecutionTime = ([\d.]+) s", log)]
        high = re.findall(r"Current number of parcels\s+=\s+(\d+)", log)
        result = {"all": clock[-1] - clock[0], "parcels": float(high[-1])}
        last = sorted((p for p in case.iterdir() if re.fullmatch(r"0\.\d+|[\d.e-]+", p.name)
                       and p.name != "0"), key=lambda p: float(p.name))  # fmt: skip
        for found in last[-1:]:
            place = found / "lagrangian/kinematicCloud/positions"
            if place.exists():
                z = re.findall(r"^\(\S+ \S+ (\S+)\)", place.read_text(), re.M)
                result["height"] = 2.0 * float(np.mean([float(v) for v in z]))
        return result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--time", type=float, default=0.02)
    parser.add_argument("--step", type=float, default=4e-4, help="of the gas [s]")
    parser.add_argument("--parts", action="store_true")
    parser.add_argument("--work", type=Path, default=Path(tempfile.gettempdir()) / "greybed_cfddem")
    given = parser.parse_args()
    given.work.mkdir(parents=True, exist_ok=True)
    own = ours(given.work, given.step, given.time)
    alone = own["particles"] + own["gas"]
    rate = own["all"] / given.time
    print(f"greybed: {rate:.1f} s per simulated second, height {1e3 * own['height']:.2f} mm; "
          f"particles {own['particles']:.2f} s, gas {own['gas']:.2f} s, coupling "
          f"{100 * (own['all'] / alone - 1):.1f} % on top", flush=True)  # fmt: skip
    if given.parts or not shutil.which("DPMFoam") or not TUTORIAL.exists():
        return
    sim = khawaja.particles(threads=1)
    restore(sim, given.work / "settled.npz")
    other = theirs(sim.centres, given.step, given.time)
    span = given.time - given.step
    print(f"DPMFoam: {other['all'] / span:.1f} s per simulated second, height "
          f"{1e3 * other.get('height', 0.0):.2f} mm, {other['parcels']:.0f} spheres")  # fmt: skip
    print(f"ratio {other['all'] / span / rate:.2f}")


if __name__ == "__main__":
    main()
