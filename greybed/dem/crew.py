"""Threads that help with compiled work: they come for it and go when it is done."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from threading import Thread
from typing import TypeVar

import numba

from greybed.dem import _step

_Result = TypeVar("_Result")

# Steps of one particle below which no helper is worth its way here.
WORTH_HELP = 20_000
# Particles below which lists are made by one thread.
WORTH_PARTS = 5_000


def run_steps(
    threads: int, order: int, steps: int, state: _step.State, near: _step.Near, *others: object
) -> tuple[int, int, int, float]:
    """``_step.work`` with helpers; the same bits with any number of them.

    Parameters
    ----------
    threads : int
        Threads at most, this one included.
    order, steps, state, near, *others
        As ``_step.work`` takes them.
    """
    # What finishes a run is a tenth of a step.
    few = order == _step.FINISH or steps * len(state.place) < WORTH_HELP
    alone = few or numba.config.DISABLE_JIT
    helpers = 0 if alone else min(threads, len(near.block) - 1) - 1
    team = _step.new_team(1 + helpers)
    given = (team, state, near, *others)
    crew = [
        Thread(target=_step.work, args=(order, steps, 1 + k, *given), daemon=True)
        for k in range(helpers)
    ]
    try:
        for helper in crew:
            helper.start()
        return _step.work(order, steps, 0, *given)
    finally:
        # Also where this thread is interrupted before it leads.
        team[_step.GO] = _step.STOP
        for helper in crew:
            if helper.is_alive():
                helper.join()


def in_parts(threads: int, count: int, function: Callable[[int, int], _Result]) -> list[_Result]:
    """Results of ``function(begin, end)``, which compiled code computes, over parts of 0 ... count.

    As many parts as threads where there is enough to do, in order; the last one ends at ``count``.
    """
    parts = 1 if count < WORTH_PARTS or numba.config.DISABLE_JIT else threads
    ends = [count * k // parts for k in range(parts + 1)]
    if parts == 1:
        return [function(0, count)]
    with ThreadPoolExecutor(parts) as pool:
        return list(pool.map(function, ends[:-1], ends[1:]))
