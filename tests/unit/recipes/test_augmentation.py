"""A set makes others from its paths: the same scenes with other noise and presets, in the same splits."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rfgen_sionna.dataset import RunFormatError, open_dataset
from rfgen_sionna.dataset.checksums import damaged
from rfgen_sionna.dataset.store import OutputError
from rfgen_sionna.recipes.augmentation import Variant, augment_dataset
from rfgen_sionna.recipes.building import build_dataset
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
            assert new.rows[number].spec["seed"] == 0
    assert damaged(tmp_path / "new") == []
    assert not (tmp_path / "new" / ".augmenting").exists()
    assert "other samples of its paths" in (tmp_path / "new" / "README.md").read_text(encoding="utf-8")


def test_the_same_call_gives_the_same_bytes(traced: Path, tmp_path: Path) -> None:
    for name in ("a", "b"):
        augment_dataset(traced, tmp_path / name, [Variant(seed=7)]).close()
    for path in sorted((tmp_path / "a").glob("shard-*.h5")):
        assert path.read_bytes() == (tmp_path / "b" / path.name).read_bytes()


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
