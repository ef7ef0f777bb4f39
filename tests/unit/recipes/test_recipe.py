"""A recipe's recordings: drawn from its seed and their number alone, in splits that share nothing."""

import json
import pickle
from collections import Counter
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from rfgen_sionna.recipes import Recipe, RecipeError, RecordingSpec

from .recipe_texts import FULL, SHORT

EXAMPLES = Path(__file__).parents[3] / "examples" / "recipes"


@pytest.fixture(scope="module")
def full() -> Recipe:
    return Recipe.parse(FULL)


def test_a_recording_is_the_same_in_any_order_process_and_parse(full: Recipe) -> None:
    backwards = [full.recording(number) for number in reversed(range(full.count))][::-1]
    again = pickle.loads(pickle.dumps(Recipe.parse(FULL, check=False)))
    assert backwards == list(full) == list(again)
    assert full.recording(3, attempt=2) == again.recording(3, attempt=2) != full.recording(3)
    assert again.digest == full.digest
    assert again.recordings_per_shard == full.recordings_per_shard > 1


def test_a_record_goes_through_json(full: Recipe) -> None:
    for number in range(20):
        spec = full.recording(number)
        assert RecordingSpec.from_dict(json.loads(json.dumps(spec.to_dict()))) == spec
    with pytest.raises(ValueError, match="recording: "):
        RecordingSpec.from_dict({"number": 3})


def test_splits_have_their_shares_and_share_nothing(full: Recipe) -> None:
    specs = list(full)
    assert Counter(spec.split for spec in specs) == {"train": 210, "validation": 30, "test": 60}
    found: dict[str, list[set[object]]] = {"body": [], "place": [], "action": [], "seed": []}
    for split in full.splits:
        own = [spec for spec in specs if spec.split == split]
        found["body"].append({body.seed for spec in own for body in spec.bodies})
        found["place"].append({(spec.place, spec.place_seed) for spec in own if spec.place != "free space"})
        found["action"].append({source.text for spec in own for source in spec.sources})
        found["seed"].append({spec.motion_seed for spec in own})
    for kind, parts in found.items():
        assert all(parts), kind
        for one, other in combinations(parts, 2):
            assert not one & other, kind


def test_further_attempts_stay_in_the_pools_of_the_split(full: Recipe) -> None:
    bodies = {split: set[int]() for split in full.splits}
    for number in range(60):
        for attempt in range(4):
            spec = full.recording(number, attempt)
            first = full.recording(number)
            bodies[spec.split] |= {body.seed for body in spec.bodies}
            assert (spec.split, spec.sources, spec.place, spec.duration_s) == (
                first.split, first.sources, first.place, first.duration_s,
            )  # fmt: skip
            assert attempt == 0 or spec.seed != first.seed
    assert not any(one & other for one, other in combinations(bodies.values(), 2))


def test_values_are_within_their_forms_and_weights_hold(full: Recipe) -> None:
    specs = list(full)
    assert all(2.0 <= spec.distance_m <= 3.0 for spec in specs if spec.distance_m is not None)
    assert {spec.azimuth_deg for spec in specs} == {-10.0, 0.0, 10.0}
    assert {spec.duration_s for spec in specs} == {0.5, 1.0}
    people = Counter(len(spec.sources) for spec in specs)
    assert abs(people[2] / len(specs) - 0.25) < 0.1
    assert all(len(spec.bodies) == len(spec.sources) for spec in specs)
    places = Counter(spec.place for spec in specs)
    assert set(places) == {"free space", "furnished: office", "furnished: lab"}
    assert abs(places["free space"] / len(specs) - 0.5) < 0.1
    heights = [body.height_m for spec in specs for body in spec.bodies]
    assert min(heights) >= 1.5
    assert max(heights) <= 1.9
    assert len({(body.seed, body.height_m, body.gender) for spec in specs for body in spec.bodies}) <= 30
    assert [radar.name for radar in specs[0].radars] == ["awr1843", "side"]
    assert len({radar.position_m for spec in specs for radar in spec.radars if radar.name == "awr1843"}) == len(specs)


def test_two_people_of_a_recording_are_different_ones(full: Recipe) -> None:
    for spec in full:
        assert len({body.seed for body in spec.bodies}) == len(spec.bodies)


