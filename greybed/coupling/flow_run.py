"""Run of a case on a grid: samples, frames and checkpoints at their times, restart bit by bit."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from greybed.core.errors import InputError
from greybed.core.files import atomic_path
from greybed.core.seal import seal_of
from greybed.coupling.flow_tables import FlowOutput, GridTable

Array = NDArray[np.float64]

FORMAT = "greybed-flow-2"


class FlowCase(Protocol):
    """What the loop asks of a case."""

    @property
    def duration(self) -> float:
        """[s]."""

    @property
    def grid(self) -> GridTable:
        """Cells."""

    @property
    def output(self) -> FlowOutput:
        """Times."""


class Flow(Protocol):
    """A case that runs."""

    @property
    def time(self) -> float:
        """[s]."""

    @property
    def steps(self) -> int:
        """Since the start."""

    def run(self, duration: float, each: Callable[[], object]) -> None:
        """Go on for so long [s]; ``each`` is called after every step."""

    def sample(self) -> dict[str, float]:
        """A row of the history."""

    def fields(self) -> dict[str, Array]:
        """Cell values of a frame."""

    def limits(self, field: str) -> tuple[float, float] | None:
        """Values of the first and last colour of a picture of it; its own range by default."""

    def results(self) -> dict[str, Any]:
        """Plain numbers at the end."""

    def save(self) -> dict[str, Array]:
        """The state as arrays."""

    def restore(self, saved: dict[str, Array]) -> None:
        """Take up a state."""


class FlowRun:
    """The loop over a flow: stops at each sample, frame and checkpoint.

    Attributes
    ----------
    history : list of dict
        Samples.
    done : int
        Stops that are behind.
    """

    def __init__(self, case: FlowCase, flow: Flow) -> None:
        self.case, self.flow = case, flow
        out = case.output
        every = [out.samples, out.frames, out.checkpoints or 0.1 * case.duration]
        self._every = [case.duration if e is None else min(e, case.duration) for e in every]
        times = {case.duration}
        for apart in self._every:
            # Whole multiples, so that a run in two parts stops at the same times.
            times |= {apart * k for k in range(1, math.ceil(case.duration / apart - 1e-9))}
        self.stops = sorted(times)
        self.history: list[dict[str, float]] = []
        self.done = 0
        self._note()

    def _note(self) -> None:
        self.history.append({"time [s]": self.flow.time, **self.flow.sample()})

    def _due(self, kind: int, time: float) -> bool:
        share = time / self._every[kind]
        return abs(share - round(share)) < 1e-9 * max(share, 1.0) or time == self.case.duration

    def go_on(self, each: Callable[[], object]) -> Iterator[tuple[bool, bool]]:
        """Run to the end; yields at each stop whether a frame and a checkpoint are due."""
        while self.done < len(self.stops):
            stop = self.stops[self.done]
            self.flow.run(stop - self.flow.time, each)
            self.done += 1
            if self._due(0, stop):
                self._note()
            framed = self.case.output.frames is not None and self._due(1, stop)
            yield framed, self._due(2, stop)

    def save(self, path: str | os.PathLike[str], key: str) -> Path:
        """Write a checkpoint, whole or not at all."""
        arrays = {name: np.asarray(value) for name, value in self.flow.save().items()}
        table: dict[str, Any] = {"format": FORMAT, "key": key, "seal": seal_of(arrays)}
        table |= {"history": self.history, "done": self.done}
        with atomic_path(path) as part, open(part, "wb") as stream:
            np.savez(stream, allow_pickle=False, numbers=np.array(json.dumps(table)), **arrays)
        return Path(path)

    def restore(self, path: str | os.PathLike[str], key: str) -> bool:
        """Take up a checkpoint of the same case; returns whether there is one.

        One that is absent, cut or of another case is left alone.
        """
        try:
            with open(path, "rb") as stream, np.load(stream, allow_pickle=False) as stored:
                arrays = {name: stored[name] for name in stored.files}
            numbers = json.loads(str(arrays.pop("numbers")))
            if numbers["seal"] != seal_of(arrays):
                return False
        except Exception:  # what numpy and zipfile raise for a cut file is not documented
            return False
        if numbers.get("format") != FORMAT or numbers.get("key") != key:
            return False
        try:
            history, done = list(numbers["history"]), int(numbers["done"])
            self.flow.restore(arrays)
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(
                f"{path}: this checkpoint does not fit its case ({error}); delete it."
            ) from None
        self.history, self.done = history, done
        return True
