"""Scores the answers to a blind test against what was sealed."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from greybed.blind.generate import ALIKE

Row = Mapping[str, Any]  # {"truth": ..., "found": ..., "competitors": ...}

QUIET = ("none", "not-identifiable")
EXPONENT = 0.2
TENTH = 0.1
PLAIN = 5.0  # standard errors
FEWEST = 20  # sets from which a bar is judged


@dataclass(frozen=True)
class Line:
    """One line of the score card."""

    what: str
    count: int
    value: float
    ci95: tuple[float, float]
    bar: str
    met: bool | None


def wilson(hits: int, count: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a share."""
    if not count:
        return 0.0, 1.0
    z, p = 1.959964, hits / count
    middle = (p + z * z / (2 * count)) / (1 + z * z / count)
    half = z * math.sqrt(p * (1 - p) / count + z * z / (4 * count * count)) / (1 + z * z / count)
    return middle - half, middle + half


def _named(found: Row) -> list[str]:
    return [effect["name"] for effect in found["effects"]]


def _true(truth: Row) -> set[str]:
    return set(truth["effects"])


def false_alarm(row: Row) -> bool:
    """Whether something was found where nothing is."""
    return row["found"]["verdict"] not in QUIET


def confident_and_wrong(row: Row) -> bool:
    """Whether a definite answer is not true: an untrue effect, covariate or label."""
    truth, found = row["truth"], row["found"]
    verdict = found["verdict"]
    if verdict == "effect":
        if truth["kind"] == "hidden":
            return True
        return not set(_named(found)) <= _true(truth)
    if verdict == "unknown":
        named = [d["covariate"] for d in found["depends_on"]]
        return bool(named) and named[0] != truth["outside"].get("covariate")
    if verdict == "suspect-data":
        label = truth["label"] or {}
        return dict(found["suspect"]) != {k: label.get(k) for k in ("label", "value")}
    return False


def identifiable(row: Row) -> bool:
    """Whether the design can tell the true effect from every single rival, with enough of it."""
    t = row["truth"]
    return bool(t["alike"] < ALIKE and t["ratio"] >= 0.95 and t["n"] >= 40)


def twins(row: Row) -> bool:
    """Whether one condition varies, a parameter is free, and a rival looks the same."""
    t = row["truth"]
    return bool(
        t["collinear"]
        and t["free"]
        and _blurred(t)
        and t["ratio"] >= 0.95
        and t["n"] >= 40
        and t["kind"] == "one"
    )


def _blurred(truth: Row) -> bool:
    """Whether the rival's best fit differs from the truth by less than two standard errors, or by
    less than a tenth of the effect, which is what published laws hold to."""
    apart = math.sqrt(max(1.0 - truth["alike"] ** 2, 0.0))
    return bool(apart < TENTH or apart * truth["ratio"] * math.sqrt(truth["n"]) < 2.0)


def _share(
    rows: Sequence[Row], test: Callable[[Row], bool]
) -> tuple[int, float, tuple[float, float]]:
    hits = sum(test(row) for row in rows)
    return len(rows), hits / len(rows) if rows else float("nan"), wilson(hits, len(rows))


def _recovered(row: Row) -> float:
    error, oracle = row["found"]["error"], row["truth"]["oracle"]
    base = error["base"]["value"] ** 2
    return float((base - error["with_effect"]["value"] ** 2) / (base - oracle**2))


def _covered(row: Row) -> list[bool]:
    hits = []
    for effect in row["found"]["effects"]:
        name = effect["name"]
        truth = row["truth"]["effects"].get(name)
        sealed = row["truth"]
        if truth is None or name not in sealed["literal"] or name not in sealed["theory"]:
            continue
        low, high = sorted(end / effect["theory"] for end in effect["ci95"])
        hits.append(low <= truth["strength"] <= high)
    return hits


