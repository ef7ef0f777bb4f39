"""What became of one recording of a data set, and which errors mean a full disk."""

from __future__ import annotations

import errno
import sqlite3
from dataclasses import asdict, dataclass
from typing import Any, Literal, Protocol

OutcomeKind = Literal["made", "impossible", "error", "crashed", "disk full"]
"""Impossible: no draw of the recipe can be made, which no further try changes. Error: a fault of the
program, of a file or of the disk, which a later call tries again.
Crashed: the worker's process ended twice."""
FINAL = ("made", "impossible")
"""Kinds of outcomes that a further try does not change."""
MAX_REASON = 2000
"""Most characters of a reason."""
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_FULL_TEXTS = (
    "no space left",
    "disk quota exceeded",
    "disk is full",
    "file too large",
    *(f"errno = {n}" for n in _FULL),
)


@dataclass(frozen=True)
class Outcome:
    """What became of one recording."""

    number: int
    kind: OutcomeKind
    reason: str = ""
    seed: int = 0
    """Seed of the last draw."""
    attempt: int = 0
    """Number of draws before the one that was made."""
    seconds: float = 0.0
    """Time of the worker [s]."""
    memory: int = 0
    """Memory of the worker at the end [bytes]; 0 where it is unknown."""
    warnings: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """The record as JSON holds it."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Outcome:
        """The record of such a dictionary."""
        return cls(**{**values, "warnings": tuple(values["warnings"])})


class Job(Protocol):
    """Work of one recording; it is sent to the workers, and never raises for what is wrong with a recording."""

    def __call__(self, number: int) -> Outcome: ...


class BuildJob(Job, Protocol):
    """Work of a build."""

    def seed(self, number: int) -> int:
        """Seed of a recording."""
        ...


def is_disk_full(error: BaseException | None) -> bool:
    """Whether an error, or one of its causes, means that the disk has no room."""
    from rfgen_sionna.dataset.disk_space import DiskSpaceError  # a worker that has not begun needs no arrays

    while error is not None:
        if isinstance(error, DiskSpaceError) or getattr(error, "errno", None) in _FULL:
            return True
        storing = isinstance(error, (OSError, RuntimeError, sqlite3.Error))  # HDF5 raises the latter two by text alone
        if storing and any(text in str(error).lower() for text in _FULL_TEXTS):
            return True
        error = error.__cause__ or error.__context__
    return False
