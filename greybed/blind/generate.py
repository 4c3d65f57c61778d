"""Makes one blind data set: conditions, truth, noise, faults, and the study that is handed over."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed.blind.worlds import WORLDS, World

Array = NDArray[np.float64]
Active = dict[str, tuple[str, float]]

KINDS = {"none": 50, "one": 80, "two": 30, "outside": 25, "hidden": 7, "faulty": 8}
SIZES = (15, 40, 150)
RATIOS = (0.5, 1.0, 2.0, 5.0)
OUTSIDE_POWERS = (-1.0, -0.5, 0.5, 1.0, 1.5, 2.0)
OUTSIDE_NAMES = ("humidity", "surface_charge", "surfactant", "running_time")
SMALLEST_NOISE, LARGEST_NOISE = 0.003, 0.3
ALIKE = 0.9  # cosine of two signatures from which a design is not called identifiable
PER_GROUP = 5


@dataclass
class BlindSet:
    """What is handed over (``study``, ``columns``, ``labels``) and what is sealed (``answer``)."""

    study: dict[str, Any]
    columns: dict[str, Array]
    labels: dict[str, list[str]] = field(default_factory=dict)
    answer: dict[str, Any] = field(default_factory=dict)


def plan(count: int, seed: int, kinds: tuple[str, ...] = tuple(KINDS)) -> list[dict[str, Any]]:
    """The strata of ``count`` sets, in an order that tells nothing.

    Kinds are dealt in the shares of ``KINDS``; sizes, ratios and designs are dealt evenly.
    """
    generator = np.random.default_rng([seed, 1])
    weights = np.array([KINDS[kind] for kind in kinds], dtype=float)
    shares = np.floor(count * weights / weights.sum()).astype(int)
    shares[int(np.argmax(weights))] += count - shares.sum()
    dealt = [kind for kind, share in zip(kinds, shares, strict=True) for _ in range(share)]
    strata = []
    for i, kind in enumerate(dealt):
        strata.append(
            {
                "kind": kind,
                "n": SIZES[i % 3],
                "rho": RATIOS[(i // 3) % 4],
                "collinear": bool((i // 2) % 2),
                "free": bool(generator.integers(2)),
                "grouped": bool(generator.integers(2)),
                "declared": bool(generator.integers(2)),
                "uneven": bool(generator.random() < 0.3),
                "outliers": bool(generator.random() < 0.5),
                "world": str(generator.choice(list(WORLDS))),
            }
        )
    order = generator.permutation(count)
    return [strata[i] for i in order]


def make(stratum: dict[str, Any], seed: int, index: int) -> BlindSet:
    """One data set of a stratum; the same for the same seed and index."""
    rng = np.random.default_rng([seed, 2, index])
    world = WORLDS[stratum["world"]]
    n = stratum["n"]
    groups = np.arange(n) if not stratum["grouped"] else np.arange(n) // PER_GROUP
    columns = _conditions(world, stratum, groups, rng)
    active = _effects(world, stratum, columns, rng)
    name, value, sd = world.parameter
    true_value = value * float(
        np.exp(rng.uniform(-0.2, 0.2) if stratum["free"] else sd * rng.standard_normal())
    )
    outside = _outside(stratum, columns, active, rng)
    truth = _respond(world, columns, true_value, active)
    base = _respond(world, columns, true_value, {})
    signature = np.log(truth) - np.log(base)
    slope = np.log(_respond(world, columns, true_value * 1.01, {})) - np.log(base)
    visible = _project(signature, slope if stratum["free"] else None)
    noise = 0.03 * float(np.exp(rng.uniform(-1.0, 1.0)))
    if stratum["kind"] not in ("none", "faulty"):
        noise = float(np.sqrt(np.mean(visible**2))) / stratum["rho"]
    noise = float(np.clip(noise, SMALLEST_NOISE, LARGEST_NOISE))
    group_share = 0.6 if stratum["grouped"] else 0.0
    random = noise * float(np.sqrt(1.0 - group_share**2))
    setting_sd, truth = _missettings(
        world, columns, true_value, active, groups, group_share * noise, rng
    )
    moved = {**columns, world.setting: columns[world.setting] * 1.001}
    steep = (np.log(_respond(world, moved, true_value, active)) - np.log(truth)) / 0.001
    covariance = np.diag(_spreads(stratum, random, columns, world) ** 2)
    covariance += setting_sd**2 * np.outer(steep, steep) * (groups[:, None] == groups[None, :])
    response, label, faulty, clean = _measure(stratum, truth, random, columns, world, rng)
    answer = {
        **stratum,
        "effects": {
            k: {"variant": v, "strength": s} for k, (v, s) in active.items() if k != "outside"
        },
        "theory": [k for k in active if k in world.theory],
        "literal": [
            k for k, (v, _) in active.items() if k != "outside" and v == world.effects[k][0][0]
        ],
        "outside": outside,
        "label": label,
        "ratio": float(np.sqrt(np.mean(visible**2))) / noise,
        "alike": _alike(world, columns, true_value, active, stratum["free"], slope),
        "noise": noise,
        "weakest": _weakest(
            world, columns, true_value, active, slope if stratum["free"] else None, covariance
        ),
        "oracle": float(
            np.sqrt(
                np.mean(
                    (
                        np.log(response)
                        - np.log(_respond(world, columns, true_value, active))
                        - faulty
                    )[clean]
                    ** 2
                )
            )
        ),
        "parameter": true_value / value,
    }
    study = _study(world, stratum, random, setting_sd, value, sd, name)
    handed = {k: v for k, v in columns.items() if k not in ("outside",)}
    if stratum["kind"] == "hidden":
        handed.pop(outside["covariate"])
    handed[world.response] = response
    order = rng.permutation(n)
    labels = {"operator": [str(rng.choice(["Ada", "Ben", "Cleo"])) for _ in range(n)]}
    if label is not None:
        labels = {label["label"]: label.pop("words")}
    if stratum["grouped"]:
        labels["setting"] = [f"G{g + 1}" for g in groups]
    return BlindSet(
        study,
        {k: v[order] for k, v in handed.items()},
        {k: [v[i] for i in order] for k, v in labels.items()},
        answer,
    )


def _conditions(
    world: World, stratum: dict[str, Any], groups: NDArray[np.int64], rng: np.random.Generator
) -> dict[str, Array]:
    n, count = len(groups), int(groups.max()) + 1
    columns = {}
    for name, (low, high) in world.ranges.items():
        if stratum["collinear"] and name != world.main:
            middle = float(np.exp(rng.uniform(np.log(low), np.log(high))))
            columns[name] = np.full(n, middle)
            continue
        # in a grouped table the settings are shared, but for one that is turned row by row
        own = name == world.main and name != world.setting and not stratum["collinear"]
        size = n if own else count
        strata = (rng.permutation(size) + rng.random(size)) / size
        drawn = np.exp(np.log(low) + strata * np.log(high / low))
        columns[name] = drawn if own else drawn[groups]
    for name, value in world.constants.items():
        columns[name] = np.full(n, value)
    return {k: np.array([float(f"{x:.5g}") for x in v]) for k, v in columns.items()}


def _effects(
    world: World, stratum: dict[str, Any], columns: dict[str, Array], rng: np.random.Generator
) -> Active:
    wanted = {"one": 1, "two": 2}.get(stratum["kind"], 0)
    if not wanted:
        return {}
    possible = []
    for name in world.effects:
        needs = world.needs.get(name)
        varies = needs is None or np.ptp(columns[needs]) > 0.0
        # with one condition varied, an effect must act through it or with it
        if varies or (stratum["collinear"] and _moves(world, columns, name)):
            possible.append(name)
    picked = rng.choice(possible, size=min(wanted, len(possible)), replace=False)
    active = {}
    for name in picked:
        variants, low, high = world.effects[str(name)]
        active[str(name)] = (str(rng.choice(variants)), float(rng.uniform(low, high)))
    if len(active) < wanted:
        stratum["kind"] = "one"
    return active


def _moves(world: World, columns: dict[str, Array], name: str) -> bool:
    """Whether an effect changes more than a constant factor in this design."""
    variants, low, high = world.effects[name]
    value = world.parameter[1]
    strength = 0.5 * (low + high)
    change = np.log(_respond(world, columns, value, {name: (variants[0], strength)}))
    change -= np.log(_respond(world, columns, value, {}))
    return float(np.std(change)) > 0.01


def _outside(
    stratum: dict[str, Any], columns: dict[str, Array], active: Active, rng: np.random.Generator
) -> dict[str, Any]:
    if stratum["kind"] not in ("outside", "hidden"):
        return {}
    n = stratum["n"]
    name = str(rng.choice(OUTSIDE_NAMES))
    span = float(rng.uniform(np.log(10.0), np.log(30.0)))
    z = np.exp(span * (rng.permutation(n) + rng.random(n)) / n)
    z = np.array([float(f"{x:.5g}") for x in z])
    power = float(rng.choice(OUTSIDE_POWERS))
    size = float(rng.uniform(0.2, 0.8))
    course = z**power
    columns[name] = z
    columns["outside"] = 1.0 + size * course / course.max()
    active["outside"] = ("power", 1.0)
    return {"covariate": name, "exponent": power, "size": size}


def _respond(world: World, columns: dict[str, Array], value: float, active: Active) -> Array:
    n = len(next(iter(columns.values())))
    return world.law({**columns, world.parameter[0]: np.full(n, value)}, active)


def _project(signature: Array, slope: Array | None) -> Array:
    """What recalibration of the parameter cannot absorb."""
    if slope is None:
        return signature
    return signature - slope * float(slope @ signature) / float(slope @ slope)


def _missettings(
    world: World,
    columns: dict[str, Array],
    value: float,
    active: Active,
    groups: NDArray[np.int64],
    wanted: float,
    rng: np.random.Generator,
) -> tuple[float, Array]:
    """Truth at what was really set, off by the same share within a group."""
    truth = _respond(world, columns, value, active)
    if wanted <= 0.0:
        return 0.0, truth
    moved = {**columns, world.setting: columns[world.setting] * 1.001}
    slope = (np.log(_respond(world, moved, value, active)) - np.log(truth)) / 0.001
    sd = wanted / max(float(np.sqrt(np.mean(slope**2))), 0.1)
    sd = min(sd, 0.08)
    off = sd * rng.standard_normal(int(groups.max()) + 1)[groups]
    really = {**columns, world.setting: columns[world.setting] * np.exp(off)}
    return sd, _respond(world, really, value, active)


def _measure(
    stratum: dict[str, Any],
    truth: Array,
    random: float,
    columns: dict[str, Array],
    world: World,
    rng: np.random.Generator,
) -> tuple[Array, dict[str, Any] | None, Array, NDArray[np.bool_]]:
    n = len(truth)
    sd = _spreads(stratum, random, columns, world)
    error = sd * rng.standard_normal(n)
    clean = np.ones(n, dtype=bool)
    if stratum["outliers"]:
        clean = rng.random(n) >= 0.02
        error[~clean] += (
            rng.choice([-1.0, 1.0], (~clean).sum())
            * rng.uniform(5.0, 10.0, (~clean).sum())
            * sd[~clean]
        )
    label = None
    shift = np.zeros(n)
    if stratum["kind"] == "faulty":
        kind, values = (("sensor", ["S1", "S2", "S3"]), ("operator", ["Ada", "Ben", "Cleo"]))[
            int(rng.integers(2))
        ]
        words = [values[i % 3] for i in rng.permutation(n)]
        bad = str(rng.choice(values))
        size = stratum["rho"] * random * float(rng.choice([-1.0, 1.0]))
        shift = np.array([size if word == bad else 0.0 for word in words])
        label = {"label": kind, "value": bad, "words": words}
    response = np.exp(np.log(truth) + error + shift)
    return response, label, shift, clean


def _spreads(
    stratum: dict[str, Any], random: float, columns: dict[str, Array], world: World
) -> Array:
    """Random error of each row: a factor 3 from end to end of the main condition, or even."""
    n = len(columns[world.main])
    if not stratum["uneven"]:
        return np.full(n, random)
    rank = np.argsort(np.argsort(columns[world.main])) / max(n - 1, 1)
    return np.asarray(random * 3.0 ** (rank - 0.5))


def _weakest(
    world: World,
    columns: dict[str, Array],
    value: float,
    active: Active,
    slope: Array | None,
    covariance: Array,
) -> float:
    """Standard errors by which the weakest true effect shows, all else about it known.

    What the other true effects and a free parameter could stand in for is taken out; no test
    can find an effect of less than some five of these without false alarms.
    """
    inverse = np.linalg.inv(covariance)
    full = np.log(_respond(world, columns, value, active))
    weakest = np.inf
    names = [name for name in active if name != "outside"]
    shares = {
        name: full
        - np.log(_respond(world, columns, value, {k: v for k, v in active.items() if k != name}))
        for name in names
    }
    for name in names:
        own = shares[name]
        others = [shares[k] for k in names if k != name] + ([] if slope is None else [slope])
        if others:
            x = np.column_stack(others)
            own = own - x @ np.linalg.solve(x.T @ inverse @ x, x.T @ inverse @ own)
        weakest = min(weakest, float(np.sqrt(max(own @ inverse @ own, 0.0))))
    return weakest if np.isfinite(weakest) else 0.0


def _alike(
    world: World,
    columns: dict[str, Array],
    value: float,
    active: Active,
    free: bool,
    slope: Array,
) -> float:
    """Largest cosine between the signature of a true effect and that of any rival."""
    base = np.log(_respond(world, columns, value, {}))

    def signature(name: str) -> Array:
        variants, low, high = world.effects[name]
        strength = 0.5 * (low + high)
        changed = np.log(_respond(world, columns, value, {name: (variants[0], strength)}))
        return _project(changed - base, slope if free else None)

    true = [name for name in active if name != "outside"]
    worst = 0.0
    for name in true:
        own = signature(name)
        for rival in world.effects:
            if rival == name:
                continue
            other = signature(rival)
            size = float(np.linalg.norm(own) * np.linalg.norm(other))
            if size > 1e-9 and float(np.linalg.norm(other)) > 1e-3:
                worst = max(worst, abs(float(own @ other)) / size)
    return worst


def _study(
    world: World,
    stratum: dict[str, Any],
    random: float,
    setting_sd: float,
    value: float,
    sd: float,
    name: str,
) -> dict[str, Any]:
    data: dict[str, Any] = {"file": "data.csv", "response": world.response}
    if stratum["grouped"]:
        data["group"] = ["setting"]
    noise: dict[str, Any] = {}
    if stratum["declared"]:
        noise["relative"] = round(random, 5)
        if setting_sd > 0.0:
            noise["systematic"] = {world.setting: round(setting_sd, 5)}
    parameter = (
        {"value": value, "free": True} if stratum["free"] else {"value": value, "sd": sd * value}
    )
    study: dict[str, Any] = {"data": data}
    if noise:
        study["noise"] = noise
    study["model"] = {"name": world.model}
    study["parameters"] = {name: parameter}
    study["options"] = {
        "alpha": 0.01,
        "seed": 1,
        "holdout": "group" if stratum["grouped"] else "none",
    }
    return study