def score(rows: Sequence[Row], alpha: float) -> list[Line]:
    """The score card.

    Parameters
    ----------
    rows : list of mapping
        ``truth`` as sealed and ``found`` as ``diagnosis.json`` has it.
    alpha : float
        Level of false alarms that the studies asked for.

    Returns
    -------
    lines : list of Line
        ``met`` is None for fewer than ``FEWEST`` sets.
    """
    lines = []

    def add(
        what: str, chosen: Sequence[Row], test: Callable[[Row], bool], bar: float, above: bool
    ) -> None:
        count, value, ends = _share(chosen, test)
        said = f"{'>=' if above else '<='} {100 * bar:.3g} %"
        met = None if count < FEWEST else (value >= bar if above else value <= bar)
        lines.append(Line(what, count, value, ends, said, met))

    def kind(*names: str) -> list[Row]:
        return [row for row in rows if row["truth"]["kind"] in names]

    clean = kind("none")
    spread = math.sqrt(alpha * (1 - alpha) / max(len(clean), 1))
    add("false alarms on clean sets", clean, false_alarm, alpha + 2 * spread, False)
    real = [r for r in kind("one", "two") if identifiable(r)]
    add(
        "first effect named is true",
        real,
        lambda r: bool(_named(r["found"])) and _named(r["found"])[0] in _true(r["truth"]),
        0.95,
        True,
    )
    strong = [r for r in real if r["truth"]["weakest"] >= PLAIN]
    add(
        f"  of these, every effect {PLAIN:g} standard errors strong",
        strong,
        lambda r: bool(_named(r["found"])) and _named(r["found"])[0] in _true(r["truth"]),
        0.95,
        True,
    )
    add(
        "exact set",
        real,
        lambda r: (
            set(_named(r["found"])) == _true(r["truth"]) and r["found"]["verdict"] == "effect"
        ),
        0.90,
        True,
    )
    add(
        f"  of these, every effect {PLAIN:g} standard errors strong ",
        strong,
        lambda r: (
            set(_named(r["found"])) == _true(r["truth"]) and r["found"]["verdict"] == "effect"
        ),
        0.90,
        True,
    )
    add("confident and wrong, over everything", rows, confident_and_wrong, 0.02, False)
    add(
        "collinear with a free parameter: ambiguous, truth among the rivals",
        [r for r in rows if twins(r)],
        lambda r: (
            r["found"]["verdict"] == "ambiguous"
            and any(_true(r["truth"]) <= set(rival) for rival in r["found"]["rivals"])
        ),
        0.90,
        True,
    )
    loud = [r for r in kind("outside") if r["truth"]["ratio"] >= 1.9 and r["truth"]["n"] >= 40]
    add(
        "outside the catalogue: unknown, right covariate",
        loud,
        lambda r: (
            r["found"]["verdict"] == "unknown"
            and bool(r["found"]["depends_on"])
            and r["found"]["depends_on"][0]["covariate"] == r["truth"]["outside"]["covariate"]
        ),
        0.90,
        True,
    )
    right = [
        r
        for r in loud
        if r["found"]["depends_on"]
        and r["found"]["depends_on"][0]["covariate"] == r["truth"]["outside"]["covariate"]
    ]
    add(
        f"  of these, exponent within {EXPONENT}",
        right,
        lambda r: (
            abs(abs(r["found"]["depends_on"][0]["exponent"] - r["truth"]["outside"]["exponent"]))
            <= EXPONENT
        ),
        0.90,
        True,
    )
    faulty = [r for r in kind("faulty") if r["truth"]["rho"] >= 2 and r["truth"]["n"] >= 40]
    add(
        "faulty sensor or operator: suspect-data, right label",
        faulty,
        lambda r: r["found"]["verdict"] == "suspect-data" and not confident_and_wrong(r),
        0.90,
        True,
    )
    fractions = [_recovered(r) for r in real]
    median = float(np.median(fractions)) if fractions else float("nan")
    ends = tuple(np.quantile(fractions, [0.25, 0.75])) if fractions else (0.0, 1.0)
    lines.append(
        Line(
            "recovered fraction of the error, median (quartiles)",
            len(fractions),
            median,
            (float(ends[0]), float(ends[1])),
            ">= 95 %",
            median >= 0.95 if len(fractions) >= FEWEST else None,
        )
    )
    hits = [hit for r in rows if r["found"]["verdict"] == "effect" for hit in _covered(r)]
    covered = sum(hits) / len(hits) if hits else float("nan")
    lines.append(
        Line(
            "95 % intervals of amplitudes that hold the truth",
            len(hits),
            covered,
            wilson(sum(hits), len(hits)),
            "92 to 98 %",
            0.92 <= covered <= 0.98 if len(hits) >= FEWEST else None,
        )
    )
    return lines


def compare(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """The same questions to the competitors, as shares; they cannot abstain."""
    if not rows or not rows[0].get("competitors"):
        return []
    names = list(rows[0]["competitors"])
    clean = [r for r in rows if r["truth"]["kind"] == "none"]
    real = [r for r in rows if r["truth"]["kind"] in ("one", "two") and identifiable(r)]
    table = []
    for name in ["greybed", *names]:

        def answer(row: Row, name: str = name) -> list[str]:
            return _named(row["found"]) if name == "greybed" else row["competitors"][name]

        def wrong(row: Row, name: str = name) -> bool:
            if name == "greybed":
                return confident_and_wrong(row)
            named = set(row["competitors"][name])
            return bool(named) and not named <= _true(row["truth"])

        table.append(
            {
                "who": name,
                "false alarms": _share(
                    clean, false_alarm if name == "greybed" else lambda r: bool(answer(r))
                )[1],
                "first effect true": _share(
                    real, lambda r: bool(answer(r)) and answer(r)[0] in _true(r["truth"])
                )[1],
                "exact set": _share(real, lambda r: set(answer(r)) == _true(r["truth"]))[1],
                "confident and wrong": _share(rows, wrong)[1],
            }
        )
    return table
