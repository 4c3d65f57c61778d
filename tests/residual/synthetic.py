"""Studies made up for tests: spheres in a liquid with effects, noise and faults of choice."""

from __future__ import annotations

import numpy as np

from greybed.residual import Noise, Options, Parameter, Study, Table
from greybed.residual.model import ModelSpec
from greybed.residual.models import build

UNITS = {"velocity": "m/s", "diameter": "m", "tube_diameter": "m", "temperature": "K"}


def spheres(
    seed: int,
    n: int = 60,
    effects: dict[str, float] | None = None,
    *,
    noise: float = 0.02,
    free: bool = False,
    only_diameter: bool = False,
    factor=None,
    group: int = 0,
    group_noise: float = 0.0,
    stated: float | None = None,
    columns: dict | None = None,
    labels: dict | None = None,
    viscosity: float = 0.2,
) -> Study:
    """A study of terminal velocities; ``factor(columns)`` multiplies the velocity besides."""
    rng = np.random.default_rng(seed)
    runs = np.arange(n) if not group else np.arange(n) // group
    count = runs.max() + 1

    def drawn(low, high):
        return np.exp(rng.uniform(np.log(low), np.log(high), count))[runs]

    table = {
        "diameter": drawn(1e-3, 8e-3),
        "particle_density": np.full(n, 1400.0) if only_diameter else drawn(1250.0, 2200.0),
        "fluid_density": np.full(n, 1150.0),
        "tube_diameter": np.full(n, 0.08) if only_diameter else drawn(0.05, 0.2),
    }
    if not only_diameter:
        table["sphericity"] = rng.uniform(0.6, 1.0, count)[runs]
        table["temperature"] = drawn(283.0, 313.0)
    table.update(columns(rng, n) if callable(columns) else columns or {})
    spec = ModelSpec(name="terminal-velocity")
    rows = np.arange(n) + 2
    shell = {**table, "velocity": np.ones(n)}
    model = build(spec, Table(columns=shell, units=UNITS, rows=rows), {"viscosity": viscosity})
    velocity = model.predict(table, {"viscosity": viscosity}, effects or {})
    if factor is not None:
        velocity = velocity * factor(table)
    velocity = velocity * np.exp(noise * rng.standard_normal(n))
    if group_noise:
        velocity = velocity * np.exp(group_noise * rng.standard_normal(count)[runs])
    words = labels(rng, n) if callable(labels) else labels or {}
    words = {**words, **({"run": tuple(f"R{k}" for k in runs)} if group else {})}
    return Study(
        table=Table(columns={**table, "velocity": velocity}, units=UNITS, labels=words, rows=rows),
        response="velocity",
        group=("run",) if group else (),
        noise=Noise(relative=stated),
        model=spec,
        parameters={"viscosity": Parameter(value=0.2, sd=0.0 if free else 0.002, free=free)},
        options=Options(holdout="group" if group else "none"),
    )
