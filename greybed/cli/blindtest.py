"""Test the residual analysis on sealed data sets, and print its score card.

Writes scorecard.json, scorecard.md, sets.csv and summary.json, besides the sets and the answers.

examples:
  greybed blindtest --sets 6 --seed 1 --kinds none,one --out runs/blind
  greybed blindtest --sets 200 --seed 1 --out runs/blind200 --competitors
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from greybed.core.errors import InputError

KINDS = ("none", "one", "two", "outside", "hidden", "faulty")
ALPHA = 0.01
TRUTH = (
    *("kind", "world", "n", "rho", "ratio", "collinear"),
    *("free", "grouped", "declared", "uneven", "outliers", "alike", "weakest"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of ``greybed blindtest``."""
    parser.add_argument("--sets", type=int, default=200, help="how many data sets (default: 200)")
    parser.add_argument("--seed", type=int, default=1, help="of the generator (default: 1)")
    parser.add_argument("--out", type=Path, required=True, help="folder for sets and results")
    parser.add_argument("--kinds", default=",".join(KINDS), help=f"some of {','.join(KINDS)}")
    parser.add_argument("--jobs", type=int, default=2, help="processes (default: 2)")
    parser.add_argument("--competitors", action="store_true", help="let others answer too")
    parser.add_argument("--quiet", action="store_true", help="no progress bar")


def run(options: argparse.Namespace) -> int:
    """Run the test; returns 0 if no bar that could be judged is missed, else 1."""
    from greybed.blind.run import blind_test
    from greybed.blind.score import compare, score
    from greybed.core.files import atomic_path, write_json, write_summary
    from greybed.core.folder_lock import locked_folder

    for name in ("sets", "jobs"):
        if getattr(options, name) < 1:
            raise InputError(f"--{name} = {getattr(options, name)} [-] must be at least 1.")
    if options.seed < 0:
        raise InputError(f"--seed = {options.seed} [-] must be at least 0.")
    kinds = tuple(options.kinds.split(","))
    for kind in kinds:
        if kind not in KINDS:
            raise InputError(f"--kinds: {kind!r} is not known; take some of {', '.join(KINDS)}.")
    with locked_folder(options.out) as folder:
        asked = {"sets": options.sets, "seed": options.seed, "kinds": kinds}
        _check_same(folder, asked)
        rows = blind_test(
            folder,
            options.sets,
            options.seed,
            kinds,
            jobs=options.jobs,
            competitors=options.competitors,
            show=not options.quiet,
        )
        refused = [row for row in rows if "refused" in row["found"]]
        rows = [row for row in rows if "refused" not in row["found"]]
        lines = score(rows, ALPHA)
        others = compare(rows)
        seconds = sorted(row["found"]["seconds"] for row in rows)
        card: dict[str, Any] = {
            **asked,
            "lines": [vars(line) for line in lines],
            "competitors": others,
            "seconds_median": seconds[len(seconds) // 2] if seconds else None,
            "seconds_longest": seconds[-1] if seconds else None,
            "refused": [{"set": row["set"], "why": row["found"]["refused"]} for row in refused],
        }
        write_json(folder / "scorecard.json", card)
        text = _markdown(card)
        with atomic_path(folder / "scorecard.md") as part:
            part.write_text(text)
        _write_sets(folder / "sets.csv", rows)
        met = {line.what: line.met for line in lines}
        write_summary(folder, "blindtest", {**asked, "met": met}, seed=options.seed)
    print(text)
    print(f"results in {folder}")
    return 1 if any(line.met is False for line in lines) else 0


def _check_same(folder: Path, asked: Mapping[str, Any]) -> None:
    """A folder holds one test: another one would mix its answers."""
    import json

    from greybed.core.files import write_json

    path = folder / "asked.json"
    plain = json.loads(json.dumps(asked))
    if path.exists() and json.loads(path.read_text()) != plain:
        raise InputError(f"{folder}: holds another blind test; give another folder with --out.")
    write_json(path, plain)


def _markdown(card: Mapping[str, Any]) -> str:
    out = [
        f"# Blind test: {card['sets']} sets, seed {card['seed']}",
        "",
        "| what | sets | value | 95 % | bar | met |",
        "|---|---|---|---|---|---|",
    ]
    for line in card["lines"]:
        low, high = line["ci95"]
        met = {True: "yes", False: "no", None: "-"}[line["met"]]
        out.append(
            f"| {line['what']} | {line['count']} | {100 * line['value']:.1f} % | "
            f"{100 * low:.1f} to {100 * high:.1f} % | {line['bar']} | {met} |"
        )
    if card["competitors"]:
        names = list(card["competitors"][0])
        out += ["", "| " + " | ".join(names) + " |", "|" + "---|" * len(names)]
        for row in card["competitors"]:
            cells = [row[names[0]], *(f"{100 * row[n]:.1f} %" for n in names[1:])]
            out.append("| " + " | ".join(cells) + " |")
    if card["seconds_median"] is not None:
        out += [
            "",
            f"Seconds for a set: median {card['seconds_median']:.1f}, longest "
            f"{card['seconds_longest']:.1f}.",
        ]
    if card["refused"]:
        out += ["", f"Refused: {len(card['refused'])} sets."]
    return "\n".join(out) + "\n"


def _write_sets(path: Path, rows: list[dict[str, Any]]) -> None:
    from greybed.core.files import atomic_path

    with atomic_path(path) as part, open(part, "w", newline="") as stream:
        writer = csv.writer(stream)
        keys = [k for k in TRUTH if rows and k in rows[0]["truth"]]
        writer.writerow(["set", *keys, "truth", "verdict", "found", "p_value", "seconds"])
        for row in rows:
            truth, found = row["truth"], row["found"]
            real = [*truth["effects"], truth["outside"].get("covariate", "")]
            named = [e["name"] for e in found["effects"]]
            named += [d["covariate"] for d in found["depends_on"]]
            rivals = [" + ".join(r) for r in found["rivals"]]
            writer.writerow(
                [
                    row["set"],
                    *(truth[k] for k in keys),
                    " + ".join(filter(None, real)),
                    found["verdict"],
                    " | ".join(rivals) or " + ".join(named),
                    found["p_value"],
                    round(found["seconds"], 2),
                ]
            )
