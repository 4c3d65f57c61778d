"""The verb ``greybed dataset drag``: a design of flows into a data set of filtered drag."""

from __future__ import annotations

import argparse
import math
import time


def run_drag(options: argparse.Namespace) -> int:
    """Run the flows, or go on with them, and write those that are finished."""
    from greybed.core.config import read_case
    from greybed.core.errors import InputError
    from greybed.core.files import output_folder, writable_file, write_summary
    from greybed.core.folder_lock import locked_folder
    from greybed.datasets.drag_campaign import generate
    from greybed.datasets.drag_design import DragDesign
    from greybed.datasets.filtered_drag import write_filtered_drag

    if not options.design:
        raise InputError(
            "greybed dataset drag needs a design; give examples/filtered_drag/default.toml or one "
            "of your own."
        )
    if options.workers != 1 or options.seed is not None:
        raise InputError(
            "greybed dataset drag takes neither --workers nor --seed: share the cases among "
            "processes with --case, and give seeds in the design."
        )
    minutes = math.inf if options.minutes is None else options.minutes
    if not minutes > 0.0:
        raise InputError(f"--minutes = {minutes:g} must be above 0.")
    design = read_case(options.design, DragDesign)
    target = writable_file(options.out)
    output_folder(target.parent)
    begin = time.perf_counter()
    data, left = generate(
        design, target.with_name(f"{target.stem}.cases"), names=options.case,
        seconds=60.0 * minutes, show=True,
    )  # fmt: skip
    found = {
        "file": target.name if data is not None else None,
        "rows": 0 if data is None else len(data.case),
        "cases": [] if data is None else [case.name for case in data.cases],
        "unfinished": left,
        "data_sha256": None if data is None else data.digest,
        "seconds": time.perf_counter() - begin,
    }
    # Processes that share the cases may end together: each waits for its turn to write.
    with locked_folder(target.parent, patience=60.0):
        if data is not None:
            write_filtered_drag(target, data)
        write_summary(target.parent, "dataset drag", found, options.design)
    if data is not None:
        print(f"{target}: {found['rows']} rows of {len(data.cases)} cases")
    if left:
        print(f"not finished: {', '.join(left)}; the same command goes on with them")
    else:
        print(f"next: greybed train drag {target} --out {target.parent}")
    return 0
