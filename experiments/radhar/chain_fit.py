"""The board's chain against RadHAR's recordings: which settings they speak for, and what is left between both.

    python -m experiments.radhar.chain_fit --data FOLDER --synthetic SET --rooms FOLDER --output chain_fit.json

Of the real data, the first recording of each activity alone is used. Tried are TI's own settings of the chain, and of
the surroundings the level of people and the floor's clutter. `range window` compares the levels of three neighbouring
bins of the strongest static reflector with those of one target between bins; `moving against range` is the mean number
of moving points of frames by the median distance of the moving points around them; `levels` are those of points of
Doppler bin 0, of its neighbours and of the others, by distance: their lowest ones are the threshold there.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import get_window

from experiments.radhar.clouds import Surroundings, simulated_clouds
from experiments.radhar.recordings import (
    ACTIVITIES,
    FRAME_RATE_HZ,
    RANGE_BIN_M,
    CloudRecording,
    first_recordings,
    read_part,
)
from rfgen_sionna.evaluation import CloudStatistics, compare_statistics
from rfgen_sionna.processing.boards import CfarSettings, OutOfBoxChain

RANGES_M = (0.6, 1.0, 1.4, 1.8, 2.2, 2.6, 3.0)
"""Edges of the ranges of `moving against range` [m]."""
VARIANTS: dict[str, Callable[[Surroundings], Surroundings]] = {
    "fitted": lambda around: around,
    "free space": lambda around: replace(around, rooms=None),
    "no floor": lambda around: replace(around, floor_db=-99.0),
    "floor 3 dB less": lambda around: replace(around, floor_db=around.floor_db - 3.0),
    "floor 3 dB more": lambda around: replace(around, floor_db=around.floor_db + 3.0),
    **{f"people {loss:g} dB weaker": partial(replace, loss_db=(loss, loss)) for loss in (0.0, 12.0, 15.0, 18.0)},
    "threshold 15 dB": lambda around: replace(around, chain=OutOfBoxChain(range_cfar=CfarSettings(threshold_db=15.0))),
    "greater of both sides": lambda around: replace(
        around, chain=OutOfBoxChain(range_cfar=CfarSettings("cago", threshold_db=20.0))
    ),
}
"""Simulated variants by name."""


def statistics(recordings: Sequence[CloudRecording]) -> dict[str, Any]:
    """What the points of some recordings have, as a dictionary for JSON."""
    frames = sum(recording.frames for recording in recordings)
    moving = np.concatenate([recording.moving for recording in recordings])
    counts = np.concatenate([np.bincount(item.frame[item.moving], minlength=item.frames) for item in recordings])
    doppler = np.concatenate([recording.doppler for recording in recordings])[moving]
    height = np.concatenate([recording.position[:, 2] for recording in recordings])[moving]
    level = np.concatenate([recording.intensity for recording in recordings])[moving]
    distance = np.concatenate([recording.distance for recording in recordings])[moving]
    return {
        "points a frame": len(moving) / frames,
        "moving points a frame": float(moving.sum() / frames),
        "share of frames with moving points": float((counts > 0).mean()),
        "moving points of those frames": float(counts[counts > 0].mean()) if counts.any() else 0.0,
        "Doppler histogram, bins -8 to 7": _rounded(np.bincount(doppler + 8, minlength=16) / max(1, len(doppler))),
        "height [m], 5, 25, 50, 75, 95 %": _quantiles(height),
        "intensity [dB], 5, 25, 50, 75, 95 %": _quantiles(level),
        "median intensity by range [dB]": [
            _quantiles(level[(distance >= low) & (distance < high)], (50,))[0] for low, high in pairwise(RANGES_M)
        ],
    }


def levels(recordings: Sequence[CloudRecording]) -> dict[str, list[list[float | None]]]:
    """Levels [dB] of points by Doppler bin and range between `RANGES_M`: 2, 50 and 95 %; None without 30 points.

    The range bins of what stands still, whose levels hardly change, are left out.
    """
    bins = [(np.round(item.distance / RANGE_BIN_M).astype(int), item) for item in recordings]
    changing = np.concatenate([~steady(number, item) for number, item in bins])
    doppler = np.abs(np.concatenate([item.doppler for item in recordings]))
    level = np.concatenate([item.intensity for item in recordings])
    distance = np.concatenate([item.distance for item in recordings])
    found = {}
    for name, own in (("bin 0", doppler == 0), ("bins 1", doppler == 1), ("others", doppler > 1)):
        parts = [level[own & changing & (distance >= low) & (distance < high)] for low, high in pairwise(RANGES_M)]
        found[name] = [_quantiles(part if len(part) >= 30 else part[:0], (2, 50, 95)) for part in parts]
    return found


def steady(number: NDArray[np.int64], item: CloudRecording, spread_db: float = 0.6) -> NDArray[np.bool_]:
    """(point,) whether a point of Doppler bin 0 is in a range bin `number` whose levels spread less than that."""
    still = item.doppler == 0
    count = np.maximum(np.bincount(number[still], minlength=number.max() + 1), 1)
    mean = np.bincount(number[still], item.intensity[still], minlength=len(count)) / count
    square = np.bincount(number[still], (item.intensity - mean[number])[still] ** 2, minlength=len(count)) / count
    return still & (np.sqrt(square)[number] < spread_db)


def moving_against_range(recordings: Sequence[CloudRecording]) -> list[float | None]:
    """Mean number of moving points a frame, in ranges between `RANGES_M`; None without 20 frames."""
    ranges, counts = [], []
    half = int(FRAME_RATE_HZ / 2)
    for recording in recordings:
        frame, distance = recording.frame[recording.moving], recording.distance[recording.moving]
        count = np.bincount(frame, minlength=recording.frames)
        edges = np.searchsorted(frame, [np.arange(recording.frames) - half, np.arange(recording.frames) + half])
        for number, (first, last) in enumerate(edges.T):
            if last > first:
                ranges.append(np.median(distance[first:last]))
                counts.append(count[number])
    where = np.digitize(ranges, RANGES_M) - 1
    chosen = [np.asarray(counts)[where == index] for index in range(len(RANGES_M) - 1)]
    return [round(float(part.mean()), 2) if len(part) >= 20 else None for part in chosen]


def range_window_errors(recordings: Sequence[CloudRecording], samples: int = 240, bins: int = 256) -> dict[str, float]:
    """Rms difference [dB] of the levels of the strongest static triple of range bins from those of one target, by the
    window of the range transform, over the recordings."""
    errors: dict[str, list[float]] = {"hann": [], "blackman": [], "boxcar": [], "hamming": []}
    offsets = np.linspace(-0.6, 0.6, 121)
    for recording in recordings:
        still = (recording.doppler == 0) & (recording.distance > 2.0)
        number = np.round(recording.distance[still] / RANGE_BIN_M).astype(int)
        level = 20 * np.log10(10 ** (recording.intensity[still] / 10) - 1)
        share = np.bincount(number, minlength=bins) / recording.frames
        median = np.array([np.median(level[number == cell]) if share[cell] > 0.5 else -np.inf for cell in range(bins)])
        triples = [cell for cell in range(1, bins - 1) if np.all(np.isfinite(median[cell - 1 : cell + 2]))]
        triples = [cell for cell in triples if median[cell] == median[cell - 1 : cell + 2].max()]
        if not triples:
            continue
        best = max(triples, key=lambda cell: median[cell])
        measured = median[best - 1 : best + 2] - median[best]
        for name, found in errors.items():
            window = get_window(name, samples, fftbins=False)
            place = (np.array([-1, 0, 1]) - offsets[:, None]) / bins
            response = np.abs(np.exp(-2j * np.pi * place[..., None] * np.arange(samples)) @ window)
            expected = 20 * np.log10(response / response[:, 1:2])
            found.append(float(np.sqrt(np.mean((expected - measured) ** 2, axis=1)).min()))
    return {name: round(float(np.mean(found)), 2) for name, found in errors.items() if found}


def compared(real: Sequence[CloudRecording], simulated: Sequence[CloudRecording]) -> dict[str, Any]:
    """Distances of each activity's statistics of moving points, with the other activities' simulations as controls."""
    ours = {name: _cloud_statistics([item for item in simulated if item.activity == name]) for name in ACTIVITIES}
    result = {}
    for name in ACTIVITIES:
        theirs = _cloud_statistics([item for item in real if item.activity == name])
        controls = {other: value for other, value in ours.items() if other != name and len(value.level_db)}
        if len(ours[name].level_db):
            found = compare_statistics(theirs, ours[name], controls)
            result[name] = {
                key: {"value": round(metric.value, 3), "best control": round(_best(metric.controls), 3)}
                for key, metric in found.items()
            }
    return result


def _best(controls: Any) -> float:
    return float(min(controls.values(), default=float("nan")))


def _cloud_statistics(recordings: Sequence[CloudRecording]) -> CloudStatistics:
    if not recordings:
        return CloudStatistics(np.empty(0), np.empty(0), np.empty(0))
    counts = [np.bincount(item.frame[item.moving], minlength=item.frames) for item in recordings]
    return CloudStatistics(
        np.concatenate(counts).astype(np.float64),
        np.concatenate([item.intensity[item.moving] for item in recordings]),
        np.concatenate([item.doppler[item.moving] for item in recordings]).astype(np.float64),
    )


def _quantiles(values: NDArray[np.float64], shares: tuple[int, ...] = (5, 25, 50, 75, 95)) -> list[float | None]:
    if not len(values):
        return [None] * len(shares)
    return [round(float(value), 2) for value in np.percentile(values, shares)]


def _rounded(values: NDArray[np.float64]) -> list[float]:
    return [round(float(value), 3) for value in values]


def _by_activity(recordings: Sequence[CloudRecording]) -> dict[str, Any]:
    own = {name: [item for item in recordings if item.activity == name] for name in ACTIVITIES}
    return {
        **{name: statistics(items) for name, items in own.items() if items},
        "moving against range, walk": moving_against_range(own["walk"]),
        "levels": levels(recordings),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder with radhar/Train")
    parser.add_argument("--synthetic", type=Path, required=True, help="data set built from recipe.toml")
    parser.add_argument("--rooms", type=Path, required=True, help="folder of experiments.radhar.surroundings")
    parser.add_argument("--output", type=Path, required=True, help="JSON file")
    parser.add_argument("--variants", nargs="*", default=list(VARIANTS), choices=list(VARIANTS))
    arguments = parser.parse_args()
    real = first_recordings(read_part(arguments.data))
    result: dict[str, Any] = {
        "recordings": {"real": [f"{item.activity}/{item.name}" for item in real]},
        "ranges [m]": list(RANGES_M),
        "range window, rms [dB]": range_window_errors(real),
        "real": _by_activity(real),
    }
    for name in arguments.variants:
        simulated = simulated_clouds(arguments.synthetic, VARIANTS[name](Surroundings(arguments.rooms)))
        result[name] = {**_by_activity(simulated), "distance from real": compared(real, simulated)}
    arguments.output.write_text(json.dumps(result, indent=1) + "\n")
    print(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
