"""Makes the programs of benchmarks/ known to these tests."""

import sys
from pathlib import Path

import greybed

sys.path.insert(0, str(Path(greybed.__file__).parents[1] / "benchmarks"))
