"""A closure as one self-contained C++11 header with golden rows, test program and CMake file."""

from __future__ import annotations

import os
import textwrap
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from greybed.closures import ViewFactorClosure, golden_rows
from greybed.closures.predictors import Network
from greybed.closures.viewfactor.visibility import ODDS_BOUND, SPREAD_BOUND
from greybed.core import InputError
from greybed.core.exact import TOUCHING, quadrature
from greybed.core.files import atomic_path, output_folder
from greybed.export.metadata import (
    LICENCE,
    QUANTITIES,
    allowed,
    dataset_hash,
    describe,
    export_name,
)
from greybed.export.tables import LARGEST, checksum, doubles, finite, forest_tables, network_tables

# Relative difference that a golden row may show on another machine or with -ffast-math.
TOLERANCE = 1e-12

CMAKE = """\
cmake_minimum_required(VERSION 3.10)
project({name} CXX)

# One header, nothing to build: link with greybed::{name} and include "{name}.hpp".
add_library({name} INTERFACE)
add_library(greybed::{name} ALIAS {name})
target_include_directories({name} INTERFACE ${{CMAKE_CURRENT_SOURCE_DIR}})
target_compile_features({name} INTERFACE cxx_std_11)

enable_testing()
add_executable({name}_test {name}_test.cpp)
target_link_libraries({name}_test PRIVATE {name})
add_test(NAME {name} COMMAND {name}_test)
"""


@dataclass(frozen=True)
class Formulae:
    """What a marker set computes, in C++.

    Attributes
    ----------
    features : tuple of str
        One expression each.
    before : tuple of str
        Statements before the rest.
    clear, gate, baseline, exact : str
        1 - gate, gate, baseline, and the factor that they share out.
    """

    features: tuple[str, ...]
    before: tuple[str, ...]
    clear: str
    gate: str
    baseline: str
    exact: str


_PAIR = (
    "radius_over_distance * (1.0 + 1.0 / radius_ratio)",
    "4.0 * radius_ratio / ((1.0 + radius_ratio) * (1.0 + radius_ratio))",
)
_FREE = "detail::pair_factor(radius_over_distance, radius_ratio)"
_OPEN = (
    # By a choice, so that -ffast-math cannot put the one together with what follows.
    ("const double open = blocked_fraction < 1.0 ? 1.0 - blocked_fraction : 0.0;",),
    "(open * open) * (open * open)",
    "1.0 - clear",
    "0.01 + 0.98 * (1.0 - 1.0 / (1.0 + open * (1.0 + open * (1.0 + open))))",
)
# The same operations in the same order as in greybed.closures.viewfactor.visibility: features of
# a forest are cut to single precision, so their last bits can decide a branch. ``clear`` is
# 1 - gate without the subtraction, because -ffast-math may cancel what it can put together.
FORMULAE = {
    "published": Formulae(
        (*_PAIR, "std::log1p(n_between)", "solid_fraction"),
        (),
        "std::exp(-6.0 * n_between)",
        "-std::expm1(-6.0 * n_between)",
        "0.01 + 0.98 * std::exp(-0.25 * n_between)",
        _FREE,
    ),
    "pencil": Formulae(
        (*_PAIR, "blocked_fraction", "std::log1p(blockers_per_line)"), *_OPEN, _FREE
    ),
    "wall": Formulae(
        (
            "blocked_fraction",
            "std::log(1e-3 + open)",
            "1.0 / distance_over_radius",
            "wall_share",
            "solid_fraction",
        ),
        *_OPEN,
        "wall_share",
    ),
    # Neither part is the difference of the other from one, so D = F exactly at emissivity 1. A
    # black pair that is wholly hidden has nothing to share out.
    "exchange": Formulae(
        (
            _PAIR[0],
            f"std::log({_PAIR[0]})",
            _PAIR[1],
            "visible_share",
            "emissivity",
            "solid_fraction",
        ),
        (
            f"const double direct = emissivity * visible_share * {_FREE};",
            "const double ratio2 = radius_ratio * radius_ratio;",
            "const double reflected = (1.0 - emissivity) * ratio2 / (1.0 + ratio2);",
        ),
        "exact > 0.0 ? direct / exact : 1.0",
        "exact > 0.0 ? reflected / exact : 0.0",
        "0.002 + 0.1 * features[0] * features[0]",
        "direct + reflected",
    ),
}


