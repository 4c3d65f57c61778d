"""Who runs the tasks of a campaign: processes of this machine, or workers of dask.distributed.

Both lose no task to a worker that is killed, and repeat no other one than that which it was at.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from itertools import islice
from multiprocessing import connection, get_context
from typing import Any, Protocol

from greybed.core.clusters import client_of
from greybed.core.processes import end_with_parent

# A task that has ended so many workers is at fault itself.
MOST_DEATHS = 3
# Parcels of tasks that wait at each thread of dask's workers, that each is to have in all, and
# tasks in one at most.
AHEAD, PARCELS, MOST_TOGETHER = 4, 30, 16

Job = tuple[str, tuple[Any, ...]]


class Executor(Protocol):
    """Runs functions of modules somewhere."""

    def run(
        self, task: Callable[..., Any], jobs: Iterable[Job]
    ) -> Iterator[tuple[str, Any | Exception]]:
        """Keys with what ``task`` returned for their arguments, or with the error it raised."""
        ...


class OwnProcesses:
    """Processes of this machine, each with one task at a time.

    Parameters
    ----------
    count : int
        Processes.
    """

    def __init__(self, count: int) -> None:
        self.count = count

    def run(
        self, task: Callable[..., Any], jobs: Iterable[Job]
    ) -> Iterator[tuple[str, Any | Exception]]:
        """See :class:`Executor`."""
        queue, again = iter(jobs), list[Job]()
        deaths: dict[str, int] = {}
        busy: dict[Any, tuple[Any, Job]] = {}
        idle: list[tuple[Any, Any]] = []
        try:
            while True:
                while len(busy) < self.count:
                    job = again.pop() if again else next(queue, None)
                    if job is None:
                        break
                    pipe, process = idle.pop() if idle else _worker(task)
                    try:
                        pipe.send(job)
                    except OSError:  # killed while it had nothing to do
                        again.append(job)
                        continue
                    busy[pipe] = process, job
                if not busy:
                    return
                ready: list[Any] = connection.wait(list(busy))
                for pipe in ready:
                    process, job = busy.pop(pipe)
                    try:
                        answer = pipe.recv()
                    except (EOFError, OSError):
                        process.join()
                        deaths[job[0]] = deaths.get(job[0], 0) + 1
                        if deaths[job[0]] < MOST_DEATHS:
                            again.append(job)
                            continue
                        answer = RuntimeError(
                            f"{MOST_DEATHS} workers in turn were ended while they were at it"
                        )
                    else:
                        idle.append((pipe, process))
                    yield job[0], answer
        finally:
            for pipe, process in [*idle, *((pipe, busy[pipe][0]) for pipe in busy)]:
                pipe.close()
                if pipe in busy:
                    process.terminate()
                process.join()


def _worker(task: Callable[..., Any]) -> tuple[Any, Any]:
    # Spawned, because a fork of a process with threads may hang.
    context = get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(target=_serve, args=(there, task), daemon=True)
    process.start()
    there.close()
    return here, process


def _serve(pipe: Any, task: Callable[..., Any]) -> None:
    end_with_parent()
    while True:
        try:
            _, arguments = pipe.recv()
        except EOFError:
            return
        try:
            answer: Any = task(*arguments)
        except Exception as error:
            answer = error
        try:
            pipe.send(answer)
        except Exception as error:  # what cannot be pickled
            pipe.send(RuntimeError(f"{type(error).__name__}: {error}"))


class Dask:
    """Workers of a dask.distributed client, each thread of them with one task at a time.

    Parameters
    ----------
    client : distributed.Client
        The client.
    """

    def __init__(self, client: Any) -> None:
        self.client = client

    def run(
        self, task: Callable[..., Any], jobs: Iterable[Job]
    ) -> Iterator[tuple[str, Any | Exception]]:
        """See :class:`Executor`."""
        from distributed import as_completed

        waiting = list(jobs)
        seats = max(1, sum(self.client.nthreads().values()))
        # Each trip to the scheduler takes milliseconds: many small tasks travel together. What a
        # killed worker has finished of them has result files, so no more is repeated.
        size = max(1, min(MOST_TOGETHER, len(waiting) // (PARCELS * seats)))
        parcels = iter([waiting[k : k + size] for k in range(0, len(waiting), size)])
        keys: dict[Any, list[str]] = {}

        def submit(parcel: list[Job]) -> Any:
            future = self.client.submit(
                together, task, [arguments for _, arguments in parcel], key=parcel[0][0],
                pure=False, retries=MOST_DEATHS,
            )  # fmt: skip
            keys[future] = [key for key, _ in parcel]
            return future

        # Some wait at each worker, so that none has nothing to do while an answer is on its way.
        first = [submit(parcel) for parcel in islice(parcels, AHEAD * seats)]
        done = as_completed(first, loop=self.client.loop, with_results=True, raise_errors=False)
        for batch in done.batches():
            for parcel in islice(parcels, len(batch)):
                done.add(submit(parcel))
            for future, answers in batch:
                names = keys.pop(future)
                if future.status == "error":
                    answers = [future.exception()] * len(names)
                yield from zip(names, answers, strict=True)
                future.release()


def together(task: Callable[..., Any], arguments: list[tuple[Any, ...]]) -> list[Any]:
    """What ``task`` returns for each of some arguments, or the error that it raises."""
    answers: list[Any] = []
    for some in arguments:
        try:
            answers.append(task(*some))
        except Exception as error:
            answers.append(error)
    return answers


@contextmanager
def executor_of(scheduler: str | None, workers: int) -> Iterator[Executor]:
    """Processes of our own, or what ``--scheduler`` names: see :func:`client_of`."""
    if scheduler is None:
        yield OwnProcesses(workers)
        return
    with client_of(scheduler, workers) as client:
        yield Dask(client)
