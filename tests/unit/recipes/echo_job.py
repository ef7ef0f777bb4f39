"""A job that only says who did it, for tests of engines; its processes start at once."""

from __future__ import annotations

import os
import signal
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rfgen_sionna.recipes.outcome import Outcome
from rfgen_sionna.recipes.worker_memory import resident_memory


@dataclass(frozen=True)
class EchoJob:
    """Says who has made a recording; `deadly` ones end the worker, as often as they say."""

    folder: Path
    deadly: dict[int, int] = field(default_factory=dict)
    """Number -> how often."""
    seconds: float = 0.0
    waits: dict[int, float] = field(default_factory=dict)
    """Number -> further time [s]."""
    starts_to_end: int = 0
    """Processes that end before they have the job."""

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        starts = len(list(self.folder.glob("start-*")))
        if starts < self.starts_to_end:
            (self.folder / f"start-{os.getpid()}").touch()
            if starts + 1 == self.starts_to_end:
                raise MemoryError("no memory for a worker")
            os.kill(os.getpid(), signal.SIGKILL)

    def __call__(self, number: int) -> Outcome:
        (self.folder / f"pid-{os.getpid()}").touch()
        time.sleep(self.seconds + self.waits.get(number, 0.0))
        tries = len(list(self.folder.glob(f"end-{number}-*")))
        if tries < self.deadly.get(number, 0):
            (self.folder / f"end-{number}-{tries}").touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return Outcome(number, "made", str(os.getpid()), memory=resident_memory())

    def seed(self, number: int) -> int:
        return number
