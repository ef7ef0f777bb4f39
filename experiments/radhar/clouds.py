"""Point clouds of simulated samples, as RadHAR's board reports them: rooms, clutter, noise and the board's chain.

Samples of a person are those of free space: the person's shadow on the room and the paths over both are left out.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from experiments.radhar.recordings import FRAME_RATE_HZ, CloudRecording, from_board_points
from experiments.radhar.surroundings import FLOOR_DB, floor_clutter, radhar_radar
from rfgen_sionna.dataset import open_dataset
from rfgen_sionna.processing.boards import OutOfBoxChain, out_of_box_points
from rfgen_sionna.radar import Radar
from rfgen_sionna.signal.noise import noise_power

LOSS_DB = (12.0, 20.0)
"""Attenuation of people's samples [dB]: about that which gives the levels of RadHAR's first recordings, 15 dB
(:mod:`experiments.radhar.chain_fit`), as people and clothes differ."""
FOLDER_OF_ACTION = {
    "boxing": "boxing", "jumping_jacks": "jack", "hop": "jump", "squat": "squats", "walk_in_a_circle": "walk",
    "walk": "walk",
}  # fmt: skip
"""RadHAR's name of an action of the package."""


@dataclass(frozen=True)
class Surroundings:
    """What is added to the samples of people."""

    rooms: Path | None = None
    """Folder with `room-*.npy` (:mod:`experiments.radhar.surroundings`), one for each recording in turn; None is free
    space without a floor."""
    floor_db: float = FLOOR_DB
    """Backscatter of the floor of a room [dB]."""
    loss_db: tuple[float, float] = LOSS_DB
    """Range of the attenuation of people's samples, drawn for each cloud [dB]."""
    noise: bool = True
    """Whether samples have the thermal noise of the receiver."""
    chain: OutOfBoxChain = field(default_factory=OutOfBoxChain)
    """The board's chain."""


def simulated_clouds(
    folder: Path, around: Surroundings, *, repeats: int = 1, numbers: Collection[int] | None = None
) -> list[CloudRecording]:
    """Point clouds of the recordings of a data set built from `recipe.toml`.

    Parameters
    ----------
    repeats
        Clouds of each recording, each with another room, floor, noise, attenuation and choice of lost frames.
    numbers
        Recordings of the recipe to take; None takes all.
    """
    files = [] if around.rooms is None else sorted(around.rooms.glob("room-*.npy"))
    if around.rooms is not None and not files:
        raise FileNotFoundError(f"{around.rooms}: no room-*.npy; make some with experiments.radhar.surroundings")
    rooms, radar = [np.load(file) for file in files], radhar_radar()
    found = []
    with open_dataset(folder) as recordings:
        for row in recordings.rows:
            if numbers is not None and row.number not in numbers:
                continue
            samples = recordings.recording(row.number).cube().data.astype(np.complex64)
            activity = FOLDER_OF_ACTION[row.actions[0]]
            for repeat in range(repeats):
                seed = 100 * row.number + repeat
                rng = np.random.default_rng(np.random.SeedSequence([54, 2, seed]))
                count = round(len(samples) * FRAME_RATE_HZ * radar.waveform.frame_period)
                kept = np.sort(rng.choice(len(samples), count, replace=False))
                cube = samples[kept] * np.float32(10 ** (-rng.uniform(*around.loss_db) / 20))
                if rooms:
                    cube += rooms[seed % len(rooms)] + floor_clutter(radar, seed, around.floor_db)
                points = out_of_box_points(noisy(cube, radar, seed) if around.noise else cube, radar, around.chain)
                found.append(from_board_points(points, activity, f"{row.number}-{repeat}"))
    return found


def noisy(cube: np.ndarray, radar: Radar, seed: int) -> np.ndarray:
    """Samples with the thermal noise of the radar's receiver."""
    rng = np.random.default_rng(np.random.SeedSequence([54, seed]))
    sigma = np.float32(np.sqrt(noise_power(radar) / 2))
    noise = rng.standard_normal(cube.shape, dtype=np.float32) + 1j * rng.standard_normal(cube.shape, dtype=np.float32)
    return (cube + sigma * noise).astype(np.complex64)
