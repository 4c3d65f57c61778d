"""Locks of places on disk: two runs never write into the same folder at the same time."""

from __future__ import annotations

import os
import re
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from greybed.core.errors import OutputError
from greybed.core.files import output_folder

LOCK = ".greybed.lock"
# A run that was killed may need a moment until the last of its processes is gone.
PATIENCE = 1.0  # [s]
# Names of :func:`greybed.core.files.atomic_path`, with the process that writes there.
_PART = re.compile(r"\..*\.(\d+)\.part(\..*)?")


@contextmanager
def locked_folder(path: str | os.PathLike[str], patience: float | None = None) -> Iterator[Path]:
    """Make the folder of a run's results and hold it: every verb writes inside this block.

    What killed runs had begun to write there, under temporary names, is removed.

    Parameters
    ----------
    path : path
        The folder; made if it is not there.
    patience : float, optional
        How long to wait for another run's end before it is refused [s]; ``PATIENCE`` if left out.

    Yields
    ------
    folder : Path
        The same as a Path.

    Raises
    ------
    OutputError
        If it cannot be written to, or another run holds it.
    """
    folder = output_folder(path)
    with sole_writer(folder / LOCK, patience):
        _tidy(folder)
        yield folder


@contextmanager
def sole_writer(path: str | os.PathLike[str], patience: float | None = None) -> Iterator[None]:
    """Hold the lock file ``path``, so that no two runs keep their finished parts in one place.

    The system frees the lock of a run that ends in whatever way: none is ever stale.

    Raises
    ------
    OutputError
        If another run holds it, and still does after ``patience`` [s].
    """
    lock = Path(path)
    try:
        import fcntl
    except ImportError:  # Windows: two runs at once are the user's to avoid
        yield
        return
    end = time.monotonic() + (PATIENCE if patience is None else patience)
    while True:
        try:
            stream = open(lock, "a+")  # noqa: SIM115
        except OSError as error:
            raise OutputError(
                f"{lock}: cannot write this file ({error.strerror or error}); choose another "
                "folder, free space, or change its permissions."
            ) from None
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            stream.seek(0)
            holder = stream.read(20).strip() or "unknown"
            stream.close()
            if time.monotonic() < end:
                time.sleep(0.02)
                continue
            raise OutputError(
                f"{lock.parent}: another run (process {holder}) is writing there; wait for its "
                "end, or choose another place with --out."
            ) from None
        except OSError as error:
            print(
                f"note: {lock.parent}: this file system has no locks ({error.strerror or error}); "
                "do not let a second run write there before this one ends.",
                file=sys.stderr,
            )
        # The holder before may have removed the file between our two calls.
        with suppress(OSError):
            if os.path.samestat(os.fstat(stream.fileno()), lock.stat()):
                break
        stream.close()
    try:
        with suppress(OSError):  # the number is for the message only
            stream.truncate(0)
            stream.write(f"{os.getpid()}\n")
            stream.flush()
        yield
    finally:
        with suppress(OSError):
            lock.unlink(missing_ok=True)
        with suppress(OSError):
            stream.close()


def _tidy(folder: Path) -> None:
    for path in folder.glob(".*.part*"):
        known = _PART.fullmatch(path.name)
        if known and not _lives(int(known[1])):
            with suppress(OSError):
                path.unlink()


def _lives(process: int) -> bool:
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:  # it is somebody else's
        return True
    return True
