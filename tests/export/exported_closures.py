"""Names of the closures that the tests of exports use, and flags of the compiler."""

from __future__ import annotations

from greybed.closures.viewfactor.visibility import MARKER_SETS

# Those of OpenFOAM among them.
WARNINGS = (
    "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wold-style-cast", "-Wnon-virtual-dtor",
    "-Wno-unused-parameter", "-Werror",
)  # fmt: skip
FLAGS = {
    "O0": ("-std=c++11", "-O0", *WARNINGS),
    "O2": ("-std=c++11", "-O2", *WARNINGS),
    "O3 native": ("-std=c++14", "-O3", "-march=native", *WARNINGS),
    "Ofast": ("-std=c++17", "-Ofast", *WARNINGS),
    "fast-math native": ("-std=c++20", "-O2", "-march=native", "-ffast-math", *WARNINGS),
}
# A call of the compiler takes seconds: every closure with these two, one of each kind with all.
EVERY = ["O2", "fast-math native"]
# Closures of pairs; those to walls and of exchange have tests of their own.
PAIRS = [name for name, markers in MARKER_SETS.items() if markers.quantity == "viewfactor"]
UNTRAINED = [f"{kind} {markers} 3" for kind in ("mlp", "forest") for markers in PAIRS]
# Weights that bend the odds far down, and a pair that is hardly visible.
HARD = {
    "mlp published 0": {
        "radius_over_distance": 0.1,
        "radius_ratio": 1.0,
        "n_between": 55.0,
        "solid_fraction": 0.6,
    }
}
FITTED = ["fitted mlp pencil", "fitted forest published"]
# To walls, and exchange factors: the shipped ones for trained ones.
OTHERS = [f"{kind} {markers} 3" for kind in ("mlp", "forest") for markers in ("wall", "exchange")]
SHIPPED = ["shipped wallfactor_mlp_wall", "shipped exchange_mlp_exchange"]
