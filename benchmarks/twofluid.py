"""Two fluids: cell steps per second against twoPhaseEulerFoam (Debian's OpenFOAM), one core each.

python benchmarks/twofluid.py               128 x 512 cells, 40 steps in the clock
python benchmarks/twofluid.py --outer 3     with three outer correctors, as its tutorial has them

Gas and particles of 75 um in a box that repeats along x, with gas coming in at the bottom and a
pressure outlet at the top: twoPhaseEulerFoam's p_rgh knows no mean pressure gradient, so a box that
repeats along y as well cannot be run in it. Both get the same cloudy start with all digits, the
same step and number of steps; Gidaspow's drag, kinetic theory with its temperature in equilibrium,
the same viscosity, radial distribution and frictional pressure, van Leer's limiter (limitedLinear
for momentum there), Euler in time. OpenFOAM runs what costs it least: one outer and one pressure
corrector, one alpha cycle, and for the pressure the faster of GAMG and PCG, to a tolerance that
leaves about the same local continuity error as here (both are printed). It always assembles two
energy equations, which we have not; their linear solves are 4 % of its time, and stay in. Both
clocks are processor time: its own of each step, ours around the same steps; reading, writing and
compiling are in neither. Afterwards the solids' mean velocity, the slip and the deviation of the
solid fraction must agree. The last line is the median of the ratios of the pairs.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from greybed.cfd.grid import Grid
from greybed.cfd.kinetic import Granular
from greybed.cfd.rims import Inflow, Outlet
from greybed.cfd.twofluid import TwoFluid
from greybed.closures.drag.laws import drag_law

CELL, NX, NY = 2.25e-4, 128, 512
DENSITY, DIAMETER, GAS, VISCOSITY = 1500.0, 75e-6, 1.2, 1.8e-5
MEAN, INFLOW, STEP = 0.1, 0.14, 1e-4
TOLERANCE = 1e-4  # of the pressure here: about the continuity error of 1e-7 there
SOLVERS = {
    "GAMG": "solver GAMG; smoother DIC;",
    "PCG": "solver PCG; preconditioner DIC;",
}
# What must agree after the steps: mean velocities over the slip, and the deviation of phi.
SAME_VELOCITY, SAME_DEVIATION = 0.02, 0.01


@dataclass
class Run:
    """Million cell steps per second, and what has come out."""

    rate: float
    solids: float
    slip: float
    deviation: float
    continuity: float
    note: str = ""


def cloudy() -> np.ndarray:
    """A smooth random solid fraction, 0.03 to 0.4."""
    rng = np.random.default_rng(1)
    ky, kx = np.meshgrid(np.fft.fftfreq(NY) * NY / 4, np.fft.rfftfreq(NX) * NX, indexing="ij")
    k2 = kx**2 + ky**2
    modes = np.where((k2 > 0) & (k2 < 36), rng.standard_normal(k2.shape), 0.0) * np.exp(
        2j * np.pi * rng.random(k2.shape)
    )
    wave = np.fft.irfft2(modes, s=(NY, NX))
    phi = MEAN * np.exp(0.35 * wave / wave.std())
    return (phi * MEAN / phi.mean())[None]


def fluids(phi: np.ndarray) -> TwoFluid:
    """The simulation before its first step."""
    grid = Grid(
        cells=(NX, NY, 1), upper=(NX * CELL, NY * CELL, CELL), periodic=(True, False, False)
    )
    return TwoFluid(
        grid, phi, particle_density=DENSITY, diameter=DIAMETER, gas_density=GAS,
        gas_viscosity=VISCOSITY, drag=drag_law("gidaspow"),
        granular=Granular(restitution=0.9, drag_dissipation=False),
        sides={"y-": Inflow(INFLOW), "y+": Outlet()}, time_step=STEP, tolerance=TOLERANCE,
        gas_velocity=(0.0, INFLOW / (1.0 - MEAN), 0.0),
    )  # fmt: skip


def greybed(phi: np.ndarray, options: argparse.Namespace) -> Run:
    """Steps after a warm-up, timed."""
    sim = fluids(phi)
    for _ in range(options.warm):
        sim.step()
    begin = time.process_time()
    for _ in range(options.steps):
        sim.step()
    seconds = time.process_time() - begin
    found = sim.solid_fraction
    v, u = (0.5 * (f[:, 1:] + f[:, :-1]) for f in (sim.solids_velocity[1], sim.gas_velocity[1]))
    solids = float((found * v).sum() / found.sum())
    gas = float(((1 - found) * u).sum() / (1 - found).sum())
    qx, qy, _ = sim.volume_flux
    gone = (np.diff(qx, axis=2) + np.diff(qy, axis=1)) / CELL
    return Run(
        1e-6 * NX * NY * options.steps / seconds, solids, gas - solids, float(found.std()),
        STEP * float(np.abs(gone).mean()), f"{sim.pressure_iterations} iterations",
    )  # fmt: skip


def head(kind: str, name: str) -> str:
    return f"FoamFile {{ version 2.0; format ascii; class {kind}; object {name}; }}\n"


def field(folder: Path, name: str, kind: str, units: str, value: str, sides: str) -> None:
    kinds = {"scalar": "volScalarField", "vector": "volVectorField"}
    (folder / "0" / name).write_text(
        head(kinds[kind], name) + f"dimensions {units};\ninternalField {value};\nboundaryField {{\n"
        'left { type cyclic; } right { type cyclic; } "front|back" { type empty; }\n'
        f"{sides}\n}}\n"
    )


def write_case(folder: Path, phi: np.ndarray, options: argparse.Namespace, solver: str) -> None:
    """The same flow as OpenFOAM reads it."""
    for name in ("0", "constant", "system"):
        (folder / name).mkdir()
    lx, ly = NX * CELL, NY * CELL
    (folder / "system/blockMeshDict").write_text(
        head("dictionary", "blockMeshDict")
        + f"""scale 1;
