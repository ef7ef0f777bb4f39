"""A recipe that cannot be made is refused whole, before anything runs, with the key and the cure."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from rfgen_sionna.generative.motion import KinematicSource
from rfgen_sionna.generative.motion.clip_editing import joint_places
from rfgen_sionna.recipes import Recipe, RecipeError

WAVES = 'count = 20\nprompts = "a person waves"\nradar = "awr1843"\npreset = "mmmesh"\n'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("count = 3", "prompts is missing"),
        (WAVES + "splits = {shares = {a = 0.98, b = 0.02}}", "'b' would be empty with 20 recordings"),
        (
            'prompts = {grid = ["a person waves", "a person claps"]}\nsplits = {shares = {a = 0.5, b = 0.5}}',
            "count is missing",
        ),
        ('prompts = "a person waves"', "count is missing"),
        ('count = 3\nprompts = ["a person waves", "a person flies to the moon"]', "prompts[1]: action: "),
        ('count = 3\nprompts = ["a person waves, blorb"]', "prompts[0]: "),
        ('count = 3\nprompts = "a person waves"\nmotion = "kinematic"\npeople = 7', "less than or equal to 6"),
        ('count = 3\nprompts = "a woman walks past a man who sits"\npeople = 2', "is about 2 actors already"),
        (WAVES.replace("awr1843", "awr1834"), "no such radar: did you mean 'awr1843'?"),
        (WAVES.replace("mmmesh", "mmmsh"), "radar: "),
        (WAVES + '[[radars]]\nradar = "awr1843"', "radar belongs to a recipe with one radar"),
        (WAVES + 'board = "nothing"', "board is 'nothing', and there is no such radar"),
        (WAVES + "receiver = {leakge = {level_db = 1.0}}", "receiver: "),
        (WAVES + 'receiver = "board.toml"', "a relative path, and the recipe has no folder"),
        (WAVES + 'keep = ["adc", "range_dopler"]', "range_dopler"),
        (WAVES + 'keep = ["adc", "adc"]', "a name twice"),
        (WAVES + "distance_m = 300.0", "distance_m is 300 m; the range window of radar 'awr1843' (preset"),
        (WAVES + "distance_m = 0.2", "distance_m is 0.2 m: at least 0.5 m are needed"),
        (WAVES.replace("waves", "waves at 200 m"), "the distance of 'a person waves at 200 m' is 200 m"),
        (WAVES + "duration_s = 0.001", "duration_s is 0.001, but one frame of radar 'awr1843'"),
        (WAVES + "look_at_m = [0, 0, 1]", "the position of the radar: a point away from it is needed"),
        (WAVES + 'places = "the moon"', "places: environment: 'the moon' names no scene that is known"),
        (WAVES + 'places = "an office with a desk"', "'desk' was not understood"),
        (WAVES + 'places = "furnished: a bedroom"\ndistance_m = 7.0', "'furnished: bedroom' is too small"),
        (WAVES + 'places = "living_room"\ndistance_m = {range = [6.0, 7.0]}', "'living_room' is too small"),
        (WAVES + 'places = "living_room"\nposition_m = [0, 0, 5]', "position_m is [0.0, 0.0, 5.0], outside of"),
        (
            'count = 9\nduration_s = 20.0\nprompts = "a person walks towards the radar"\nplaces = "a bedroom"',
            "the way of 'a person walks towards the radar' in 20 s is 24.0 m long",
        ),
        (WAVES.replace("waves", "waves in an office") + 'places = "a lab"', "the prompt 'a person waves in "),
        (WAVES.replace("person", "tall man") + 'bodies = {gender = "female"}', "says the gender, too"),
        (WAVES + "bodies = {height_m = {grid = [1.6, 1.8]}}", "bodies.height_m is a grid"),
        (
            WAVES + 'people = 2\nbodies = {pool = 3}\nsplits = {shares = {a = 0.5, b = 0.5}, by = ["body"]}',
            "bodies.pool is 3: split 'b' has 1 of them, and recordings have 2 people",
        ),
        (
            WAVES + 'bodies = {pool = 2}\nsplits = {shares = {a = 0.5, b = 0.3, c = 0.2}, by = ["body"]}',
            "bodies.pool is 2, and splits.by has 'body': 2 for 3 splits",
        ),
        (
            WAVES + 'places = "a lab"\nlayouts = 1\nsplits = {shares = {a = 0.5, b = 0.5}, by = ["place"]}',
            "layouts is 1, and splits.by has 'place'",
        ),
        (WAVES + 'splits = {shares = {a = 0.5, b = 0.5}, by = ["action"]}', "'action', and there are 1 (wave)"),
        (
            WAVES + 'places = "living_room"\nsplits = {shares = {a = 0.5, b = 0.5}, by = ["place"]}',
            "living_room cannot be in 2 splits at once",
        ),
        ('count = 3\n[[sources]]\nclip = "/no/such/file.bvh"', "sources[0]: there is no file '/no/such/file.bvh'"),
        ('count = 3\n[[sources]]\nmesh = "/dev/zero"\nmaterial = "metal"', "sources[0]: there is no file '/dev/zero'"),
        ('count = 3\n[[sources]]\nprompt = "a person waves"\nweight = 0.0', "weight is 0 in all of them"),
    ],
)  # fmt: skip
def test_what_cannot_be_made_is_refused(text: str, message: str) -> None:
    with pytest.raises(RecipeError) as caught:
        Recipe.parse(text)
    assert message in str(caught.value)


def test_all_prompts_that_cannot_be_met_are_named() -> None:
    with pytest.raises(RecipeError) as caught:
        Recipe.parse('count = 3\nprompts = ["a person flies to the moon", "a person waves", "a person teleports"]')
    first, second = str(caught.value).splitlines()
    assert first.startswith("prompts[0]")
    assert second.startswith("prompts[2]")


def test_radars_far_apart_each_have_their_range_window() -> None:
    radars = '[[radars]]\nradar = "awr1843"\npreset = "mmmesh"\n[[radars]]\nname = "far"\nradar = "awr1843"\n'
    radars += 'preset = "mmmesh"\nposition_m = [500, 0, 1]\nlook_at_m = [0, 0, 1]\n'
    with pytest.raises(RecipeError, match="the range window of radar 'awr1843'"):
        Recipe.parse('count = 3\nprompts = "a person waves"\n' + radars)
    Recipe.parse('count = 3\nprompts = "a person waves"\noutside = "ignore"\n' + radars)


def test_two_radars_have_two_names() -> None:
    two = '[[radars]]\nradar = "awr1843"\n' * 2
    recipe = Recipe.parse('count = 3\nprompts = "a person waves"\n' + two)
    assert [radar.name for radar in recipe.recording(0).radars] == ["awr1843_1", "awr1843_2"]
    named = two.replace('"\n', '"\nname = "one"\n')
    with pytest.raises(RecipeError, match=r"radars\[1\].name: 'one' is another radar's, too"):
        Recipe.parse('count = 3\nprompts = "a person waves"\n' + named)


def test_files_are_read_before_anything_runs(tmp_path: Path) -> None:
    trimesh.creation.icosphere(1, 0.1).export(tmp_path / "ball.ply")
    (tmp_path / "broken.ply").write_text("ply\nnothing")
    np.save(tmp_path / "broken.npy", np.zeros((4, 3)))
    text = 'count = 3\n[[sources]]\nmesh = "{}"\nmaterial = "{}"\n'
    recipe = Recipe.parse(text.format("ball.ply", "metal"), tmp_path)
    assert recipe.recording(0).sources[0].file == str(tmp_path.resolve() / "ball.ply")
    assert recipe.recording(0).bodies == ()
    for file, material in (("broken.ply", "metal"), ("ball.ply", "unobtainium")):
        with pytest.raises(RecipeError, match=r"sources\[0\]: "):
            Recipe.parse(text.format(file, material), tmp_path)
    with pytest.raises(RecipeError, match=r"sources\[0\]: "):
        Recipe.parse('count = 3\n[[sources]]\njoints = "broken.npy"\nlayout = "smpl22"', tmp_path)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ("position_m = [50, 0.5, 1]", r"sources\[0\].position_m is \[50.0, 0.5, 1.0\], 50 m from radar 'awr1843'"),
        ("position_m = [-3, 0.5, 1]", "behind the radar"),
        ("position_m = [0, 0, 1]", "0 m from radar 'awr1843': at least 0.5 m"),
        ("position_m = [-3, 0.5, 1]\nvelocity_m_s = [2, 0, 0]", ""),
        ("position_m = [3, 0.5, 1]", ""),
    ],
)
def test_meshes_are_within_the_sight_of_the_radar(tmp_path: Path, more: str, message: str) -> None:
    trimesh.creation.icosphere(1, 0.1).export(tmp_path / "ball.ply")
    text = f'count = 3\npreset = "mmmesh"\n[[sources]]\nmesh = "ball.ply"\nmaterial = "metal"\n{more}'
    if not message:
        Recipe.parse(text, tmp_path)
        return
    with pytest.raises(RecipeError, match=message):
        Recipe.parse(text, tmp_path)


def test_a_mesh_without_a_material_is_told_the_key(tmp_path: Path) -> None:
    trimesh.creation.icosphere(1, 0.1).export(tmp_path / "ball.ply")
    with pytest.raises(RecipeError, match=r"sources\[0\]: material is missing") as caught:
        Recipe.parse('count = 3\n[[sources]]\nmesh = "ball.ply"', tmp_path)
    assert len(str(caught.value)) < 250


def test_a_receiver_may_be_a_file(tmp_path: Path) -> None:
    (tmp_path / "board.toml").write_text("adc = {bits = 12, full_scale_dbm = -20.0}\n")
    recipe = Recipe.parse(WAVES + 'receiver = "board.toml"', tmp_path)
    assert recipe.recording(0).receiver == {"adc": {"bits": 12, "full_scale_dbm": -20.0}}
    (tmp_path / "board.toml").write_text("adc = [")
    with pytest.raises(RecipeError, match="receiver: "):
        Recipe.parse(WAVES + 'receiver = "board.toml"', tmp_path)


def test_joints_and_clips_are_read(tmp_path: Path) -> None:
    motion = KinematicSource()("wave", 1.0, 0)
    np.savez(tmp_path / "waving.npz", positions=joint_places(motion)[:, :22], frame_rate=motion.frame_rate)
    recipe = Recipe.parse('count = 3\n[[sources]]\njoints = "waving.npz"\nlayout = "smpl22"', tmp_path)
    spec = recipe.recording(0)
    assert (spec.sources[0].kind, spec.sources[0].options, len(spec.bodies)) == ("joints", {"layout": "smpl22"}, 1)
    with pytest.raises(RecipeError, match="people is 2, but a joints is alone"):
        Recipe.parse('count = 3\npeople = 2\n[[sources]]\njoints = "waving.npz"\nlayout = "smpl22"', tmp_path)
    (tmp_path / "meshes").mkdir()
    for index in range(3):
        trimesh.creation.icosphere(1, 0.1 + 0.01 * index).export(tmp_path / "meshes" / f"ball{index}.ply")
    swelling = 'count = 3\n[[sources]]\nclip = "meshes"\n'
    with pytest.raises(RecipeError, match=r"sources\[0\]: frame_rate: needed"):
        Recipe.parse(swelling, tmp_path)
    clip = Recipe.parse(swelling + "frame_rate = 10.0", tmp_path)
    assert "vertices" in clip.recording(0).keep
    assert clip.digest
    (tmp_path / "walk.bvh").write_text("HIERARCHY")
    with pytest.raises(RecipeError, match=r"sources\[0\]: "):
        Recipe.parse('count = 3\n[[sources]]\nclip = "walk.bvh"\nwords = "a tall man"', tmp_path)
    with pytest.raises(RecipeError, match=r"sources\[0\]: .*bicep"):
        Recipe.parse('count = 3\n[[sources]]\nclip = "walk.bvh"\nwords = "a man with bicepses"', tmp_path)


def test_what_changes_freely_is_stored_as_vertices() -> None:
    dog = 'count = 3\nprompts = "a dog runs"\n'
    assert Recipe.parse(dog).recording(0).keep == ("adc", "vertices", "joints", "labels")
    with pytest.raises(RecipeError, match="no parameters rebuild 'dog': keep 'vertices' instead"):
        Recipe.parse(dog + 'keep = ["adc", "body"]')
