"""Exported closures against ONNX Runtime and keras2cpp's pattern, one thread each, in turn.

python benchmarks/closure.py            needs g++; with gfortran the Fortran module as well
python benchmarks/closure.py --forest   also a forest of 100 trees and 438,000 nodes, a minute

1. Shipped closures of pairs: the same pairs go into the exported header and the exported graph;
   both answers must agree. ONNX Runtime gets one thread, full graph optimisation, inputs that are
   bound beforehand, and of several batch sizes the fastest. The exact pair factor is part of both.
   Bar: half a microsecond.
2. A network 4-32-32-1 with tanh in double precision and nothing else, call by call, at several
   flags, against ONNX Runtime's batch of 10,000 and the calling pattern of keras2cpp
   (peers/network_rate.cpp).
   Bars: 3 times ONNX Runtime, 8 times keras2cpp, value with Jacobian at most 3.5 times the value.
3. Python, header, C library, Fortran and ONNX on 100,000 pairs: at most 1e-12 apart, one hash.

The last line is the ratio of the batch in ONNX Runtime to one call of the network, both per row.
"""

from __future__ import annotations

import argparse
import json
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
from onnx import TensorProto, helper

from greybed.closures import ViewFactorClosure, load, model_path
from greybed.closures.predictors import Forest, Network
from greybed.closures.viewfactor.closure import Domain
from greybed.closures.viewfactor.limits import random_markers
from greybed.closures.viewfactor.visibility import MARKER_SETS
from greybed.export import (
    CompiledClosure,
    CompiledLibrary,
    FortranProgram,
    OnnxClosure,
    compile_c,
    compile_cpp,
    export_c,
    export_cpp,
    export_onnx,
    find_fortran,
    form_of,
)
from greybed.export.graph import Graph, network_nodes

PEERS = Path(__file__).parent / "peers"
SOURCE = PEERS / "closure_rate.cpp"
# Those of a distribution's package, and those that the C library is dispatched to.
FLAGS = (("-O2",), ("-O3",), ("-O3", "-mavx2", "-mfma"))
BARS = {"ONNX Runtime": 3.0, "keras2cpp": 8.0, "Jacobian": 3.5}
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
    session = session_of(path)
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
        spent = 0.0
        for binding in bindings:  # seconds of the processor, the best of three
            times = []
            for _ in range(3):
                begin = time.process_time()
                session.run_with_iobinding(binding)
                times.append(time.process_time() - begin)
            spent += min(times)
        seconds = spent / min(len(pieces) * size, n)
        best = min(best, (seconds, size))
        for first, binding in zip(pieces, bindings, strict=True):
            values = binding.copy_outputs_to_cpu()[0]
            answers[first : first + len(values)] = values
    return best[0], best[1], answers


