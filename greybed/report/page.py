"""The page of the quickstart: from its results to sections of pictures, figures and tables."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from greybed.report.beds import beds_section
from greybed.report.elements import (
    NOTHING,
    Page,
    Tone,
    Verdict,
    count,
    duration,
    fixed,
    interval,
    listed,
    number,
)
from greybed.report.sections import (
    Results,
    accuracy_section,
    dataset_section,
    exports_section,
    files_section,
    known,
    limits_section,
    many,
    next_section,
    notes_section,
    replays,
    timings_section,
)

Arrays = Mapping[str, Mapping[str, NDArray]]


def render_page(results: Results, arrays: Arrays, path: str | os.PathLike[str]) -> Path:
    """Write the page of a quickstart.

    Parameters
    ----------
    results : mapping
        What ``summary.json`` holds; a missing entry leaves a gap, not an error.
    arrays : mapping
        ``parity_<closure>``: ``truth``, ``predicted``, ``stderr`` (the closure's own error), and
        if known ``solid_fraction`` and ``truth_stderr`` (ray noise); all [-], shape (n,).
        ``bed_<bed>``: ``centres`` (n, 3), ``radii`` (n,) [m], ``traced``, ``closure`` (n,) [K].
    path : path
        HTML file to write.

    Returns
    -------
    Path
        The file.
    """
    results = known(results)
    parts = (
        beds_section(results, arrays),
        accuracy_section(results, arrays),
        limits_section(results),
        exports_section(results),
        dataset_section(results),
        timings_section(results),
        files_section(results),
        next_section(results),
        notes_section(results),
    )
    machine = results.get("machine") or {}
    facts = [
        f"greybed {results.get('version', NOTHING)}",
        f"seed {results.get('seed', NOTHING)}",
        f"{duration(results.get('seconds'))} in all",
        f"{count(machine['processors'], 'processor')}" if machine.get("processors") else "",
        f"Python {machine['python']}" if machine.get("python") else "",
        str(machine.get("system", "")),
    ]
    page = Page(
        _title(results),
        _summary(results),
        _verdicts(results),
        tuple(part for part in parts if part is not None),
        " · ".join(fact for fact in facts if fact),
    )
    return page.write(path)


def _title(results: Results) -> str:
    packings = sum(((results.get("dataset") or {}).get("packings") or {}).values())
    made = count(len(many(results, "closures")), "view-factor closure")
    origin = f" from {count(packings, 'ray-traced packing')}" if packings else ""
    beds = len(many(results, "cases"))
    return f"{made}{origin}" + (f", put to work in {count(beds, 'heated bed')}" if beds else "")


def _summary(results: Results) -> str:
    targets = {entry.get("target") for entry in many(results, "exports")}
    names = [word for key, word in (("cpp", "C++"), ("onnx", "ONNX")) if key in targets]
    also = f", in Python as in {listed(names)}" if names else ""
    return (
        "A view factor is the share of a sphere's heat radiation that reaches another one. Tracing "
        "rays finds it, slowly; a closure gives it from a few numbers per pair and is built to "
        f"obey the exact laws wherever one is known{also}."
    )


def _verdicts(results: Results) -> tuple[Verdict, ...]:
    found = []
    limits = many(results, "limits")
    failed = sum(not row.get("passed") for row in limits)
    if limits and failed:
        found.append(
            Verdict(
                f"✗ {failed} of {len(limits)} limits fail",
                "exact laws that a closure must obey; see the table of limits",
                "bad",
            )
        )
    elif limits:
        what = f"{len(limits)} checks against exact laws, from untrained to exported form"
        found.append(Verdict("✓ All limits hold", what, "good"))
    else:
        found.append(Verdict("No limits checked", "this run holds no limiting cases", "muted"))
    closure = _running(results)
    if closure is not None:
        s = closure.get("score") or {}
        found.append(
            Verdict(
                f"R² {fixed(s.get('r2'), 4)}",
                f"95 %: {interval(s.get('r2_ci95'), 4)}, on {number(s.get('packings'))} packings "
                f"never trained on; ray noise alone caps it at {fixed(s.get('r2_noise'), 4)} "
                f"({closure['name']})",
            )
        )
    cases = [c for c in many(results, "cases") if (c.get("difference") or {}).get("max_K")]
    if cases:
        worst = max(cases, key=lambda c: c["difference"]["max_K"])
        d = worst["difference"]
        found.append(
            Verdict(
                f"{number(d['max_K'])} K off at most",
                f"largest temperature difference, closure against rays, of a span of "
                f"{number(d.get('span_K'))} K; {number(d.get('rms_K'))} K rms "
                f"({worst['bed']} bed)",
            )
        )
    verdicts = [replays(e) for e in many(results, "exports")]
    if verdicts:
        wrong, ran = verdicts.count(False), len(verdicts) - verdicts.count(None)
        value = f"✓ {count(ran, 'export')} agree" + ("s" if ran == 1 else "")
        if not ran:
            value = "No export replayed"
        elif wrong:
            value = f"✗ {wrong} of {count(ran, 'export')} wrong"
        tone: Tone = "bad" if wrong else ("good" if ran else "muted")
        left = f"; {len(verdicts) - ran} not replayed here" if ran < len(verdicts) else ""
        found.append(Verdict(value, f"C++ and ONNX replay what Python predicts{left}", tone))
    return tuple(found)


def _running(results: Results) -> Mapping[str, Any] | None:
    """The closure that the beds ran with, or else the first one."""
    closures = {c["name"]: c for c in many(results, "closures")}
    for case in many(results, "cases"):
        name = (case.get("closure") or {}).get("closure")
        if name in closures:
            return closures[name]
    return next(iter(closures.values()), None)
