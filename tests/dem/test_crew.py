"""Threads that share the blocks of a step: counters, helpers that end, parts that cover all."""

import threading
from types import SimpleNamespace

import numpy as np
import pytest

from greybed.core.jit import njit
from greybed.dem import _share, _step, crew


@njit(nogil=True)
def _take(counter, most, taken):
    while True:
        ticket = _share.add(counter, 0, 1)
        if ticket >= most:
            return
        taken[ticket] += 1


def test_each_ticket_is_taken_once():
    most = 200_000
    counter, taken = np.zeros(1, np.int64), np.zeros(most, np.int64)
    _take(counter.copy(), 0, taken)  # compiles
    threads = [threading.Thread(target=_take, args=(counter, most, taken)) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert (taken == 1).all()
    # Each thread has taken one more, that was none.
    assert counter[0] == most + len(threads)


def test_helpers_end_when_the_leader_is_interrupted(monkeypatch):
    helped = []

    def work(order, steps, who, team, *others):
        if who == 0:
            raise KeyboardInterrupt
        while team[_step.GO] != _step.STOP:
            pass
        helped.append(order)

    monkeypatch.setattr(crew, "_step", SimpleNamespace(**{**vars(_step), "work": work}))
    state = SimpleNamespace(place=np.zeros((crew.WORTH_HELP, 4)))
    near = SimpleNamespace(block=np.arange(9))
    before = threading.active_count()
    with pytest.raises(KeyboardInterrupt):
        crew.run_steps(3, _step.STEPS, 1, state, near)
    assert helped == [_step.STEPS] * 2
    assert threading.active_count() == before


@pytest.mark.parametrize(("threads", "count"), [(1, 5), (2, 7), (3, 7), (4, 2)])
def test_parts_cover_all_once_and_in_order(monkeypatch, threads, count):
    monkeypatch.setattr(crew, "WORTH_PARTS", 0)
    parts = crew.in_parts(threads, count, lambda begin, end: list(range(begin, end)))
    assert len(parts) == threads
    assert [k for part in parts for k in part] == list(range(count))
