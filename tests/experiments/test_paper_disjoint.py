"""The sets of the paper's tables: training and test have nothing in common. Recipes alone, nothing is simulated."""

from __future__ import annotations

from dataclasses import replace

import pytest

from experiments.paper import noise, prompts
from experiments.paper.sets import check_disjoint, shared, specs_of


@pytest.mark.parametrize("quick", [True, False])
@pytest.mark.parametrize("seed", [0, 1])
def test_noise_is_tested_on_other_people_motions_and_places(quick: bool, seed: int) -> None:
    sets = noise.recipes(quick, seed)
    noise.check(sets)
    training = specs_of(sets["clean"]) + specs_of(sets["rooms"], "train")
    seen, unseen = specs_of(sets["rooms"], "seen"), specs_of(sets["unseen"])
    assert shared(training, unseen) == {}
    assert set(shared(training, seen)) == {"places"}
    assert {spec.place for spec in seen} == {spec.place for spec in specs_of(sets["rooms"], "train")}
    assert shared(seen, unseen) == {}
    assert not shared(specs_of(sets["clean"]), specs_of(sets["rooms"]))


@pytest.mark.parametrize("quick", [True, False])
@pytest.mark.parametrize("seed", [0, 1])
def test_prompts_are_tested_on_other_people_motions_and_places(quick: bool, seed: int) -> None:
    sets = prompts.recipes(quick, seed)
    for level in prompts.LEVELS:
        assert shared(specs_of(sets[level]), specs_of(sets["test"])) == {}
    assert {sets[level].count for level in prompts.LEVELS} == {sets["P1"].count}


def test_sets_of_two_seeds_share_nothing() -> None:
    for made in (noise.recipes, prompts.recipes):
        first, second = (
            [spec for recipe in made(False, seed).values() for spec in recipe] for seed in (0, 1)
        )  # fmt: skip
        assert shared(first, second) == {}


def test_what_is_shared_is_found() -> None:
    specs = specs_of(noise.recipes(True, 0)["rooms"])
    assert set(shared(specs[:1], specs[:1])) == {"bodies", "places", "motions", "noise"}
    captured = [replace(spec, motion="auto", seed=spec.seed + 1) for spec in specs[:2]]
    assert "clips" in shared(captured[:1], captured[1:])
    check_disjoint({"one": specs, "other": captured}, allowed={"bodies", "places", "motions"})
    with pytest.raises(ValueError, match="'one' and 'other' share bodies"):
        check_disjoint({"one": specs, "other": captured})
