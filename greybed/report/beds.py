"""Section of the heated beds: pictures, profiles and heat flows, rays beside the closure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed.core import Packing
from greybed.report import figures
from greybed.report.elements import (
    NOTHING,
    Block,
    Cell,
    ColourBar,
    Figure,
    Figures,
    Section,
    Text,
    duration,
    fixed,
    listed,
    number,
    percent,
    table,
)
from greybed.report.picture import DIFFERENCE, HEAT, look_at, value_limits
from greybed.report.sections import Results, many

ZERO_CELSIUS = 273.15  # [K]


def beds_section(results: Results, arrays: Mapping[str, Mapping[str, NDArray]]) -> Section | None:
    """Pictures, profiles and numbers of every heated bed, traced beside closure."""
    cases = many(results, "cases")
    if not cases:
        return None
    beds = {bed["name"]: bed for bed in many(results, "beds")}
    blocks: list[Block] = []
    for case in cases:
        lead = f"{case['bed'].capitalize()} bed."
        blocks.append(Text(_bed_words(case, beds.get(case["bed"], {})), lead))
        a = arrays.get(f"bed_{case['bed']}")
        if a is not None and {"centres", "radii", "traced", "closure"} <= set(a):
            # A page of many beds must stay small enough to mail.
            width = 640 if len(cases) <= 2 else 420
            blocks += _bed_figures(a, width=width // 3 if results.get("small") else width)
        blocks.append(_bed_table(case))
    return Section(
        "beds",
        "The beds, heated",
        "Each bed stands between walls of fixed temperature until nothing changes any more. It was "
        "solved twice, with traced view factors and with those of the closure. If the closure is "
        "good, you cannot tell the two pictures apart.",
        tuple(blocks),
    )


def _bed_words(case: Mapping[str, Any], bed: Mapping[str, Any]) -> str:
    walls = listed([
        f"{name} {fixed(kelvin - ZERO_CELSIUS, 0)} °C"
        for name, kelvin in (case.get("wall_temperatures") or {}).items()
    ])  # fmt: skip
    radii = listed([f"{r:g}" for r in bed.get("radii_mm") or ()])
    words = [
        f"{number(case.get('spheres'))} spheres",
        f"radius {radii} mm" if radii else "",
        f"solid fraction {fixed(bed['solid_fraction'], 3)}" if bed.get("solid_fraction") else "",
        f"{fixed(bed['coordination'], 1)} contacts each" if bed.get("coordination") else "",
        f"emissivity {case['emissivity']:g}" if case.get("emissivity") is not None else "",
        f"walls: {walls}" if walls else "",
    ]
    return ", ".join(word for word in words if word) + "."


def _bed_figures(a: Mapping[str, NDArray], width: int) -> list[Block]:
    packing = Packing(a["centres"], a["radii"])
    celsius = {source: np.asarray(a[source]) - ZERO_CELSIUS for source in ("traced", "closure")}
    away = np.asarray(a["closure"]) - np.asarray(a["traced"])
    limits = value_limits(*celsius.values())
    reach = float(np.abs(away[np.isfinite(away)]).max(initial=0.0)) or 1.0
    height = 1e3 * (packing.centres[:, 2] - packing.bounds[0][2])

    sight = look_at(packing, width=width)

    def picture(values: NDArray, **options: Any) -> str:
        return figures.png_uri(sight.paint(values, **options))

    pair = tuple(
        Figure(title, uri=picture(celsius[source], limits=limits))
        for source, title in (
            ("traced", "With traced view factors"),
            ("closure", "With the closure"),
        )
    )
    ticks = tuple(fixed(t, 0) for t in np.linspace(*limits, 5))
    bar = ColourBar(figures.gradient(HEAT), ticks, "temperature [°C], same scale on both")
    gap = picture(away, limits=(-reach, reach), colours=DIFFERENCE)
    what = "Closure minus traced"
    compared = (
        Figure(
            "Where they differ",
            f"Closure minus traced, from −{number(reach)} K (blue) to +{number(reach)} K (red). "
            "Look for patches: scattered colour is noise, a patch is a bias.",
            uri=gap,
        ),
        Figure(
            "Temperature along the height",
            "The dashed line should cover the broad one. The band shows how much spheres of one "
            "layer differ among themselves.",
            figures.profile_figure(
                height,
                [
                    figures.Profile("traced", celsius["traced"]),
                    figures.Profile("closure", celsius["closure"]),
                ],
                xlabel="temperature [°C]",
            ),
        ),
        Figure(
            "Difference along the height",
            "One dot per sphere. The cloud should be narrow and stand on zero; a lean to one side "
            "means that the closure lets through too much or too little heat.",
            figures.difference_figure(height, away, xlabel=f"{what} [K]"),
        ),
    )
    return [Figures(pair, bar), Figures(compared)]


def _bed_table(case: Mapping[str, Any]) -> Block:
    sides = [case.get(source) or {} for source in ("traced", "closure")]
    d = case.get("difference") or {}

    def row(name: str, *texts: str, small: str = "") -> list[Cell | str]:
        return [Cell(name, small=small), *texts]

    rows = [
        row(
            f"{word} temperature [°C]",
            *(fixed(s[key] - ZERO_CELSIUS, 1) if key in s else NOTHING for s in sides),
            f"{fixed(sides[1][key] - sides[0][key], 2)} K"
            if all(key in s for s in sides)
            else NOTHING,
        )
        for key, word in (("mean_K", "Mean"), ("min_K", "Lowest"), ("max_K", "Highest"))
    ]
    flux = d.get("flux_relative") or {}
    walls = list(dict.fromkeys(w for s in sides for w in s.get("wall_heat_W") or {}))
    for wall in walls:
        parts = [(s.get("wall_heat_W") or {}).get(wall) or {} for s in sides]
        totals = [number(sum(p.values())) if p else NOTHING for p in parts]
        small = "; ".join(
            f"{how} {' / '.join(number(p.get(how)) for p in parts)}"
            for how in ("conduction", "radiation")
            if any(how in p for p in parts)
        )
        rows.append(row(f"Heat from {wall} [W]", *totals, percent(flux.get(wall)), small=small))
    rows += [
        row("Energy not accounted for", *(number(s.get("energy_error"), 2) for s in sides), ""),
        row("Pairs outside the training data", "", percent(sides[1].get("extrapolated")), ""),
        row("Time for factors and solve", *(duration(s.get("seconds")) for s in sides), ""),
    ]
    rays = f"; traced with {number(sides[0]['rays'])} rays per sphere" if "rays" in sides[0] else ""
    off = (
        f": rms {number(d.get('rms_K'))} K, largest {number(d['max_K'])} K of a span of "
        f"{number(d.get('span_K'))} K{rays}"
        if "max_K" in d
        else ""
    )
    return table(
        ("", "traced", "closure", "difference"),
        rows,
        caption=f"{case['bed'].capitalize()} bed in numbers{off}.",
    )
