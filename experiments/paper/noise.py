"""Noise of surroundings (section 8.3): activities in rooms, from recordings that were made without rooms.

    python -m experiments.paper.noise --output FOLDER

A network names one of five activities by a range-Doppler sequence with all static returns. It is trained on the same
recordings in free space ("baseline"), and beside these on the same number of

- "AWGN": the recordings with white Gaussian noise of 0 to 40 dB over the receiver's own;
- "CycleGAN": the recordings translated to rooms, learned from unpaired maps of the training part of "ours", unlabelled;
- "ours": recordings that were simulated in furnished rooms.

It is tested on other people and other motions in the rooms of training ("seen") and in rooms of other kinds ("unseen").
All are simulated. Networks of several seeds have the same number of steps; no setting was chosen by a test set.
"""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Sequence
from typing import Any

from experiments.paper.activity_network import accuracies
from experiments.paper.activity_sets import ADULTS, SEEN, UNSEEN, activity_recipe, activity_set
from experiments.paper.cycle_gan import MapTranslator
from experiments.paper.reports import experiment_parser, progress, run_experiment
from experiments.paper.sets import built_set, check_disjoint, specs_of
from rfgen_sionna.recipes import Recipe

AWGN_DB = (0.0, 40.0)
"""Levels of the noise over the receiver's [dB]."""


def recipes(quick: bool, seed: int) -> dict[str, Recipe]:
    """ "clean", "rooms" (with the splits "train" and "seen") and "unseen"."""
    training, seen, unseen, length = (5, 5, 5, 0.4) if quick else (25, 15, 25, 0.8)
    placed: dict[str, Any] = {
        "distance_m": (1.6, 3.4), "azimuth_deg": 12.0, "orientation_deg": 30.0, "bodies": ADULTS
    }  # fmt: skip
    whole = training + seen
    shares = f"shares = {{train = {training / whole:.9f}, seen = {seen / whole:.9f}}}\nby = ['body', 'seed']\n"
    return {
        "clean": activity_recipe(training, 3 * seed, length, **placed),
        "rooms": activity_recipe(
            whole, 3 * seed + 1, length, places=SEEN, layouts=2 if quick else 5, splits=shares, **placed
        ),
        "unseen": activity_recipe(unseen, 3 * seed + 2, length, places=UNSEEN, **placed),
    }


def check(sets: dict[str, Recipe]) -> None:
    """ValueError unless tests have other people, motions and noise than training, and "unseen" other places."""
    training = specs_of(sets["clean"]) + specs_of(sets["rooms"], "train")
    seen, unseen = specs_of(sets["rooms"], "seen"), specs_of(sets["unseen"])
    check_disjoint({"training": training, "seen": seen}, allowed={"places"})
    check_disjoint({"training": training, "unseen": unseen})


def noise(arguments: Namespace) -> dict[str, Any]:
    """Accuracy of each way in seen and in unseen places."""
    quick, seed = arguments.quick, arguments.seed
    sets = recipes(quick, seed)
    check(sets)
    folders = {
        name: built_set(recipe, arguments.output / "noise" / name, arguments.workers) for name, recipe in sets.items()
    }
    clean = activity_set(folders["clean"])
    rooms = activity_set(folders["rooms"], "train")
    tests = {"seen": activity_set(folders["rooms"], "seen"), "unseen": activity_set(folders["unseen"])}
    translator = MapTranslator(clean.maps, rooms.maps, 60 if quick else 1200, seed)
    ways = {
        "baseline": clean,
        "AWGN": clean.joined(activity_set(folders["clean"], noise_db=AWGN_DB).maps),
        "CycleGAN": clean.joined(translator(clean.maps)),
        "ours": clean.and_also(rooms),
    }
    found = {}
    for name, training in ways.items():
        progress(f"{name}: {len(training)} recordings")
        found[name] = accuracies(training, tests, 60 if quick else 300, 1 if quick else 3, seed)
    above = {
        place: found["ours"][place]["mean"] - max(found[name][place]["mean"] for name in ("AWGN", "CycleGAN"))
        for place in tests
    }
    return {
        "recordings": {"clean": len(clean), "rooms": len(rooms), **{name: len(test) for name, test in tests.items()}},
        "classes": clean.classes,
        "accuracy": found,
        "ours above AWGN and CycleGAN": above,
        "unseen places above both": above["unseen"] > 0,
    }


def main(argv: Sequence[str] | None = None) -> None:
    parser = experiment_parser(__doc__)
    parser.add_argument("--workers", type=int, help="processes that simulate (default: one for each core)")
    run_experiment("noise", parser, noise, argv)


if __name__ == "__main__":
    main()
