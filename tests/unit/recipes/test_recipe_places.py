"""A place that a file gives has the file's name everywhere: a set is the same wherever its recipe lies."""

from __future__ import annotations

from pathlib import Path

import pytest
import trimesh

from rfgen_sionna.dataset import open_dataset
from rfgen_sionna.recipes.building import build_dataset
from rfgen_sionna.recipes.recipe import Recipe
from rfgen_sionna.recipes.recipe_error import RecipeError
from rfgen_sionna.recipes.recording_spec import RecordingSpec
from tests.unit.recipes.small_recipes import write_small_recipe

SCENE = """<scene version="2.1.0"><bsdf type="diffuse" id="mat-itu_concrete"/>
<shape type="ply" id="mesh-Wall"><string name="filename" value="wall.ply"/><ref id="mat-itu_concrete" name="bsdf"/>
</shape></scene>"""


def write_recipe(folder: Path, places: str = '"rooms/wall.xml"') -> Path:
    for name in ("rooms", "others"):
        (folder / name).mkdir(parents=True)
        trimesh.creation.box((0.1, 4.0, 2.0), transform=trimesh.transformations.translation_matrix((5, 0, 1))).export(
            folder / name / "wall.ply"
        )
        (folder / name / "wall.xml").write_text(SCENE, encoding="utf-8")
    return write_small_recipe(folder, 2, f"places = {places}")


def test_a_set_in_a_scene_of_a_file_is_the_same_in_another_folder(tmp_path: Path) -> None:
    written = []
    for name in ("one", "another_one"):
        build_dataset(write_recipe(tmp_path / name), tmp_path / name / "set", workers=1)
        folder = tmp_path / name / "set"
        with open_dataset(folder) as made:
            assert [row.place for row in made.rows] == 2 * ["wall.xml"]
            assert "place_file" not in made.rows[0].spec
            assert RecordingSpec.from_dict(made.rows[0].spec).place == "wall.xml"
        assert "wall.xml" in (folder / "README.md").read_text(encoding="utf-8")
        files = sorted(path for path in folder.iterdir() if not path.name.startswith("."))
        written.append({path.name: path.read_bytes() for path in files})
        for name_of_file, data in written[-1].items():
            assert str(tmp_path).encode() not in data, name_of_file
    assert written[0] == written[1]


def test_the_spec_leads_to_the_file(tmp_path: Path) -> None:
    recipe = Recipe.load(write_recipe(tmp_path))
    assert recipe.recording(0).place == "wall.xml"
    assert recipe.recording(0).place_file == str(tmp_path / "rooms" / "wall.xml")


def test_two_files_of_one_name_are_refused(tmp_path: Path) -> None:
    recipe = write_recipe(tmp_path, '["rooms/wall.xml", "others/wall.xml"]')
    with pytest.raises(RecipeError, match=r"places: .*both named 'wall\.xml': rename one"):
        Recipe.load(recipe)
    text = recipe.read_text(encoding="utf-8").replace("others/wall.xml", "rooms/../rooms/wall.xml")
    recipe.write_text(text, encoding="utf-8")
    assert {each.place for each in Recipe.load(recipe)} == {"wall.xml"}
