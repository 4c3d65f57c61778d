"""Kills of ``hardening.py``: each verb on a small case, ended at random moments, started again."""

from __future__ import annotations

import hashlib
import json
import os
import random
import re
import shutil
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hardening_targets import EXAMPLES

# What tells of the machine and the way, not of the result.
# Of two answers that are as good, a calibration names the one that took less time.
_OF_THE_WAY = re.compile(
    r"second|cheapest|per_s|found|threads|made_now|from_store|resumed|python|numpy"
)
DESIGN = "rays = 3000\nemitters = 30\nseed = 4\n" + "".join(
    f'[[packing]]\nkind = "random"\ncount = 200\nshake = 20\nfraction = {fraction}\n'
    f'split = "{split}"\n'
    for fraction, split in zip(
        (0.2, 0.25, 0.3, 0.35, 0.4, 0.45), 2 * ("train", "calibrate", "test"), strict=True
    )
)


@dataclass(frozen=True)
class Job:
    """A command, the files that it needs, and which of its files are finished parts.

    Attributes
    ----------
    words : str
        After ``greybed``, in a folder of its own.
    files : dict of str
        Text by name, or the place of a file to copy.
    parts : str
        Pattern of files, below the folder, each of which is a finished task.
    before : str
        A command that makes an input, once.
    """

    words: str
    files: dict[str, str | Path]
    parts: str = ""
    before: str = ""


def _text(*place: str, **changes: str) -> str:
    text = EXAMPLES.joinpath(*place).read_text()
    for old, new in changes.items():
        text = re.sub(rf"(?m)^{old} = .*$", f"{old} = {new}", text, count=1)
    return text


def _jobs() -> dict[str, Job]:
    bounce = {"start.csv": EXAMPLES / "campaign" / "start.csv"}
    particles = _text("particles", "hopper.toml", duration='"40 ms"')
    particles = particles.replace("[output]", '[output]\ncheckpoints = "4 ms"')
    gas = _text("flows", "channel.toml", duration='"1 s"')
    gas = gas.replace("[output]", '[output]\ncheckpoints = "50 ms"')
    fluids = _text("flows", "clusters.toml", duration='"60 ms"', cells="[32, 64, 1]")
    fluids = fluids.replace("[output]", '[output]\ncheckpoints = "5 ms"')
    bed = _text("heated_bed", "case.toml", rays="300")
    bed = bed.replace("../../greybed/datasets/packings/", "")
    packing = EXAMPLES.parent / "greybed" / "datasets" / "packings" / "settled_mono_4k.dump"
    drag = re.sub(
        r"samples = 4",
        "samples = 2\ndevelop = 0.5\napart = 0.2",
        _text("filtered_drag", "small.toml"),
    )
    drag = drag.replace("[32, 96, 1]", "[16, 32, 1]")  # fmt: skip
    campaign = _text("campaign", "campaign.toml").replace("[0.5, 0.9]", "[0.5, 0.7, 0.9]")
    study = {p.name: p for p in (EXAMPLES / "settling_spheres").iterdir() if p.is_file()}
    return {
        "campaign": Job(
            "campaign campaign.toml --out out --workers 1 --quiet",
            {"campaign.toml": campaign, "bounce.toml": EXAMPLES / "campaign" / "bounce.toml",
             **bounce}, "tasks/*.json",
        ),
        "train": Job(
            "train viewfactor ../data.h5 --epochs 40 --no-curve --name new --out out", {},
            before="dataset viewfactor design.toml --out data.h5",
        ),
        "calibrate": Job(
            "calibrate twin.toml --out out --quiet",
            {"twin.toml": _text("calibration", "twin.toml")},
        ),
        "simulate particles": Job(
            "simulate case.toml --out out --quiet --threads 1", {"case.toml": particles}
        ),
        "simulate gas": Job("simulate case.toml --out out --quiet", {"case.toml": gas}),
        "simulate two-fluid": Job("simulate case.toml --out out --quiet", {"case.toml": fluids}),
        "simulate thermal": Job(
            "simulate case.toml --out out --quiet",
            {"case.toml": bed, packing.name: packing},
        ),
        "dataset viewfactor": Job(
            "dataset viewfactor design.toml --out out/data.h5", {"design.toml": DESIGN},
            "data.h5.parts/[!.]*.npz",
        ),
        "dataset drag": Job(
            "dataset drag small.toml --out out/drag.h5", {"small.toml": drag},
        ),
        "diagnose": Job("diagnose study.toml --out out --quiet", {**study}),
        "trace": Job(
            f"trace {packing.name} --rays 1500 --seed 2 --quiet --threads 1 --out out",
            {packing.name: packing}, ".trace/*/[!.]*.npz",
        ),
    }  # fmt: skip