vertices ((0 0 0) ({lx!r} 0 0) ({lx!r} {ly!r} 0) (0 {ly!r} 0)
 (0 0 {CELL}) ({lx!r} 0 {CELL}) ({lx!r} {ly!r} {CELL}) (0 {ly!r} {CELL}));
blocks (hex (0 1 2 3 4 5 6 7) ({NX} {NY} 1) simpleGrading (1 1 1));
edges ();
boundary (
 left {{ type cyclic; neighbourPatch right; faces ((0 4 7 3)); }}
 right {{ type cyclic; neighbourPatch left; faces ((1 2 6 5)); }}
 bottom {{ type patch; faces ((0 1 5 4)); }}
 top {{ type patch; faces ((3 7 6 2)); }}
 front {{ type empty; faces ((4 5 6 7)); }}
 back {{ type empty; faces ((0 3 2 1)); }}
);
"""
    )
    steps = options.warm + options.steps
    (folder / "system/controlDict").write_text(
        head("dictionary", "controlDict")
        + f"""application twoPhaseEulerFoam;
startFrom startTime; startTime 0; stopAt endTime; endTime {steps * STEP!r}; deltaT {STEP!r};
writeControl timeStep; writeInterval {steps}; writeFormat ascii; writePrecision 12;
timeFormat general; timePrecision 10; runTimeModifiable off; adjustTimeStep no; maxCo 1;
profiling {{ active {"true" if options.profile else "false"}; cpuInfo false; memInfo false;
 sysInfo false; }}
"""
    )
    (folder / "system/fvSchemes").write_text(
        head("dictionary", "fvSchemes")
        + """ddtSchemes { default Euler; }
