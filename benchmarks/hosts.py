"""What a drag closure costs in LAMMPS and OpenFOAM: the runs of docs/hosts.md, processor time.

python benchmarks/hosts.py [lammps] [openfoam] [--turns N] builds the adapters in a folder of its
own, runs with the closure and without it in turns and prints the least times. OpenFOAM's first
build fetches its source and takes minutes. The last line is ``ratio <x>``, the bar of each over
what was found, the smaller one: 2.5 times for LAMMPS, 1.15 times for DPMFoam with the network
evaluated each time.
"""

import argparse
import os
import re
import resource
import subprocess
import tempfile
from pathlib import Path

from greybed.dem.lammps.process import needed_lammps
from greybed.hosts import host_model, lammps, openfoam

MODEL = "shipped:filtered_drag_mlp_plain"


def lammps_times(folder, turns):
    """Processor seconds of 500 steps without and with the closure, settling not counted."""
    lammps.generate(host_model(MODEL), folder)
    lammps.build(folder)
    found = needed_lammps()
    times = {"off": [], "on": []}
    for _ in range(turns):
        for fix, taken in times.items():
            words = found.command(1, "-in", lammps.DECK, "-var", "fix", fix, "-log", "log.bench")
            environment = {**os.environ, **found.environment}
            subprocess.run(words, cwd=folder, env=environment, check=True, capture_output=True)
            text = (folder / "log.bench").read_text()
            wall = [float(word) for word in re.findall(r"^Loop time of (\S+)", text, re.M)]
            used = [float(word) for word in re.findall(r"^(\S+)% CPU use", text, re.M)]
            taken.append(wall[-1] * used[-1] / 100.0)
    return min(times["off"]), min(times["on"])


def openfoam_times(folder, turns):
    """Processor seconds of 20 steps: own law, the closure with baseline and with clamp."""
    openfoam.generate(host_model(MODEL, law="gidaspow"), folder)
    openfoam.build(folder)
    kinds = {"own": {"own": True}, "baseline": {}, "clamp": {"policy": "clamp"}}
    times = {kind: [] for kind in kinds}
    for _ in range(turns):
        for kind, more in kinds.items():
            openfoam.lay_out("DPMFoam", folder / kind, **more)
            before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
            openfoam.run_case("DPMFoam", folder / kind, folder / openfoam.LIBRARIES)
            times[kind].append(resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before)
    return tuple(min(times[kind]) for kind in kinds)


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("hosts", nargs="*", default=["lammps"], help="lammps, openfoam")
    parser.add_argument("--turns", type=int, default=3, help="runs of each (default: 3)")
    options = parser.parse_args()
    ratios = []
    with tempfile.TemporaryDirectory() as name:
        if "lammps" in options.hosts:
            off, on = lammps_times(Path(name) / "lammps", options.turns)
            print(f"LAMMPS: {off:.2f} s without, {on:.2f} s with the closure, {on / off:.2f} times")
            ratios.append(2.5 / (on / off))
        if "openfoam" in options.hosts:
            own, law, net = openfoam_times(Path(name) / "openfoam", options.turns)
            print(
                f"DPMFoam: {own:.2f} s with ErgunWenYuDrag, {law:.2f} s outside (the law), "
                f"{net:.2f} s with the network each time, {net / own:.2f} times"
            )
            ratios.append(1.15 / (net / own))
    print(f"ratio {min(ratios):.2f}")


if __name__ == "__main__":
    main()