def session_of(path: Path) -> onnxruntime.InferenceSession:
    """One thread, everything optimised."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.graph_optimization_level = onnxruntime.GraphOptimizationLevel.ORT_ENABLE_ALL
    return onnxruntime.InferenceSession(path, options, ["CPUExecutionProvider"])


def network(folder: Path, runs: int) -> float:
    """Part 2; returns the ratio to ONNX Runtime's batch with the flags of the C library."""
    net = Network.random(4, (32, 32), seed=1)
    closure = ViewFactorClosure(MARKER_SETS["pencil"], net, Domain.everywhere(4))
    header = export_cpp(closure, folder / "net", "net")
    table = np.random.default_rng(0).normal(size=(10_000, 4))
    data, out = folder / "net.bin", folder / "net.out"
    data.write_bytes(np.int32(len(table)).tobytes() + table.tobytes())
    g = Graph()
    raw = network_nodes(g, net, "x")
    g.add("Gather", raw, np.array([0], dtype=np.int64), axis=1, out="y")
    kind = TensorProto.DOUBLE
    inputs = [helper.make_tensor_value_info("x", kind, ["N", 4])]
    outputs = [helper.make_tensor_value_info("y", kind, ["N", 1])]
    graph = helper.make_graph(g.nodes, "net", inputs, outputs, list(g.constants.values()))
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    onnx.save(model, folder / "net.onnx")
    session = session_of(folder / "net.onnx")
    ratio = 0.0
    for flags in FLAGS:
        words = ["g++", "-std=c++11", *flags, f"-I{header.parent}", '-DCLOSURE_HEADER="net.hpp"']
        words += ["-DCLOSURE=greybed::net", PEERS / "network_rate.cpp", "-o", folder / "rate"]
        subprocess.run(words, check=True)
        ours, batches = [], []
        for _ in range(runs):
            words = [folder / "rate", data, out]
            run = subprocess.run(words, capture_output=True, text=True, check=True)
            ours.append(json.loads(run.stdout))
            for _ in range(10):
                begin = time.process_time()
                (answer,) = session.run(None, {"x": table})
                batches.append((time.process_time() - begin) / len(table))
        best = {k: min(found[k] for found in ours) for k in ours[0]}
        np.testing.assert_allclose(np.fromfile(out), answer[:, 0], rtol=0.0, atol=1e-13)
        batch, value = 1e9 * min(batches), best["value"]
        ratio = batch / value
        print(
            f"4-32-32-1 {' '.join(flags)}: {value:.0f} ns a call, with Jacobian "
            f"{best['jacobian'] / value:.2f} times (bar {BARS['Jacobian']}); keras2cpp's pattern "
            f"{best['keras']:.0f} ns, {best['keras'] / value:.2f} times (bar {BARS['keras2cpp']}); "
            f"ONNX Runtime's batch {batch:.0f} ns, {ratio:.2f} times (bar {BARS['ONNX Runtime']})"
        )
    return ratio


def agreement(folder: Path) -> bool:
    """Part 3: every form on the same 100,000 pairs."""
    closure = load(model_path(MODELS[0]))
    markers = random_markers(closure, 100_000, seed=9)
    here = closure.evaluate(**markers)
    header = export_c(closure, folder / "all", "all", fortran=True)
    program = compile_cpp(header.with_name("all.hpp"), folder / "all")
    library, form = compile_c(header, folder / "all"), form_of(closure, "all")
    forms = {"header": CompiledClosure(program), "C library": CompiledLibrary(library, form)}
    if find_fortran():
        forms["Fortran"] = FortranProgram(header, library, form)
    for single in (False, True):
        graph = export_onnx(closure, folder / f"{single}.onnx", single=single)
        forms["ONNX float32" if single else "ONNX"] = OnnxClosure(graph)
    sound = len({form.hash for form in forms.values()}) == 1
    for name, form in forms.items():
        batch = form.batch(**markers)[:, 0] if name == "C library" else form.predict(**markers)[0]
        # In single precision of the largest factor: what is nearly hidden keeps no more digits.
        scale = here.max() if name == "ONNX float32" else here
        error, bar = np.abs(batch / scale - here / scale).max(), 1e-6 if "32" in name else 1e-12
        sound &= bool(error <= bar)
        print(f"{name}: largest difference from Python on 100,000 pairs {error:.1e} (bar {bar:g})")
    return sound


