"""The C++ header: no warnings, one copy in a program, changed weights found, refusals."""

from __future__ import annotations

import re
import shutil
import subprocess

import numpy as np
import pytest
from exported_closures import WARNINGS

from greybed.closures import ViewFactorClosure, content_hash, golden_rows
from greybed.closures.predictors import Network
from greybed.closures.viewfactor.closure import Domain
from greybed.core import InputError, RangeError, VerificationError
from greybed.export import CompiledClosure, compile_cpp, export_cpp, find_compiler

needs_compiler = pytest.mark.skipif(
    find_compiler() is None, reason="no C++ compiler (CXX, g++, clang++, c++)"
)
MLP, FOREST = "mlp pencil 3", "forest published 3"
QUICK = ("-std=c++11", "-O0")
TOGETHER = [
    MLP, FOREST, "shipped wallfactor_mlp_wall", "shipped exchange_mlp_exchange", "drag", "term",
]  # fmt: skip
CALLS = [
    "x[0] = greybed::viewfactor_pencil_mlp::eval_grad(0.3, 1.0, 0.1, 0.2, x + 1);",
    "x[0] = greybed::viewfactor_published_forest::eval(0.3, 0.1, 1.0, 0.2);",
    "greybed::filtereddrag_full_mlp::eval_grad(0.1, 2, 1, 1, 1, 0.1, 0.1, 2, 1, x, x + 3);",
]


@pytest.fixture(scope="module")
def together(headers, tmp_path_factory):
    """One file that includes every kind of header."""
    folder = tmp_path_factory.mktemp("together")
    stems = []
    for header in map(headers, TOGETHER):
        shutil.copy(header, folder)
        stems.append(header.stem)
    text = "".join(f'#include "{stem}.hpp"\n' for stem in stems)
    sums = " + ".join(f"greybed::{stem}::self_test()" for stem in stems)
    (folder / "all.cpp").write_text(f"{text}int main() {{ return {sums}; }}\n")
    return folder / "all.cpp"


