"""The page of a closure of filtered drag: what the data say, scores beside guesses, card."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed.closures.drag.filtered import FilteredDragClosure
from greybed.closures.viewfactor.limits import LimitCase
from greybed.report import drag_figures
from greybed.report.elements import (
    Block,
    Cell,
    Figure,
    Figures,
    Page,
    Section,
    Text,
    Verdict,
    count,
    fixed,
    number,
    percent,
    table,
)
from greybed.report.laws import laws_section
from greybed.training.drag_rows import DragRows

Array = NDArray[np.float64]

WORDS = {
    "none": "no correction",
    "radl-sundaresan": "Radl & Sundaresan (2014)",
    "igci": "Igci et al. (2012)",
    "milioli": "Milioli et al. (2013)",
    "gas balance": "gas balance: −ε(∇p − ρg)",
    "two constants": "two constants: aF₀ + bP",
}


def render_drag_model(
    closure: FilteredDragClosure,
    rows: DragRows,
    forces: Mapping[str, Array],
    cases: Sequence[LimitCase],
    path: str | os.PathLike[str],
    *,
    name: str,
) -> Path:
    """Write the page of a closure of filtered drag.

    Parameters
    ----------
    closure : FilteredDragClosure
        Trained, with its card; ``card["learning_curve"]`` is drawn where it is there.
    rows : DragRows
        What it was scored on.
    forces : mapping of (n, 3) arrays
        What guesses and the held-out fits say of these rows, as ``train_drag`` gives them.
    cases : sequence of LimitCase
        Its limiting cases.
    path : path
        HTML file to write.
    name : str
        Of the closure.
    """
    card = closure.card
    score, plain = card["score"], {row["name"]: row for row in card["guesses"]}
    failed = [case for case in cases if not case.passed]
    gap = card["random_rows"]["kept_r2"] - score["kept_r2"] if "random_rows" in card else None
    page = Page(
        f"{name}: filtered drag, the fraction kept",
        "How much of the drag law gas and particles keep on a grid that does not see their "
        "clusters. H is the fraction kept everywhere on this page: 1 means no correction. All "
        "scores are of fits that have not seen the case of a row.",
        (
            Verdict(
                f"R² {fixed(score['drift_r2'], 3)}",
                f"of the drift flux along gravity, {count(score['cases'], 'case')} held out in "
                f"turn; two constants reach {fixed(plain['two constants']['drift_r2'], 3)}",
            ),
            Verdict(
                f"R² {fixed(score['kept_r2'], 3)}",
                f"of H; no correction is off by {number(plain['none']['kept_rms'])} rms, this by "
                f"{number(score['kept_rms'])}",
            ),
            Verdict(
                f"{percent(card['coverage95'], 3)} covered",
                "H of held-out rows inside the stated intervals of 95 %",
            ),
            Verdict(
                f"✗ {len(failed)} limits fail" if failed else "✓ All limits hold",
                f"{len(cases)} cases, up to a million random places each",
                "bad" if failed else "good",
            ),
        ),
        (
            _data(rows),
            _accuracy(card, rows, forces, gap),
            *_learning(card.get("learning_curve") or ()),
            laws_section(
                cases,
                "Largest deviation, or share of places that violate it. Nothing is clipped.",
            ),
            _card(card, closure),
        ),
        f"greybed {card.get('greybed', '')} · seed {card.get('seed', '')} · data "
        f"{str(card.get('data_sha256', ''))[:16]}",
    )
    return page.write(path)


def median_table(rows: DragRows) -> tuple[list[float], list[float], Array]:
    """Median H by solid fraction and filter size: edges of both, and medians (NaN for few rows)."""
    phi, size = rows.markers["solid_fraction"], rows.markers["filter_size"]
    edges = [0.0, 0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.55, 1.0]
    filters = np.unique(np.round(np.quantile(size, np.linspace(0.0, 1.0, 6)), 2)).tolist()
    filters[-1] += 0.01
    clean, kept = rows.clean, rows.kept
    found = np.full((len(edges) - 1, len(filters) - 1), np.nan)
    for i in range(len(edges) - 1):
        for k in range(len(filters) - 1):
            own = clean & (phi >= edges[i]) & (phi < edges[i + 1])
            own &= (size >= filters[k]) & (size < filters[k + 1])
            if own.sum() >= 20:
                found[i, k] = np.median(kept[own])
    return edges, filters, found


def _data(rows: DragRows) -> Section:
    edges, filters, medians = median_table(rows)
    body = [
        [
            f"{edges[i]:g} to {edges[i + 1]:g}",
            *(number(None if np.isnan(m) else float(m), 2) for m in medians[i]),
        ]
        for i in range(len(edges) - 1)
    ]
    heads = tuple(f"Δ* {a:.2g} to {b:.2g}" for a, b in pairwise(filters))
    share = float(rows.clean.mean())
    return Section(
        "data",
        "What the data say",
        "Median fraction kept along gravity. The closure is exactly 1 for no particles, packed "
        "particles and filters of size 0; here is how near the data come to these limits.",
        (
            table(
                ("solid fraction", *heads), body,
                caption="Filter sizes over L_c = d Fr^(1/3). Fewer than 20 rows: a dash.",
            ),
            Text(
                f"{percent(share, 3)} of all rows have a slip along gravity of at least 0.1 u_t "
                "and an H between 0 and 3; medians and scores of H are of these.",
            ),
        ),
    )  # fmt: skip


def _accuracy(
    card: Mapping[str, Any], rows: DragRows, forces: Mapping[str, Array], gap: float | None
) -> Section:
    listed = [*card["guesses"], {**card["score"], "name": "closure"}]
    if "random_rows" in card:
        listed.append({**card["random_rows"], "name": "random rows"})
    names = {**WORDS, "closure": "this closure", "random rows": "this closure, random rows"}
    scores = [
        [
            names.get(row["name"], row["name"]), fixed(row["drift_r2"], 3),
            fixed(row["drift_r2_vector"], 3), fixed(row["force_r2"], 3), fixed(row["kept_r2"], 3),
            number(row["kept_rms"]), number(row["kept_bias"], 2),
        ]
        for row in listed
    ]  # fmt: skip
    cases = [
        [row["case"], number(row["rows"]), fixed(row["drift_r2"], 3), fixed(row["kept_r2"], 3),
         number(row["kept_rms"]), number(row["kept_bias"], 2)]
        for row in card["by_case"]
    ]  # fmt: skip
    drawn = [n for n in ("none", "gas balance", "two constants", "closure") if n in forces]
    blocks: list[Block] = [
        Figures(
            (
                Figure(
                    "Drift flux, against the data",
                    "Medians of what each says, and the middle half for this closure, by the true "
                    "drift flux along gravity. A perfect one lies on the line.",
                    drag_figures.drift_parity(
                        rows, {names[n]: forces[n] for n in drawn}, names["closure"]
                    ),
                ),
                Figure(
                    "H by solid fraction",
                    "Medians of the data and of each model, filters of middle size.",
                    drag_figures.kept_by_fraction(
                        rows,
                        {
                            names[n]: forces[n]
                            for n in ("radl-sundaresan", "igci", "closure")
                            if n in forces
                        },
                    ),
                ),
            )
        ),
        table(
            ("", "R², drift flux", "R², all axes", "R², force", "R², H", "rms of H", "bias of H"),
            scores,
            caption="Rows of cases that were held out. A high R² of the force alone says little: "
            "the gas balance has it without any model.",
        ),
        table(("case held out", "rows", "R², drift flux", "R², H", "rms of H", "bias"), cases),
    ]
    if gap is not None:
        blocks.append(
            Text(
                f"R² of H on random rows is {fixed(gap, 3)} above that on held-out cases: what "
                "splitting by rows would have flattered.",
            )
        )
    return Section(
        "accuracy",
        "How close it comes",
        "Beside published models and three trivial guesses; the two constants were fitted to the "
        "same cases as the closure.",
        tuple(blocks),
    )


def _learning(points: Sequence[Mapping[str, Any]]) -> tuple[Section, ...]:
    if len(points) < 2:
        return ()
    body = [
        [number(p["cases"]), fixed(p["drift_r2"], 3), fixed(p["kept_r2"], 3), number(p["kept_rms"])]
        for p in points
    ]
    figure = Figure(
        "Error of H against cases",
        "A curve that still falls at its right end says: more cases would help.",
        drag_figures.curve([p["cases"] for p in points], [p["kept_rms"] for p in points]),
    )
    return (
        Section(
            "learning",
            "What more data bring",
            "The same fit to part of the cases, scored on the same held-out ones.",
            (Figures((figure,)), table(("cases", "R², drift flux", "R², H", "rms of H"), body)),
        ),
    )


def _card(card: Mapping[str, Any], closure: FilteredDragClosure) -> Section:
    materials = "; ".join(
        sorted(
            {
                f"{1e6 * m['diameter_m']:.4g} µm, {m['particle_density_kg_m3']:.4g} kg/m³ in gas "
                f"of {m['gas_density_kg_m3']:.3g} kg/m³"
                for m in card.get("materials", ())
            }
        )
    )
    facts: list[list[Cell | str]] = [
        ["convention", str(card.get("convention", ""))],
        ["form", f"{closure.kind}, markers {closure.markers.name}, {card.get('numbers')} numbers"],
        ["data set (SHA-256)", str(card.get("data_sha256", ""))],
        ["cases", f"{card.get('cases')}: {', '.join(card.get('sources', ()))}, dimensions "
         f"{', '.join(map(str, card.get('dimensions', ())))}"],
        ["drag law of the fine grid", str(card.get("law", ""))],
        ["materials", materials],
        ["rows", number(card.get("rows"))],
        *(
            [name, f"{number(float(low))} to {number(float(high))}"]
            for name, (low, high) in card.get("ranges", {}).items()
        ),
    ]  # fmt: skip
    known: list[list[Cell | str]] = [
        ["markers outside the ranges above", "flagged as extrapolation, never clipped"],
        ["parcels", "no data: exp(-0.05 (α - 1)) of Radl & Sundaresan, gated"],
        ["walls", "no data: filters near walls see another flow"],
        ["stress of clusters", "not in here: drag only"],
        ["a coarse run", "a score on rows is no score of a run: compare runs too"],
    ]
    return Section(
        "card",
        "Model card",
        "Where it comes from, where it holds, where it does not.",
        (
            table(("what", "value"), facts, words=(0, 1)),
            table(("not covered", "what happens"), known, words=(0, 1)),
        ),
    )
