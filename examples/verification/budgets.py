"""Budgets of two runs, and what does not add up: python examples/verification/budgets.py [FIGURE].

Momentum of the gas in Khawaja's bed, along the flow, summed over the gas steps of the start: what
convection, pressure, drag and changing void fractions do to it. Heat of the settled bed that
cools (examples/flows/cooling_bed.toml): what gas, surroundings and walls take. A minute on one
core.
"""

from __future__ import annotations

import sys
from dataclasses import fields
from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from greybed.cfd.boundaries import Inflow
from greybed.core.config import build, read_toml
from greybed.core.readers import read_packing
from greybed.coupling.gas_particles_case import GasParticlesCase
from greybed.coupling.gas_particles_run import GasParticlesRun

EXAMPLES = Path(__file__).parents[1]
sys.path.insert(0, str(EXAMPLES / "fluidised_bed"))
import khawaja  # noqa: E402


def momentum(until: float = 0.15) -> tuple[np.ndarray, dict[str, np.ndarray], np.ndarray]:
    """Times [s], sums of each part along z [N s], and the defect of gas and particles [-]."""
    sim = khawaja.particles(threads=1)
    sim.run(khawaja.SETTLE)
    both = khawaja.with_gas(sim, speed=0.01 * khawaja.SPEED, budget=True)
    times, rows, defects = [], [], []
    while both.time < until:
        ramp = min(1.0, 0.01 + both.time / khawaja.RAMP)
        both.gas.set_boundary("z-", Inflow(khawaja.SPEED * ramp))
        report = both.step()
        budget = both.gas_report.budget
        times.append(both.time)
        rows.append([getattr(budget, field.name)[2] for field in fields(budget)])
        defects.append(report.defect)
    sums = np.cumsum(rows, axis=0)
    names = [field.name for field in fields(budget)]
    return np.array(times), dict(zip(names, sums.T, strict=True)), np.array(defects)


def heat(until: float = 0.06) -> tuple[np.ndarray, dict[str, np.ndarray], np.ndarray]:
    """Times [s], sums of each part [J], and the defect of each gas step [-]."""
    path = EXAMPLES / "flows/cooling_bed.toml"
    case = build(GasParticlesCase, read_toml(path) | {"duration": until}, path)
    packing = read_packing(path.parent / case.particles[0].file)
    run = GasParticlesRun(case, {0: packing}, threads=1)
    rows: list[list[float]] = []
    warm = run.coupled.heat
    inner = warm.close

    def close():
        report = inner()
        rows.append([run.coupled.time, report.from_gas, report.from_surroundings,
                     report.from_walls, report.stored, report.defect])  # fmt: skip
        return report

    warm.close = close
    for _ in run.go_on():
        pass
    table = np.array(rows)
    names = ("gas", "walls and opening, by radiation", "walls, by contact", "stored")
    parts = {name: np.cumsum(table[:, k + 1]) for k, name in enumerate(names)}
    return table[:, 0], parts, table[:, -1]


def measure(picture: Path) -> dict[str, float]:
    """Draw, and give the largest defects."""
    figure, axes = plt.subplots(1, 3, figsize=(12, 3.8), layout="constrained")
    t, parts, defects = momentum()
    rest = parts.pop("change")
    for name, values in parts.items():
        if np.any(values):
            axes[0].plot(t, 1e3 * values, label=name, lw=1.2)
    axes[0].plot(t, 1e3 * rest, "k--", lw=1.0, label="change")
    axes[0].set(xlabel="time [s]", ylabel="momentum of the gas [mN s]", title="Khawaja's bed")
    scale = sum(np.abs(values) for values in parts.values())
    left = np.abs(rest - sum(parts.values())) / scale
    axes[2].semilogy(t / t[-1], np.maximum(left, 1e-18), label="gas: change less the others")
    axes[2].semilogy(t / t[-1], np.maximum(defects, 1e-18), label="given less taken")
    found = {"budgets.momentum": float(left.max()), "budgets.exchange": float(defects.max())}
    print(f"momentum: {left.max():.1e} of the sum of the parts; given less taken "
          f"{defects.max():.1e}")  # fmt: skip
    t, parts, defects = heat()
    stored = parts.pop("stored")
    for name, values in parts.items():
        axes[1].plot(t, values, label=name, lw=1.2)
    axes[1].plot(t, stored, "k--", lw=1.0, label="stored in the spheres")
    axes[1].set(xlabel="time [s]", ylabel="heat into the spheres [J]", title="A bed that cools")
    axes[2].semilogy(t / t[-1], np.maximum(defects, 1e-18), label="heat of each gas step")
    whole = abs(stored[-1] - sum(v[-1] for v in parts.values())) / abs(stored[-1])
    print(f"heat: {defects.max():.1e} of what is exchanged, at the end {whole:.1e}")
    found["budgets.heat"] = float(defects.max())
    axes[2].axhline(1e-10, color="k", ls=":", lw=0.8)
    axes[2].set(xlabel="time over that of the run", title="What does not add up, relative",
                ylim=(1e-18, 1e-8))  # fmt: skip
    for axis in axes:
        axis.legend(fontsize=8)
    figure.savefig(picture, dpi=110)
    plt.close(figure)
    return found


def main() -> None:
    measure(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/images/budgets.png"))


if __name__ == "__main__":
    main()
