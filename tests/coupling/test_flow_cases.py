"""Cases with a gas from files: what they come to, restart bit by bit, what they refuse."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest

from greybed.cli.main import main
from greybed.core.config import build, read_toml
from greybed.core.errors import InputError
from greybed.core.readers import read_packing
from greybed.coupling.flow_run import FlowRun
from greybed.coupling.gas_case import GasCase
from greybed.coupling.gas_particles_case import GasParticlesCase
from greybed.coupling.gas_particles_run import GasParticlesRun
from greybed.coupling.two_fluid_case import TwoFluidCase, TwoFluidRun

FLOWS = Path(__file__).parents[2] / "examples/flows"


def content(name, **change):
    """A case of the examples, with other numbers; nested tables are merged."""
    found = read_toml(FLOWS / f"{name}.toml")
    for key, value in change.items():
        found[key] = {**found[key], **value} if isinstance(value, dict) else value
    return found


def clusters(**change):
    small = {
        "duration": 0.01,
        "grid": {"cells": [16, 32, 1], "upper": ["4 mm", "8 mm", "0.25 mm"]},
        "output": {"samples": "2 ms", "frames": "5 ms"},
    }
    return content("clusters", **{**small, **change})


def bed(**change):
    """Some 300 spheres in a narrow box, blown from below."""
    found = content("khawaja", **change)
    found |= {"duration": 0.02, "grid": {"cells": [4, 1, 8], "upper": ["10 mm", "10 mm", "30 mm"]}}
    for wall in found["wall"]:
        wall["point"] = [{"43.2 mm": "10 mm", "124.8 mm": "30 mm"}.get(c, c) for c in wall["point"]]
    found["particles"][0] |= {"count": 300, "upper": ["10 mm", "10 mm", "20 mm"]}
    found["output"] = {"samples": "5 ms"}
    return found


def write(path, value):
    import tomli_w

    path.write_text(tomli_w.dumps(value))
    return path


def test_a_pressure_gradient_between_plates_gives_the_mean_velocity_of_a_parabola(tmp_path):
    case = content("channel", grid={"cells": [4, 1, 16]}, output={"samples": 0.5, "frames": 0.5})
    # Stiffer than the example, so that it is steady after a tenth of the time.
    case |= {"duration": 0.15, "gas": {"density": 1.2, "viscosity": 1e-3}}
    out, file = tmp_path / "out", str(write(tmp_path / "c.toml", case))
    assert main(["simulate", file, "--out", str(out), "--quiet"]) == 0
    summary = json.loads((out / "summary.json").read_text())
    mean = summary["mean_superficial_velocity_m_per_s"][0]
    # h2 / (12 mu); halving the cells takes a quarter of the error 0.5 / 16^2 of wall cells.
    assert mean == pytest.approx(0.01**2 / 12e-3, rel=0.01)
    assert summary["cells"] == 64
    assert summary["cell_steps_per_second"] > 0.0
    with h5py.File(out / "frames.vtkhdf") as file:
        root = file["VTKHDF"]
        assert root.attrs["Type"] == b"ImageData"
        assert root["CellData/speed [m per s]"].shape == (2, 16, 1, 4)
        np.testing.assert_allclose(root["Steps/Values"], [0.0, 0.15])
    for name in ("history.csv", "history.png", "final.png"):
        assert (out / name).stat().st_size > 100


def test_two_fluids_keep_their_mass_and_go_on_bit_by_bit(tmp_path):
    case = build(TwoFluidCase, clusters(), FLOWS / "clusters.toml")
    whole = FlowRun(case, TwoFluidRun(case))
    for _ in whole.go_on(lambda: None):
        pass
    mass = [row["solids mass [kg]"] for row in whole.history]
    assert max(mass) / min(mass) - 1.0 < 1e-13
    assert [row["time [s]"] for row in whole.history] == pytest.approx(np.arange(6) * 2e-3)
    part = FlowRun(case, TwoFluidRun(case))
    for _ in part.go_on(lambda: None):
        if part.done == 3:
            break
    part.save(tmp_path / "part.npz", "key")
    rest = FlowRun(case, TwoFluidRun(case))
    assert not rest.restore(tmp_path / "part.npz", "another case")
    assert rest.restore(tmp_path / "part.npz", "key")
    for _ in rest.go_on(lambda: None):
        pass
    assert rest.history == whole.history
    for name, values in whole.flow.fields().items():
        np.testing.assert_array_equal(values, rest.flow.fields()[name])


def test_particles_in_a_gas_exchange_momentum_whole_and_go_on_bit_by_bit(tmp_path):
    case = build(GasParticlesCase, bed(), FLOWS / "khawaja.toml")
    whole = GasParticlesRun(case, {}, threads=1)
    for _ in whole.go_on():
        pass
    assert whole.worst["momentum"] < 1e-12
    assert whole.totals["gas steps"] > 10
    result = whole.gas_results()["gas"]
    assert result["pressure_iterations"] > 0
    assert 0.0 < result["largest_divergence"] <= case.tolerance
    # The gas carries what the bed weighs at most, and some of it.
    weight = float(whole.simulation.masses.sum()) * 9.81 / 1e-4
    assert 0.1 * weight < result["pressure drop along z [Pa]"] < 3.0 * weight
    part = GasParticlesRun(case, {}, threads=1)
    for _ in part.go_on(part.steps // 2):
        pass
    part.save(tmp_path / "part.npz")
    rest = GasParticlesRun(case, {}, threads=1)
    rest.restore(tmp_path / "part.npz")
    for _ in rest.go_on():
        pass
    np.testing.assert_array_equal(rest.simulation.centres, whole.simulation.centres)
    for name, values in whole.gas_fields().items():
        np.testing.assert_array_equal(values, rest.gas_fields()[name])
    assert rest.totals == whole.totals


def test_the_settled_bed_cools_and_no_heat_is_lost():
    # Gas, contacts, walls and radiation in one account, at each step; the bed of the quickstart.
    case = content("cooling_bed", gas_heat={"rays": 64}, output={"samples": "2 ms"})
    case = build(GasParticlesCase, case | {"duration": "4 ms"}, FLOWS / "cooling_bed.toml")
    packing = read_packing(FLOWS / case.particles[0].file)
    run = GasParticlesRun(case, {0: packing}, threads=1)
    heat, stored = run.coupled.heat, 0.0
    start = heat.heat.temperatures.copy()
    flows = np.zeros(4)
    inner = heat.close

    def close():
        report = inner()
        flows[:] += [report.from_gas, report.from_surroundings, report.from_walls, report.exchanged]
        return report

    heat.close = close
    for _ in run.go_on():
        pass
    assert run.worst["energy"] < 1e-10
    stored = float(heat.heat.capacities @ (heat.heat.temperatures - start))
    assert abs(stored - flows[:3].sum()) < 1e-10 * flows[3]
    last = run.tally.history[-1]
    told = [last["heat from the gas [J]"], last["heat by radiation from walls and opening [J]"]]
    np.testing.assert_allclose(told, flows[:2], rtol=1e-12)
    # All three take heat from the bed, and each a share that counts.
    assert flows[:3].max() < -1e-3 * abs(stored)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"grid": {"cells": [400, 1, 26]}}, "smaller than a tenth of the diameter"),
        ({"side": [{"name": "z-", "kind": "inflow", "velocity": 1.0}]}, "no side lets it out"),
        ({"coupling": {"drag": "wen-you"}}, "did you mean"),
        ({"coarse_graining": 2.0}, "parcels"),
        ({"grid": {"cells": [12, 1, 26], "periodic": "y"}}, "must repeat"),
        ({"grid": {"upper": ["10 mm", "10 mm", "20 mm"]}}, "densest packing"),
        ({"gas": {"temperature": 300.0}}, "no \\[gas_heat\\]"),
        ({"grid": {"cells": [0, 1, 26]}}, "three whole numbers from 1"),
    ],
)
def test_gas_particles_refuse(change, words):
    with pytest.raises(InputError, match=words) as error:
        build(GasParticlesCase, content("khawaja", **change), FLOWS / "khawaja.toml")
    assert "khawaja.toml" in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("kind", "value", "words"),
    [
        (TwoFluidCase, clusters(solids={"fraction": 0.7}), "packing"),
        (TwoFluidCase, clusters(drag="nothing"), "not a known law"),
        (TwoFluidCase, clusters(side=[{"name": "x-", "kind": "wall"}]), "repeats"),
        (GasCase, {**content("channel"), "bed": {"fraction": 0.8, "diameter": 1e-4}}, "densest"),
        (GasCase, {**content("channel"), "side": [{"name": "z-", "kind": "wall",
         "temperature": 300.0}]}, "\\[gas\\] none"),
    ],
)  # fmt: skip
def test_flows_refuse(kind, value, words):
    with pytest.raises(InputError, match=words):
        build(kind, value, FLOWS / "case.toml")


def test_a_bad_case_ends_with_one_sentence_and_code_2(tmp_path, capsys):
    case = content("channel", duration=-1.0)
    path = write(tmp_path / "c.toml", case)
    assert main(["simulate", str(path), "--out", str(tmp_path / "out"), "--quiet"]) == 2
    said = capsys.readouterr().err.strip()
    assert said.count("\n") == 0
    assert "duration = -1 [s] must be above 0" in said
