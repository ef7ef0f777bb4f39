"""Sets of five activities before a small radar, and their range-Doppler sequences as arrays.

Motion is by the rules of movement, without captured clips: sets of different seeds share no clip. People, motions and
noise of two sets differ by their seeds, rooms by their layouts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.dataset import Run
from rfgen_sionna.dataset.torch import RadarDataset
from rfgen_sionna.processing import range_doppler_power
from rfgen_sionna.recipes import Recipe
from rfgen_sionna.signal.noise import noise_power

PROMPTS = (
    "a person walks to and fro", "a person does jumping jacks", "a person boxes", "a person waves",
    "a person marches in place",
)  # fmt: skip
"""One prompt an activity."""
SEEN = ("furnished: a living room", "furnished: an office", "furnished: a corridor")
"""Kinds of places of training."""
UNSEEN = ("furnished: a bedroom", "furnished: a classroom", "furnished: a lab")
"""Kinds of places of the test in places that nobody has trained in."""
ADULTS = "gender = ['female', 'male']\nage_years = {range = [18.0, 75.0]}\n"
"""Table `[bodies]` of adults of all ages."""
RANGE_BINS, VELOCITY_BINS = 64, 32
"""Cells of a map: two range bins of 4.7 cm each, and Doppler bins of 0.46 m/s."""
SPAN_DB = (-125.0, -50.0)
"""Power of a cell [dBm] that counts as 0 and as 1."""

Sequences = NDArray[np.float32]


@dataclass(frozen=True)
class ActivitySet:
    """Range-Doppler sequences with their activities."""

    maps: Sequences
    """(recording, frame, range, velocity), 0 … 1."""
    activity: NDArray[np.int64]
    """(recording,) number of the activity, in the order of the classes."""
    classes: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.maps)

    def joined(self, maps: Sequences) -> ActivitySet:
        """Twice the recordings: these, and the same activities by other maps."""
        return ActivitySet(np.concatenate([self.maps, maps]), np.tile(self.activity, 2), self.classes)

    def and_also(self, other: ActivitySet) -> ActivitySet:
        """The recordings of both."""
        if self.classes != other.classes:
            raise ValueError(f"sets have the classes {self.classes} and {other.classes}: the same ones are needed")
        activity = np.concatenate([self.activity, other.activity])
        return ActivitySet(np.concatenate([self.maps, other.maps]), activity, self.classes)


def activity_recipe(
    count: int,
    seed: int,
    duration_s: float,
    *,
    places: tuple[str, ...] = (),
    layouts: int | None = None,
    distance_m: tuple[float, float] | None = None,
    azimuth_deg: float = 0.0,
    orientation_deg: float = 0.0,
    bodies: str = "",
    splits: str = "",
) -> Recipe:
    """Recordings of the five activities in turn.

    Parameters
    ----------
    count, seed, duration_s
        As in recipes.
    places, layouts
        Surroundings, and the number of layouts of each; none is free space.
    distance_m
        Range of distances [m]; None leaves the generator's own, 3 m.
    azimuth_deg, orientation_deg
        Largest angles to either side [degrees]; 0 leaves the generator's own, ahead and facing the radar.
    bodies, splits
        Keys of these tables.
    """
    lines = [
        f"count = {count}", f"seed = {seed}", f"duration_s = {duration_s}", f"prompts = {{grid = {list(PROMPTS)}}}",
        'motion = "kinematic"', 'radar = "awr1642boost"', 'preset = "sdk1"', "rtol = 0.05",
        "receiver = {adc = {bits = 16, full_scale_dbm = -26.0}}", 'keep = ["adc", "labels"]',
    ]  # fmt: skip
    if places:
        lines.append(f"places = {{choice = {list(places)}}}")
    if layouts is not None:
        lines.append(f"layouts = {layouts}")
    if distance_m is not None:
        lines.append(f"distance_m = {{range = {list(distance_m)}}}")
    for name, value in (("azimuth_deg", azimuth_deg), ("orientation_deg", orientation_deg)):
        if value:
            lines.append(f"{name} = {{range = [{-value}, {value}]}}")
    text = "\n".join(lines) + "\n"
    text += f"[bodies]\n{bodies}" if bodies else ""
    return Recipe.parse(text + (f"[splits]\n{splits}" if splits else ""))


def activity_set(folder: Path, split: str | None = None, noise_db: tuple[float, float] | None = None) -> ActivitySet:
    """Sequences of a built set.

    Parameters
    ----------
    folder, split
        The set, and its split; None takes all recordings.
    noise_db
        White Gaussian noise is added to the samples, in each recording of a level drawn from this range over that of
        the receiver [dB], by the recording's seed; None adds none.
    """
    data = RadarDataset(folder, split, _maps(noise_db), "action")
    maps, activity = zip(*(data[index] for index in range(len(data))), strict=True)
    return ActivitySet(np.stack([each.numpy() for each in maps]), np.array(activity, np.int64), data.classes)


def _maps(noise_db: tuple[float, float] | None) -> Callable[[Run, slice], Sequences]:
    def maps(run: Run, frames: slice) -> Sequences:
        cube: NDArray[Any] = run.cube(frames).data
        if noise_db is not None:
            rng = np.random.default_rng([run.recording["seed"], 83])
            sigma = np.sqrt(noise_power(run.radar) * 10 ** (rng.uniform(*noise_db) / 10) / 2)
            cube = cube + sigma * (rng.standard_normal(cube.shape) + 1j * rng.standard_normal(cube.shape))
        return scaled_maps(range_doppler_power(cube.astype(np.complex64), run.radar))

    return maps


def scaled_maps(power: NDArray[Any]) -> Sequences:
    """(frame, range, velocity) powers [W] of the nearest ranges, pairs of bins added, on the scale of `SPAN_DB`."""
    near = power[:, : 2 * RANGE_BINS].reshape(len(power), RANGE_BINS, 2, -1).sum(axis=2)
    if near.shape[-1] != VELOCITY_BINS:
        raise ValueError(f"maps have {near.shape[-1]} velocities: {VELOCITY_BINS} are needed")
    low, high = SPAN_DB
    level = 10 * np.log10(np.maximum(near, 1e-30)) + 30
    return np.clip((level - low) / (high - low), 0.0, 1.0).astype(np.float32)
