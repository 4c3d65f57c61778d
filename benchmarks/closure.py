"""Exported closure in C++ against the same closure in ONNX Runtime, one thread each, in turn.

python benchmarks/closure.py            needs g++

The same pairs go into the exported header and into the exported graph; both answers must agree.
ONNX Runtime gets one thread, full graph optimisation, inputs that are bound beforehand, and of
several batch sizes the fastest. The exact pair factor is part of both. Bar: half a microsecond.
"""

from __future__ import annotations

import argparse
import json
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import onnxruntime

from greybed.closures import load, model_path
from greybed.export import export_cpp, export_onnx

SOURCE = Path(__file__).parent / "peers" / "closure_rate.cpp"
MODELS = ("shipped:viewfactor_mlp_pencil", "shipped:viewfactor_mlp_published")
BATCHES = (1, 64, 1024, 16_384)
BAR = 0.5e-6
AGREE = 1e-10


def rows(n: int) -> dict[str, np.ndarray]:
    """Pairs of a bed: sizes 1:4, gaps up to three diameters, any blocked share."""
    rng = np.random.default_rng(3)
    ratio = np.exp(rng.uniform(-1.4, 1.4, n))
    return {
        "radius_over_distance": ratio / (1.0 + ratio) / rng.uniform(1.0, 4.0, n),
        "radius_ratio": ratio,
        "blocked_fraction": rng.uniform(0.0, 1.0, n),
        "blockers_per_line": rng.uniform(0.0, 5.0, n),
        "n_between": rng.uniform(0.0, 8.0, n),
        "solid_fraction": rng.uniform(0.1, 0.63, n),
    }


def peer(path: Path, columns: dict[str, np.ndarray]) -> tuple[float, int, np.ndarray]:
    """Seconds a pair in ONNX Runtime, the batch that was fastest, and the answers."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.graph_optimization_level = onnxruntime.GraphOptimizationLevel.ORT_ENABLE_ALL
    session = onnxruntime.InferenceSession(path, options, ["CPUExecutionProvider"])
    n = len(columns["radius_ratio"])
    answers, best = np.empty(n), (np.inf, 0)
    for size in BATCHES:
        pieces = range(0, n if size > 1 else 2000, size)
        bindings = []
        for first in pieces:
            binding = session.io_binding()
            for name, values in columns.items():
                piece = np.ascontiguousarray(values[first : first + size])
                binding.bind_cpu_input(name, piece)
            binding.bind_output("view_factor")
            bindings.append(binding)
        begin = time.perf_counter()
        for binding in bindings:
            session.run_with_iobinding(binding)
        seconds = (time.perf_counter() - begin) / min(len(pieces) * size, n)
        best = min(best, (seconds, size))
        for first, binding in zip(pieces, bindings, strict=True):
            values = binding.copy_outputs_to_cpu()[0]
            answers[first : first + len(values)] = values
    return best[0], best[1], answers


def main() -> int:
    """Measure both in turn; returns the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--pairs", type=int, default=5, help="runs of each, in turn (default 5)")
    parser.add_argument("--rows", type=int, default=65_536)
    parser.add_argument(
        "--model", action="append", help="a .closure of pairs (the shipped networks by default)"
    )
    options = parser.parse_args()
    if shutil.which("g++") is None:
        print("needs g++")
        return 2
    table = rows(options.rows)
    slowest, ratios, same = 0.0, [], True
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        data = folder / "rows.bin"
        for number, model in enumerate(options.model or MODELS):
            closure = load(model_path(model))
            columns = {marker: table[marker] for marker in closure.marker_names}
            data.write_bytes(
                np.int32(options.rows).tobytes()
                + b"".join(values.astype("<f8").tobytes() for values in columns.values())
            )
            header = export_cpp(closure, folder / str(number))
            graph = export_onnx(closure, folder / f"{number}.onnx")
            binary = folder / f"rate_{number}"
            build = ["g++", "-std=c++11", "-O3", "-march=native", f"-I{header.parent}"]
            build += [f'-DCLOSURE_HEADER="{header.name}"', f"-DCLOSURE=greybed::{header.stem}"]
            subprocess.run([*build, SOURCE, "-o", binary], check=True)
            ours, theirs = [], []
            for _ in range(options.pairs):
                command = [binary, data, "3", folder / "out.bin"]
                run = subprocess.run(command, capture_output=True, text=True, check=True)
                found = json.loads(run.stdout)
                seconds, batch, answers = peer(graph, columns)
                ours.append(found["batch"])
                theirs.append(seconds)
                mine = np.fromfile(folder / "out.bin")
                same &= bool(found["sound"]) and np.allclose(mine, answers, rtol=AGREE, atol=0.0)
            ratio = statistics.median(b / a for a, b in zip(ours, theirs, strict=True))
            ratios.append(ratio)
            slowest = max(slowest, statistics.median(ours))
            print(
                f"{model}: C++ {1e6 * found['single']:.3f} us a call, "
                f"{1e6 * statistics.median(ours):.3f} us a pair in a batch; ONNX Runtime "
                f"{onnxruntime.__version__} {1e6 * statistics.median(theirs):.3f} us a pair in "
                f"batches of {batch}; ratio {ratio:.2f}"
            )
    if not same:
        print(f"the answers differ by more than a relative {AGREE:g}: not the same work")
        return 1
    print(f"bar {1e6 * BAR:g} us a pair: {'met' if slowest <= BAR else 'NOT met'}")
    print(f"ratio {min(ratios):.3f}")
    return 0 if slowest <= BAR else 1


if __name__ == "__main__":
    sys.exit(main())
