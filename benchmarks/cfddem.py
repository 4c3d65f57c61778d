"""Gas and particles: seconds per simulated second against OpenFOAM's DPMFoam, one core each.

python benchmarks/cfddem.py [--time 0.004] [--overhead]

The bed of examples/fluidised_bed in flow: 9,240 spheres, 12 x 1 x 26 cells, after 0.3 s of air at
0.66 m/s.
Both start from the same places and velocities of spheres and gas, and get the same gas step
(--step), density, size, stiffness and friction; DPMFoam takes its own law of contacts
(pairSpringSliderDashpot, 12 steps for a contact); both take Ergun and Wen & Yu's drag. Compiling,
reading and the way to the start are not in the clock. Times are of the processor, so that other
programs that run meanwhile count little. If height, speed of the spheres or pressure drop differ at
the end, the comparison is void and says so. Pressure drops differ by some 18 Pa of 190:
cfddem_checks.py and docs/gas_particles.md tell why (the velocities of DPMFoam's cells do not carry
the flux where drag changes between cells). --overhead tells how much of ours is neither particles
nor gas alone, at 10, 20 and 50 steps of the particles in one of the gas and at those that the bed
takes by itself, and runs no peer.
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

from greybed.core.errors import InputError
from greybed.coupling.gas_particles import GasParticles
from greybed.dem.checkpoint import restore, save

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "examples/fluidised_bed"))
import khawaja  # noqa: E402

TUTORIAL = Path("/usr/share/doc/openfoam-examples/examples/lagrangian/DPMFoam/Goldschmidt")
START = 0.3  # [s]
FOAM = "/usr/share/openfoam"  # of Debian's package, which needs no more of an environment


def flowing(work: Path) -> GasParticles:
    """The bed in flow; its state is made once."""
    kept, sim = work / "flowing.npz", khawaja.particles(threads=1)
    try:
        beside = restore(sim, kept)["beside"]
    except InputError:  # none yet, or of another version
        sim.run(khawaja.SETTLE)
        both = khawaja.with_gas(sim, "gidaspow")
        while both.time < START:
            both.step()
        save(sim, kept, beside={**both.gas.save(), **both.state()})
        return both
    both = khawaja.with_gas(sim, "gidaspow")
    both.gas.restore(beside)
    both.go_back(beside)
    return both


def timed(both: GasParticles, steps: int | None, count: int) -> dict[str, float]:
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


def ours(both: GasParticles, gas_step: float, span: float) -> dict[str, float]:
    """Our processor time, and what has come about."""
    steps = max(1, round(gas_step / both.simulation.time_step))
    spent = timed(both, steps, round(span / gas_step))
    p = both.gas.pressure.mean(axis=(1, 2))
    spent["height"] = 2.0 * float(both.simulation.centres[:, 2].mean())
    spent["speed"] = float(both.simulation.velocities[:, 2].mean())
    spent["drop"] = float(p[0] - p[-1])
    return spent


def overhead(both: GasParticles) -> None:
    """Share of the coupling, for several lengths of a gas step, at last those it takes itself."""
    for steps, gas_steps in ((10, 100), (20, 50), (50, 20), (None, 20)):
        both.step(steps)
        before = both.simulation.steps
        spent = timed(both, steps, gas_steps)
        alone = spent["particles"] + spent["gas"]
        more = 1e3 * (spent["all"] - alone) / gas_steps
        taken = (both.simulation.steps - before) / gas_steps
        how = "" if steps else " (as it takes them)"
        share = 100.0 * (spent["all"] / alone - 1.0)
        print(f"{taken:.0f} steps of the particles in one of the gas{how}: coupling {more:.2f} ms "
              f"a gas step, {share:.1f} % on top", flush=True)  # fmt: skip


def dictionary(name: str, body: str, kind: str = "dictionary") -> str:
    return f"FoamFile {{ version 2.0; format ascii; class {kind}; object {name}; }}\n{body}\n"


def field(name: str, dimensions: str, values: np.ndarray, rims: str) -> str:
    """Text of a field of the cells."""
    vector = values.ndim > 1
    rows = ["({:.9g} {:.9g} {:.9g})".format(*v) if vector else f"{v:.9g}" for v in values]
    kind = "vector" if vector else "scalar"
    body = "\n".join(rows)
    return dictionary(
        name,
        f"dimensions {dimensions};\n"
        f"internalField nonuniform List<{kind}>\n{len(rows)}\n(\n{body}\n);"
        f"\nboundaryField {{ {rims} }}",
        f"vol{kind.title()}Field",
    )


def edit(path: Path, *changes: tuple[str, str]) -> None:
    """Replace patterns in a file, each of which must be there."""
    text = path.read_text()
    for pattern, new in changes:
        text, count = re.subn(pattern, new, text, flags=re.M)
        if not count:
            raise SystemExit(f"{path.name} has no {pattern!r}; another version of OpenFOAM?")
    path.write_text(text)


def write_case(case: Path, both: GasParticles, gas_step: float) -> None:
    """DPMFoam's tutorial with our bed and gas in it."""
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
    edit(case / "system/controlDict", (r"^endTime\s.*;", "endTime 1e-9;"),
         (r"^deltaT\s.*;", "deltaT 1e-9;"), (r"^writeInterval\s.*;", "writeInterval 1e-9;"),
         (r"^writeFormat.*;", "writeFormat ascii;"), (r"^writePrecision.*;", "writePrecision 12;"),
         (r"^startFrom.*;", "startFrom startTime;"))  # fmt: skip
    edit(
        case / "constant/kinematicCloudProperties",
        (r"rho0(\s+)2526;", f"rho0 {khawaja.SEED.density};"),
        (r"value   0.0025;", f"value {khawaja.D};"),
        (r"maxInteractionDistance  0.0025;", f"maxInteractionDistance {khawaja.D};"),
        (r"youngsModulus(\s+)1e8;", "youngsModulus 1e6;"),
        (r"poissonsRatio(\s+)0.\d+;", "poissonsRatio 0.3;"),
        (r"mu(\s+)0.09;", "mu 0.10;"),
    )
    rho, nu = khawaja.AIR.density, khawaja.AIR.viscosity / khawaja.AIR.density
    (case / "constant/transportProperties").write_text(
        dictionary(
            "transportProperties",
            f"continuousPhase air; rho.air {rho}; transportModel Newtonian; nu {nu:.6g};",
        )
    )
    places = "\n".join("({:.12g} {:.12g} {:.12g})".format(*c) for c in both.simulation.centres)
    (case / "constant/kinematicCloudPositions").write_text(
        dictionary("kinematicCloudPositions", f"(\n{places}\n)", "vectorField")
    )
    u, v, w = both.gas.velocity
    air = np.stack([0.5 * (u[:, :, 1:] + u[:, :, :-1]), 0.5 * (v[:, 1:] + v[:, :-1]),
                    0.5 * (w[1:] + w[:-1])], axis=-1).reshape(-1, 3)  # fmt: skip
    (case / "0/p").write_text(
        field("p", "[0 2 -2 0 0 0 0]", both.gas.pressure.reshape(-1) / rho, """
 "(walls|bottom|frontAndBack)" { type fixedFluxPressure; phi phi.air; value uniform 0; }
 top { type fixedValue; value uniform 0; }"""),
    )  # fmt: skip
    (case / "0/U.air").write_text(
        field("U.air", "[0 1 -1 0 0 0 0]", air, f"""
 walls {{ type slip; }}
 frontAndBack {{ type slip; }}
 top {{ type pressureInletOutletVelocity; phi phi.air; inletValue uniform (0 0 0);
  value uniform (0 0 0); }}
 bottom {{ type interstitialInletVelocity; inletVelocity uniform (0 0 {khawaja.SPEED});
  value uniform (0 0 {khawaja.SPEED}); phi phi.air; alpha alpha.air; }}"""),
    )  # fmt: skip


