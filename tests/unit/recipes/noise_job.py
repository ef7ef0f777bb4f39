"""A job that writes runs of noise, and engines of one process, for tests of builds."""

from __future__ import annotations

import os
import time
from collections.abc import Generator, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rfgen_sionna.dataset import RunInfo, RunWriter
from rfgen_sionna.radar import Radar
from rfgen_sionna.recipes.outcome import Job, Outcome, is_disk_full
from rfgen_sionna.recipes.recipe import Recipe
from rfgen_sionna.recipes.recording_job import WORKER_FOLDER, part_name, publish


@dataclass(frozen=True)
class NoiseJob:
    """Writes runs of noise, which depend on the number alone, as a build's own job does."""

    recipe: Recipe
    folder: Path
    radar: Radar
    impossible: tuple[int, ...] = ()
    full: tuple[int, ...] = ()
    """Recordings at which the disk is full."""
    frames: int = 2
    seconds: float = 0.0

    def __call__(self, number: int) -> Outcome:
        seed = self.recipe.recording(number).seed
        if number in self.impossible:
            return Outcome(number, "impossible", "somebody is in a wall", seed)
        if number in self.full:
            return Outcome(number, "disk full", "no space left")
        time.sleep(self.seconds)
        own = self.folder / f"{WORKER_FOLDER}{os.getpid()}"
        try:
            own.mkdir(exist_ok=True)
            self._write(own / part_name(number), number)
            publish(own / part_name(number), self.folder / part_name(number))
        except OSError as error:
            return Outcome(number, "disk full" if is_disk_full(error) else "error", str(error), seed)
        return Outcome(number, "made", seed=seed, warnings=("a warning",) if number % 2 else ())

    def seed(self, number: int) -> int:
        return self.recipe.recording(number).seed

    def _write(self, path: Path, number: int) -> None:
        rng = np.random.default_rng(number)
        info = RunInfo(
            self.radar, prompt="noise", seeds={"noise": number}, recording=self.recipe.recording(number).to_dict()
        )
        with RunWriter(path, info, overwrite=True, compressed=True, dated=False) as writer:
            for frame in range(self.frames):
                parts = rng.standard_normal((2, *self.radar.frame_shape))
                writer.append(1e-6 * (parts[0] + 1j * parts[1]), time=0.1 * frame)


class InlineEngine:
    """Engine of the driver's own process."""

    def outcomes(self, job: Job, numbers: Iterable[int]) -> Generator[Outcome, None, None]:
        yield from map(job, numbers)


NOISE_COUNT = 7
"""Recordings of the recipe of noise."""


class EndingEngine:
    """Ends after a number of recordings as a killed driver does: nothing more is run."""

    def __init__(self, count: int) -> None:
        self.count = count

    def outcomes(self, job: Job, numbers: Iterable[int]) -> Generator[Outcome, None, None]:
        for done, number in enumerate(numbers):
            if done == self.count:
                raise KeyboardInterrupt
            yield job(number)


class CrashingEngine:
    """Reports one recording as one whose worker crashed."""

    def outcomes(self, job: Job, numbers: Iterable[int]) -> Generator[Outcome, None, None]:
        for number in numbers:
            yield Outcome(number, "crashed", "signal SIGKILL") if number == 4 else job(number)
