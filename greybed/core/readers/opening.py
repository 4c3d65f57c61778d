"""Opening particle files: the checks that come before any parsing, and a cursor over lines."""

from __future__ import annotations

import mmap
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from greybed.core.errors import InputError

_CHUNK = 1 << 24


def shown(text: str | bytes, longest: int = 40) -> str:
    """``text`` from a file as it may stand in a one-line message: quoted, escaped, cut short."""
    if isinstance(text, bytes):
        text = text[: longest + 1].decode("utf-8", "replace")
    return repr(text if len(text) <= longest else text[:longest] + "...")


def listed(names: list[str], most: int = 12) -> str:
    """Column or array names as they may stand in a one-line message."""
    words = [shown(name, 24)[1:-1] for name in names[:most]]
    return ", ".join(words + (["..."] if len(names) > most else [])) or "none"


@contextmanager
def mapped(path: Path) -> Iterator[mmap.mmap]:
    """Give the bytes of a regular file, paged in as they are used.

    Raises
    ------
    InputError
        If the file is missing, a folder, a device, empty, or may not be read.
    """
    try:
        mode = path.stat().st_mode
        if stat.S_ISDIR(mode):
            raise InputError(f"{path}: this is a folder; give a file inside it.")
        if not stat.S_ISREG(mode):
            raise InputError(f"{path}: this is not a regular file; save the data to a file first.")
        with open(path, "rb") as stream:
            if os.fstat(stream.fileno()).st_size == 0:
                raise InputError(f"{path}: the file is empty; write it again or give another file.")
            data = mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ)
    except FileNotFoundError:
        raise InputError(
            f"{path}: there is no such file; check the name, or the folder you are in."
        ) from None
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        reason = getattr(error, "strerror", None) or error
        raise InputError(
            f"{path}: cannot be read ({reason}); change its permissions or give another file."
        ) from None
    try:
        yield data
    finally:
        data.close()


class Cursor:
    """A place in the bytes of a file, moved forward line by line.

    Parameters
    ----------
    path : Path
        The file, for messages.
    data : bytes or mmap
        Its content.
    position : int
        Byte to start at.
    """

    def __init__(self, path: Path, data: bytes | mmap.mmap, position: int = 0) -> None:
        self.path = path
        self.data = data
        self.position = position
        self.start = position

    def line(self, *, blanks: bool = False) -> str | None:
        """Next line without its end and outer spaces, or None after the last.

        Lines without content are passed over unless ``blanks``; bytes that are not ASCII
        become question marks, for no keyword holds any.
        """
        while self.position < len(self.data):
            self.start = self.position
            end = self.data.find(b"\n", self.start)
            self.position = len(self.data) if end < 0 else end + 1
            # A line that never ends is no header line: 10,000 bytes show that well enough.
            raw = self.data[self.start : min(self.position, self.start + 10_000)]
            text = raw.decode("ascii", "replace").strip()
            if text or blanks:
                return text
        self.start = len(self.data)
        return None

    def line_number(self, position: int | None = None) -> int:
        """Number, from 1, of the line with byte ``position`` (default: the line last read)."""
        position = self.start if position is None else position
        count = 1
        for low in range(0, position, _CHUNK):
            count += self.data[low : min(low + _CHUNK, position)].count(b"\n")
        return count

    @property
    def here(self) -> str:
        """File and line last read, as messages begin."""
        return f"{self.path}: line {self.line_number()}"
