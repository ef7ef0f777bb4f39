"""A set makes others from its paths: the same scenes with other noise and presets, in the same splits."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from rfgen_sionna import cli
from rfgen_sionna.dataset import RunFormatError, open_dataset
from rfgen_sionna.dataset.checksums import damaged
from rfgen_sionna.dataset.store import OutputError
from rfgen_sionna.recipes import augmentation
from rfgen_sionna.recipes.augmentation import Variant, augment_dataset, read_variants, variants_of
from rfgen_sionna.recipes.building import build_dataset
from rfgen_sionna.recipes.building_folder import BuildingFolder, BusyError
from rfgen_sionna.recipes.repairing import repair_dataset
from tests.unit.recipes.small_recipes import write_small_recipe


def built(folder: Path, keep: str, count: int = 3) -> Path:
    recipe = write_small_recipe(folder / "recipe", count)
    text = recipe.read_text(encoding="utf-8").replace('keep = ["adc", "labels"]', f"keep = {keep}")
    recipe.write_text(text, encoding="utf-8")
    build_dataset(recipe, folder / "set", workers=1)
    return folder / "set"


@pytest.fixture(scope="module")
def traced(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built(tmp_path_factory.mktemp("sets"), '["adc", "labels", "body", "paths"]')


@pytest.fixture(scope="module")
def derived(traced: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("derived") / "set"
    augment_dataset(traced, folder, [Variant(seed=1)]).close()
    return folder


def test_variants_are_recordings_of_their_own_in_the_same_splits(traced: Path, tmp_path: Path) -> None:
    steps: list[Any] = []
    variants = [Variant(seed=0), Variant(), Variant(receiver={"adc": "none", "thermal_noise": False})]
    step = lambda *numbers: steps.append(numbers)  # noqa: E731
    with augment_dataset(traced, tmp_path / "new", variants, progress=step) as new, open_dataset(traced) as old:
        assert steps[-1] == (9, 9)
        assert [row.number for row in new.rows] == list(range(9))
        assert [row.split for row in new.rows] == 3 * [row.split for row in old.rows]
        assert [row.place for row in new.rows] == 3 * [row.place for row in old.rows]
        for number in range(3):
            samples = [new[number + 3 * variant].cube().data for variant in range(3)]
            recorded = old[number]
            assert recorded.has_paths
            assert not new[number].has_paths
            # Both are the noiseless echoes, with noise of their own.
            noise = [each - samples[2] for each in (*samples[:2], recorded.cube().data)]
            levels = [float(np.std(each)) for each in noise]
            np.testing.assert_allclose(levels, levels[0], rtol=0.2)
            for first, second in ((0, 1), (0, 2), (1, 2)):
                coherence = np.vdot(noise[first], noise[second]) / noise[0].size / levels[0] ** 2
                assert abs(coherence) < 0.1
            np.testing.assert_array_equal(new[number + 3].labels["position"].values, recorded.labels["position"].values)
    assert damaged(tmp_path / "new") == []
    assert not (tmp_path / "new" / ".building").exists()
    assert variants_of(tmp_path / "new") == variants


def test_a_seed_gives_every_recording_its_own_noise(traced: Path, tmp_path: Path) -> None:
    """Noise of a test recording that is that of one in training would be known to a network."""
    quiet = Variant(receiver={"adc": "none", "thermal_noise": False})
    with augment_dataset(traced, tmp_path / "new", [Variant(seed=7), quiet]) as new:
        seeds = [row.seed for row in new.rows[:3]]
        assert len(set(seeds)) == 3
        noise = [new[number].cube().data - new[number + 3].cube().data for number in range(3)]
        for first, second in ((0, 1), (0, 2), (1, 2)):
            norms = np.linalg.norm(noise[first]) * np.linalg.norm(noise[second])
            assert abs(np.vdot(noise[first], noise[second])) / norms < 0.1


def test_the_new_set_says_that_it_is_derived_and_from_what(traced: Path, derived: Path) -> None:
    with open_dataset(traced) as old, open_dataset(derived) as new:
        source = old.index.meta["recipe_digest"]
        assert new.index.meta["derived"] == f"augmentation of the set of recipe {source}"
        assert "derived" not in old.index.meta
        assert new.index.meta["recordings"] == "3"
    card = (derived / "README.md").read_text(encoding="utf-8")
    assert "other samples of its paths" in card
    assert f"Derived by augment_dataset from the stored paths of another set (SHA-256 of its recipe: {source})" in card
    with pytest.raises(ValueError, match="is derived from no other set"):
        variants_of(traced)


def test_repair_needs_no_paths_for_what_holds_no_recordings(derived: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(derived, tmp_path / "new"))
    whole = {path.name: path.read_bytes() for path in folder.iterdir() if path.name != ".verified"}
    for names in (["README.md"], ["index.sqlite"], ["SHA256SUMS"], ["recipe.toml"], ["README.md", "index.sqlite"]):
        for name in names:
            (folder / name).write_bytes(whole[name][:-9] + b"something")
        if "README.md" not in names:
            with pytest.raises(ValueError, match="rfgen dataset repair"):
                _ = open_dataset(folder).recipe_text
        assert repair_dataset(folder, workers=1) is not None
        assert {path.name: path.read_bytes() for path in folder.iterdir() if path.name != ".verified"} == whole


def test_lost_recordings_are_made_again_from_their_set(traced: Path, derived: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(derived, tmp_path / "new"))
    whole = {path.name: path.read_bytes() for path in folder.iterdir() if path.name != ".verified"}
    shard = folder / "shard-00000.h5"
    middle = len(whole[shard.name]) // 2
    shard.write_bytes(whole[shard.name][:middle])
    with pytest.raises(ValueError, match=r"derived from another set.*augment_dataset\(SOURCE, .*resume=True"):
        repair_dataset(folder, workers=1)
    with pytest.raises(OutputError, match="holds no set of this one, these variants and keep"):
        augment_dataset(traced, folder, [Variant(seed=2)], resume=True)
    variants = variants_of(folder)
    shard.unlink()
    augment_dataset(traced, folder, variants, resume=True).close()
    assert {path.name: path.read_bytes() for path in folder.iterdir() if path.name != ".verified"} == whole


def test_one_process_works_in_a_folder(traced: Path, tmp_path: Path) -> None:
    with open_dataset(traced) as source:
        state = BuildingFolder(tmp_path / "new", augmentation._facts(source, [Variant()], None, "cpu"))
    with state.locked(), pytest.raises(BusyError, match="is being built by"):
        augment_dataset(traced, tmp_path / "new", [Variant()])


def test_the_same_call_gives_the_same_bytes(traced: Path, derived: Path, tmp_path: Path) -> None:
    augment_dataset(traced, tmp_path / "new", [Variant(seed=1)], workers=2).close()
    for path in sorted(derived.glob("[!.]*")):
        assert path.read_bytes() == (tmp_path / "new" / path.name).read_bytes()


def test_the_command_line_makes_the_same_bytes(traced: Path, derived: Path, tmp_path: Path) -> None:
    (tmp_path / "variants.toml").write_text("[[variants]]\nseed = 1\n")
    command = ["dataset", "augment", str(traced), str(tmp_path / "new"), "--workers", "1"]
    for options in (["--variants", str(tmp_path / "variants.toml")], ["--resume"]):
        done = CliRunner().invoke(cli.app, [*command, *options])
        assert done.exit_code == 0, done.output
        for path in sorted(derived.glob("[!.]*")):
            assert path.read_bytes() == (tmp_path / "new" / path.name).read_bytes()
        (tmp_path / "new" / "shard-00000.h5").unlink()
    assert "give one of them" in str(CliRunner().invoke(cli.app, command).exception)


def test_variants_of_a_file_are_checked_and_name_radars_beside_it(tmp_path: Path) -> None:
    file = tmp_path / "variants.toml"
    (tmp_path / "own.toml").touch()
    file.write_text('[[variants]]\nradar = "own.toml"\n[[variants]]\nradar = "awr1843"\nreceiver = {adc = "none"}\n')
    own, shipped = read_variants(file)
    assert (own.radar, shipped) == (str(tmp_path / "own.toml"), Variant(radar="awr1843", receiver={"adc": "none"}))
    for text, said in (
        ("variants = []", "has no tables"),
        ("[[variants]]\nbits = 9", "has the key 'bits'; allowed"),
    ):
        file.write_text(text)
        with pytest.raises(ValueError, match=said):
            read_variants(file)


def test_a_variant_may_have_another_preset(traced: Path, tmp_path: Path) -> None:
    file = tmp_path / "narrow.toml"
    text = (traced.parent / "recipe" / "tiny.toml").read_text(encoding="utf-8")
    file.write_text(text.replace("num_samples = 64", "num_samples = 32"), encoding="utf-8")
    with augment_dataset(traced, tmp_path / "new", [Variant(radar=str(file))]) as new, open_dataset(traced) as old:
        assert new[0].adc.shape == (*old[0].adc.shape[:-1], 32)
        assert new.rows[0].spec["radars"][0]["radar"] == "narrow.toml"


def test_mistakes_are_named_before_anything_is_written(traced: Path, tmp_path: Path) -> None:
    with pytest.raises(TypeError, match="a list of Variant is needed"):
        augment_dataset(traced, tmp_path / "new", [])
    radar = str(traced.parent / "recipe" / "tiny.toml")
    with pytest.raises(ValueError, match="nonsense"):
        augment_dataset(traced, tmp_path / "new", [Variant(preset="nonsense", radar=radar)])
    with pytest.raises(OutputError, match="is not empty"):
        augment_dataset(traced, traced, [Variant()])
    plain = built(tmp_path / "plain", '["adc"]', 2)
    with pytest.raises(RunFormatError, match="holds no paths"):
        augment_dataset(plain, tmp_path / "new", [Variant()])
    assert not (tmp_path / "new").exists()
