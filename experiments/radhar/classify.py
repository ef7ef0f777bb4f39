"""Activities of RadHAR's real recordings, by classifiers trained on simulated ones.

    python -m experiments.radhar.classify --data FOLDER --synthetic SET --output classify.json

Windows of 2 s; plain features without levels (`experiments.radhar.features`) for a random forest and logistic
regression, counts (`experiments.radhar.network`) for a small network. Simulated → real is tested on the whole training
part; real → real on a quarter of its recordings; k real recordings an activity, alone and beside the simulated ones, on
the others; the figures are means over draws. With `--test-part Test` everything is tested on RadHAR's test part and the
draws are from the training part. Every draw is by seed. `--ablations` takes parts of the simulation away.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.radhar.clouds import Surroundings, simulated_clouds
from experiments.radhar.features import window_features
from experiments.radhar.network import NetworkVote, window_counts
from experiments.radhar.recordings import ACTIVITIES, CloudRecording, first_recordings, read_part
from rfgen_sionna.dataset import open_dataset

TREES = 200
"""Trees of the random forest."""
REAL_STEP, SYNTHETIC_STEP = 27, 3
"""Frames between windows of real and of simulated recordings."""
REAL_WEIGHT = 3.0
"""Weight of all real windows against all simulated ones, where a classifier is trained on both."""
REPEATS, ABLATION_REPEATS = 4, 1
"""Clouds of each simulated recording, of different surroundings, and those where a part is taken away."""


@dataclass(frozen=True)
class WindowSet:
    """Windows of recordings, with the activity and the recording of each."""

    features: NDArray[np.float64]
    counts: NDArray[np.float32]
    activity: NDArray[np.str_]
    recording: NDArray[np.int64]

    def select(self, chosen: NDArray[np.bool_] | NDArray[np.int64]) -> WindowSet:
        return WindowSet(*(getattr(self, name)[chosen] for name in vars(self)))


def window_set(recordings: Sequence[CloudRecording], step: int) -> WindowSet:
    """Windows of all recordings, `step` frames apart."""
    parts = [window_features(recording, step) for recording in recordings]
    sizes = [len(part) for part in parts]
    return WindowSet(
        np.concatenate(parts),
        np.concatenate([window_counts(recording, step) for recording in recordings]),
        np.repeat([recording.activity for recording in recordings], sizes),
        np.repeat(np.arange(len(parts)), sizes),
    )


Predictor = Callable[[WindowSet], NDArray[np.str_]]
"""Activities of windows."""


def trained_on(name: str, synthetic: WindowSet | None, real: WindowSet | None, seed: int) -> Predictor:
    """A classifier trained on simulated windows, real ones, or both; the network sees simulated ones first."""
    given = [part for part in (synthetic, real) if part is not None]
    if name == "network":
        network = NetworkVote(ACTIVITIES, seed).train(given[0].counts, given[0].activity)
        if len(given) == 2:
            network.train(given[1].counts, given[1].activity)
        return lambda windows: network.predict(windows.counts)
    features, activity = (np.concatenate([getattr(part, key) for part in given]) for key in ("features", "activity"))
    weight = np.concatenate([np.full(len(part.features), 1.0 / len(part.features)) for part in given])
    if len(given) == 2 and real is not None:
        weight[-len(real.features) :] *= REAL_WEIGHT
    model = _models()[name](seed)
    last = model.steps[-1][0]
    model.fit(features, activity, **{f"{last}__sample_weight": weight * len(weight) / weight.sum()})
    return lambda windows: np.asarray(model.predict(windows.features))


CLASSIFIERS = ("random forest", "logistic regression", "network")


def _models() -> dict[str, Callable[[int], Any]]:
    """New classifiers on features by name, of a seed."""
    from sklearn.ensemble import RandomForestClassifier
    from sklearn.linear_model import LogisticRegression
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    return {
        "random forest": lambda seed: make_pipeline(
            RandomForestClassifier(TREES, random_state=seed, min_samples_leaf=2, class_weight="balanced")
        ),
        "logistic regression": lambda seed: make_pipeline(
            StandardScaler(), LogisticRegression(C=0.1, max_iter=2000, class_weight="balanced", random_state=seed)
        ),
    }


def share_right(predictor: Predictor, test: WindowSet) -> float:
    """Share of right windows."""
    return float(np.mean(predictor(test) == test.activity))


def confusion(predictor: Predictor, test: WindowSet) -> list[list[int]]:
    """Windows by true (row) and found (column) activity, in the order of `ACTIVITIES`."""
    from sklearn.metrics import confusion_matrix

    return [[int(n) for n in row] for row in confusion_matrix(test.activity, predictor(test), labels=ACTIVITIES)]


def evaluate(
    name: str, real: WindowSet, synthetic: WindowSet | None, draws: int, test: WindowSet | None = None
) -> dict[str, Any]:
    """All figures of a classifier as a dictionary for JSON; without `test` the windows that were not drawn test."""

    def over_draws(amount: float, windows: int | None, beside: WindowSet | None) -> dict[str, float]:
        shares = []
        for seed in range(draws):
            drawn, others = drawn_recordings(real, amount, seed, windows)
            shares.append(share_right(trained_on(name, beside, drawn, seed), others if test is None else test))
        return {"mean": float(np.mean(shares)), "std": float(np.std(shares))}

    found: dict[str, Any] = {}
    if synthetic is not None:
        predictor, all_real = trained_on(name, synthetic, None, 0), real if test is None else test
        found = {"synthetic to real": share_right(predictor, all_real), "confusion": confusion(predictor, all_real)}
    found["real to real"] = over_draws(0.75 if test is None else 1.0 - 1e-9, None, None)
    for label, amount, windows in (
        ("10 windows of 1 real", 1, 10), ("1 real", 1, None), ("2 real", 2, None), ("5 real", 5, None),
    ):  # fmt: skip
        found[label] = over_draws(amount, windows, None)
        if synthetic is not None:
            found[f"synthetic and {label}"] = over_draws(amount, windows, synthetic)
    return found


def drawn_recordings(
    windows: WindowSet, amount: float, seed: int, first: int | None = None
) -> tuple[WindowSet, WindowSet]:
    """Windows of recordings drawn for training, a share (below 1) or a number of each activity, and of the others.

    `first` keeps that many windows of each drawn recording.
    """
    rng = np.random.default_rng(np.random.SeedSequence([54, seed]))
    chosen: list[int] = []
    for name in ACTIVITIES:
        numbers = np.unique(windows.recording[windows.activity == name])
        count = round(amount * len(numbers)) if amount < 1 else int(amount)
        chosen += [int(number) for number in rng.choice(numbers, count, replace=False)]
    mask = np.isin(windows.recording, chosen)
    rank = np.arange(len(mask)) - np.searchsorted(windows.recording, windows.recording)
    return windows.select(mask & (rank < (len(mask) if first is None else first))), windows.select(~mask)


def ablated(name: str, folder: Path, around: Surroundings) -> list[CloudRecording]:
    """Simulated clouds with a part of the simulation taken away."""
    if name == "one body":
        with open_dataset(folder) as recordings:
            bodies = [row.bodies for row in recordings.rows]
            most = max(set(bodies), key=bodies.count)
            own = [row.number for row in recordings.rows if row.bodies == most]
        return simulated_clouds(folder, around, repeats=ABLATION_REPEATS, numbers=own)
    changed = {
        "none": around,
        "no room": replace(around, rooms=None),
        "no floor": replace(around, floor_db=-99.0),
        "no noise": replace(around, noise=False),
        "own level": replace(around, loss_db=(0.0, 0.0)),
        "one level": replace(around, loss_db=(15.0, 15.0)),
    }[name]
    return simulated_clouds(folder, changed, repeats=ABLATION_REPEATS)


ABLATIONS = ("none", "no room", "no floor", "no noise", "own level", "one level", "one body")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder with radhar/Train")
    parser.add_argument("--synthetic", type=Path, help="data set built from recipe.toml")
    parser.add_argument("--rooms", type=Path, help="folder of experiments.radhar.surroundings; free space by default")
    parser.add_argument("--output", type=Path, required=True, help="JSON file")
    parser.add_argument("--test-part", help="part of RadHAR to test on, a folder beside Train")
    parser.add_argument("--classifiers", nargs="*", default=list(CLASSIFIERS), choices=CLASSIFIERS)
    parser.add_argument("--ablations", nargs="*", default=[], choices=ABLATIONS, help="tested alone, without draws")
    parser.add_argument("--draws", type=int, default=10, help="draws of real recordings")
    arguments = parser.parse_args()
    recordings = read_part(arguments.data)
    real, test = window_set(recordings, REAL_STEP), None
    if arguments.test_part is not None:
        test = window_set(read_part(arguments.data, arguments.test_part), REAL_STEP)
    around = Surroundings(arguments.rooms)
    result: dict[str, Any] = {"tested on": arguments.test_part or "Train", "draws": arguments.draws}
    result["windows"] = {"real": len(real.activity)} | ({} if test is None else {"test": len(test.activity)})
    target = real if test is None else test
    if arguments.ablations:
        result["ablations"] = {}
        for ablation in arguments.ablations:
            windows = window_set(ablated(ablation, arguments.synthetic, around), SYNTHETIC_STEP)
            shares = {name: share_right(trained_on(name, windows, None, 0), target) for name in arguments.classifiers}
            result["ablations"][ablation] = {"windows": len(windows.activity), **shares}
    else:
        synthetic = None
        if arguments.synthetic is not None:
            clouds = simulated_clouds(arguments.synthetic, around, repeats=REPEATS)
            synthetic = window_set(clouds, SYNTHETIC_STEP)
            result["windows"]["synthetic"] = len(synthetic.activity)
            fitted = window_set(first_recordings(recordings), REAL_STEP)
            result["on the recordings of the fit"] = {
                name: share_right(trained_on(name, synthetic, None, 0), fitted) for name in arguments.classifiers
            }
        for name in arguments.classifiers:
            result[name] = evaluate(name, real, synthetic, arguments.draws, test)
    arguments.output.write_text(json.dumps(result, indent=1) + "\n")
    print(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
