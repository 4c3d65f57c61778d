"""Breaks greybed on purpose: spoilt files for every reader, and kills of every verb.

python benchmarks/hardening.py fuzz [--inputs 10000] [--seed 1] [--only "VTK, text"]
python benchmarks/hardening.py kills --verb campaign [--kills 50]

``fuzz`` reads spoilt files, each format in a process of its own with a limit of time for each file
and of memory: a file must load or be refused in one sentence. ``kills`` ends runs by SIGKILL at
random moments and gives the same command again; the results must be those of a run that nobody
stopped. Both print a table; docs/hardening.md has the recorded ones.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from contextlib import suppress
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))

SECONDS = 5.0  # for one file
MEMORY = 1 << 30  # bytes beyond what the libraries and the whole file have taken


class HangError(BaseException):
    """Time is over; no reader may catch it."""


def _over(*_: Any) -> None:
    raise HangError


def fuzz_one(
    name: str, inputs: int, seed: int, folder: Path, limits: bool = True
) -> dict[str, Any]:
    """Read so many spoilt files of a format; what was found.

    Parameters
    ----------
    name : str
        Key of ``TARGETS``.
    inputs : int
        Files.
    seed : int
        Of the spoiling.
    folder : Path
        Existing, for the files; becomes the working folder.
    limits : bool
        Limit memory of this process; cannot be taken back.
    """
    from hardening_targets import TARGETS, of_store

    from greybed.core.errors import GreybedError

    target = TARGETS[name]
    whole = target.make(folder)
    target.read(whole)
    content = whole.read_bytes()
    if name == "store of runs":
        target = type(target)(target.name, target.make, target.read, of_store(folder))
    before = Path.cwd()
    os.chdir(folder)
    if limits:
        size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (size + MEMORY, resource.RLIM_INFINITY))
    rng = random.Random(f"{seed} {name}")
    faults: dict[str, Any] = {}
    taken = refused = 0
    slowest = 0.0
    old = signal.signal(signal.SIGALRM, _over)
    try:
        for number in range(inputs):
            data = target.input(content, rng)
            path = folder / f"input{whole.suffix}"
            path.write_bytes(data)
            begin = time.perf_counter()
            said = None
            signal.setitimer(signal.ITIMER_REAL, SECONDS)
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("error")
                    target.read(path)
                taken += 1
            except GreybedError as error:
                refused += 1
                if "\n" in str(error) or len(str(error)) > 2000:
                    said = f"a refusal that is no sentence: {str(error)[:200]!r}"
            except (Exception, HangError) as error:
                place = traceback.extract_tb(error.__traceback__)[-1]
                own = [
                    f for f in traceback.extract_tb(error.__traceback__) if "greybed" in f.filename
                ]
                last = own[-1] if own else place
                said = (
                    f"{type(error).__name__}: {str(error)[:120]} at {Path(last.filename).name}:"
                    f"{last.lineno}"
                )
            finally:
                signal.setitimer(signal.ITIMER_REAL, 0.0)
            if Path("owned").exists():
                said = "a file was executed"
                Path("owned").unlink()
            slowest = max(slowest, time.perf_counter() - begin)
            if said is not None:
                key = said.split(" at ")[-1] + said.split(":")[0]
                if key in faults:
                    faults[key]["times"] += 1
                else:
                    kept = folder / f"fault{len(faults)}{whole.suffix}"
                    kept.write_bytes(data)
                    faults[key] = {"said": said, "times": 1, "input": str(kept), "number": number}
    finally:
        signal.signal(signal.SIGALRM, old)
        os.chdir(before)
    return {
        "format": name, "inputs": inputs, "loaded": taken, "refused": refused,
        "faults": list(faults.values()), "slowest": slowest,
    }  # fmt: skip


def fuzz(options: argparse.Namespace) -> int:
    """All formats, each in a process of its own; returns 1 where a file was a fault."""
    from hardening_targets import TARGETS

    names = options.only or list(TARGETS)
    print("| format | inputs | loaded | refused | faults | slowest [ms] | time [s] |")
    print("|---|---|---|---|---|---|---|", flush=True)
    bad = 0
    root = Path(tempfile.mkdtemp(prefix="greybed-fuzz-")) if options.keep is None else options.keep
    for number, name in enumerate(names):
        folder = root / str(number)
        folder.mkdir(parents=True)
        words = [sys.executable, __file__, "one", name, "--inputs", str(options.inputs)]
        begin = time.perf_counter()
        done = subprocess.run(
            [*words, "--seed", str(options.seed), "--folder", str(folder)],
            capture_output=True, text=True, check=False,
            env={**os.environ, "NUMBA_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
        )  # fmt: skip
        seconds = time.perf_counter() - begin
        try:
            found = json.loads(done.stdout.splitlines()[-1])
        except (IndexError, ValueError):
            bad += 1
            print(
                f"| {name} | died: {done.returncode} {done.stderr[-1500:]} in {folder} |",
                flush=True,
            )
            continue
        bad += len(found["faults"])
        print(
            f"| {name} | {found['inputs']} | {found['loaded']} | {found['refused']} | "
            f"{sum(f['times'] for f in found['faults'])} | {1e3 * found['slowest']:.0f} | "
            f"{seconds:.0f} |",
            flush=True,
        )
        for fault in found["faults"]:
            print(f"    {fault['times']} x {fault['said']} ({fault['input']})", flush=True)
    return 1 if bad else 0


def kills(options: argparse.Namespace) -> int:
    """All verbs, or those named; returns 1 where a result was lost or another one."""
    from hardening_kills import kill, verbs

    print("| verb | kills | runs | one run [s] | faults |\n|---|---|---|---|---|", flush=True)
    bad = 0
    for verb in options.verb_name or verbs():
        root = Path(tempfile.mkdtemp(prefix="greybed-kills-"))
        found = kill(verb, options.kills, options.seed, root)
        bad += len(found["faults"])
        print(
            f"| {verb} | {found['kills']} | {found['runs']} | {found['seconds']:.1f} | "
            f"{len(found['faults'])} |",
            flush=True,
        )
        for fault in found["faults"]:
            print(f"    {fault} ({root})", flush=True)
    return 1 if bad else 0


def main() -> int:
    """Read the words and do it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    verbs = parser.add_subparsers(dest="verb", required=True)
    all_formats = verbs.add_parser("fuzz")
    all_formats.add_argument("--inputs", type=int, default=10_000)
    all_formats.add_argument("--seed", type=int, default=1)
    all_formats.add_argument("--only", action="append")
    all_formats.add_argument("--keep", type=Path)
    one = verbs.add_parser("one")
    one.add_argument("name")
    one.add_argument("--inputs", type=int, required=True)
    one.add_argument("--seed", type=int, required=True)
    one.add_argument("--folder", type=Path, required=True)
    ends = verbs.add_parser("kills")
    ends.add_argument("--verb", action="append", dest="verb_name")
    ends.add_argument("--kills", type=int, default=50)
    ends.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    if options.verb == "kills":
        return kills(options)
    if options.verb == "one":
        found = fuzz_one(options.name, options.inputs, options.seed, options.folder.resolve())
        print(json.dumps(found))
        return 0
    return fuzz(options)


if __name__ == "__main__":
    with suppress(BrokenPipeError):
        sys.exit(main())
