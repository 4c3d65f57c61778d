"""Writing results: whole files or none, summaries with their provenance, clear refusals."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from greybed._version import __version__
from greybed.core.errors import OutputError


def output_folder(path: str | os.PathLike[str]) -> Path:
    """Make ``path`` and check that files can be written there.

    Raises
    ------
    OutputError
        If it cannot be made or written to.
    """
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise OutputError(
            f"{folder}: cannot write to this folder ({error.strerror or error}); "
            "choose another with --out or change its permissions."
        ) from None
    return folder


def writable_file(path: str | os.PathLike[str]) -> Path:
    """Refuse a place for a file that is taken by a folder or a device, before any work.

    Raises
    ------
    OutputError
        If it is, or if the name cannot be that of a file.
    """
    target = Path(path)
    try:
        taken = not target.name or (target.exists() and not target.is_file())
    except OSError as error:
        raise OutputError(
            f"{target}: cannot write this file ({error.strerror or error}); choose another name."
        ) from None
    if taken:
        raise OutputError(
            f"{target}: this is a folder or a device, not a place for a file; name a file."
        )
    return target


def reason_of(error: OSError) -> str:
    """What the system said; the HDF5 library puts it into a page of text."""
    told = re.search(r"error message = '([^']*)'", str(error))
    return told[1] if told else (error.strerror or str(error))


@contextmanager
def atomic_path(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a temporary path beside ``path`` that takes its place only when the block succeeds.

    A killed run leaves the old file or none under the final name, never half of one.
    """
    target = writable_file(path)
    # The suffix stays last because some writers choose their format by it.
    temporary = target.with_name(f".{target.stem}.{os.getpid()}.part{target.suffix}")
    try:
        yield temporary
        os.replace(temporary, target)
    except OSError as error:
        raise OutputError(
            f"{target}: cannot write this file ({reason_of(error)}); choose another "
            "folder, free space, or change its permissions."
        ) from None
    finally:
        with suppress(OSError):  # no such folder, a name too long: told above
            temporary.unlink(missing_ok=True)


def sha256_of(path: str | os.PathLike[str]) -> str:
    """SHA-256 of a file's bytes, as hexadecimal digits."""
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def provenance(*inputs: str | os.PathLike[str], seed: int | None = None) -> dict[str, Any]:
    """Who made a result from what: versions, seed, and the hash of every input file."""
    record: dict[str, Any] = {
        "greybed": __version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
    }
    if seed is not None:
        record["seed"] = seed
    if inputs:
        record["inputs"] = {Path(path).name: sha256_of(path) for path in inputs}
    return record


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    raise TypeError(f"{type(value).__name__} has no plain form for JSON")


def write_json(path: str | os.PathLike[str], content: Any) -> Path:
    """Write ``content`` as indented JSON, whole or not at all."""
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(content, indent=2, default=_plain) + "\n")
    return Path(path)


def write_summary(
    folder: str | os.PathLike[str],
    verb: str,
    results: dict[str, Any],
    *inputs: str | os.PathLike[str],
    seed: int | None = None,
) -> Path:
    """Write ``summary.json``: the verb, its results, and the provenance."""
    content = {"verb": verb, **results, "provenance": provenance(*inputs, seed=seed)}
    return write_json(Path(folder) / "summary.json", content)
