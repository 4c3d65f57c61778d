"""The quickstart: beds -> packings -> traces -> closures -> exports -> heated beds -> page."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from greybed._version import __version__
from greybed.closures import ViewFactorClosure, content_hash, load, save
from greybed.closures.artifact import SUFFIX
from greybed.closures.viewfactor.bed import inner_fraction
from greybed.closures.viewfactor.limits import check_limits
from greybed.core.files import output_folder, write_summary
from greybed.datasets.beds import RandomBed
from greybed.datasets.viewfactor import ViewFactorData, generate, quick_design, read
from greybed.export import (
    CompiledClosure,
    OnnxClosure,
    compile_cpp,
    export_cpp,
    export_onnx,
    find_compiler,
)
from greybed.export.replay import CPP_TOLERANCE, ONNX_TOLERANCE, replay
from greybed.report.heated import BEDS, RUNNING, heat, walled
from greybed.report.page import render_page
from greybed.report.stages import Arrays, Result, Stages
from greybed.training import train

CLOSURES = (("mlp", "pencil"), ("forest", "pencil"), ("mlp", "published"))


def quickstart(
    out: str | os.PathLike[str],
    *,
    seed: int = 1,
    small: bool = False,
    say: Callable[[str], object] = print,
) -> dict[str, Any]:
    """Run the whole chain into a folder; a killed run continues where it stopped.

    Parameters
    ----------
    out : path
        Folder for everything that is made.
    seed : int
        Seed of packings, rays and fits.
    small : bool
        A few packings, rays and epochs only: for tests, not for results.
    say : callable
        Called with every line of progress.

    Returns
    -------
    dict
        What ``summary.json`` holds; ``passed`` tells whether every limit and replay holds.
    """
    folder = output_folder(out)
    begin = time.perf_counter()
    settings = {"version": __version__, "seed": seed, "small": small}
    stages = Stages(folder, settings, say)
    beds, _ = stages.run("beds", "reading the two settled beds", _read_beds)
    dataset, _ = stages.run(
        "dataset",
        "packings of solid fraction 0.10 to 0.63, traced",
        lambda: _dataset(folder, seed, small),
    )
    data = read(folder / dataset["file"])
    closures, parity = stages.run(
        "closures", "training two networks and a forest", lambda: _train(folder, data, seed, small)
    )
    limits, _ = stages.run(
        "exports", "limits, export to C++ and ONNX, replay", lambda: _export(folder, seed, small)
    )
    cases: list[dict[str, Any]] = []
    temperatures: dict[str, Arrays] = {}
    for name, file, top in BEDS:
        case, arrays = stages.run(
            f"case_{name}",
            f"heating the {name} bed: traced factors beside the closure's",
            lambda n=name, f=file, t=top: heat(folder, n, f, t, seed, small),  # type: ignore[misc]
        )
        cases.append(case)
        temperatures[f"bed_{name}"] = arrays
    failed = [f"{row['closure']}: {row['case']}" for row in limits["limits"] if not row["passed"]]
    failed += [f"replay of {e['file']}" for e in limits["exports"] if not e.get("passed", True)]
    results = {
        "version": __version__,
        "seed": seed,
        "small": small,
        "machine": {
            "processors": os.cpu_count(),
            "python": platform.python_version(),
            "system": f"{platform.system()} {platform.machine()}",
        },
        "beds": beds["beds"],
        "dataset": dataset,
        "closures": closures["closures"],
        **limits,
        "cases": cases,
        "timings": stages.timings,
        "files": _files(),
        "next": _next(folder),
        "seconds": time.perf_counter() - begin,
    }
    tables = {**_split(parity), **temperatures}
    say(f"[{len(stages.timings) + 1}] writing the page")
    page = render_page(results, tables, folder / "report.html")
    results |= {"passed": not failed, "failed": failed, "report": page.name}
    write_summary(folder, "quickstart", results, seed=seed)
    return results


def _read_beds() -> Result:
    rows = []
    for name, file, top in BEDS:
        packing = walled(file, top)
        overlaps = packing.overlaps()
        # Touching: closer than a thousandth of the mean radius.
        touching, _ = packing.neighbours(1e-3 * float(packing.radii.mean()))
        rows.append(
            {
                "name": name,
                "file": file,
                "spheres": len(packing),
                "radii_mm": np.unique((1e3 * packing.radii).round(6)).tolist(),
                "overlaps": overlaps.count,
                "largest_overlap": overlaps.largest,
                "solid_fraction": inner_fraction(packing),
                "coordination": 2.0 * len(touching) / len(packing),
            }
        )
    return {"beds": rows}, {}, []


def _dataset(folder: Path, seed: int, small: bool) -> Result:
    design = quick_design(seed)
    if small:
        few = [replace(p, count=120) for p in design.packing[::6] if isinstance(p, RandomBed)]
        for split, k in (("calibrate", -2), ("test", -1)):
            few[k] = replace(few[k], split=split, fraction=0.4)
        design = replace(design, packing=tuple(few), rays=4_000, emitters=20)
    path = folder / "viewfactors.h5"
    begin = time.perf_counter()
    data = generate(design, path, show_progress=not small)
    results = {
        "file": path.name,
        "rows": len(data),
        "packings": {
            s: sum(p["split"] == s for p in data.packings) for s in ("train", "calibrate", "test")
        },
        "fractions": sorted({p.fraction for p in design.packing}),
        "sizes": sorted({p.sizes for p in design.packing if isinstance(p, RandomBed)}),
        "data_sha256": data.digest,
        "seconds": time.perf_counter() - begin,
        "design": [asdict(p) for p in design.packing],
    }
    return results, {}, [path]


def _train(folder: Path, data: ViewFactorData, seed: int, small: bool) -> Result:
    rows: list[dict[str, Any]] = []
    arrays: Arrays = {}
    written: list[Path] = []
    for kind, markers in CLOSURES:
        name = f"viewfactor_{kind}_{markers}"
        begin = time.perf_counter()
        closure = train(
            data, kind, markers, seed=seed, epochs=4 if small else None, show_progress=not small
        )
        path = save(closure, folder / (name + SUFFIX))
        written.append(path)
        rows.append(
            {
                "name": name,
                "file": path.name,
                "kind": kind,
                "markers": markers,
                "hash": content_hash(closure),
                "seconds": time.perf_counter() - begin,
                "score": closure.card["score"],
            }
        )
        arrays |= {f"{name}/{key}": value for key, value in _parity(closure, data).items()}
    return {"closures": rows}, arrays, written


def _parity(closure: ViewFactorClosure, data: ViewFactorData) -> Arrays:
    """Traced and predicted factors of the held-out pairs, thinned for the plot."""
    index = np.flatnonzero(data.in_split("test") & (data.columns["factor"] > 1e-4))
    index = index[:: max(1, len(index) // 20_000)]
    p = closure.predict(**{n: data.columns[n][index] for n in closure.marker_names})
    return {
        "truth": data.columns["factor"][index],
        "truth_stderr": data.columns["stderr"][index],
        "predicted": p.view_factor,
        "stderr": p.stderr,
        "solid_fraction": data.columns["solid_fraction"][index],
    }


def _split(arrays: Arrays) -> dict[str, Arrays]:
    """Arrays named ``closure/key`` as one dictionary per closure."""
    parted: dict[str, Arrays] = {}
    for name, value in arrays.items():
        closure, key = name.split("/")
        parted.setdefault(f"parity_{closure}", {})[key] = value
    return parted


def _export(folder: Path, seed: int, small: bool) -> Result:
    pairs = 2_000 if small else 20_000
    limits: list[dict[str, Any]] = []
    exports: list[dict[str, Any]] = []
    notes: list[str] = []
    written: list[Path] = []
    target = output_folder(folder / "exported")
    if find_compiler() is None:
        notes.append("No C++ compiler was found: the header was written but not replayed.")
    for kind, markers in CLOSURES:
        name = f"viewfactor_{kind}_{markers}"
        closure = load(folder / (name + SUFFIX))
        untrained = ViewFactorClosure.untrained(kind, markers, seed)
        columns: dict[str, list[Any]] = {
            "untrained": check_limits(untrained, n=pairs),
            "trained": check_limits(closure, n=pairs),
            "reloaded": check_limits(load(folder / (name + SUFFIX)), n=pairs),
        }
        begin = time.perf_counter()
        header = export_cpp(closure, target, name)
        written.append(header)
        entry = {
            "closure": name, "target": "cpp", "file": f"exported/{header.name}",
            "bound": CPP_TOLERANCE, "note": "not compiled", "rows": 0, "max_relative_error": None,
        }  # fmt: skip
        if find_compiler() is not None:
            program = CompiledClosure(compile_cpp(header, target))
            entry |= {"note": "", **replay(closure, program, CPP_TOLERANCE)}
            columns["C++"] = check_limits(closure, program.evaluate, n=pairs)
        exports.append(entry | {"seconds": time.perf_counter() - begin})
        begin = time.perf_counter()
        graph = export_onnx(closure, target / f"{name}.onnx")
        written.append(graph)
        session = OnnxClosure(graph)
        exports.append(
            {
                "closure": name, "target": "onnx", "file": f"exported/{graph.name}",
                "bound": ONNX_TOLERANCE, "note": "", **replay(closure, session, ONNX_TOLERANCE),
                "seconds": time.perf_counter() - begin,
            }
        )  # fmt: skip
        columns["ONNX"] = check_limits(closure, session.evaluate, n=pairs)
        for k, case in enumerate(columns["trained"]):
            limits.append(
                {
                    "closure": name,
                    "case": case.name,
                    "bound": case.bound,
                    "errors": {form: cases[k].error for form, cases in columns.items()},
                    "passed": all(cases[k].passed for cases in columns.values()),
                }
            )
    return {"limits": limits, "exports": exports, "notes": notes}, {}, written


def _files() -> list[dict[str, str]]:
    rows = [
        ("report.html", "this page"),
        ("summary.json", "every number of this page, with versions and hashes"),
        ("viewfactors.h5", "the data set: markers, traced factors, standard errors"),
    ]
    for kind, markers in CLOSURES:
        name = f"viewfactor_{kind}_{markers}"
        rows += [
            (name + SUFFIX, f"closure: {kind} on the {markers} markers; one file, no pickle"),
            (f"exported/{name}.hpp", "the same closure as a C++11 header"),
            (f"exported/{name}.onnx", "the same closure as an ONNX graph in double precision"),
        ]
    rows += [
        (f"bed_{n}.vtu", f"the {n} bed with both temperatures, for ParaView") for n, *_ in BEDS
    ]
    return [{"path": path, "what": what} for path, what in rows]


def _next(folder: Path) -> list[dict[str, str]]:
    model = folder / (RUNNING + SUFFIX)
    return [
        {"command": f"greybed check {model}", "what": "the limiting cases of a closure"},
        {
            "command": f"greybed export {model} --to cpp --out {folder / 'cpp'}",
            "what": "a header for your own C++ code, compiled and replayed",
        },
        {
            "command": "greybed pack --count 2000 --fraction 0.5 --sizes mono:1.5mm --out bed.h5",
            "what": "a packing of your own",
        },
        {
            "command": "greybed trace bed.h5 --rays 10000 --out traced",
            "what": "its view factors with standard errors",
        },
    ]
