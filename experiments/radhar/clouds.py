"""Point clouds of simulated samples, as RadHAR's board reports them: rooms, noise and the board's chain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from experiments.radhar.recordings import CloudRecording, from_board_points
from experiments.radhar.synthesis import ACTIVITIES, radhar_radar
from rfgen_sionna.processing.boards import OutOfBoxChain, out_of_box_points
from rfgen_sionna.radar import Radar
from rfgen_sionna.signal.noise import noise_power


def simulated_clouds(
    folder: Path,
    chain: OutOfBoxChain | None = None,
    *,
    rooms: bool = True,
    loss_db: float = 0.0,
    names: Sequence[str] | None = None,
) -> list[CloudRecording]:
    """Point clouds of all recordings of `folder` (:mod:`experiments.radhar.synthesis`), by activity and name.

    Parameters
    ----------
    rooms
        Whether each recording has the static samples of an empty room, in turn.
    loss_db
        Attenuation of all samples against the noise [dB].
    names
        Recordings to take; None takes all.
    """
    chain, radar = OutOfBoxChain() if chain is None else chain, radhar_radar()
    empty = [np.load(file) for file in sorted(folder.glob("room-*.npy"))] if rooms else []
    if rooms and not empty:
        raise FileNotFoundError(f"{folder}: no room-*.npy; make some with experiments.radhar.synthesis --rooms 8")
    found = []
    for activity in ACTIVITIES:
        for file in sorted(folder.glob(f"{activity}-*.npy")):
            if names is None or file.stem in names:
                number = int(file.stem.split("-")[-1])
                cube = np.load(file)
                if empty:
                    cube += empty[(number + ACTIVITIES.index(activity)) % len(empty)]
                points = out_of_box_points(noisy(cube, radar, number, loss_db), radar, chain)
                found.append(from_board_points(points, activity, file.stem))
    return found


def noisy(cube: np.ndarray, radar: Radar, seed: int, loss_db: float = 0.0) -> np.ndarray:
    """Samples after an attenuation, with the thermal noise of the radar's receiver."""
    rng = np.random.default_rng(np.random.SeedSequence([54, seed]))
    sigma = np.float32(np.sqrt(noise_power(radar) / 2))
    noise = rng.standard_normal(cube.shape, dtype=np.float32) + 1j * rng.standard_normal(cube.shape, dtype=np.float32)
    return (cube * np.float32(10 ** (-loss_db / 20)) + sigma * noise).astype(np.complex64)


def without_clutter(chain: OutOfBoxChain) -> OutOfBoxChain:
    """The chain with removal of static clutter."""
    return replace(chain, clutter_removal=True)
