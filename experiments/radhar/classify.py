"""Activities of RadHAR's real recordings, by classifiers trained on simulated ones.

    python -m experiments.radhar.classify --data FOLDER --synthetic FOLDER --output classify.json

Windows of 2 s, 64 plain features without levels (`experiments.radhar.features`), a random forest and logistic
regression. Real → real is a split of the training part by recording, three to one, mean over draws; simulated → real is
tested on the whole training part; k real recordings an activity, alone and beside the simulated ones, are tested on the
others, mean over draws. Every draw is by seed.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.radhar.clouds import simulated_clouds
from experiments.radhar.features import FEATURES, window_features
from experiments.radhar.recordings import CloudRecording, read_training_part
from experiments.radhar.synthesis import ACTIVITIES

LOSS_DB = 12.0
"""Attenuation of simulated samples that gives the intensities of RadHAR's moving points [dB], by
:mod:`experiments.radhar.chain_fit`."""
TREES = 200
"""Trees of the random forest."""


@dataclass(frozen=True)
class WindowSet:
    """Features of windows, with the activity and the recording of each."""

    features: NDArray[np.float64]
    activity: NDArray[np.str_]
    recording: NDArray[np.int64]

    def select(self, chosen: NDArray[np.bool_]) -> WindowSet:
        return WindowSet(self.features[chosen], self.activity[chosen], self.recording[chosen])

    def of_recordings(self, numbers: Sequence[int] | NDArray[np.int64]) -> NDArray[np.bool_]:
        return np.isin(self.recording, numbers)


def window_set(recordings: Sequence[CloudRecording], step: int) -> WindowSet:
    """Windows of all recordings, `step` frames apart."""
    parts = [window_features(recording, step) for recording in recordings]
    names = np.concatenate(
        [[recording.activity] * len(part) for recording, part in zip(recordings, parts, strict=True)]
    )
    numbers = np.concatenate([[number] * len(part) for number, part in enumerate(parts)])
    return WindowSet(np.concatenate(parts), names, numbers.astype(np.int64))


def joined(first: WindowSet, second: WindowSet) -> WindowSet:
    """Windows of both, with recordings of their own."""
    offset = first.recording.max() + 1
    return WindowSet(
        np.concatenate([first.features, second.features]),
        np.concatenate([first.activity, second.activity]),
        np.concatenate([first.recording, second.recording + offset]),
    )


def classifiers() -> dict[str, Callable[[int], Any]]:
    """New classifiers by name, of a seed."""
    from sklearn.ensemble import RandomForestClassifier
    from sklearn.linear_model import LogisticRegression
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    return {
        "random forest": lambda seed: RandomForestClassifier(
            TREES, random_state=seed, min_samples_leaf=2, class_weight="balanced"
        ),
        "logistic regression": lambda seed: make_pipeline(
            StandardScaler(), LogisticRegression(C=0.1, max_iter=2000, class_weight="balanced", random_state=seed)
        ),
    }


def accuracy(name: str, training: WindowSet, test: WindowSet, seed: int = 0) -> float:
    """Share of right windows of the test set."""
    model = classifiers()[name](seed).fit(training.features, training.activity)
    return float(model.score(test.features, test.activity))


def confusion(name: str, training: WindowSet, test: WindowSet) -> list[list[int]]:
    """Windows by true (row) and found (column) activity, in the order of `ACTIVITIES`."""
    from sklearn.metrics import confusion_matrix

    found = classifiers()[name](0).fit(training.features, training.activity).predict(test.features)
    return [[int(count) for count in row] for row in confusion_matrix(test.activity, found, labels=ACTIVITIES)]


def evaluate(real: WindowSet, synthetic: WindowSet | None, draws: int) -> dict[str, Any]:
    """All accuracies as a dictionary for JSON."""
    result: dict[str, Any] = {"features": FEATURES, "windows": {"real": len(real.features)}, "draws": draws}
    splits = [_drawn(real, 0.75, seed) for seed in range(draws)]
    for name in classifiers():
        own: dict[str, Any] = {"real to real": _summary([accuracy(name, a, b, s) for s, (a, b) in enumerate(splits)])}
        for count in (1, 2, 5):
            few = [_drawn(real, count, seed) for seed in range(draws)]
            own[f"{count} real"] = _summary([accuracy(name, a, b, s) for s, (a, b) in enumerate(few)])
            if synthetic is not None:
                both = [accuracy(name, joined(synthetic, a), b, s) for s, (a, b) in enumerate(few)]
                own[f"synthetic and {count} real"] = _summary(both)
        if synthetic is not None:
            own["synthetic to real"] = accuracy(name, synthetic, real)
            own["confusion"] = confusion(name, synthetic, real)
        result[name] = own
    if synthetic is not None:
        result["windows"]["synthetic"] = len(synthetic.features)
        result["synthetic recordings"] = {
            name: len(np.unique(synthetic.recording[synthetic.activity == name])) for name in ACTIVITIES
        }
    return result


def _drawn(windows: WindowSet, amount: float, seed: int) -> tuple[WindowSet, WindowSet]:
    """Recordings drawn for training, a share (below 1) or a number of each activity, and the others."""
    rng = np.random.default_rng(np.random.SeedSequence([54, seed]))
    chosen: list[int] = []
    for name in ACTIVITIES:
        numbers = np.unique(windows.recording[windows.activity == name])
        count = round(amount * len(numbers)) if amount < 1 else int(amount)
        chosen += [int(number) for number in rng.choice(numbers, count, replace=False)]
    mask = windows.of_recordings(chosen)
    return windows.select(mask), windows.select(~mask)


def _summary(values: Sequence[float]) -> dict[str, float]:
    return {"mean": float(np.mean(values)), "std": float(np.std(values))}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder with radhar/Train")
    parser.add_argument("--synthetic", type=Path, help="folder of experiments.radhar.synthesis")
    parser.add_argument("--output", type=Path, required=True, help="JSON file")
    parser.add_argument("--loss-db", type=float, default=LOSS_DB, help="attenuation of the simulated samples")
    parser.add_argument("--draws", type=int, default=10, help="draws of the splits")
    arguments = parser.parse_args()
    real = window_set(read_training_part(arguments.data), 27)
    synthetic = (
        window_set(simulated_clouds(arguments.synthetic, loss_db=arguments.loss_db), 3) if arguments.synthetic else None
    )
    result = evaluate(real, synthetic, arguments.draws)
    arguments.output.write_text(json.dumps(result, indent=1) + "\n")
    print(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
