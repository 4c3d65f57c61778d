"""The C library and the Fortran module: the same numbers, and a build that refuses to serve."""

from __future__ import annotations

import re
import shutil
import subprocess

import numpy as np
import pytest
from exported_closures import FITTED

from greybed.closures import content_hash
from greybed.closures.viewfactor.limits import random_markers
from greybed.core import InputError, VerificationError
from greybed.export import (
    CompiledLibrary,
    FortranProgram,
    compile_c,
    export_c,
    find_compiler,
    find_fortran,
    form_of,
)
from greybed.export.replay import replay

needs_compiler = pytest.mark.skipif(
    find_compiler() is None, reason="no C++ compiler (CXX, g++, clang++, c++)"
)
NAMES = [FITTED[0], "drag"]
STRICT = ("-std=c++11", "-O2", "-Wall", "-Wextra", "-Wold-style-cast", "-Werror")


@pytest.fixture(scope="module")
def built(closures, tmp_path_factory):
    """Header and library by the closure's name, compiled once."""
    made = {}

    def get(name):
        if name not in made:
            folder = tmp_path_factory.mktemp("library")
            header = export_c(closures[name], folder / "files", "bed", fortran=True)
            made[name] = header, compile_c(header, folder / "build", STRICT)
        return made[name]

    return get


def markers_of(closure, n=300):
    if closure.quantity == "filtereddrag":
        from greybed.closures.drag.filtered.limits import random_markers as of_drag

        return of_drag(closure, n, seed=3)
    return random_markers(closure, n, seed=3)


@needs_compiler
@pytest.mark.parametrize("name", NAMES)
def test_the_library_answers_as_python(name, closures, built):
    closure = closures[name]
    library = CompiledLibrary(built(name)[1], form_of(closure, "bed"))
    assert replay(closure, library, 1e-12)["passed"]
    assert library.hash == content_hash(closure)
    markers = markers_of(closure)
    expected, answer = closure.predict(**markers), library.predict(**markers)
    for there, here in zip(answer[:-1], expected[:-1], strict=True):
        np.testing.assert_allclose(there, here, rtol=1e-12, atol=1e-16)
    np.testing.assert_array_equal(answer.extrapolates, expected.extrapolates)
    batch, (values, gradient) = library.batch(**markers), library.gradients(**markers)
    np.testing.assert_allclose(batch[:, 0], expected[0], rtol=1e-12)
    np.testing.assert_allclose(values, batch, rtol=1e-12)
    assert np.isfinite(gradient).all()
    wrong = {k: np.append(v, np.nan) for k, v in markers.items()}
    assert np.isnan(library.predict(**wrong)[0][-1])


@needs_compiler
@pytest.mark.skipif(find_fortran() is None, reason="no Fortran compiler (FC, gfortran)")
@pytest.mark.parametrize("name", NAMES)
def test_fortran_answers_as_python(name, closures, built):
    closure, (header, library) = closures[name], built(name)
    form = form_of(closure, "bed")
    program = FortranProgram(header, library, form)
    assert replay(closure, program, 1e-12)["passed"]
    assert program.hash == content_hash(closure)
    markers = markers_of(closure)
    table, n, m = program.table(**markers), form.n_answers, len(form.markers)
    outputs = len(form.outputs)
    np.testing.assert_allclose(table[:, 0], closure.predict(**markers)[0], rtol=1e-12)
    np.testing.assert_allclose(table[:, outputs], table[:, 0], rtol=1e-12)
    # gradient(i, k) in Fortran is row after row what C has.
    _, gradient = CompiledLibrary(library, form).gradients(**markers)
    slopes = table[:, outputs + n : outputs + n + n * m].reshape(-1, n, m)
    np.testing.assert_allclose(slopes, gradient, rtol=1e-12, atol=1e-300)


@needs_compiler
def test_a_build_whose_rows_fail_does_not_open(closures, tmp_path):
    form = form_of(closures[FITTED[0]], "bed")
    header = export_c(closures[FITTED[0]], tmp_path / "files", "bed")
    hpp = header.with_name("bed.hpp")
    text = hpp.read_text()
    at = text.index("bias_0()")
    hpp.write_text(text[:at] + re.sub(r"(\d\.\d{6})\d", r"\g<1>0", text[at:], count=1))
    library = compile_c(header, tmp_path / "build", ("-std=c++11", "-O0"))
    with pytest.raises(VerificationError, match=r"bed: \d+ of 64 golden rows .* does not serve"):
        CompiledLibrary(library, form)


