"""Sections on closures and data: accuracy, limits, exports, data set, timings, files, commands."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from numpy.typing import NDArray

from greybed.report import figures
from greybed.report.elements import (
    NOTHING,
    Bars,
    Block,
    Cell,
    Commands,
    Figure,
    Figures,
    Section,
    Text,
    Tone,
    duration,
    fixed,
    interval,
    number,
    percent,
    table,
)

Results = Mapping[str, Any]

# Columns of the limit table in the order of the life of a closure.
FORMS = ("untrained", "trained", "reloaded", "C++", "ONNX")
_TARGETS = {"cpp": "C++ header", "onnx": "ONNX graph"}


def known(value: Any) -> Any:
    """The same results without the entries that are None: unknown and missing are one thing."""
    if isinstance(value, Mapping):
        return {key: known(entry) for key, entry in value.items() if entry is not None}
    return [known(entry) for entry in value] if isinstance(value, (list, tuple)) else value


def many(results: Results, key: str) -> Sequence[Mapping[str, Any]]:
    """Rows of results; none where the entry is missing."""
    return results.get(key) or ()


def replays(entry: Mapping[str, Any]) -> bool | None:
    """Whether an export agrees with Python; None where it was not replayed."""
    error = entry.get("max_relative_error")
    if error is None:
        return None
    return bool(entry.get("passed", error <= entry.get("bound", math.inf)))


def _scored(key: str, show: Callable[[Any], str]) -> Callable[[Mapping[str, Any]], Cell]:
    return lambda score: Cell(show(score.get(key)))


def _r2(score: Mapping[str, Any]) -> Cell:
    text = interval(score.get("r2_ci95"), 4)
    return Cell(fixed(score.get("r2"), 4), small=f"95 %: {text}" if text != NOTHING else "")


def _none_wanted(key: str) -> Callable[[Mapping[str, Any]], Cell]:
    def cell(score: Mapping[str, Any]) -> Cell:
        n = score.get(key)
        tone: Tone = "" if n is None else ("bad" if n else "good")
        return Cell(number(n) if n != 0 else "none", tone)

    return cell


def _held_out(score: Mapping[str, Any]) -> Cell:
    packings = score.get("packings")
    return Cell(number(score.get("pairs")), small=f"in {packings} packings" if packings else "")


# name, what it tells, cell of a score
_SCORES: tuple[tuple[str, str, Callable[[Mapping[str, Any]], Cell]], ...] = (
    ("R²", "share of the scatter explained, F > 10⁻⁴; 1 is perfect", _r2),
    ("R² noise ceiling", "what a perfect closure would reach: the truth is traced with finitely "
     "many rays", _scored("r2_noise", lambda v: fixed(v, 4))),
    ("Relative error, F > 0.01", "mean, near neighbours",
     _scored("mape_above_1e-2", percent)),
    ("Relative error, F > 0.001", "mean, farther pairs",
     _scored("mape_above_1e-3", percent)),
    ("Root mean square error", "of F [-]", _scored("rmse", number)),
    ("Mean absolute error", "of F [-]", _scored("mae", number)),
    ("Bias", "mean of predicted minus traced F; below zero blocks too much",
     _scored("bias", number)),
    ("Factors below zero", "impossible, so none may occur", _none_wanted("negative")),
    ("Factors above the exact free one", "impossible, so none may occur",
     _none_wanted("above_exact")),
    ("Largest error, nothing between", "against the exact law; only rounding may remain",
     _scored("unobstructed_error", lambda v: number(v, 2))),
    ("Inside the 95 % interval", "honest error bars give 95 %",
     _scored("coverage95", lambda v: percent(v, 3))),
    ("Extrapolated", "share of held-out pairs outside the training data",
     _scored("extrapolated", percent)),
    ("Held-out pairs", "whole packings that training never saw", _held_out),
)  # fmt: skip


def accuracy_section(
    results: Results, arrays: Mapping[str, Mapping[str, NDArray]]
) -> Section | None:
    """Parity plots, error by regime and the table of scores."""
    closures = many(results, "closures")
    if not closures:
        return None
    parity = {c["name"]: arrays.get(f"parity_{c['name']}") or {} for c in closures}
    parity = {name: a for name, a in parity.items() if {"truth", "predicted"} <= set(a)}
    blocks: list[Block] = []
    if parity:
        blocks.append(Figures(tuple(_parity(name, a) for name, a in parity.items())))
        blocks.append(Figures(_regimes(parity)))
    scores = [c.get("score") or {} for c in closures]
    rows = [
        [Cell(name, small=what), *(cell(score) for score in scores)] for name, what, cell in _SCORES
    ]
    columns = ("Score", *(c["name"] for c in closures))
    blocks.append(table(columns, rows, caption="Intervals: bootstrap over whole packings."))
    return Section(
        "accuracy",
        "How close the closures come",
        "All of this is measured on packings that no closure was trained on, so it tells what to "
        "expect in a bed of your own, as long as that bed lies inside the training data.",
        tuple(blocks),
    )


def _parity(name: str, a: Mapping[str, NDArray]) -> Figure:
    sigma, of = a.get("stderr"), "the closure's own error"
    noise = a.get("truth_stderr")
    if sigma is not None and noise is not None:
        sigma, of = (sigma**2 + noise**2) ** 0.5, f"{of} and the noise of the rays"
    dashes = f" By {of}, 95 % should lie between the dashed lines." if sigma is not None else ""
    return Figure(
        name,
        "A stronger colour means more pairs, on a logarithmic scale. Look for a narrow cloud on "
        f"the line from corner to corner.{dashes}",
        figures.parity_figure(a["truth"], a["predicted"], sigma, name=name),
    )


def _regimes(parity: Mapping[str, Mapping[str, NDArray]]) -> tuple[Figure, ...]:
    by_size = Figure(
        "Error by size of the view factor",
        "Solid: typical (median) relative error. Dotted: one pair in ten is worse. Errors should "
        "fall to the right, where most of the heat goes; on the left rays are few and the truth "
        "itself is uncertain.",
        figures.error_figure(parity),
    )
    if not all("solid_fraction" in a for a in parity.values()):
        return (by_size,)
    by_density = Figure(
        "Error by density of the bed",
        "Read as before. A curve that climbs at one end warns that the closure is weaker in "
        "beds of that density.",
        figures.error_figure(
            parity, "solid_fraction", xlabel="solid fraction [-]", log=False, bins=8
        ),
    )
    return by_size, by_density


def limits_section(results: Results) -> Section | None:
    """Every limiting case, in every form of the closure, with its verdict in words."""
    limits = many(results, "limits")
    if not limits:
        return None
    seen = {form for row in limits for form in row.get("errors") or {}}
    forms = [*FORMS, *sorted(seen - set(FORMS))]
    blocks: list[Block] = []
    for name in dict.fromkeys(row["closure"] for row in limits):
        mine = [row for row in limits if row["closure"] == name]
        rows = [
            [
                row["case"],
                *(_limit(row, form) for form in forms),
                number(row.get("bound"), 2),
                Cell("✓ holds", "good") if row.get("passed") else Cell("✗ fails", "bad"),
            ]
            for row in mine
        ]
        failed = sum(not row.get("passed") for row in mine)
        verdict = f"{failed} of {len(mine)} fail" if failed else f"all {len(mine)} hold"
        blocks.append(
            table(
                ("Law", *forms, "bound", "verdict"),
                rows,
                words=(0, len(forms) + 2),
                caption=f"{name}: {verdict}. Numbers are the largest deviation found.",
            )
        )
    return Section(
        "limits",
        "Limits that must hold exactly",
        "These laws are built into the closure, not learnt. So they must hold even for an "
        "untrained one with random weights, and still hold after saving, loading and export. "
        "Look for a row without any cross.",
        tuple(blocks),
    )


def _limit(row: Mapping[str, Any], form: str) -> Cell:
    error = (row.get("errors") or {}).get(form)
    if error is None:
        return Cell("not run", "muted")
    # A form may have a bound of its own: exported arithmetic rounds differently.
    bound = (row.get("bounds") or {}).get(form)
    if bound is None:
        holds = bool(row.get("passed")) or error <= row.get("bound", math.inf)
        return _judged(error, holds)
    holds = error <= bound
    small = "" if bound == row.get("bound") else f"bound {number(bound, 2)}"
    return _judged(error, holds, small)


def _judged(error: float, holds: bool, small: str = "") -> Cell:
    text = number(error, 2)
    return Cell(f"✓ {text}", "ok", small) if holds else Cell(f"✗ fails: {text}", "bad", small)


def exports_section(results: Results) -> Section | None:
    """Exported files and how closely they replay Python."""
    exports = many(results, "exports")
    if not exports:
        return None
    rows: list[list[Cell | str]] = []
    for e in exports:
        agrees = replays(e)
        note = f" ({e['note']})" if e.get("note") else ""
        verdict = {
            True: Cell("✓ agrees", "good"),
            False: Cell("✗ differs", "bad"),
            None: Cell("not replayed", "muted"),
        }[agrees]
        rows.append(
            [
                Cell(e.get("file", NOTHING), small=f"{e.get('closure', '')}{note}"),
                _TARGETS.get(e.get("target", ""), str(e.get("target", NOTHING))),
                number(e.get("rows") or None),
                number(e.get("max_relative_error"), 2),
                number(e.get("bound"), 2),
                duration(e.get("seconds")),
                verdict,
            ]
        )
    columns = ("File", "form", "rows", "largest relative difference", "bound", "time",
               "verdict")  # fmt: skip
    return Section(
        "exports",
        "Exports for your own code",
        "Each exported file was run on the same rows as the Python closure. The largest relative "
        "difference should be down at rounding, far below its bound.",
        (table(columns, rows, words=(0, 1, 6)),),
    )


def dataset_section(results: Results) -> Section | None:
    """What the closures were trained on."""
    d = results.get("dataset")
    if not d:
        return None
    packings = d.get("packings") or {}
    fractions = d.get("fractions") or ()
    rows = [
        ("File", str(d.get("file", NOTHING))),
        ("Pairs of spheres (rows)", number(d.get("rows"))),
        *(
            (f"Packings to {use}", number(packings.get(split)))
            for split, use in (("train", "train on"), ("calibrate", "set the error bars"),
                               ("test", "test on, never seen before"))
        ),
        ("Solid fractions", ", ".join(f"{f:g}" for f in fractions) or NOTHING),
        ("Sizes", ", ".join(map(str, d.get("sizes") or ())) or NOTHING),
        ("SHA-256 of the data, first digits", str(d.get("data_sha256", NOTHING))[:16]),
        ("Time to make it", duration(d.get("seconds"))),
    ]  # fmt: skip
    return Section(
        "data",
        "The data set",
        "Random packings, traced with rays. Packings are kept whole: one that is tested on has no "
        "pair in the training data.",
        (table(("", ""), rows, words=(0, 1)),),
    )


def timings_section(results: Results) -> Section | None:
    """Where the time went."""
    timings = [row for row in many(results, "timings") if "seconds" in row]
    if not timings:
        return None
    longest = max(float(row["seconds"]) for row in timings) or 1.0
    rows = tuple(
        (str(row["stage"]), float(row["seconds"]) / longest, duration(row["seconds"]))
        for row in timings
    )
    lead = "Stages already done by an earlier, interrupted run keep the time they took then."
    return Section("time", "Where the time went", lead, (Bars(rows),))


def files_section(results: Results) -> Section | None:
    """What each file is."""
    rows = [(row["path"], row["what"]) for row in many(results, "files")]
    if not rows:
        return None
    block = table(("File", "what it is"), rows, words=(0, 1))
    return Section("files", "Files", "All in the folder of this page.", (block,))


def next_section(results: Results) -> Section | None:
    """Commands to go on with."""
    rows = tuple((str(row["command"]), str(row["what"])) for row in many(results, "next"))
    if not rows:
        return None
    lead = "Copy a line into a terminal, in the folder where you ran the quickstart."
    return Section("next", "What to do next", lead, (Commands(rows),))


def notes_section(results: Results) -> Section | None:
    """What did not run, and why."""
    notes = results.get("notes") or ()
    if not notes:
        return None
    return Section("notes", "Notes", "", tuple(Text(str(note)) for note in notes))
