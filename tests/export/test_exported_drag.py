"""Filtered drag in C++ and ONNX: limits, golden rows, forces and their derivatives."""

from __future__ import annotations

import dataclasses
import subprocess

import numpy as np
import pytest
from exported_closures import WARNINGS

from greybed.closures.drag import drag_law
from greybed.closures.drag.filtered import MARKER_SETS, FilteredDragClosure, filtered_force
from greybed.closures.drag.filtered.force import law_with_slope
from greybed.closures.drag.filtered.limits import FCC, check_limits, random_markers
from greybed.closures.predictors import Network
from greybed.closures.viewfactor.closure import Domain
from greybed.core.errors import InputError
from greybed.export import (
    CompiledClosure,
    OnnxClosure,
    compile_cpp,
    export_cpp,
    export_onnx,
    find_compiler,
)
from greybed.export.replay import CPP_TOLERANCE, ONNX_TOLERANCE, replay

FORMS = [(kind, markers) for kind in ("mlp", "forest") for markers in MARKER_SETS]
# A call of the compiler takes seconds: each form once, with -ffast-math or without.
PLAIN = ("-std=c++11", "-O1", *WARNINGS)
FAST = ("-std=c++17", "-O2", "-march=native", "-ffast-math", *WARNINGS)
BUILT = [
    ("mlp", "plain", PLAIN), ("mlp", "gradient", FAST), ("mlp", "linear", FAST),
    ("mlp", "full", PLAIN), ("mlp", "full", FAST), ("forest", "full", FAST),
]  # fmt: skip
needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")


def closure_of(kind, markers):
    """Random weights, a domain with bounds, a spread and a gate of their own."""
    closure = FilteredDragClosure.untrained(kind, markers, seed=3)
    some = closure.markers.features(random_markers(closure, 1000, seed=5))
    return dataclasses.replace(closure, domain=Domain.of(some), card={"law": "wen-yu"})


@pytest.fixture(scope="module")
def programs(tmp_path_factory):
    """Compiled programs by kind, markers and speed."""
    made = {}

    def get(kind, markers, flags=FAST):
        key = (kind, markers, flags)
        if key not in made:
            folder = tmp_path_factory.mktemp("drag")
            header = export_cpp(closure_of(kind, markers), folder)
            made[key] = CompiledClosure(compile_cpp(header, folder / "build", flags))
        return made[key]

    return get


@needs_compiler
@pytest.mark.parametrize(("kind", "markers", "flags"), BUILT)
def test_cpp_holds_limits_and_golden_rows(kind, markers, flags, programs):
    closure = closure_of(kind, markers)
    program = programs(kind, markers, flags)
    result = replay(closure, program, CPP_TOLERANCE)
    assert result["passed"], result
    for case in check_limits(closure, program.predict, n=2000):
        assert case.passed, (case.name, case.error)


@pytest.mark.parametrize(("kind", "markers"), FORMS)
def test_onnx_holds_limits_and_golden_rows(kind, markers, tmp_path):
    closure = closure_of(kind, markers)
    graph = OnnxClosure(export_onnx(closure, tmp_path / "a.onnx"))
    result = replay(closure, graph, ONNX_TOLERANCE)
    assert result["passed"], result
    assert result["max_relative_error"] < 1e-11
    for case in check_limits(closure, graph.predict, n=2000):
        assert case.passed, (case.name, case.error)
    drawn = random_markers(closure, 500, seed=9, beyond=0.4)
    here, there = closure.predict(**drawn), graph.predict(**drawn)
    assert (here.extrapolates == there.extrapolates).all()
    assert here.extrapolates.any()
    nothing = {**drawn, "solid_fraction": np.full(500, np.nan)}
    assert np.isnan(graph.predict(**nothing).kept_along).all()


def places(closure, n=300):
    """What Python says of random places, and the rows of the program."""
    law = drag_law("wen-yu")
    rng = np.random.default_rng(1)
    gravity = np.array([1.0, -9.0, 3.0])
    gravity *= FCC.gravity / np.linalg.norm(gravity)
    phi = rng.uniform(0.0, 0.7, n)
    slip = FCC.terminal_velocity * rng.normal(0.0, 1.5, (n, 3))
    slip[0], slip[1] = 0.0, -gravity * 0.03
    pressure = FCC.weight * rng.normal(0.0, 0.4, (n, 3))
    size, parcels = FCC.length * rng.uniform(0.0, 12.0, n), rng.uniform(1.0, 4.0, n)
    here = filtered_force(closure, FCC, law, gravity, phi, slip, size, pressure, parcels)
    re = FCC.gas_density * FCC.diameter / FCC.gas_viscosity * (1.0 - phi)
    f, steep = law_with_slope(law, phi, re * np.linalg.norm(slip, axis=1))
    material = [FCC.diameter, FCC.particle_density, FCC.gas_density, FCC.gas_viscosity, *gravity]
    rows = np.column_stack(
        [np.tile(material, (n, 1)), phi, slip, pressure, size, f, steep, parcels]
    )
    return here, rows


