"""Wall and exchange closures in C++ and ONNX: the limits of Python, and the numbers of Python."""

from __future__ import annotations

import subprocess

import numpy as np
import onnx
import pytest
from exported_closures import OTHERS, SHIPPED, WARNINGS

from greybed.closures import content_hash, load, save
from greybed.closures.viewfactor.limits import check_limits, random_markers
from greybed.closures.viewfactor.walls import rectangle_share
from greybed.export import export_onnx, find_compiler
from greybed.export.replay import relative_error, replay

NAMES = OTHERS + SHIPPED
# The compiler once for each: untrained ones as they come, shipped ones with -ffast-math.
FORMS = [(name, "onnx") for name in NAMES] + [(name, "O2") for name in (OTHERS[0], OTHERS[-1])]
FORMS += [(name, "fast-math native") for name in SHIPPED]
OUTPUTS = {"wallfactor": "wall_factor", "exchange": "exchange_factor"}


@pytest.fixture
def form(closures, compiled, onnx_form, tmp_path):
    def make(name, which):
        if which == "python":
            return closures[name]
        if which == "reloaded":
            return load(save(closures[name], tmp_path / "closure.closure"))
        return onnx_form(name) if which == "onnx" else compiled(name, which)

    return make


@pytest.mark.parametrize(
    ("name", "which"),
    [(name, which) for name in NAMES for which in ("python", "reloaded")] + FORMS,
)
def test_limiting_cases(name, which, closures, form):
    cases = check_limits(closures[name], evaluate=form(name, which).evaluate, n=3000)
    assert len(cases) == 5
    assert [case for case in cases if not case.passed] == []


@pytest.mark.parametrize(("name", "which"), FORMS)
def test_random_and_golden_rows(name, which, closures, form):
    closure = closures[name]
    markers = random_markers(closure, 2000, seed=11)
    if closure.quantity == "wallfactor":
        markers["blocked_fraction"][:200] = 0.0
        markers["blocked_fraction"][200:300] = 1.0
        markers["distance_over_radius"][300:400] = 1.0
    else:
        markers["emissivity"][:200] = 1.0  # reflects nothing
        markers["visible_share"][100:300] = 0.0  # the first half of them black and hidden
    expected = closure.predict(**markers)
    answer = form(name, which).predict(**markers)
    assert relative_error(answer.view_factor, expected.view_factor).max() <= 1e-12
    np.testing.assert_allclose(answer.stderr, expected.stderr, rtol=1e-12, atol=1e-16)
    assert not answer.stderr[:200].any()
    np.testing.assert_array_equal(answer.extrapolates, expected.extrapolates)
    if closure.quantity == "exchange":
        assert not answer.view_factor[100:200].any()
        assert (answer.view_factor[200:300] > 0.0).all()
    assert replay(closure, form(name, which), tolerance=1e-12)["passed"]
    assert form(name, which).hash == content_hash(closure)


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_closures_flag_extrapolation_somewhere_only(name, closures):
    # Guards the comparison above: a flag that never changes would agree for no reason.
    markers = random_markers(closures[name], 2000, seed=11)
    assert 0.01 < closures[name].predict(**markers).extrapolates.mean() < 0.99


@pytest.mark.parametrize("which", ["fast-math native", "onnx"])
@pytest.mark.parametrize(
    ("name", "sound", "wrong"),
    [
        (
            SHIPPED[0],
            {
                "wall_share": 0.2,
                "distance_over_radius": 2.0,
                "blocked_fraction": 0.5,
                "solid_fraction": 0.5,
            },
            [
                ("wall_share", 0.0),
                ("wall_share", 1.1),
                ("distance_over_radius", 0.9),
                ("distance_over_radius", np.inf),
                ("blocked_fraction", np.nan),
                ("solid_fraction", 0.0),
            ],
        ),
        (
            SHIPPED[1],
            {
                "radius_over_distance": 0.4,
                "radius_ratio": 1.0,
                "visible_share": 0.5,
                "emissivity": 0.5,
                "solid_fraction": 0.5,
            },
            [
                ("radius_over_distance", 0.6),  # spheres that overlap
                ("visible_share", -0.1),
                ("visible_share", 1.1),
                ("emissivity", 0.0),
                ("emissivity", np.nan),
            ],
        ),
    ],
)
def test_markers_out_of_range_give_nan(name, sound, wrong, which, form):
    columns = {key: np.full(len(wrong) + 1, value) for key, value in sound.items()}
    for row, (key, value) in enumerate(wrong):
        columns[key][row] = value
    answer = form(name, which).predict(**columns)
    assert np.isnan(answer.view_factor).tolist() == [True] * len(wrong) + [False]
    assert answer.extrapolates[: len(wrong)].all()


@pytest.mark.parametrize("name", NAMES)
def test_exported_forms_say_what_they_give(name, closures, headers, tmp_path):
    closure = closures[name]
    output = OUTPUTS[closure.quantity]
    model = onnx.load(export_onnx(closure, tmp_path / "closure.onnx"))
    onnx.checker.check_model(model, full_check=True)
    assert [value.name for value in model.graph.output] == [output, "stderr", "extrapolates"]
    header = headers(name)
    assert header.stem == f"{closure.quantity}_{closure.markers.name}_{closure.kind}"
    text = header.read_text()
    assert max(map(len, text.splitlines())) < 120
    symbol = "F_iw" if closure.quantity == "wallfactor" else "D_ij"
    for file in (text, header.with_name("README.md").read_text()):
        assert symbol in file
        assert "F_ij from sphere" not in file
    assert f'"{output},stderr"' in text
    assert ("pair_factor" in text) == (closure.quantity == "exchange")


@pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler (CXX, g++, clang++, c++)")
def test_the_header_of_a_wall_has_the_exact_share_of_a_rectangle(headers, tmp_path):
    edges = [(-1.0, 2.0, -0.5, 0.25, 1.5), (0.5, 3.0, 1.0, 4.0, 0.1), (-1e9, 1e9, -1e9, 1e9, 2e-3)]
    header = headers("shipped wallfactor_mlp_wall")
    calls = "".join(
        f'  std::printf("%.17g\\n", w::rectangle_share({", ".join(map(repr, e))}));\n'
        for e in edges
    )
    (tmp_path / "share.cpp").write_text(
        f'#include "{header.name}"\n#include <cstdio>\nnamespace w = greybed::{header.stem};\n'
        f"int main() {{\n{calls}  return 0;\n}}\n"
    )
    command = [*find_compiler(), "-std=c++11", *WARNINGS, f"-I{header.parent}"]
    subprocess.run([*command, tmp_path / "share.cpp", "-o", tmp_path / "share"], check=True)
    done = subprocess.run([tmp_path / "share"], capture_output=True, text=True, check=True)
    share = [float(word) for word in done.stdout.split()]
    e = np.array(edges)
    expected = rectangle_share(e[:, [0, 2]], e[:, [1, 3]], e[:, 4])
    np.testing.assert_allclose(share, expected, rtol=1e-13)
    assert share[2] == pytest.approx(0.5, abs=1e-11)
