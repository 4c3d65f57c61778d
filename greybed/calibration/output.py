"""``calibration.json`` and ``posterior.csv``: the answer as plain values."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from greybed.calibration.answer import Answer
from greybed.calibration.isolines import WIDTH
from greybed.calibration.posterior import REGION
from greybed.calibration.study import Study
from greybed.core.files import atomic_path, write_json


def _clean(value: Any) -> Any:
    """JSON knows no NaN: it becomes null."""
    if isinstance(value, dict):
        return {str(k): _clean(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_clean(v) for v in value]
    if isinstance(value, np.ndarray):
        return _clean(value.tolist())
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    return value.item() if isinstance(value, np.generic) else value


def content_of(study: Study, found: Answer) -> dict[str, Any]:
    """The answer as plain values, with units in the study's terms (parameters in SI)."""
    names, space = study.space.names, study.space
    ends = found.posterior.interval()
    low, high = (space.values(ends[:, k][None])[0] for k in range(2))
    means = space.values(found.posterior.points).mean(axis=0)
    sds = space.values(found.posterior.points).std(axis=0)
    per = {v.name: v for v in found.verdicts}
    plain: dict[str, Any] = _clean(
        {
            "sentence": found.sentence,
            "fits": found.fits,
            "best": found.best,
            "chi2": found.chi2,
            "freedom": found.freedom,
            "p_value": found.p_value,
            "diagnose": None if found.fits else "greybed diagnose STUDY.toml --out DIR",
            "parameters": {
                name: {
                    "mean": means[k],
                    "sd": sds[k],
                    "interval": [low[k], high[k]],
                    "share": REGION,
                    "verdict": per[name].word,
                    "sentence": per[name].sentence,
                    "sd_over_prior": per[name].shrink,
                }
                for k, name in enumerate(names)
            },
            "directions": {
                "determined": sum(d.determined for d in found.directions),
                "effective_number": sum(
                    d.information / (1.0 + d.information) for d in found.directions
                ),
                "all": [
                    {
                        "words": d.words,
                        "determined": d.determined,
                        "information": d.information,
                        "variance_left": d.left,
                        "weights": dict(zip(names, d.weights, strict=True)),
                    }
                    for d in found.directions
                ],
            },
            "posterior": {
                "samples": len(found.posterior.points),
                "effective": found.posterior.effective,
                "r_hat": dict(zip(names, found.posterior.r_hat, strict=True)),
                "parts_of_region": found.posterior.modes(),
            },
            "error_budget": {
                b.label: {
                    "measurement": b.measurement,
                    "replicates": b.replicates,
                    "surrogate": b.surrogate,
                    "sd": b.total,
                }
                for b in found.budget
            },
            "limits": found.limits,
            "surrogates": {
                q.label: {
                    "cop": q.cop,
                    "cop_sd": q.cop_sd,
                    "ceiling": q.ceiling,
                    "replicate_sd": q.noise,
                    "points": q.runs,
                }
                for q in found.quality
            },
            "sensitivities": {
                label: {
                    "pearson": dict(zip(names, found.pearson[label], strict=True)),
                    "sobol_first": dict(zip(names, found.sobol_first[label], strict=True)),
                    "sobol_total": dict(zip(names, found.sobol_total[label], strict=True)),
                }
                for label in found.pearson
            },
            "anova": {
                label: [vars(row) for row in table]
                for label, table in found.extra.get("anova", {}).items()
            },
            "overlap": {
                "half_width_in_sd": WIDTH,
                "alone": found.overlap.alone,
                "without": found.overlap.without,
                "together": found.overlap.together,
            },
            "checks": [vars(c) for c in found.checks],
            "next_tests": [
                {**vars(t), "left": dict(zip(names, t.left, strict=True))} for t in found.next_tests
            ],
            "transfer": [vars(t) for t in found.transfers],
            "cheapest_as_good": None
            if found.cheapest is None
            else {"parameters": found.cheapest[0], "share_of_work": found.cheapest[1]},
            "notes": found.notes,
            "runs": {
                "jobs": found.runs,
                "made_now": found.made,
                "from_store": found.found,
                "failed": found.failed,
                "seconds": found.seconds,
                "seconds_in_runs_made_now": found.run_seconds,
            },
        }
    )
    return plain


def write_answer(folder: Path, study: Study, found: Answer) -> None:
    """Write ``calibration.json`` and ``posterior.csv`` (parameters in SI)."""
    write_json(folder / "calibration.json", content_of(study, found))
    values = study.space.values(found.posterior.points)
    with atomic_path(folder / "posterior.csv") as temporary, open(temporary, "w") as stream:
        stream.write(",".join([*study.space.names, "log_density"]) + "\n")
        table = np.column_stack([values, found.posterior.density])
        np.savetxt(stream, table, delimiter=",", fmt="%.9g")
