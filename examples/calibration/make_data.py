"""Stands in for a laboratory: repeats of an experiment at parameters that a study does not know.

    python examples/calibration/make_data.py STUDY.toml NAME=VALUE ... [--repeats N] [--count N]

Prints mean and standard deviation of each measure, of the mean and of a single repeat. ``--count``
takes another number of grains than the study.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from greybed.calibration.read import StudyFile
from greybed.core.config import read_case

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("study", type=Path)
parser.add_argument("truth", nargs="+")
parser.add_argument("--repeats", type=int, default=6)
parser.add_argument("--count", type=int)
options = parser.parse_args()
content = read_case(options.study, StudyFile)
truth = {name: float(value) for name, value in (word.split("=") for word in options.truth)}
for table in content.experiment:
    if options.count:
        table = replace(table, count=options.count)
    experiment = table.experiment(options.study.parent)
    rows = []
    for repeat in range(options.repeats):
        try:
            rows.append(experiment.run(truth, 1_000_000 + repeat))
        except Exception as error:
            print(f"{table.name}: repeat {repeat} failed ({error})")
    for name, measure in experiment.measures.items():
        if measure.kind == "signal" or not rows:
            continue
        values = np.array([row[name] for row in rows])
        sd = values.std(ddof=1)
        print(
            f"{table.name}.{name}: {values.mean():.5g} +- {sd / np.sqrt(len(values)):.2g} "
            f"{measure.unit}, single {sd:.2g}"
        )