def run(case: Path, command: str) -> str:
    """The log of a command of OpenFOAM."""
    plain = {**os.environ, "WM_PROJECT_DIR": FOAM}
    done = subprocess.run(
        ["bash", "-c", f"{command} > run.log 2>&1"], cwd=case, env=plain, check=False
    )
    log = (case / "run.log").read_text()
    if done.returncode:
        raise SystemExit(f"{command} failed:\n{log[-2000:]}")
    return log


def listed(path: Path) -> list[str]:
    """Entries of a list that OpenFOAM has written as text, one a line."""
    text = path.read_text()
    text = text[text.index("// * *") :] if "// * *" in text else text
    return re.search(r"\n\(\n(.*?)\n\)", text, re.S)[1].split("\n")  # type: ignore[index]


def theirs(both: GasParticles, gas_step: float, span: float) -> dict[str, float]:
    """DPMFoam's own clock, from the same state: it injects spheres at rest, which then get ours."""
    with tempfile.TemporaryDirectory() as folder:
        case = Path(folder) / "case"
        write_case(case, both, gas_step)
        run(case, "blockMesh > mesh.log && DPMFoam")
        (first,) = (p for p in case.iterdir() if p.name.startswith("1e-"))
        shutil.copytree(first / "lagrangian", case / "0/lagrangian")
        shutil.rmtree(first)
        cloud = case / "0/lagrangian/kinematicCloud"
        order = [int(n) for n in listed(cloud / "origId")]
        velocities = both.simulation.velocities[np.array(order) - min(order)]
        text = (cloud / "U").read_text()
        rows = "\n".join("({:.9g} {:.9g} {:.9g})".format(*v) for v in velocities)
        head = text[: text.index("// * *")]
        (cloud / "U").write_text(f"{head}\n{len(rows.splitlines())}\n(\n{rows}\n)\n")
        edit(case / "system/controlDict", (r"^endTime\s.*;", f"endTime {span};"),
             (r"^deltaT\s.*;", f"deltaT {gas_step};"),
             (r"^writeInterval\s.*;", f"writeInterval {span};"))  # fmt: skip
        properties = case / "constant/kinematicCloudProperties"
        text = properties.read_text()
        begin = text.index("injectionModels")
        end = text.index("dispersionModel")
        properties.write_text(text[:begin] + "injectionModels {}\n" + text[end:])
        log = run(case, "DPMFoam")
        clock = [float(t) for t in re.findall(r"ExecutionTime = ([\d.]+) s", log)]
        (last,) = (p for p in case.iterdir() if re.fullmatch(r"0\.\d+|[\d.]+e-\d+", p.name))
        places = last / "lagrangian/kinematicCloud"
        z, w = (
            np.array([float(row.split()[2].rstrip(")")) for row in listed(places / name)])
            for name in ("positions", "U")
        )
        p = np.array(listed(last / "p"), dtype=float).reshape(khawaja.CELLS[2], -1).mean(axis=1)
        rho = khawaja.AIR.density
        weight = 9.81 * rho * (p.size - 1) / p.size * khawaja.SIZE[2]  # of the gas
        return {
            # All steps but the first one, which also reads.
            "all": (clock[-1] - clock[0]) * len(clock) / (len(clock) - 1), "parcels": float(len(z)),
            "height": 2.0 * float(z.mean()), "speed": float(w.mean()),
            "drop": rho * float(p[0] - p[-1]) - weight,
        }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--time", type=float, default=0.004)
    parser.add_argument("--step", type=float, default=4e-4, help="of the gas [s]")
    parser.add_argument("--overhead", action="store_true")
    parser.add_argument("--work", type=Path, default=Path(tempfile.gettempdir()) / "greybed_cfddem")
    given = parser.parse_args()
    given.work.mkdir(parents=True, exist_ok=True)
    both = flowing(given.work)
    if given.overhead:
        overhead(both)
        return
    if not shutil.which("DPMFoam") or not TUTORIAL.exists():
        raise SystemExit("DPMFoam is not here: apt install openfoam openfoam-examples.")
    start = 2e3 * float(both.simulation.centres[:, 2].mean())
    other = theirs(both, given.step, given.time)
    own = ours(both, given.step, given.time)
    print(f"start: height {start:.3f} mm")
    for name, found in (("greybed", own), ("DPMFoam", other)):
        print(
            f"{name}: {found['all'] / given.time:.1f} s per simulated second; at the end height "
            f"{1e3 * found['height']:.3f} mm, rise {1e3 * found['speed']:.1f} mm/s, pressure drop "
            f"{found['drop']:.1f} Pa"
        )
    weight = 9.81 * float(both.simulation.masses.sum()) / (khawaja.SIZE[0] * khawaja.SIZE[1])
    # Within the travel of the span, gravity's speed and the weight of the bed.
    off = {
        "height": abs(own["height"] / other["height"] - 1.0) / 0.01,
        "rise": abs(own["speed"] - other["speed"]) / (0.1 * 9.81 * given.time),
        "pressure drop": abs(own["drop"] - other["drop"]) / (0.15 * weight),
    }
    void = [name for name, share in off.items() if share > 1.0]
    print(f"void: {', '.join(void)} differ" if void else "height, rise and pressure drop agree")
    print(f"ratio {other['all'] / own['all']:.2f}")


if __name__ == "__main__":
    main()
