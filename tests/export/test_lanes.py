"""Every way through an exported network: for any processor, dispatched, of eight lanes, held."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest
from exported_closures import WARNINGS

from greybed.closures import ViewFactorClosure
from greybed.closures.predictors import Network
from greybed.closures.viewfactor.closure import Domain
from greybed.closures.viewfactor.limits import random_markers
from greybed.closures.viewfactor.visibility import MARKER_SETS
from greybed.export import CompiledClosure, compile_cpp, export_cpp, find_compiler

pytestmark = pytest.mark.skipif(
    find_compiler() is None, reason="no C++ compiler (CXX, g++, clang++, c++)"
)
INFO = Path("/proc/cpuinfo")
needs_avx2 = pytest.mark.skipif(
    not INFO.exists() or " avx2 " not in INFO.read_text(), reason="the processor has no AVX2"
)
WAYS = {
    "as the processor has it": [],
    "any processor": ["-DGREYBED_NO_DISPATCH"],
    "eight lanes": ["-mavx2", "-mfma", "-DGREYBED_EIGHT", "-Wno-psabi"],
}


@pytest.fixture(scope="module")
def steep():
    """A network whose numbers before tanh go to thousands, in both layers."""
    net = Network.random(4, (20, 12), seed=3)
    first, second, last = net.weights
    weights = (400.0 * first, 100.0 * second, last)
    return ViewFactorClosure(
        MARKER_SETS["pencil"],
        Network(net.mean, net.scale, weights, net.biases),
        Domain.everywhere(4),
    )


@pytest.mark.parametrize(
    "way", [pytest.param(w, marks=needs_avx2 if "eight" in w else ()) for w in WAYS]
)
def test_large_numbers_before_a_bend(way, steep, tmp_path):
    header = export_cpp(steep, tmp_path, "steep")
    flags = ["-std=c++11", "-O1", *WAYS[way]]
    compiled = CompiledClosure(compile_cpp(header, tmp_path, flags))
    markers = random_markers(steep, 500, seed=2)
    # The weights multiply what rounding does by 1e4 and more.
    np.testing.assert_allclose(compiled.evaluate(**markers), steep.evaluate(**markers), rtol=1e-10)


def test_a_program_for_512_bits_compiles_without_warning(steep, tmp_path):
    header = export_cpp(steep, tmp_path, "steep")
    words = [*find_compiler(), "-std=c++11", "-march=skylake-avx512", "-S", "-O1", *WARNINGS]
    target = tmp_path / "steep.s"
    program = header.with_name("steep_test.cpp")
    done = subprocess.run([*words, program, "-o", target], capture_output=True, text=True)
    if "skylake-avx512" in done.stderr and "error" in done.stderr:
        pytest.skip("the compiler does not know x86-64 with AVX-512")
    assert (done.returncode, done.stderr) == (0, "")
    assert "%zmm" in target.read_text()