gradSchemes { default Gauss linear; }
divSchemes {
 default none;
 "div\\(phi,alpha.*\\)" Gauss vanLeer;
 "div\\(phir,alpha.*\\)" Gauss vanLeer;
 "div\\(alphaRhoPhi.*,U.*\\)" Gauss limitedLinearV 1;
 "div\\(phi.*,U.*\\)" Gauss limitedLinearV 1;
 "div\\(alphaRhoPhi.*,(h|e).*\\)" Gauss limitedLinear 1;
 "div\\(alphaRhoPhi.*,K.*\\)" Gauss limitedLinear 1;
 "div\\(alphaPhi.*,p\\)" Gauss limitedLinear 1;
 "div\\(alphaRhoPhi.*,Theta.*\\)" Gauss limitedLinear 1;
 div((((alpha.air*thermo:rho.air)*nuEff.air)*dev2(T(grad(U.air))))) Gauss linear;
 "div\\(\\(\\(\\(thermo:rho.particles\\*nut.*" Gauss linear;
}
laplacianSchemes { default Gauss linear uncorrected; bounded Gauss linear uncorrected; }
interpolationSchemes { default linear; }
snGradSchemes { default uncorrected; bounded uncorrected; }
"""
    )
    smooth = "solver smoothSolver; smoother symGaussSeidel; relTol 0; minIter 1;"
    (folder / "system/fvSolution").write_text(
        head("dictionary", "fvSolution")
        + f"""solvers {{
 "alpha.*" {{ nAlphaCorr 1; nAlphaSubCycles 1; smoothLimiter 0.1; implicitPhasePressure yes;
  {smooth} tolerance 1e-9; }}
 "p_rgh.*" {{ {SOLVERS[solver]} tolerance {options.tolerance:g}; relTol 0; }}
 "U.*" {{ {smooth} tolerance 1e-6; }}
 "(h|e).*" {{ {smooth} tolerance 1e-6; }}
 "Theta.*" {{ {smooth} tolerance 1e-6; }}
}}
PIMPLE {{ nOuterCorrectors {options.outer}; nCorrectors 1; nNonOrthogonalCorrectors 0; }}
relaxationFactors {{ equations {{ ".*" 1; }} }}
"""
    )
    (folder / "constant/g").write_text(
        head("uniformDimensionedVectorField", "g")
        + "dimensions [0 1 -2 0 0 0 0];\nvalue (0 -9.81 0);\n"
    )
    thermo = """thermoType {{ type heRhoThermo; mixture pureMixture; transport const; thermo hConst;
 equationOfState {state}; specie specie; energy sensibleInternalEnergy; }}
mixture {{ specie {{ molWeight 28.9; }} {more}
 thermodynamics {{ Cp 1007; Hf 0; }} transport {{ mu {mu}; Pr 0.7; }} }}
"""
    for name, rho, mu in (("air", GAS, VISCOSITY), ("particles", DENSITY, 0.0)):
        (folder / f"constant/thermophysicalProperties.{name}").write_text(
            head("dictionary", "thermophysicalProperties") + thermo.format(
                state="rhoConst", more=f"equationOfState {{ rho {rho}; }}", mu=mu)
        )  # fmt: skip
    (folder / "constant/turbulenceProperties.air").write_text(
        head("dictionary", "turbulenceProperties") + "simulationType laminar;\n"
    )
    (folder / "constant/turbulenceProperties.particles").write_text(
        head("dictionary", "turbulenceProperties")
        + """simulationType RAS;
RAS { RASModel kineticTheory; turbulence on; printCoeffs off;
 kineticTheoryCoeffs {
  equilibrium on; e 0.9; alphaMax 0.63; alphaMinFriction 0.5; residualAlpha 1e-6;
  viscosityModel Syamlal; conductivityModel Syamlal; granularPressureModel Lun;
  frictionalStressModel JohnsonJackson; radialModel SinclairJackson;
  JohnsonJacksonCoeffs { Fr 0.05; eta 2; p 5; phi 28.5; alphaDeltaMin 0.02; }
 }
}
"""
    )
    (folder / "constant/phaseProperties").write_text(
        head("dictionary", "phaseProperties")
        + f"""phases (particles air);
particles {{ diameterModel constant; constantCoeffs {{ d {DIAMETER}; }}
 alphaMax 0.63; residualAlpha 1e-6; }}
air {{ diameterModel constant; constantCoeffs {{ d 1; }} residualAlpha 0; }}
blending {{ default {{ type none; continuousPhase air; }} }}
sigma ( (particles and air) 0 );
aspectRatio ();
drag ( (particles in air) {{ type GidaspowErgunWenYu; residualRe 1e-3;
 swarmCorrection {{ type none; }} }} );
