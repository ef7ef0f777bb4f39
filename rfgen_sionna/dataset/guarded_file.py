"""A file that HDF5 writes to on a disk that may be full.

HDF5 does not survive a write that fails: closing the file fails too, and the process may end. Here what cannot be
written stays in memory, so that HDF5 closes the file, and the fault is raised after that.
"""

from __future__ import annotations

import io
import os
from pathlib import Path
from typing import Any


class GuardedFile(io.RawIOBase):
    """New file at `path`, for `h5py.File(file, "w")`; :meth:`check` raises what failed."""

    def __init__(self, path: Path) -> None:
        self._handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_TRUNC, 0o666)
        self._path, self._place, self._size = path, 0, 0
        self._fault: BaseException | None = None
        self._unwritten: list[tuple[int, bytes]] = []

    def check(self) -> None:
        """Raise the first fault, such as an OSError of a full disk."""
        if isinstance(self._fault, OSError):
            raise OSError(self._fault.errno, self._fault.strerror, str(self._path)) from self._fault
        if self._fault is not None:
            raise self._fault

    def write(self, data: Any) -> int:
        """Write all of `data`, or keep it in memory."""
        view = memoryview(data).cast("B")
        done = 0
        try:
            while self._fault is None and done < len(view):
                done += os.pwrite(self._handle, view[done:], self._place + done)
        except BaseException as error:  # an interrupt, too, is raised after HDF5 has closed the file
            self._fault = error
        if done < len(view):
            self._unwritten.append((self._place + done, bytes(view[done:])))
        self._place += len(view)
        self._size = max(self._size, self._place)
        return len(view)

    def readinto(self, buffer: Any) -> int:
        """Read all of `buffer`, zeros beyond the end."""
        view = memoryview(buffer).cast("B")
        stop = self._place + len(view)
        found = os.pread(self._handle, len(view), self._place)
        view[: len(found)] = found
        view[len(found) :] = bytes(len(view) - len(found))
        for start, data in self._unwritten:
            first, last = max(start, self._place), min(start + len(data), stop)
            if first < last:
                view[first - self._place : last - self._place] = data[first - start : last - start]
        self._place = stop
        return len(view)

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Move to a place in the file."""
        start = {os.SEEK_SET: 0, os.SEEK_CUR: self._place, os.SEEK_END: self._size}[whence]
        self._place = start + offset
        return self._place

    def tell(self) -> int:
        """Place in the file."""
        return self._place

    def truncate(self, size: int | None = None) -> int:
        """Give the file its size."""
        self._size = self._place if size is None else size
        try:
            if self._fault is None:
                os.ftruncate(self._handle, self._size)
        except BaseException as error:
            self._fault = error
        return self._size

    def readable(self) -> bool:
        """Whether it can be read."""
        return True

    def writable(self) -> bool:
        """Whether it can be written."""
        return True

    def seekable(self) -> bool:
        """Whether it has places."""
        return True

    def close(self) -> None:
        """Close the file; faults are those of :meth:`check`."""
        if not self.closed:
            os.close(self._handle)
        super().close()
