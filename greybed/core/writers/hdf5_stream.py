"""HDF5 files on disks that may be full: the library is closed in order, then the error is told."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any


@contextmanager
def written_hdf5(path: Path, **options: Any) -> Iterator[Any]:
    """An HDF5 file to write.

    Where a write fails, the HDF5 library keeps the file open and crashes the process at its end.
    So it is not told of failures; what it writes afterwards goes nowhere.

    Parameters
    ----------
    path : Path
        A temporary name: after a failure, the file is not whole.
    **options
        Of :class:`h5py.File`.

    Yields
    ------
    file : h5py.File
        Open for writing.

    Raises
    ------
    OSError
        At the end, if a write has failed.
    """
    import h5py

    with open(path, "w+b", buffering=0) as file:
        stream = _Stream(file.fileno())
        with h5py.File(stream, "w", **options) as root:
            yield root
    if stream.error is not None:
        raise stream.error


class _Stream:
    """What h5py needs of a file, on a file descriptor."""

    def __init__(self, descriptor: int) -> None:
        self.descriptor = descriptor
        self.at = self.end = 0
        self.error: OSError | None = None

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Go to a place."""
        self.at = offset + (0, self.at, self.end)[whence]
        return self.at

    def tell(self) -> int:
        """The place."""
        return self.at

    def write(self, data: Any) -> int:
        """Write; nothing after the first failure."""
        view = memoryview(data).cast("B")
        done = 0
        while self.error is None and done < len(view):
            try:
                done += os.pwrite(self.descriptor, view[done:], self.at + done)
            except OSError as error:
                self.error = error
        self.at += len(view)
        self.end = max(self.end, self.at)
        return len(view)

    def readinto(self, buffer: Any) -> int:
        """Read what was written; zeros where it was not."""
        view = memoryview(buffer).cast("B")
        found = os.pread(self.descriptor, len(view), self.at)
        view[: len(found)] = found
        view[len(found) :] = bytes(len(view) - len(found))
        self.at += len(view)
        return len(view)

    def read(self, size: int) -> bytes:
        """Read so many bytes."""
        data = bytearray(size)
        self.readinto(data)
        return bytes(data)

    def truncate(self, size: int | None = None) -> int:
        """Set the length."""
        self.end = self.at if size is None else size
        if self.error is None:
            try:
                os.ftruncate(self.descriptor, self.end)
            except OSError as error:
                self.error = error
        return self.end

    def flush(self) -> None:
        """Nothing waits here."""