virtualMass ();
heatTransfer ();
lift ();
wallLubrication ();
turbulentDispersion ();
pMin 10000;
"""
    )
    zero = '"bottom|top" { type zeroGradient; }'
    solid = "\n".join(f"{x:.17g}" for x in phi.ravel())
    gas = "\n".join(f"{1.0 - x:.17g}" for x in phi.ravel())
    n = phi.size
    none, speed = "[0 0 0 0 0 0 0]", "[0 1 -1 0 0 0 0]"
    field(
        folder,
        "alpha.particles",
        "scalar",
        none,
        f"nonuniform List<scalar> {n} (\n{solid}\n)",
        zero,
    )
    field(folder, "alpha.air", "scalar", none, f"nonuniform List<scalar> {n} (\n{gas}\n)", zero)
    field(folder, "U.particles", "vector", speed, "uniform (0 0 0)",
          '"bottom|top" { type fixedValue; value uniform (0 0 0); }')  # fmt: skip
    field(folder, "U.air", "vector", speed, f"uniform (0 {INFLOW / (1 - MEAN)!r} 0)",
          f"bottom {{ type interstitialInletVelocity; inletVelocity uniform (0 {INFLOW} 0); "
          f"alpha alpha.air; value uniform (0 {INFLOW} 0); }}\n"
          "top { type pressureInletOutletVelocity; phi phi.air; value uniform (0 0 0); }",
    )  # fmt: skip
    pressure = "[1 -1 -2 0 0 0 0]"
    field(folder, "p", "scalar", pressure, "uniform 1e5",
          '"bottom|top" { type calculated; value uniform 1e5; }')  # fmt: skip
    field(folder, "p_rgh", "scalar", pressure, "uniform 1e5",
          "bottom { type fixedFluxPressure; value uniform 1e5; }\n"
          "top { type prghPressure; p uniform 1e5; value uniform 1e5; }")  # fmt: skip
    for name in ("air", "particles"):
        field(folder, f"T.{name}", "scalar", "[0 0 0 1 0 0 0]", "uniform 300", zero)
    field(folder, "Theta.particles", "scalar", "[0 2 -2 0 0 0 0]", "uniform 1e-4", zero)
    field(folder, "nut.particles", "scalar", "[0 2 -1 0 0 0 0]", "uniform 0",
          '"bottom|top" { type calculated; value uniform 0; }')  # fmt: skip
    field(folder, "alphat.particles", "scalar", "[1 -1 -1 0 0 0 0]", "uniform 0",
          '"bottom|top" { type calculated; value uniform 0; }')  # fmt: skip


def foam(command: str, folder: Path) -> str:
    """Run a program of OpenFOAM with Debian's environment."""
    done = subprocess.run(
        ["bash", "-c", f"source /usr/share/openfoam/etc/bashrc >/dev/null 2>&1; {command}"],
        cwd=folder, capture_output=True, text=True, env={**os.environ, "OMP_NUM_THREADS": "1"},
    )  # fmt: skip
    if done.returncode:
        raise SystemExit(f"{command} has failed:\n{(done.stdout + done.stderr)[-3000:]}")
    return done.stdout


def read_field(path: Path, width: int, part: str = "internalField") -> np.ndarray:
    text = path.read_text()
    text = text[text.index(part) :]
    found = re.search(r"nonuniform List<\w+>\s*\d+\s*\((.*?)\n\)", text, re.S)
    if found is None:
        raise SystemExit(f"{path} holds no list of values")
    return np.array(found[1].replace("(", " ").replace(")", " ").split(), float).reshape(-1, width)


def local_continuity(path: Path) -> float:
    """Mean volume that a cell creates in a step, over its own, from the fluxes of both phases."""
    inner = iter(read_field(path, 1)[:, 0].tolist())
    fx, fy = np.zeros((NY, NX + 1)), np.zeros((NY + 1, NX))
    for j in range(NY):
        for i in range(NX):
            if i < NX - 1:
                fx[j, i + 1] = next(inner)
            if j < NY - 1:
                fy[j + 1, i] = next(inner)
    left, right, bottom, top = (
        read_field(path, 1, f"    {side}\n")[:, 0] for side in ("left", "right", "bottom", "top")
    )
    fx[:, 0], fx[:, -1], fy[0], fy[-1] = -left, right, -bottom, top
    gone = np.diff(fx, axis=1) + np.diff(fy, axis=0)
    return STEP * float(np.abs(gone).mean()) / CELL**3


