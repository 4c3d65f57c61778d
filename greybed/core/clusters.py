"""Clients of dask.distributed: one machine, a scheduler at an address, or jobs of Slurm."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from greybed.core.config import read_toml
from greybed.core.errors import InputError
from greybed.core.processors import available_threads

# How long a scheduler may take to answer, and Slurm to start a first job [s].
PATIENCE = 20.0
PATIENCE_QUEUE = 3600.0
LOCAL = "local"


@contextmanager
def client_of(scheduler: str, workers: int | None = None) -> Iterator[Any]:
    """A client with workers.

    Parameters
    ----------
    scheduler : str
        ``local`` for workers on this machine; the address of a scheduler, such as
        ``tcp://host:8786``; or a TOML file of Slurm jobs, ``jobs = N`` and in ``[slurm]`` the
        arguments of ``dask_jobqueue.SLURMCluster``.
    workers : int, optional
        Of ``local``; as many as threads by default.

    Raises
    ------
    InputError
        If a package is missing, a file cannot be used, or no worker answers.
    """
    try:
        from distributed import Client, LocalCluster
    except ImportError:
        raise InputError(
            "--scheduler needs dask.distributed, which is not installed; pip install "
            "'greybed[cluster]', or give --workers N to use this machine."
        ) from None
    with ExitStack() as stack:
        if scheduler == LOCAL:
            count = workers or available_threads()
            place: Any = stack.enter_context(
                LocalCluster(
                    n_workers=count, threads_per_worker=1, processes=True, dashboard_address=None,
                    silence_logs=40,
                )
            )  # fmt: skip
        elif scheduler.endswith(".toml"):
            place = stack.enter_context(_slurm(Path(scheduler)))
        else:
            place = scheduler
        try:
            client = Client(place, timeout=PATIENCE, set_as_default=False)
        except (OSError, ValueError, ImportError) as error:
            raise InputError(
                f"--scheduler {scheduler}: no scheduler answers there within {PATIENCE:g} [s] "
                f"({type(error).__name__}); start one with dask scheduler and give the address "
                "that it prints."
            ) from None
        stack.enter_context(client)
        if scheduler.endswith(".toml"):
            client.wait_for_workers(1, timeout=PATIENCE_QUEUE)
        if not client.nthreads():
            raise InputError(
                f"--scheduler {scheduler} has no workers; start some with dask worker {scheduler}."
            )
        yield client


def slurm_table(path: Path) -> tuple[int, dict[str, Any]]:
    """Number of jobs and the arguments of a Slurm cluster that a TOML file holds.

    Raises
    ------
    InputError
        If the file cannot be read or says something else.
    """
    table = read_toml(path)
    jobs, slurm = table.pop("jobs", None), table.pop("slurm", None)
    if table or not isinstance(jobs, int) or jobs < 1 or not isinstance(slurm, dict):
        raise InputError(
            f"{path} must hold jobs = N, at least 1, and a table [slurm] with the arguments of "
            "dask_jobqueue.SLURMCluster, and nothing else."
        )
    return jobs, slurm


def _slurm(path: Path) -> Any:
    jobs, arguments = slurm_table(path)
    try:
        from dask_jobqueue import SLURMCluster
    except ImportError:
        raise InputError(
            f"--scheduler {path} needs dask-jobqueue, which is not installed; pip install "
            "dask-jobqueue."
        ) from None
    try:
        cluster = SLURMCluster(**arguments)
    except (TypeError, ValueError) as error:
        raise InputError(f"{path}: dask_jobqueue refuses [slurm] ({error}).") from None
    cluster.scale(jobs=jobs)
    return cluster
