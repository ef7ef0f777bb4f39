"""A recipe's recordings: drawn from its seed and their number alone, in splits that share nothing."""

import json
import pickle
import shutil
from collections import Counter
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from rfgen_sionna.recipes import Recipe, RecipeError, RecordingSpec
from rfgen_sionna.resources import resolve

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


def of_files(folder: Path, text: str) -> str:
    return Recipe.parse("count = 2\n" + text, folder, check=False).digest


def test_every_file_that_a_recipe_leads_to_is_in_its_digest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rfgen_sionna.recipes.recipe.recording_bytes", lambda recipe: 1e6)  # which reads the radars
    (tmp_path / "meshes" / "more").mkdir(parents=True)
    (tmp_path / "scene" / "parts").mkdir(parents=True)
    shutil.copy(resolve("radars", "awr1843"), tmp_path / "own.toml")
    radar = (tmp_path / "own.toml").read_text()
    (tmp_path / "own.toml").write_text(radar + '# "pattern.csv"\n')
    (tmp_path / "board.toml").write_text("x = 1")
    (tmp_path / "chirps.mmwave.json").write_text('{"mmWaveDevices": []}')
    (tmp_path / "chirps.setup.json").write_text('{"configUsed": "C:\\\\lab\\\\chirps.mmwave.json"}')
    (tmp_path / "scene" / "room.xml").write_text('<string name="filename" value="parts/wall.ply"/>')
    (tmp_path / "receiver.toml").write_text('adc = {bits = 12}\ninterferers = [{radar = "INTERFERER"}]')
    interferer = tmp_path / "other.toml"
    receiver = (tmp_path / "receiver.toml").read_text().replace("INTERFERER", str(interferer))
    (tmp_path / "receiver.toml").write_text(receiver)
    for name in ("pattern.csv", "scene/room.toml", "scene/parts/wall.ply", "meshes/0.ply", "meshes/more/1.ply"):
        (tmp_path / name).write_text("")
    interferer.write_text("")
    (tmp_path / "unused.csv").write_text("")
    text = """
        places = "scene/room.xml"
        receiver = "receiver.toml"
        [[radars]]
        radar = "own.toml"
        [[radars]]
        radar = "chirps.mmwave.json"
        board = "board.toml"
        [[sources]]
        clip = "meshes"
        frame_rate = 10.0
        """
    before = of_files(tmp_path, text)
    for path in [each for each in sorted(tmp_path.rglob("*")) if each.is_file()]:
        whole = path.read_text()
        path.write_text(whole + "\n " if path.name != "receiver.toml" else whole.replace("12", "10"))
        assert (of_files(tmp_path, text) == before) == (path.name == "unused.csv"), path
        path.write_text(whole)
    assert of_files(tmp_path, text) == before


def test_the_digest_is_the_same_in_another_folder(tmp_path: Path) -> None:
    found = set()
    for name in ("one", "two"):
        (tmp_path / name / "meshes").mkdir(parents=True)
        (tmp_path / name / "meshes" / "0.ply").write_text("")
        found.add(of_files(tmp_path / name, '[[sources]]\nclip = "meshes"\nframe_rate = 10.0'))
    assert len(found) == 1


def test_a_file_that_is_gone_has_no_digest(tmp_path: Path) -> None:
    with pytest.raises(RecipeError, match=r"sources\[0\]: .*none.npy"):
        of_files(tmp_path, '[[sources]]\njoints = "none.npy"\nlayout = "smpl22"')


def test_what_the_prompt_says_of_the_place_is_not_drawn(tmp_path: Path) -> None:
    recipe = Recipe.parse(
        """
        count = 30
        prompts = ["a person waves", "a man, at 2.5 m, claps", "a person 3 m away waves"]
        distance_m = {range = [1.0, 2.0]}
        azimuth_deg = {range = [-5.0, 5.0]}
        """
    )
    for spec in recipe:
        own = {"a man, at 2.5 m, claps": 2.5, "a person 3 m away waves": 3.0}.get(spec.prompt)
        assert spec.distance_m == own if own else 1.0 <= spec.distance_m <= 2.0  # type: ignore[operator]
        assert spec.azimuth_deg is not None
    (tmp_path / "ball.ply").write_text("")
    placed = 'distance_m = 2.0\n[[sources]]\nmesh = "ball.ply"\nmaterial = "metal"\nposition_m = [4, 0, 1]'
    spec = Recipe.parse("count = 2\n" + placed, tmp_path, check=False).recording(0)
    assert (spec.distance_m, spec.azimuth_deg, spec.orientation_deg) == (None, None, None)


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
