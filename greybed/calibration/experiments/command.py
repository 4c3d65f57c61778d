"""An experiment that is a command: parameters as TOML into a file, measures as JSON out of one.

This is how another simulator stands in: a script that reads ``input.toml``, writes and runs a
deck (LIGGGHTS through MPI, YADE, ...), and leaves the measures in ``output.json``.
"""

from __future__ import annotations

import json
import os
import shlex
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import tomli_w

from greybed.calibration.experiment import COST, Experiment, Measure, RunFailed, Value
from greybed.core.errors import InputError
from greybed.core.files import sha256_of
from greybed.core.processes import ending_with_parent

INPUT, OUTPUT = "input.toml", "output.json"
_TAIL = 200  # characters of what a failed command said


class CommandExperiment(Experiment):
    """A command that is run in a new folder for each run.

    Parameters
    ----------
    name : str
        Of the experiment.
    command : sequence of str
        Program and arguments; ``{input}``, ``{output}`` and ``{seed}`` are put in. Without
        ``{input}`` and ``{output}`` the two paths come as the last arguments.
    measures : mapping of str to Measure
        What it gives.
    folder : Path
        From which relative paths of files that exist start.
    takes : tuple of str, optional
        Parameters that it knows; all by default.
    settings : mapping, optional
        Table ``settings`` of the input file.
    limit : float
        Seconds after which it is ended and counts as failed [s].

    Raises
    ------
    InputError
        If there is no such program.

    Notes
    -----
    The input file has the tables ``parameters`` and ``settings`` and the number ``seed``. The
    output file is one object: a number for each measure, a pair of lists for each curve, and, if
    known, ``cost``. An exit code other than 0 is a failed run.
    """

    def __init__(
        self, name: str, command: Sequence[str], measures: Mapping[str, Measure], folder: Path,
        takes: tuple[str, ...] | None = None, settings: Mapping[str, Any] | None = None,
        limit: float = 3600.0,
    ) -> None:  # fmt: skip
        self.name, self.measures, self.takes = name, dict(measures), takes
        self.settings, self.limit = dict(settings or {}), limit
        words = [str(word) for word in command]
        if not words:
            raise InputError(f"experiment {name!r}: command is empty; give a program.")
        here = [folder / word for word in words]
        words = [
            str(path.resolve()) if "{" not in word and path.is_file() else word
            for word, path in zip(words, here, strict=True)
        ]
        if shutil.which(words[0]) is None:
            raise InputError(
                f"experiment {name!r}: there is no program {words[0]!r}; install it, or give its "
                "path."
            )
        if not any("{input}" in word for word in words):
            words += ["{input}", "{output}"]
        self.words = words

    def identity(self) -> Any:
        """See :meth:`Experiment.identity`: words, contents of the files that they name."""
        files = [sha256_of(word) for word in self.words if Path(word).is_file()]
        return ["command", self.words, files, self.settings, sorted(self.measures)]

    def run(self, values: Mapping[str, float], seed: int) -> dict[str, Value]:
        """See :meth:`Experiment.run`."""
        known = {k: v for k, v in values.items() if self.takes is None or k in self.takes}
        with tempfile.TemporaryDirectory(prefix="greybed-") as folder:
            given, wanted = Path(folder) / INPUT, Path(folder) / OUTPUT
            table = {"seed": seed, "parameters": known, "settings": self.settings}
            given.write_text(tomli_w.dumps(table))
            place = {"{input}": str(given), "{output}": str(wanted), "{seed}": str(seed)}
            words = []
            for word in self.words:
                for mark, value in place.items():
                    word = word.replace(mark, value)
                words.append(word)
            code, said = _run(words, folder, self.limit)
            if code != 0:
                raise RunFailed(f"{shlex.join(self.words)} ended with {code}: {said}")
            try:
                found = json.loads(wanted.read_text())
            except (OSError, ValueError) as error:
                raise RunFailed(f"{OUTPUT} is not there or no JSON ({error})") from None
        if not isinstance(found, dict):
            raise RunFailed(f"{OUTPUT} holds no object")
        return {k: v for k, v in found.items() if k in self.measures or k == COST}


def _run(words: Sequence[str], folder: str, limit: float) -> tuple[int, str]:
    """Exit code and the end of what was said; what it started ends with it."""
    with subprocess.Popen(
        words, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        errors="replace", start_new_session=True, preexec_fn=ending_with_parent(),
    ) as process:  # fmt: skip
        try:
            said, _ = process.communicate(timeout=limit)
        except subprocess.TimeoutExpired:
            _end(process)
            raise RunFailed(f"it took longer than {limit:g} s") from None
        except BaseException:  # Ctrl-C: no orphan goes on
            _end(process)
            raise
        return process.returncode, said[-_TAIL:].strip()


def _end(process: subprocess.Popen[str]) -> None:
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
