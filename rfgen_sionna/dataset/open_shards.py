"""Open shards of a data set, for several recordings and processes."""

from __future__ import annotations

import os
from collections import OrderedDict
from pathlib import Path
from threading import RLock
from typing import Any

import h5py

from rfgen_sionna.dataset.run_file import check_format, open_hdf5
from rfgen_sionna.dataset.schema import SHARD_FORMAT
from rfgen_sionna.dataset.verified_files import VerifiedFiles

MAX_OPEN = 32
"""Number of shards that stay open."""


class OpenShards:
    """Shards of a set, opened when first needed, once verified; the least recently used ones are closed again.

    A copy in another process, pickled or inherited by a fork, opens its own files.
    """

    def __init__(self, verified: VerifiedFiles) -> None:
        self._verified = verified
        self.checked: set[tuple[Path, str]] = set()
        """Files and groups in them that are known to be runs."""
        self._start()

    def _start(self) -> None:
        self._files: OrderedDict[Path, h5py.File] = OrderedDict()
        self._process, self._lock = os.getpid(), RLock()

    def __getstate__(self) -> dict[str, Any]:
        return {"_verified": self._verified, "checked": self.checked}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self._verified, self.checked = state["_verified"], state["checked"]
        self._start()

    def file(self, path: Path) -> h5py.File:
        """The shard at `path`, open for reading in this process.

        Raises
        ------
        ChecksumError
            If it is not the file that was written.
        RunFormatError
            If it is no shard.
        """
        if self._process != os.getpid():
            for inherited in self._files.values():
                inherited.close()  # HDF5 would share the handle with a file that is open
            self._start()
        with self._lock:
            found = self._files.pop(path, None)
            if not found:
                self._verified.check(path.name)
                found = open_hdf5(path)
                check_format(path, found, SHARD_FORMAT)
            self._files[path] = found
            while len(self._files) > MAX_OPEN:
                self._files.popitem(last=False)  # closed with the last run that reads it
            return found

    def close(self) -> None:
        """Close all shards."""
        with self._lock:
            for file in self._files.values():
                file.close()
            self._files.clear()
