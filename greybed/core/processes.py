"""Processes that work beside this one: started, fed a few jobs ahead, and ended with it."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from itertools import islice
from multiprocessing import connection, get_context, parent_process
from typing import Any

from greybed.core.errors import OutputError

_PARENT_DIES = 1  # PR_SET_PDEATHSIG


def processes(
    count: int, start: Callable[..., None] | None = None, about: tuple[Any, ...] = ()
) -> ProcessPoolExecutor:
    """A pool of ``count`` processes, each of which calls ``start(*about)`` first.

    They end when this process ends, also when it is killed.
    """
    # Spawned, because a fork of a process with threads may hang.
    return ProcessPoolExecutor(
        count, mp_context=get_context("spawn"), initializer=_begin, initargs=(start, about)
    )


def end_with_parent() -> None:
    """End this process when its parent ends, from now on."""
    threading.Thread(target=_end_with_parent, daemon=True).start()


def ending_with_parent(number: int = signal.SIGKILL) -> Callable[[], None]:
    """What a program calls before it starts (``preexec_fn``), so as to end when we do.

    A killed run would leave it at work in a folder that the next run takes for its own. Only
    Linux has this; elsewhere nothing is called.

    Parameters
    ----------
    number : int
        Signal that it gets then.
    """
    parent = os.getpid()
    # Found here: between fork and exec, nothing may be loaded.
    library = ctypes.CDLL(None) if sys.platform == "linux" else None

    def before_exec() -> None:
        if library is not None:
            library.prctl(_PARENT_DIES, number)
            if os.getppid() != parent:  # it has died since
                os.kill(os.getpid(), number)

    return before_exec


def _begin(start: Callable[..., None] | None, about: tuple[Any, ...]) -> None:
    end_with_parent()
    if start is not None:
        start(*about)


def _end_with_parent() -> None:
    # A killed parent closes no queue: its children would wait for work forever.
    parent = parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(1)


def finished(
    executor: Executor, task: Callable[..., Any], jobs: Iterable[tuple[Any, ...]], ahead: int
) -> Iterator[tuple[tuple[Any, ...], Any]]:
    """Jobs with their results, in the order in which they are finished.

    Parameters
    ----------
    executor : Executor
        Where ``task(*job)`` runs.
    task : callable
        The work, a function of a module.
    jobs : iterable of tuple
        Arguments.
    ahead : int
        Jobs handed out at once: the results of so many may wait in memory [-].

    Raises
    ------
    OutputError
        If a process was killed from outside, as systems do that run out of memory.
    """
    waiting: dict[Future[Any], tuple[Any, ...]] = {}
    queue = iter(jobs)
    try:
        while True:
            for job in islice(queue, ahead - len(waiting)):
                waiting[executor.submit(task, *job)] = job
            if not waiting:
                return
            done, _ = wait(waiting, return_when=FIRST_COMPLETED)
            for future in done:
                yield waiting.pop(future), future.result()
    except BrokenProcessPool:
        raise OutputError(
            "a worker process was killed from outside, perhaps because memory ran out; give the "
            "same command with fewer workers: what was finished is kept."
        ) from None
    except BaseException:  # Ctrl-C must not wait for the jobs that have not begun
        executor.shutdown(wait=False, cancel_futures=True)
        raise
