"""The kinematic half of the training data: many varied clips, written once to a folder and read again."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.diffusion.features import FRAME_RATE
from rfgen_sionna.generative.diffusion.phrasebook import CLAUSES
from rfgen_sionna.generative.motion import ACTIONS, JOINT_NAMES, MEAN_ADULT, PARENTS, KinematicSource
from rfgen_sionna.records import Motion

CLIP_SECONDS = 8.0
_BLOCK = 25
_SPEEDS = (0.75, 1.3)


@dataclass(frozen=True)
class Clip:
    """One synthesised motion and what it was asked for."""

    action: str
    hand: str
    """The working hand of a one-handed action, else empty."""
    speed: float
    """Factor on the action's usual speed."""
    seed: int
    motion: Motion


def synthesise(
    folder: Path,
    per_action: int,
    *,
    seed: int = 0,
    workers: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> list[Path]:
    """Write `per_action` clips of each action, in files of 25; files that exist are kept.

    Args:
        folder: made if it is missing.
        per_action: rounded up to whole files.
        seed: first number of every clip's seed.
        workers: processes to use.
        progress: called with (files there, files wanted).
    """
    folder.mkdir(parents=True, exist_ok=True)
    blocks = -(-per_action // _BLOCK)
    jobs = [(folder / f"{action}-{seed}-{b:03d}.npz", action, seed, b) for b in range(blocks) for action in CLAUSES]
    missing = [job for job in jobs if not job[0].is_file()]
    done = len(jobs) - len(missing)
    if progress is not None:
        progress(done, len(jobs))
    with ProcessPoolExecutor(workers) if workers > 1 else _Inline() as pool:
        for _ in pool.map(_write_block, missing):
            done += 1
            if progress is not None:
                progress(done, len(jobs))
    return [job[0] for job in jobs]


def read_clips(path: Path) -> Iterator[Clip]:
    """The clips of one file."""
    with np.load(path, allow_pickle=False) as data:
        block = {key: data[key] for key in data.files}
    for k in range(len(block["seed"])):
        hand = str(block["hand"][k])
        yield Clip(
            str(block["action"]),
            hand,
            float(block["speed"][k]),
            int(block["seed"][k]),
            Motion(
                rotations=block["rotations"][k].astype(np.float64),
                translation=block["translation"][k].astype(np.float64),
                frame_rate=FRAME_RATE,
                joint_names=JOINT_NAMES,
                parents=PARENTS,
                offsets=block["offsets"],
                contacts=block["contacts"][k],
                action=str(block["action"]),
                seed=int(block["seed"][k]),
            ),
        )


class _Inline:
    """Stands in for a process pool where one process does the work."""

    def __enter__(self) -> _Inline:
        return self

    def __exit__(self, *exc: object) -> None:
        return None

    def map(
        self, work: Callable[[tuple[Path, str, int, int]], None], jobs: list[tuple[Path, str, int, int]]
    ) -> Iterator[None]:
        return map(work, jobs)


def _write_block(job: tuple[Path, str, int, int]) -> None:
    path, action, seed, block = job
    rng = np.random.default_rng([seed, list(ACTIONS).index(action), block])
    source = KinematicSource(FRAME_RATE)
    rotations: list[FloatArray] = []
    translations: list[FloatArray] = []
    contacts: list[NDArray[np.bool_]] = []
    hands: list[str] = []
    speeds: list[float] = []
    seeds: list[int] = []
    for k in range(_BLOCK):
        # a different number for every clip of the set, whatever order files are written in
        clip_seed = int(rng.integers(2**31))
        # both hands equally: the synthesiser's own right-handedness is put back when captions leave the hand open
        hand = ("left", "right")[k % 2] if ACTIONS[action].one_handed else None
        low, high = np.log(_SPEEDS)
        speed = float(np.exp(rng.uniform(low, high)))
        motion = source(action, CLIP_SECONDS, clip_seed, hand=hand, speed=speed)
        planted = motion.contacts
        if planted is None:
            raise RuntimeError(f"the synthesiser gave no contacts for {action}")
        rotations.append(motion.rotations.astype(np.float32))
        translations.append(motion.translation.astype(np.float32))
        contacts.append(planted)
        hands.append(hand or "")
        speeds.append(speed)
        seeds.append(clip_seed)
    partial = path.with_suffix(f".{os.getpid()}.part.npz")
    np.savez(
        partial,
        action=np.array(action),
        rotations=np.stack(rotations),
        translation=np.stack(translations),
        contacts=np.stack(contacts),
        hand=np.array(hands),
        speed=np.array(speeds),
        seed=np.array(seeds),
        offsets=MEAN_ADULT.offsets,
    )
    # appears whole or not at all, so a run that was stopped can be taken up again
    partial.replace(path)