HOST = """\
#include <bed_c.h>
#include <stdio.h>
int main(void) {
  char message[512];
  const bed_library* bed = bed_open(BED_ABI, message, sizeof message);
  double inputs[BED_INPUTS] = {1e-3, 1e-3, 4e-3, 0.2, 0.3}, factor, gradient[BED_INPUTS];
  bed_guard guard = {3, 0, 0, 0};
  if (bed == NULL) { puts(message); return 1; }
  if (bed_open(BED_ABI + 1, message, sizeof message) != NULL) return 2;
  if (bed_physical(NULL, inputs, &guard, &factor, NULL) != BED_NOT_OPEN) return 3;
  bed_physical(bed, inputs, &guard, &factor, gradient);
  inputs[0] = -1.0;
  if (bed_physical(bed, inputs, &guard, gradient, NULL) != 3) return 4;
  printf("%s %.17g %d %d\\n", bed_hash(), factor, (int)guard.calls, (int)guard.invalid);
  return 0;
}
"""
PROJECT = """\
cmake_minimum_required(VERSION 3.13)
project(host C Fortran)
find_package(bed 0.1 REQUIRED)
add_executable(host host.c)
target_link_libraries(host greybed::bed_c)
"""


@needs_compiler
@pytest.mark.skipif(
    not (shutil.which("cmake") and shutil.which("pkg-config") and shutil.which("cc")),
    reason="needs cmake, pkg-config and a C compiler",
)
def test_cmake_package_and_pkg_config(closures, built, tmp_path):
    closure = closures[FITTED[0]]
    source, place = built(FITTED[0])[0].parent, tmp_path / "place"
    build = tmp_path / "build"
    flags = ["-DCMAKE_BUILD_TYPE=Debug", f"-DCMAKE_INSTALL_PREFIX={place}"]
    targets = ["--build", build, "--target", "install"]
    for words in (["-S", source, "-B", build, *flags], targets):
        subprocess.run(["cmake", *words], check=True, capture_output=True)
    host = tmp_path / "host"
    host.mkdir()
    (host / "host.c").write_text(HOST)
    (host / "CMakeLists.txt").write_text(PROJECT)
    for words in (["-S", host, "-B", host / "b", f"-DCMAKE_PREFIX_PATH={place}"],
                  ["--build", host / "b"]):  # fmt: skip
        subprocess.run(["cmake", *words], check=True, capture_output=True)
    x = {"radius_over_distance": 0.25, "radius_ratio": 1.0,
         "blocked_fraction": 0.2, "blockers_per_line": 0.3}  # fmt: skip
    (folder,) = place.rglob("pkgconfig")
    found = subprocess.run(
        ["pkg-config", "--cflags", "--libs", "bed"],
        env={"PKG_CONFIG_PATH": str(folder), "PATH": "/usr/bin:/bin"},
        capture_output=True, text=True, check=True,
    ).stdout.split()  # fmt: skip
    words = ["cc", "-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", host / "host.c"]
    rpath = f"-Wl,-rpath,{folder.parent}"
    subprocess.run([*words, *found, rpath, "-o", host / "plain"], check=True)
    for program in (host / "b" / "host", host / "plain"):
        said = subprocess.run([program], capture_output=True, text=True, check=True).stdout.split()
        assert said[0] == content_hash(closure)
        assert float(said[1]) == pytest.approx(float(closure.evaluate(**x)), rel=1e-12)
        assert said[2:] == ["2", "1"]


def test_a_name_too_long_for_fortran(closures, tmp_path):
    with pytest.raises(InputError, match="Fortran leaves 49"):
        export_c(closures[FITTED[0]], tmp_path, "a" * 50, fortran=True)


@needs_compiler
def test_two_libraries_of_one_name_keep_their_weights(closures, built):
    # Constants of inline functions would be one for the whole process, whoever loads them first.
    first, second = (CompiledLibrary(built(n)[1], form_of(closures[n], "bed")) for n in NAMES)
    assert first.hash != second.hash
    for name, library in zip(NAMES, (first, second), strict=True):
        assert replay(closures[name], library, 1e-12)["passed"]