def verbs() -> list[str]:
    """Names of what can be killed."""
    return list(_jobs())


def _plain(value: Any) -> Any:
    """JSON without what tells of the way."""
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items() if not _OF_THE_WAY.search(k)}
    if isinstance(value, list):
        return [_plain(v) for v in value]
    return value


def _hash(path: Path) -> str:
    content = path.read_bytes()
    if path.suffix == ".json":
        content = json.dumps(_plain(json.loads(content)), sort_keys=True).encode()
    return hashlib.sha256(content).hexdigest()


# Times stand in these: the page, the table and the store of a calibration, the seconds of runs,
# and the checkpoint, whose archive has the same arrays.
_NOT_COMPARED = (".html", ".sqlite", ".npz", ".lock")


def results(folder: Path) -> dict[str, str]:
    """Hashes of all result files below a folder, by name."""
    found = {}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        if path.is_file() and path.suffix not in _NOT_COMPARED and ".part" not in name:
            if name == "campaign.csv":
                text = [line.split(",") for line in path.read_text().splitlines()]
                keep = [k for k, cell in enumerate(text[0]) if not _OF_THE_WAY.search(cell)]
                content = str([[row[k] for k in keep] for row in text]).encode()
                found[name] = hashlib.sha256(content).hexdigest()
            else:
                found[name] = _hash(path)
    return found


def _set_up(job: Job, folder: Path) -> None:
    folder.mkdir(parents=True)
    for name, content in job.files.items():
        if isinstance(content, Path):
            shutil.copy(content, folder / name)
        else:
            (folder / name).write_text(content)


def _started(words: str, folder: Path) -> subprocess.Popen[bytes]:
    one = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA")}
    with open(folder / "said.log", "ab") as log:
        return subprocess.Popen(
            [sys.executable, "-m", "greybed", *words.split()], cwd=folder, stdout=log, stderr=log,
            env={**os.environ, **one},
        )  # fmt: skip


def kill(verb: str, kills: int, seed: int, root: Path) -> dict[str, Any]:
    """Kill a verb so often, at random moments, and compare what the restarted runs give.

    Parameters
    ----------
    verb : str
        One of :func:`verbs`.
    kills : int
        How many; runs are ended and started again until they finish, then a new one begins.
    seed : int
        Of the moments.
    root : Path
        Existing, empty folder.
    """
    job, rng = _jobs()[verb], random.Random(f"{seed} {verb}")
    if job.before:
        (root / "design.toml").write_text(DESIGN)
        if _started(job.before, root).wait() != 0:
            raise RuntimeError((root / "said.log").read_text())
    # Always the same folder: the names of files are inputs of a campaign.
    folder = root / "run"
    found: list[dict[str, str]] = []
    duration = 0.0
    for _ in range(2):  # the first one also compiles
        _set_up(job, folder)
        begin = time.perf_counter()
        if _started(job.words, folder).wait() != 0:
            raise RuntimeError((folder / "said.log").read_text())
        duration = time.perf_counter() - begin
        found.append(results(folder / "out"))
        shutil.rmtree(folder)
    wanted = found[1]
    faults: list[str] = []
    if found[0] != wanted:
        faults.append("two whole runs differ")
    done = chains = 0
    while done < kills:
        chains += 1
        _set_up(job, folder)
        while True:
            out = folder / "out"
            before = {p: p.stat().st_mtime_ns for p in out.glob(job.parts)} if job.parts else {}
            run = _started(job.words, folder)
            if done < kills:
                try:
                    run.wait(rng.uniform(0.0, duration))
                except subprocess.TimeoutExpired:
                    run.kill()
                    run.wait()
                    done += 1
                    again = [
                        p for p, at in before.items() if p.exists() and p.stat().st_mtime_ns != at
                    ]
                    if again:
                        faults.append(f"run {chains}: a finished part was made again: {again[0]}")
                    continue
            code = run.wait()
            if code != 0:
                said = (folder / "said.log").read_text()[-300:]
                faults.append(f"run {chains}: ended with {code}: {said}")
            break
        got = results(folder / "out")
        if got != wanted:
            names = [n for n in {*got, *wanted} if got.get(n) != wanted.get(n)]
            faults.append(f"run {chains}: other results: {sorted(names)[:5]}")
            shutil.copytree(folder, root / f"fault{chains}")
        shutil.rmtree(folder)
    return {"verb": verb, "kills": done, "runs": chains, "seconds": duration, "faults": faults}