def openfoam(phi: np.ndarray, options: argparse.Namespace, solver: str) -> Run:
    """Steps after a warm-up, by the time that its own steps report."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_case(folder, phi, options, solver)
        foam("blockMesh", folder)
        log = foam("twoPhaseEulerFoam", folder)
        clock = [float(x) for x in re.findall(r"^ExecutionTime = (\S+) s", log, re.M)]
        if len(clock) != options.warm + options.steps:
            raise SystemExit(f"twoPhaseEulerFoam has made {len(clock)} steps:\n{log[-2000:]}")
        seconds = clock[-1] - clock[options.warm - 1]
        last = max(
            (p for p in folder.iterdir() if re.match(r"0\.\d+$", p.name)),
            key=lambda p: float(p.name),
        )
        alpha = read_field(last / "alpha.particles", 1)[:, 0]
        v = read_field(last / "U.particles", 3)[:, 1]
        u = read_field(last / "U.air", 3)[:, 1]
        continuity = local_continuity(last / "phi")
        if options.profile:
            for path in folder.rglob("profiling"):
                print(path.read_text())
    solids = float((alpha * v).sum() / alpha.sum())
    gas = float(((1 - alpha) * u).sum() / (1 - alpha).sum())
    solved = re.findall(r"(\w+):  Solving for p_rgh.*No Iterations (\d+)", log)[-options.steps :]
    return Run(
        1e-6 * phi.size * options.steps / seconds, solids, gas - solids, float(alpha.std()),
        continuity,
        f"{solver}, {statistics.mean(int(n) for _, n in solved):.1f} iterations",
    )  # fmt: skip


def main() -> int:
    """Both in turn."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--pairs", type=int, default=3, help="runs of each, in turn (default 3)")
    parser.add_argument("--steps", type=int, default=40, help="in the clock (default 40)")
    parser.add_argument("--warm", type=int, default=10, help="before the clock (default 10)")
    parser.add_argument("--tolerance", type=float, default=1e-7, help="of OpenFOAM's p_rgh")
    parser.add_argument("--outer", type=int, default=1, help="OpenFOAM's outer correctors")
    parser.add_argument("--profile", action="store_true", help="OpenFOAM's own profile")
    options = parser.parse_args()
    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[-1:])
    if shutil.which("twoPhaseEulerFoam") is None:
        print("needs OpenFOAM (Debian: apt-get install openfoam)")
        return 2
    phi = cloudy()
    greybed(phi, argparse.Namespace(warm=2, steps=1))  # compiles
    short = argparse.Namespace(**{**vars(options), "warm": 5, "steps": 10, "profile": False})
    trials = {solver: openfoam(phi, short, solver).rate for solver in SOLVERS}
    best = max(trials, key=trials.__getitem__)
    print("OpenFOAM by its solver [M cell steps/s]: "
          + ", ".join(f"{k} {v:.4f}" for k, v in trials.items()), flush=True)  # fmt: skip
    mine, theirs = [], []
    for pair in range(options.pairs):
        mine.append(greybed(phi, options))
        theirs.append(openfoam(phi, options, best))
        for name, run in (("greybed", mine[-1]), ("OpenFOAM", theirs[-1])):
            print(
                f"pair {pair + 1}: {name} {run.rate:.4f} M cell steps/s; solids {run.solids:.5f}, "
                f"slip {run.slip:.5f} m/s, deviation of phi {run.deviation:.6f}, local continuity "
                f"{run.continuity:.1e}; {run.note}",
                flush=True,
            )
    same = all(
        abs(a.solids - b.solids) < SAME_VELOCITY * b.slip
        and abs(a.slip / b.slip - 1.0) < SAME_VELOCITY
        and abs(a.deviation / b.deviation - 1.0) < SAME_DEVIATION
        for a, b in zip(mine, theirs, strict=True)
    )
    if not same:
        print("velocities or solid fractions differ: not the same work")
        return 1
    print(
        f"ratio {statistics.median(a.rate / b.rate for a, b in zip(mine, theirs, strict=True)):.2f}"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
