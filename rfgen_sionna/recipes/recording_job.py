"""The work of one recording in a worker: it is made beside its place, and renamed when it is whole."""

from __future__ import annotations

import logging
import os
import shutil
import socket
import sys
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from rfgen_sionna.dataset.whole_files import synced
from rfgen_sionna.recipes.outcome import MAX_REASON, Outcome, OutcomeKind, is_disk_full
from rfgen_sionna.recipes.recipe import Recipe
from rfgen_sionna.recipes.worker_memory import resident_memory
from rfgen_sionna.scene.scene_errors import PlacementError

ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS"), "1")
"""Environment of a worker, which uses one core: its recordings do not depend on the number of cores."""
WITHOUT_GPU = {"CUDA_VISIBLE_DEVICES": ""}
"""Environment of a worker on the CPU."""
WORKER_FOLDER = "worker-"
"""Beginning of the names of the workers' folders."""
MAX_WARNINGS = 10
"""Most warnings of one recording that are reported."""


@dataclass(frozen=True)
class RecordingJob:
    """Makes recordings of a recipe in a folder."""

    recipe: Recipe
    folder: Path
    """Folder of finished recordings that are in no shard yet."""
    device: str = "cpu"
    """Device that sums the paths."""

    def __call__(self, number: int) -> Outcome:
        """Make one recording; its file is there whole or not at all."""
        from rfgen_sionna.recipes.making import make_with_attempts

        started, own = time.monotonic(), self.folder / f"{WORKER_FOLDER}{socket.gethostname()}-{os.getpid()}"
        kind: OutcomeKind = "made"
        reason = ""
        prepare_worker()
        with collected_warnings() as noted:
            try:
                own.mkdir(exist_ok=True)
                made = own / part_name(number)
                attempt = make_with_attempts(self.recipe, number, made, self.device).attempt
                publish(made, self.folder / part_name(number))
            except Exception as error:
                kind = _kind(error)
                attempt = max(0, self.recipe.tables.attempts - 1) if kind == "impossible" else 0
                reason = str(error) if kind == "impossible" else f"{type(error).__name__}: {error}"
                shutil.rmtree(own, ignore_errors=True)
                if kind == "error":
                    logging.getLogger(__name__).error("recording %d", number, exc_info=error)
        seed, memory = self.recipe.recording(number, attempt).seed, resident_memory()
        seconds = time.monotonic() - started
        return Outcome(number, kind, reason[:MAX_REASON], seed, attempt, seconds, memory, tuple(noted[:MAX_WARNINGS]))

    def seed(self, number: int) -> int:
        """Seed of a recording."""
        return self.recipe.recording(number).seed


def _kind(error: Exception) -> OutcomeKind:
    if is_disk_full(error):
        return "disk full"
    return "impossible" if isinstance(error, PlacementError) else "error"


def part_name(number: int) -> str:
    """File name of a finished recording that is in no shard yet."""
    return f"{number:06d}.h5"


def publish(made: Path, target: Path) -> None:
    """Rename a whole file, after it is on the disk."""
    synced(made)
    synced(made.parent)
    os.replace(made, target)


def prepare_worker() -> None:
    """Limit this process to one core."""
    import drjit
    from threadpoolctl import threadpool_limits

    drjit.set_thread_count(1)
    threadpool_limits(1)
    if "torch" in sys.modules:
        sys.modules["torch"].set_num_threads(1)


@contextmanager
def collected_warnings() -> Iterator[list[str]]:
    """Context that collects warnings and log messages of this package instead of showing them."""
    found: list[str] = []

    class Collector(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            add(record.getMessage())

    def add(text: str) -> None:
        if text[:MAX_REASON] not in found:
            found.append(text[:MAX_REASON])

    logger, handler = logging.getLogger("rfgen_sionna"), Collector(logging.WARNING)
    propagates = logger.propagate
    logger.addHandler(handler)
    logger.propagate = False
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("always")
            warnings.showwarning = lambda message, *_, **__: add(str(message))
            yield found
    finally:
        logger.removeHandler(handler)
        logger.propagate = propagates