def _context(closure: ViewFactorClosure, name: str) -> dict[str, Any]:
    if closure.markers.name not in FORMULAE:
        raise InputError(
            f"the marker set {closure.markers.name!r} has no form in C++; "
            f"known are {', '.join(FORMULAE)}."
        )
    formulae = FORMULAE[closure.markers.name]
    predictor, domain = closure.predictor, closure.domain
    with np.errstate(over="ignore"):
        limit2 = float(finite(np.float64(domain.limit) ** 2))
    of_pairs = closure.quantity != "wallfactor"
    nodes = zip(("node_square", "node_weight"), quadrature(), strict=True)
    tables = [
        *(doubles(*node) for node in nodes if of_pairs),
        doubles("domain_low", finite(domain.low)),
        doubles("domain_high", finite(domain.high)),
        doubles("domain_centre", domain.centre),
        doubles("domain_precision", domain.precision),
    ]
    context: dict[str, Any] = {}
    if isinstance(predictor, Network):
        tables += network_tables(predictor)
        sizes = [len(predictor.mean), *(len(bias) for bias in predictor.biases)]
        context["layers"] = list(pairwise(sizes))
    else:
        tables += forest_tables(predictor)
    inputs, outputs = golden_rows(closure)
    golden = [
        *(doubles(f"golden_{n}", c) for n, c in zip(closure.marker_names, inputs.T, strict=True)),
        doubles("golden_factor", outputs[:, 0]),
        doubles("golden_stderr", outputs[:, 1]),
    ]
    return {
        **context,
        "meta": describe(closure, name),
        "name": name,
        "guard": f"GREYBED_{name.upper()}_HPP",
        "kind": closure.kind,
        "outputs": 2,
        "quantity": QUANTITIES[closure.quantity],
        "of_pairs": of_pairs,
        "markers": closure.markers.markers,
        "allowed": allowed,
        "largest": repr(LARGEST),
        "reach": repr(1.0 / (1.0 - TOUCHING)),
        "features": list(zip(closure.markers.feature_names, formulae.features, strict=True)),
        "formulae": formulae,
        "odds_bound": repr(ODDS_BOUND),
        "spread_bound": repr(SPREAD_BOUND),
        "limit2": repr(limit2),
        "tables": tables,
        "golden": golden,
        "rows": len(inputs),
        "tolerance": repr(TOLERANCE),
        "checksum": f"0x{checksum(tables):016x}ULL",
        "dataset_hash": dataset_hash(closure),
        "licence": LICENCE,
    }


@cache
def environment() -> Any:
    """Templates of the exported files."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("greybed.export"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,  # C++ is no HTML
    )
    environment.filters["quoted"] = _quoted
    environment.filters["wrapped"] = _wrapped
    environment.filters["capital"] = _capital
    return environment


def _capital(text: str) -> str:
    """The text with its first letter large."""
    return text[:1].upper() + text[1:]


def _wrapped(line: str) -> str:
    """A long line of C++, continued four columns further in."""
    body = (
        line.strip().replace("double* ", "double*\1").replace("double ", "double\1")
    )  # kept with the name that follows
    indent = " " * (len(line) - len(line.lstrip()))
    text = textwrap.fill(
        body,
        100,
        initial_indent=indent,
        subsequent_indent=indent + "    ",
        break_long_words=False,
        break_on_hyphens=False,
    )
    return text.replace("\1", " ") + "\n"


def _quoted(text: str) -> str:
    """A C++ string literal: printable ASCII, everything else as octal bytes."""
    # Octal escapes end after three digits, hexadecimal ones swallow what follows.
    body = "".join(
        chr(byte) if 32 <= byte < 127 and byte not in b'"\\?' else f"\\{byte:03o}"
        for byte in text.encode()
    )
    return f'"{body}"'


def export_cpp(
    closure: ViewFactorClosure, folder: str | os.PathLike[str], name: str | None = None
) -> Path:
    """Write ``NAME.hpp``, ``NAME_test.cpp``, ``CMakeLists.txt`` and ``README.md``.

    Parameters
    ----------
    closure : ViewFactorClosure
        What to export.
    folder : path
        Made if it does not exist.
    name : str, optional
        Namespace inside ``greybed`` and stem of the files; made from the closure by default.

    Returns
    -------
    header : Path
        The header: C++11, no heap, no threads, nothing to link but the C++ library.

    Raises
    ------
    InputError
        If the name is no C++ identifier, or the closure holds numbers that are not finite.
    OutputError
        If a file cannot be written.

    Notes
    -----
    The header's ``self_test()`` replays the golden rows to a relative 1e-12 and compares a
    checksum of every constant; ``NAME_test.cpp`` runs it and evaluates CSV rows.
    """
    word = export_name(closure, name)
    context = _context(closure, word)
    target = output_folder(folder)
    files = {
        f"{word}.hpp": environment().get_template("closure.hpp").render(context),
        f"{word}_test.cpp": environment().get_template("closure_test.cpp").render(context),
        "README.md": environment().get_template("README.md").render(context),
        "CMakeLists.txt": CMAKE.format(name=word),
    }
    for file, text in files.items():
        with atomic_path(target / file) as temporary:
            temporary.write_text(text, encoding="ascii")
    return target / f"{word}.hpp"
