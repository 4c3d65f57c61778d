"""Filtered drag in C++ and ONNX: limits, golden rows, forces and their derivatives."""

from __future__ import annotations

import dataclasses
import subprocess

import numpy as np
import pytest

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
WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror")
FAST = ("-std=c++17", "-O3", "-march=native", "-ffast-math", *WARNINGS)
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

    def get(kind, markers, flags=("-std=c++11", "-O1", *WARNINGS)):
        key = (kind, markers, flags)
        if key not in made:
            folder = tmp_path_factory.mktemp("drag")
            header = export_cpp(closure_of(kind, markers), folder)
            made[key] = CompiledClosure(compile_cpp(header, folder / "build", flags))
        return made[key]

    return get


@needs_compiler
@pytest.mark.parametrize(("kind", "markers"), FORMS)
def test_cpp_holds_limits_and_golden_rows(kind, markers, programs):
    closure = closure_of(kind, markers)
    for flags in (("-std=c++11", "-O1", *WARNINGS), FAST):
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


@needs_compiler
@pytest.mark.parametrize(("kind", "markers"), FORMS)
def test_forces_and_derivatives_in_cpp_are_those_of_python(kind, markers, programs):
    closure, law = closure_of(kind, markers), drag_law("wen-yu")
    rng = np.random.default_rng(1)
    n, gravity = 300, np.array([1.0, -9.0, 3.0])
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
    for flags in (("-std=c++11", "-O1", *WARNINGS), FAST):
        force, derivative = programs(kind, markers, flags).forces(rows)
        scale = np.abs(here.force).max(axis=1, keepdims=True) + 1e-9
        # A tree's cut may fall between two roundings of the same marker: none does here.
        assert (np.abs(force - here.force) <= 1e-11 * scale).all()
        steepest = np.abs(here.derivative).max(axis=(1, 2), keepdims=True) + 1e-9
        assert (np.abs(derivative - here.derivative) <= 1e-10 * steepest).all()


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
    odd = dataclasses.replace(closure, predictor=Network.random(6, (6, 6), 0, 3, bent=True))
    with pytest.raises(InputError, match=r"layers of \[6, 6\] neurons must be bent and multiples"):
        export_cpp(odd, tmp_path)


@needs_compiler
def test_time_of_a_force_is_measured(programs):
    # How fast it is depends on the machine; that it is said, and below that of an ONNX call.
    assert 1.0 < programs("mlp", "plain", FAST).nanoseconds() < 5000.0
