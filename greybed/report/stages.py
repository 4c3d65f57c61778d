"""Stages of a long run: each result is kept, so that a killed run continues where it stopped."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed.core.files import atomic_path, output_folder, sha256_of, write_json

Arrays = dict[str, NDArray]
# Plain results, arrays, and the files that a stage wrote.
Result = tuple[dict[str, Any], Arrays, list[Path]]
Work = Callable[[], Result]


class Stages:
    """Runs stages in order and keeps what they give under ``FOLDER/.state``.

    Parameters
    ----------
    folder : Path
        Folder of the run.
    settings : dict
        Everything that decides the results; other settings make a new start.
    say : callable
        Called with one line before each stage.
    """

    def __init__(
        self, folder: Path, settings: dict[str, Any], say: Callable[[str], object] = print
    ) -> None:
        self._root = folder
        self._folder = output_folder(folder / ".state")
        self._key = hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()
        self._say = say
        self.timings: list[dict[str, Any]] = []

    def run(self, name: str, title: str, work: Work) -> tuple[dict[str, Any], Arrays]:
        """Do a stage, or take what an earlier run left of it.

        ``work`` returns plain results, arrays, and the files it wrote; a stage counts as done
        only while those files are as they were written. Stages after one that was done again
        are done again too.
        """
        record = self._folder / f"{name}.json"
        kept = self._kept(record)
        if kept is not None:
            self._say(f"[kept] {title}")
            self.timings.append({"stage": title, "seconds": kept["seconds"]})
            self._key = kept["next"]
            return kept["results"], kept["arrays"]
        self._say(f"[{len(self.timings) + 1}] {title}")
        begin = time.perf_counter()
        results, arrays, files = work()
        seconds = time.perf_counter() - begin
        with atomic_path(record.with_suffix(".npz")) as temporary:
            np.savez_compressed(temporary, **arrays)  # type: ignore[arg-type]
        content = json.loads(json.dumps(results, default=float))
        hashes = {str(p.relative_to(self._root)): sha256_of(p) for p in files}
        follow = hashlib.sha256(
            (self._key + json.dumps(hashes, sort_keys=True)).encode()
        ).hexdigest()
        write_json(
            record,
            {
                "key": self._key,
                "next": follow,
                "seconds": seconds,
                "files": hashes,
                "results": content,
            },
        )
        self._key = follow
        self.timings.append({"stage": title, "seconds": seconds})
        return content, arrays

    def _kept(self, record: Path) -> dict[str, Any] | None:
        try:
            content = json.loads(record.read_text())
            same = content["key"] == self._key
            # Opened here, for numpy would leave a damaged file open.
            with (
                open(record.with_suffix(".npz"), "rb") as stream,
                np.load(stream, allow_pickle=False) as archive,
            ):
                content["arrays"] = {key: archive[key] for key in archive.files}
            whole = all(
                sha256_of(self._root / name) == digest for name, digest in content["files"].items()
            )
        except Exception:  # absent, or cut as after a power failure: this stage is done again
            return None
        return content if same and whole else None