@pytest.mark.parametrize("standard", ["c++11", "c++14", "c++17", "c++20"])
@pytest.mark.parametrize("compiler", ["g++", "clang++"])
def test_no_warning_in_any_standard(compiler, standard, together):
    # Without optimisation; the programs of the other tests are built with -Werror as well.
    if shutil.which(compiler) is None:
        pytest.skip(f"{compiler} is not installed")
    words = [compiler, f"-std={standard}", "-fsyntax-only", "-Wshadow", *WARNINGS, together]
    done = subprocess.run(words, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.skipif(shutil.which("clang++") is None, reason="clang++ is not installed")
def test_clang_gives_the_golden_rows_of_all_kinds(together, tmp_path):
    # clang puts together more than g++ does where -ffast-math lets it.
    words = ["clang++", "-std=c++11", "-O2", "-march=native", "-ffast-math", *WARNINGS, together]
    subprocess.run([*words, "-o", tmp_path / "all"], check=True)
    assert subprocess.run([tmp_path / "all"]).returncode == 0


DEVICE = [
    ["clang++", "-x", "cuda", "--cuda-host-only", "-nocudainc", "-nocudalib", "-std=c++14"],
    ["nvcc", "-x", "cu", "-std=c++14", "-Werror", "all-warnings", "-cuda"],
]


@pytest.mark.parametrize("words", DEVICE, ids=["clang", "nvcc"])
def test_a_compiler_for_graphics_processors_takes_the_header(words, together, tmp_path):
    if shutil.which(words[0]) is None:
        pytest.skip(f"{words[0]} is not installed")
    kernels = "".join(
        f"__global__ void run_{k}(double* x) {{ {call} }}\n" for k, call in enumerate(CALLS)
    )
    text = together.read_text().replace("int main", f"{kernels}int main")
    if words[0] == "clang++":  # what the toolkit's header would define
        text = "#define __global__ __attribute__((global))\n" + text
    (together.parent / "device.cu").write_text(text)
    end = ["-fsyntax-only"] if words[0] == "clang++" else ["-o", str(tmp_path / "device.ii")]
    done = subprocess.run(
        [*words, *end, together.parent / "device.cu"], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


@needs_compiler
def test_the_program_says_what_it_is(compiled, closures):
    program = compiled(MLP, "O2")
    assert program.name == "viewfactor_pencil_mlp"
    assert program.hash == content_hash(closures[MLP])
    assert program.marker_names == closures[MLP].marker_names
    assert program.failing_rows == 0


@needs_compiler
def test_shapes_broadcast_and_no_rows_is_no_error(compiled, closures):
    program = compiled(MLP, "O2")
    markers = {
        "radius_over_distance": np.array([[0.1], [0.2]]),
        "radius_ratio": 1.0,
        "blocked_fraction": np.array([0.0, 0.3, 0.6]),
        "blockers_per_line": 0.5,
    }
    expected = closures[MLP].evaluate(**markers)
    np.testing.assert_allclose(program.evaluate(**markers), expected, rtol=1e-12)
    none = {name: np.zeros((0, 2)) for name in markers}
    assert program.evaluate(**none).shape == (0, 2)
    with pytest.raises(RangeError, match=r"takes the markers radius_over_distance, .* not x"):
        program.evaluate(x=1.0)


def _changed(header, folder, array, pattern, replacement):
    """A copy of a header and its test program, with one number of one array changed."""
    folder.mkdir()
    text = header.read_text()
    start = text.index(f"* {array}()")
    changed = re.sub(pattern, replacement, text[start:], count=1)
    assert changed != text[start:]
    copy = folder / header.name
    copy.write_text(text[:start] + changed)
    shutil.copy(header.with_name(f"{header.stem}_test.cpp"), folder)
    return copy


@needs_compiler
@pytest.mark.parametrize(
    ("name", "array", "pattern", "replacement"),
    [
        (MLP, "weight_1", r"(0\.\d{6})\d", r"\g<1>0"),
        (MLP, "domain_low", r"-1\.79", "-1.69"),
        (FOREST, "leaf_values", r"(0\.\d{9})\d", r"\g<1>0"),
        (FOREST, "threshold", r"(0\.\d{4})\d", r"\g<1>0"),
    ],
)
def test_a_changed_constant_fails_the_self_test(
    name, array, pattern, replacement, headers, tmp_path
):
    copy = _changed(headers(name), tmp_path / "changed", array, pattern, replacement)
    program = compile_cpp(copy, tmp_path, QUICK)
    assert CompiledClosure(program).failing_rows >= 1
    assert subprocess.run([program], capture_output=True).returncode == 1


@needs_compiler
def test_a_changed_golden_row_fails_by_itself(headers, tmp_path):
    copy = _changed(
        headers(MLP), tmp_path / "changed", "golden_answers", r"(0\.0\d{3})\d", r"\g<1>0"
    )
    # Both the single evaluation and the batch see that row: it counts once.
    assert CompiledClosure(compile_cpp(copy, tmp_path, QUICK)).failing_rows == 1


@needs_compiler
def test_two_closures_in_two_files_of_one_program(headers, tmp_path):
    """No symbol stands twice, and arrays of a header are shared by the files that include it."""
    for header in (headers(MLP), headers(FOREST)):
        shutil.copy(header, tmp_path)
    include = '#include "viewfactor_pencil_mlp.hpp"\n#include "viewfactor_published_forest.hpp"\n'
    (tmp_path / "a.cpp").write_text(
        include + "const double* there() "
        "{ return greybed::viewfactor_pencil_mlp::detail::weight_1(); }\n"
    )
    (tmp_path / "b.cpp").write_text(
        include + "const double* there();\n"
        "int main() {\n"
        "  const bool one = there() == greybed::viewfactor_pencil_mlp::detail::weight_1();\n"
        "  return greybed::viewfactor_pencil_mlp::self_test() +\n"
        "         greybed::viewfactor_published_forest::self_test() + (one ? 0 : 1);\n"
        "}\n"
    )
    files = [tmp_path / "a.cpp", tmp_path / "b.cpp", "-o", tmp_path / "both"]
    subprocess.run([*find_compiler(), *QUICK, *WARNINGS, *files], check=True)
    assert subprocess.run([tmp_path / "both"]).returncode == 0


@needs_compiler
def test_rows_with_the_wrong_header_or_too_few_numbers_are_refused(compiled):
    program = compiled(MLP, "O2")
    wrong = subprocess.run([program.program, "rows"], input="a,b\n", capture_output=True, text=True)
    assert wrong.returncode == 2
    assert "the first line must be radius_over_distance,radius_ratio" in wrong.stderr
    text = ",".join(program.marker_names) + "\n0.1,1,0.2\n"
    short = subprocess.run([program.program, "rows"], input=text, capture_output=True, text=True)
    assert (short.returncode, short.stderr) == (2, "row 1: 4 numbers are needed\n")


def test_header_carries_its_facts(headers, closures):
    text = headers("fitted mlp pencil").read_text()
    assert "SPDX-License-Identifier: BSD-3-Clause" in text
    assert content_hash(closures["fitted mlp pencil"]) in text
    assert "ab" * 32 in text  # hash of the data set, from the card
    assert text.isascii()
    assert max(map(len, text.splitlines())) < 120
    inputs, _ = golden_rows(closures["fitted mlp pencil"])
    assert repr(float(inputs[5, 0])) in text


def test_export_writes_four_files(headers):
    names = {path.name for path in headers(MLP).parent.iterdir()}
    stem = "viewfactor_pencil_mlp"
    assert names == {f"{stem}.hpp", f"{stem}_test.cpp", "CMakeLists.txt", "README.md"}


@pytest.mark.parametrize("name", ["3d", "a b", "double", "std", "a__b", "x-y", "", "größe"])
def test_names_that_cpp_cannot_take_are_refused(name, closures, tmp_path):
    with pytest.raises(InputError, match="cannot be a namespace"):
        export_cpp(closures[MLP], tmp_path, name)


def test_weights_that_are_not_finite_are_refused(tmp_path):
    network = Network.random(4, (3,))
    network.weights[0][1, 1] = np.nan
    closure = ViewFactorClosure(
        ViewFactorClosure.untrained().markers, network, Domain.everywhere(4)
    )
    with pytest.raises(InputError, match="weight_0 of the closure is not finite"):
        export_cpp(closure, tmp_path)


def test_no_compiler_is_one_sentence(headers, tmp_path, monkeypatch):
    monkeypatch.setenv("CXX", "/nowhere/g++")
    assert find_compiler() is None
    with pytest.raises(InputError, match=r"no C\+\+ compiler found .* install one or set CXX"):
        compile_cpp(headers(MLP), tmp_path)


@needs_compiler
def test_a_header_that_does_not_compile_is_one_sentence(headers, tmp_path):
    copy = _changed(headers(MLP), tmp_path / "changed", "mean", r"return data", "return nothing")
    with pytest.raises(VerificationError, match=r"refuses it: .*nothing.*try other flags"):
        compile_cpp(copy, tmp_path, QUICK)


def test_another_program_is_no_closure():
    with pytest.raises(VerificationError, match="does not answer as the test program"):
        CompiledClosure("/bin/true")
