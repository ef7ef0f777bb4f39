"""Prompts of more and more fields (section 8.4): what each field of the training prompts is worth.

    python -m experiments.paper.prompts --output FOLDER

A network that names one of five activities is trained on sets whose prompts name

- "P1": the action alone; all else stays the generator's: 3 m ahead, facing the radar, one adult, free space;
- "P2": also distance (1.6 to 3.4 m), azimuth (to 12 degrees) and orientation (to 60 degrees);
- "P3": also the body: both genders, 18 to 75 years, 1.5 to 1.95 m;
- "P4": also the place: three kinds of furnished rooms.

This is the reading here of P1 to P4: the fields in the order of the package's guide, each level with all fields of the
one before; what is named is drawn anew for each recording, and so is what every level leaves to the seed, the motion.
Fields stand in keys of the recipes instead of sentences, which do the same. The test set has all of it: other bodies
and motions, in rooms of three other kinds. Levels have the same number of recordings and steps.
"""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Sequence
from typing import Any

from experiments.paper.activity_network import accuracies
from experiments.paper.activity_sets import SEEN, UNSEEN, activity_recipe, activity_set
from experiments.paper.reports import experiment_parser, progress, run_experiment
from experiments.paper.sets import built_set, check_disjoint, specs_of
from rfgen_sionna.recipes import Recipe

ONE_ADULT = "pool = 1\ngender = 'male'\nage_years = 35.0\nheight_m = 1.75\n"
"""Table `[bodies]` where prompts name no body."""
EVERYBODY = "gender = ['female', 'male']\nage_years = {range = [18.0, 75.0]}\nheight_m = {range = [1.5, 1.95]}\n"
"""Table `[bodies]` where they do."""
LEVELS = ("P1", "P2", "P3", "P4")
"""Levels, from the fewest fields to all."""


def recipes(quick: bool, seed: int) -> dict[str, Recipe]:
    """Training sets "P1" to "P4", and "test"."""
    training, test, length = (5, 5, 0.4) if quick else (20, 20, 0.8)
    placed: dict[str, Any] = {"distance_m": (1.6, 3.4), "azimuth_deg": 12.0, "orientation_deg": 60.0}
    first = 1_000_000 + 5 * seed
    return {
        "P1": activity_recipe(training, first, length, bodies=ONE_ADULT),
        "P2": activity_recipe(training, first + 1, length, bodies=ONE_ADULT, **placed),
        "P3": activity_recipe(training, first + 2, length, bodies=EVERYBODY, **placed),
        "P4": activity_recipe(training, first + 3, length, bodies=EVERYBODY, places=SEEN, **placed),
        "test": activity_recipe(test, first + 4, length, bodies=EVERYBODY, places=UNSEEN, **placed),
    }


def prompts(arguments: Namespace) -> dict[str, Any]:
    """Accuracy of each level on the test set."""
    quick, seed = arguments.quick, arguments.seed
    sets = recipes(quick, seed)
    check_disjoint({name: specs_of(recipe) for name, recipe in sets.items()})
    folders = {
        name: built_set(recipe, arguments.output / "prompts" / name, arguments.workers) for name, recipe in sets.items()
    }
    test = activity_set(folders["test"])
    found = {}
    for name in LEVELS:
        training = activity_set(folders[name])
        progress(f"{name}: {len(training)} recordings")
        found[name] = accuracies(training, {"test": test}, 60 if quick else 300, 1 if quick else 3, seed)["test"]
    means = [found[name]["mean"] for name in LEVELS]
    return {
        "recordings": {name: sets[name].count for name in LEVELS} | {"test": len(test)},
        "classes": test.classes,
        "accuracy": found,
        "gain of each level": {name: means[k] - means[k - 1] for k, name in enumerate(LEVELS) if k},
        "P4 above P1": means[-1] > means[0],
    }


def main(argv: Sequence[str] | None = None) -> None:
    parser = experiment_parser(__doc__)
    parser.add_argument("--workers", type=int, help="processes that simulate (default: one for each core)")
    run_experiment("prompts", parser, prompts, argv)


if __name__ == "__main__":
    main()