@needs_compiler
@pytest.mark.parametrize(("kind", "markers", "flags"), BUILT)
def test_forces_and_derivatives_in_cpp_are_those_of_python(kind, markers, flags, programs):
    here, rows = places(closure_of(kind, markers))
    force, derivative = programs(kind, markers, flags).forces(rows)
    scale = np.abs(here.force).max(axis=1, keepdims=True) + 1e-9
    # A tree's cut may fall between two roundings of the same marker: none does here.
    assert (np.abs(force - here.force) <= 1e-11 * scale).all()
    steepest = np.abs(here.derivative).max(axis=(1, 2), keepdims=True) + 1e-9
    assert (np.abs(derivative - here.derivative) <= 1e-10 * steepest).all()


@needs_compiler
@pytest.mark.parametrize("policy", ["clamp", "baseline", "abort"])
def test_what_a_guard_does_outside(policy, programs):
    closure = closure_of("mlp", "full")
    here, rows = places(closure)
    table, counts = programs("mlp", "full").guarded(rows, policy)
    outside = here.prediction.extrapolates
    assert 0.1 < outside.mean() < 0.9
    assert counts == (len(rows), outside.sum(), 0)
    force, exchange, status = table[:, :3], table[:, 12], table[:, -1]
    assert (status[~outside] == 0).all()
    if policy == "abort":
        assert (status[outside] == 3).all()
        assert np.isnan(force[outside]).all()
        return
    slip = rows[:, 8:11]
    speed2 = (slip**2).sum(axis=1)
    # No drag works against the slip, whatever is done outside.
    assert ((force * slip).sum(axis=1) >= 0.0).all()
    np.testing.assert_allclose(exchange * speed2, (force * slip).sum(axis=1), rtol=1e-12)
    if policy == "baseline":  # exactly the drag law, and its derivative
        assert (status[outside] == 2).all()
        np.testing.assert_allclose(force[outside], here.unfiltered[outside], rtol=1e-15)
        np.testing.assert_allclose(exchange[outside], here.beta[outside], rtol=1e-15)
        return
    # The derivative is that of the clamped force: by differences in the slip, the law's steepness
    # frozen out by a law that is constant.
    rows[:, 16] = 0.0
    table, _ = programs("mlp", "full").guarded(rows, policy)
    step = 1e-6
    wrong = 0.0
    for j in range(3):
        up, down = rows.copy(), rows.copy()
        up[:, 8 + j] += step
        down[:, 8 + j] -= step
        high, low = (programs("mlp", "full").guarded(r, policy)[0][:, :3] for r in (up, down))
        slope = (high - low) / (2.0 * step)
        error = np.abs(table[:, 3:12].reshape(-1, 3, 3)[:, :, j] - slope).max(axis=1)
        wrong += (error > 1e-5 * np.abs(slope).max(axis=1) + 1e-6).mean()
    assert wrong < 0.03  # a few stand at the edge of the training data


@needs_compiler
@pytest.mark.parametrize("markers", ["plain", "full"])
def test_derivatives_for_markers_are_those_of_differences(markers, programs):
    closure = closure_of("mlp", markers)
    program = programs("mlp", markers, PLAIN)
    drawn = random_markers(closure, 300, seed=2)
    drawn["solid_fraction"] = np.clip(drawn["solid_fraction"], 1e-3, 0.61)
    drawn["parcels"] = 1.0 + 3.0 * np.random.default_rng(0).uniform(0.1, 1.0, 300)
    value, gradient = program.gradients(**drawn)
    np.testing.assert_allclose(value[:, 0], closure.predict(**drawn).kept_along, rtol=1e-12)
    for k, name in enumerate(closure.marker_names):
        step = 1e-6 * np.maximum(np.abs(drawn[name]), 1e-2)
        high, low = (
            np.stack(closure.predict(**{**drawn, name: drawn[name] + s})[:3], axis=1)
            for s in (step, -step)
        )
        slope = (high - low) / (2.0 * step)[:, None]
        scale = np.abs(slope) + value / np.maximum(np.abs(drawn[name]), 1e-2)[:, None]
        assert (np.abs(gradient[:, :, k] - slope) <= 2e-7 * scale).all(), name


@needs_compiler
def test_a_changed_header_says_so(tmp_path):
    header = export_cpp(closure_of("mlp", "plain"), tmp_path, "bed")
    text = header.read_text()
    at = text.index("{\n      ", text.index("weight_0()")) + len("{\n      ")
    header.write_text(f"{text[:at]}1.0 + {text[at:]}")
    program = CompiledClosure(compile_cpp(header, tmp_path / "build"))
    assert program.failing_rows > 0
    assert subprocess.run([program.program]).returncode == 1


def test_a_network_that_has_no_header_is_refused(tmp_path):
    closure = FilteredDragClosure.untrained()
    odd = dataclasses.replace(closure, predictor=Network.random(6, (), 0, 3, bent=True))
    with pytest.raises(InputError, match=r"without a layer between features and answers"):
        export_cpp(odd, tmp_path)


@needs_compiler
def test_layers_of_any_width_and_either_bend(tmp_path):
    closure = closure_of("mlp", "full")
    network = Network.random(9, (6, 7), 0, 4)
    odd = dataclasses.replace(closure, predictor=network)
    program = CompiledClosure(compile_cpp(export_cpp(odd, tmp_path), tmp_path / "build"))
    assert replay(odd, program, CPP_TOLERANCE)["passed"]


@needs_compiler
def test_time_of_a_force_is_measured(programs):
    # How fast it is depends on the machine; that it is said, and below that of an ONNX call.
    value, derivative = programs("mlp", "full").nanoseconds()
    assert 1.0 < value < 5000.0
    assert 1.0 < derivative < 10_000.0