def test_grids_are_gone_through_in_order_in_each_split() -> None:
    recipe = Recipe.parse(
        """
        count = 24
        prompts = {grid = ["a person waves", "a person claps"]}
        distance_m = {grid = [2.0, 2.5, 3.0]}
        splits = {shares = {train = 0.5, test = 0.5}}
        """
    )
    for split in recipe.splits:
        own = [(spec.prompt, spec.distance_m) for spec in recipe if spec.split == split]
        assert own[:3] == [("a person waves", 2.0), ("a person claps", 2.0), ("a person waves", 2.5)]
        assert set(Counter(own).values()) == {2}


def test_without_a_count_the_grids_are_gone_through_once() -> None:
    text = 'prompts = {grid = ["a person waves", "a person claps"]}\nazimuth_deg = {grid = [-5.0, 0.0, 5.0]}'
    recipe = Recipe.parse(text)
    assert len(recipe) == 6
    assert len({(spec.prompt, spec.azimuth_deg) for spec in recipe}) == 6


def test_a_short_recipe_has_defaults() -> None:
    recipe = Recipe.parse(SHORT)
    spec = recipe.recording(0)
    assert recipe.splits == ("all",)
    assert (spec.place, spec.duration_s, spec.distance_m, spec.keep) == (
        "free space", 2.0, None, ("adc", "body", "joints", "labels"),
    )  # fmt: skip
    assert len({body.seed for each in recipe for body in each.bodies}) == len(recipe)
    with pytest.raises(IndexError, match="the set has 0 to 39"):
        recipe.recording(40)


def test_a_place_may_stand_in_the_prompt() -> None:
    recipe = Recipe.parse('count = 20\nprompts = ["a person waves in an office", "a person claps"]')
    assert {(spec.prompt, spec.place) for spec in recipe} == {
        ("a person waves in an office", "furnished: office"),
        ("a person claps", "free space"),
    }


def test_scenes_are_partitioned_and_keep_their_share() -> None:
    recipe = Recipe.parse(
        """
        count = 400
        prompts = "a person waves"
        places = {choice = ["free space", "living_room", "floor_wall", "box"], weights = [1, 1, 1, 1]}
        splits = {shares = {train = 0.5, test = 0.5}, by = ["place"]}
        """,
        check=False,
    )
    parts = {split: {spec.place for spec in recipe if spec.split == split} for split in recipe.splits}
    assert parts["train"] & parts["test"] == {"free space"}
    for split in recipe.splits:
        own = [spec.place for spec in recipe if spec.split == split]
        assert abs(own.count("free space") / len(own) - 0.25) < 0.08


def test_actions_that_overlap_stay_together() -> None:
    recipe = Recipe.parse(
        """
        count = 60
        prompts = ["a person waves", "a man waves", "a person waves at 2 m", "a person claps"]
        splits = {shares = {train = 0.5, test = 0.5}, by = ["action"]}
        """
    )
    claps = {spec.split for spec in recipe if "claps" in spec.prompt}
    waves = {spec.split for spec in recipe if "waves" in spec.prompt}
    assert len(claps) == len(waves) == 1
    assert claps != waves


def test_the_digest_is_of_the_contents(tmp_path: Path) -> None:
    one = Recipe.parse(SHORT).digest
    assert Recipe.parse("# a comment\ntitle = 'other'\n" + SHORT).digest == one
    assert Recipe.parse(SHORT + "seed = 1\n").digest != one
    joints = tmp_path / "joints.npy"
    np.save(joints, np.zeros((3, 22, 3)))
    text = 'count = 2\n[[sources]]\njoints = "joints.npy"\nlayout = "smpl22"'
    before = Recipe.parse(text, tmp_path, check=False).digest
    np.save(joints, np.ones((3, 22, 3)))
    assert Recipe.parse(text, tmp_path, check=False).digest != before


@pytest.mark.parametrize("name", ["thousand", "tiny"])
def test_the_examples_can_be_made(name: str) -> None:
    recipe = Recipe.load(EXAMPLES / f"{name}.toml")
    assert recipe.count >= 20


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(RecipeError, match="cannot be read: No such file"):
        Recipe.load(tmp_path / "none.toml")
    (tmp_path / "bytes.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(RecipeError, match="no text in UTF-8"):
        Recipe.load(tmp_path / "bytes.toml")
