"""Results of the papers' runs: a JSON file that grows, so that a stopped script goes on."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

from greybed.calibration.experiment import Experiment, RunFailed

HERE = Path(__file__).parent / "results"


class Record:
    """Runs by their names, kept in ``results/NAME.json``."""

    def __init__(self, name: str, about: str) -> None:
        self.path = HERE / f"{name}.json"
        self.content: dict[str, Any] = {"about": about, "runs": {}}
        if self.path.exists():
            self.content = json.loads(self.path.read_text()) | {"about": about}

    @property
    def runs(self) -> dict[str, dict[str, Any]]:
        """What there is."""
        return self.content["runs"]

    def make(
        self, key: str, experiment: Experiment, values: dict[str, float], seed: int
    ) -> dict[str, Any]:
        """A run, made once: its scalars, and the processor time that it took."""
        if key not in self.runs:
            begin = time.process_time()
            try:
                found = experiment.run(values, seed)
                kept = {k: round(v, 6) for k, v in found.items() if isinstance(v, float)}
            except RunFailed as failed:
                kept = {"failed": str(failed)}
            kept["cpu_s"] = round(time.process_time() - begin, 1)
            self.runs[key] = kept
            print(key, kept, flush=True)
            self.save()
        return self.runs[key]

    def save(self) -> None:
        """Write what there is."""
        HERE.mkdir(exist_ok=True)
        self.path.write_text(json.dumps(self.content, indent=1) + "\n")