def forest(folder: Path) -> bool:
    """A forest of 100 trees, 438,000 nodes: seconds to compile, difference from scikit-learn."""
    from sklearn.ensemble import RandomForestRegressor

    rng = np.random.default_rng(5)
    x = np.abs(rng.normal(size=(6000, 4))).astype(np.float32)
    y = rng.uniform(0.05, 0.95, (6000, 2))
    model = RandomForestRegressor(100, max_leaf_nodes=2190, random_state=0, n_jobs=1).fit(x, y)
    columns: list[list] = [[], [], [], []]
    roots = []
    for tree in (estimator.tree_ for estimator in model.estimators_):
        first, order = len(columns[0]), [0]  # breadth first: children side by side
        roots.append(first)
        for node in order:
            left, inner = tree.children_left[node], tree.children_left[node] >= 0
            columns[0].append(tree.feature[node] if inner else -1)
            columns[1].append(tree.threshold[node] if inner else 0.0)
            columns[2].append(first + len(order) if inner else 0)
            columns[3].append(tree.value[node, :, 0])
            if inner:
                order += [left, tree.children_right[node]]
    kinds = (np.int32, np.float32, np.int32, np.float64)
    arrays = (np.array(c, dtype=t) for c, t in zip(columns, kinds, strict=True))
    trees = Forest(np.array(roots, dtype=np.int32), *arrays)
    closure = ViewFactorClosure(MARKER_SETS["published"], trees, Domain.everywhere(4))
    header = export_cpp(closure, folder / "forest", "trees")
    (folder / "trees.cpp").write_text(
        '#include "trees.hpp"\n#include <cstdio>\nint main() { double x[4], raw[2];\n'
        '  while (std::scanf("%lf %lf %lf %lf", x, x + 1, x + 2, x + 3) == 4) {\n'
        "    greybed::trees::detail::forest(x, raw);\n"
        '    std::printf("%.17g %.17g\\n", raw[0], raw[1]);\n  } }\n'
    )
    words = ["g++", "-std=c++11", "-O2", f"-I{header.parent}", folder / "trees.cpp"]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    begin = time.perf_counter()
    subprocess.run([*words, "-o", folder / "trees"], check=True)
    wall, after = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    some = x[:2000].astype(np.float64)
    text = "\n".join(" ".join(f"{v:.17g}" for v in row) for row in some)
    run = subprocess.run([folder / "trees"], input=text, capture_output=True, text=True, check=True)
    found = np.loadtxt(run.stdout.splitlines())
    error = np.abs(found / model.predict(some.astype(np.float32)) - 1.0).max()
    print(
        f"forest of 100 trees, {len(trees.feature)} nodes: {seconds:.1f} s of the processor to "
        f"compile ({wall:.1f} s by the clock; bar 6), {error:.1e} from scikit-learn (bar 1e-15)"
    )
    return bool(seconds <= 6.0 and error <= 1e-15)


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
    parser.add_argument("--forest", action="store_true", help="also the large forest")
    options = parser.parse_args()
    if shutil.which("g++") is None:
        print("needs g++")
        return 2
    table = rows(options.rows)
    slowest, same = 0.0, True
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
                command = [binary, data, "10", folder / "out.bin"]
                run = subprocess.run(command, capture_output=True, text=True, check=True)
                found = json.loads(run.stdout)
                seconds, batch, answers = peer(graph, columns)
                ours.append(found["batch"])
                theirs.append(seconds)
                mine = np.fromfile(folder / "out.bin")
                same &= bool(found["sound"]) and np.allclose(mine, answers, rtol=AGREE, atol=0.0)
            ratio = statistics.median(b / a for a, b in zip(ours, theirs, strict=True))
            slowest = max(slowest, statistics.median(ours))
            print(
                f"{model}: C++ {1e6 * found['single']:.3f} us a call, "
                f"{1e6 * statistics.median(ours):.3f} us a pair in a batch; ONNX Runtime "
                f"{onnxruntime.__version__} {1e6 * statistics.median(theirs):.3f} us a pair in "
                f"batches of {batch}; ratio {ratio:.2f}"
            )
        bare = network(folder, options.pairs)
        same &= agreement(folder)
        large = not options.forest or forest(folder)
    if not same:
        print(f"the answers differ by more than a relative {AGREE:g}, or the forms among them do")
        return 1
    print(f"bar {1e6 * BAR:g} us a pair: {'met' if slowest <= BAR else 'NOT met'}")
    print(f"ratio {bare:.3f}")
    return 0 if slowest <= BAR and bare >= BARS["ONNX Runtime"] and large else 1


if __name__ == "__main__":
    sys.exit(main())
