"""Run a case file with many values: on this machine, a cluster of dask, or jobs of Slurm.

Examples:
  greybed campaign examples/campaign/campaign.toml --out runs/campaign
  greybed campaign study.toml --out runs/study --workers 2
  greybed campaign study.toml --out runs/study --scheduler local
  greybed campaign study.toml --out runs/study --scheduler tcp://head:8786
  greybed campaign study.toml --out runs/study --scheduler slurm.toml

study.toml names a case and what to vary; every combination is a task:
  case = "hopper.toml"
  [vary]
  seed = [1, 2, 3]
  "contact.0.friction" = [0.2, 0.4]

Each task is known by a hash of its inputs and has one result file, tasks/KEY.json; campaign.csv
holds a row for each. Workers may be killed and the command given again: what has a result file is
never done twice. The exit code is 1 where tasks failed; those are tried again the next time.
"""

from __future__ import annotations

import argparse
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of ``greybed campaign``."""
    parser.add_argument("file", type=Path, help="campaign file (TOML)")
    parser.add_argument("--out", type=Path, required=True, help="folder for the results")
    parser.add_argument(
        "--workers", type=int, metavar="N", help="processes (default: one a thread)"
    )
    parser.add_argument(
        "--scheduler",
        metavar="WHERE",
        help="local, the address of a dask.distributed scheduler, or a TOML file of Slurm jobs",
    )
    parser.add_argument("--quiet", action="store_true", help="no progress bar")


def run(options: argparse.Namespace) -> int:
    """Do what is not done yet; returns 0, or 1 where tasks failed."""
    from greybed.core.errors import InputError
    from greybed.core.files import write_summary
    from greybed.core.folder_lock import locked_folder
    from greybed.core.processors import available_threads
    from greybed.core.progress import progress
    from greybed.datasets.campaign import run_campaign
    from greybed.datasets.case_campaign import cases_of, simulate_case, write_table
    from greybed.datasets.executors import executor_of

    if options.workers is not None and options.workers < 1:
        raise InputError(f"--workers = {options.workers} [-] must be at least 1.")
    if options.workers is not None and options.scheduler not in (None, "local"):
        raise InputError("--workers is for this machine only; leave it out beside --scheduler.")
    cases = cases_of(options.file)
    with locked_folder(options.out) as folder:
        workers = options.workers or available_threads()
        with (
            executor_of(options.scheduler, workers) as executor,
            progress(len(cases), "cases", show=not options.quiet) as advance,
        ):
            campaign = run_campaign(simulate_case, cases, folder / "tasks", executor, advance)
        write_table(campaign, cases, folder / "campaign.csv")
        results = {
            "cases": len(campaign.keys), "found_from_before": campaign.found,
            "failed": campaign.failed, "scheduler": options.scheduler,
        }  # fmt: skip
        summary = write_summary(folder, "campaign", results, options.file)
    print(
        f"{len(campaign.keys)} cases: {campaign.found} were done before, "
        f"{len(campaign.keys) - campaign.found - len(campaign.failed)} done now, "
        f"{len(campaign.failed)} failed"
    )
    for key, said in campaign.failed.items():
        print(f"{key}: {said}")
    print(f"wrote {folder / 'campaign.csv'}\nwrote {summary}")
    return 1 if campaign.failed else 0
