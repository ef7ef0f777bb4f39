"""Contact sheets, and the choice of recordings for them."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from rfgen_sionna.dataset import OutputError
from rfgen_sionna.show.contact_sheet import contact_sheet, draw_dataset_sheet, spread_sample
from tests.unit.dataset.small_sets import make_set

few_cells = pytest.mark.filterwarnings("ignore::scipy.integrate.IntegrationWarning")
"""Thresholds of order statistics of few cells are integrals at the limit of their routine."""


def test_a_sample_has_all_values_before_any_of_them_often():
    kinds = [
        ("train" if k % 10 else "test", "office" if k % 3 else "free space", f"action {k % 8}") for k in range(400)
    ]
    chosen = spread_sample(kinds, 16, seed=3)
    assert len(set(chosen)) == 16
    assert chosen == sorted(chosen)
    counts = [Counter(kinds[index][k] for index in chosen) for k in range(3)]
    assert min(counts[0].values()) >= 6  # a tenth of the set is for tests
    assert min(counts[1].values()) >= 6
    assert len(counts[2]) == 8
    assert max(counts[2].values()) <= 3
    assert chosen == spread_sample(kinds, 16, seed=3)
    assert chosen != spread_sample(kinds, 16, seed=4)


@given(
    st.lists(st.tuples(st.sampled_from("ab"), st.sampled_from("cde")), max_size=30),
    st.integers(1, 40),
    st.integers(0, 5),
)
def test_a_sample_has_different_things_as_many_as_there_are(kinds, count, seed):
    chosen = spread_sample(kinds, count, seed)
    assert len(chosen) == len(set(chosen)) == min(count, len(kinds))
    assert set(chosen) <= set(range(len(kinds)))


def test_a_sheet_shows_each_run_in_four_pictures(make_run, tmp_path):
    runs = {"with images": make_run("sheet"), "bare": make_run("bare", pir=False, actors=False)}
    seen = []
    path = contact_sheet(runs, tmp_path / "sheet.png", progress=lambda done, of: seen.append((done, of)))
    assert seen == [(1, 2), (2, 2)]
    picture = np.asarray(Image.open(path).convert("RGB"), np.int16)
    height, width = picture.shape[:2]
    assert width < 1500
    assert height < 300
    colourful = np.ptp(picture, axis=2) > 60  # maps, and points in the colours of velocities
    parts = np.array_split(colourful, 8, axis=1)
    for run in (0, 1):
        assert parts[4 * run + 1].mean() > 0.005
        assert parts[4 * run + 2].mean() > 0.005
    dark = (picture.max(axis=2) < 200) & ~colourful
    with_mesh, without = (np.array_split(dark[45:-45], 8, axis=1)[part].mean() for part in (0, 4))
    assert with_mesh > 0.05
    assert without < 0.01


@few_cells
def test_a_set_is_sampled_over_its_splits_and_places(tmp_path):
    folder = make_set(tmp_path / "set", count=6, per_shard=3)
    seen = []
    path = draw_dataset_sheet(folder, tmp_path / "set.png", count=4, progress=lambda *step: seen.append(step))
    assert seen[-1] == (4, 4)
    with Image.open(path) as picture:
        assert picture.size[0] > 1200
    with pytest.raises(OutputError, match="exists"):
        draw_dataset_sheet(folder, path)
    with pytest.raises(ValueError, match="count is 0"):
        draw_dataset_sheet(folder, tmp_path / "none.png", count=0)
    with pytest.raises(ValueError, match=r"allowed: \."):
        draw_dataset_sheet(folder, tmp_path / "set.h5")
    with pytest.raises(ValueError, match="no recordings"):
        contact_sheet({}, tmp_path / "none.png")
