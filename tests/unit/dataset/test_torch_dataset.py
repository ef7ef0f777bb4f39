"""What a training loop sees of a data set."""

import multiprocessing
import pickle
from dataclasses import replace

import h5py
import numpy as np
import pytest
import torch
from torch.utils.data import DataLoader

from rfgen_sionna.dataset import open_dataset
from rfgen_sionna.dataset.adc_words import AdcWords
from rfgen_sionna.dataset.shards import assemble_shard, recording_digest
from rfgen_sionna.dataset.torch import RadarDataset, StreamingRadarDataset, to_db
from rfgen_sionna.dataset.windows import WindowReader
from rfgen_sionna.processing import range_doppler
from tests.unit.dataset.small_sets import ACTIONS, JOINTS, finish, make_set, small_radar, write_part


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return make_set(tmp_path_factory.mktemp("torch") / "set")


def half_power(run, frames):
    """A representation of the user's own."""
    return 0.5 * run.representation("range_doppler", frames).values


def test_items_are_maps_and_class_numbers(folder):
    data = RadarDataset(folder, "train", "range_doppler", "action")
    assert data.classes == ACTIONS
    assert len(data) == 8
    x, y = data[0]
    assert x.shape == (5, 32, 8)
    assert x.dtype == torch.float32
    with open_dataset(folder).split("train")[0] as run:
        np.testing.assert_allclose(x, run.representation("range_doppler").values)
        assert data.classes[y] == run.stored("labels/action").asstr()[0, 0]


def test_maps_of_words_are_those_of_samples(tmp_path):
    folder = make_set(tmp_path / "set", count=2, words=True)
    data = RadarDataset(folder, None)
    with open_dataset(folder)[0] as run:
        assert isinstance(run.adc, AdcWords)
        power = range_doppler(run.adc[:], run.radar).power
        np.testing.assert_allclose(data[0][0], power, rtol=1e-4, atol=1e-6 * power.max())
        np.testing.assert_array_equal(run.representation("range_doppler").values.shape, data[0][0].shape)


@pytest.mark.parametrize("context", ["fork", pytest.param("spawn", marks=pytest.mark.slow)])
def test_workers_give_the_items_of_the_main_process(folder, context):
    data = RadarDataset(folder, "train", {"map": "range_doppler", "half": half_power}, ["action", "joints", "distance"])
    alone = list(DataLoader(data, batch_size=4))
    data[0]  # files are open when the workers start
    shared = list(DataLoader(data, batch_size=4, num_workers=2, multiprocessing_context=context))
    assert len(alone) == len(shared) == 2
    for one, other in zip(alone, shared, strict=True):
        assert set(one) == {"map", "half", "action", "joints", "distance"}
        for name in one:
            torch.testing.assert_close(one[name], other[name], rtol=0, atol=0)
    torch.testing.assert_close(alone[0]["map"], 2 * alone[0]["half"])
    assert alone[0]["joints"].shape == (4, 5, 1, len(JOINTS), 3)
    assert data.joint_names == JOINTS
    assert multiprocessing.active_children() == []


def test_windows_in_time(folder):
    data = RadarDataset(folder, "train", "range_doppler", ["recording", "position"], window_s=0.2, stride_s=0.1)
    assert len(data) == 8 * 4  # five frames at 10 Hz: windows of two, one apart
    whole = RadarDataset(folder, "train", "range_doppler", "action")
    for index, first in ((0, 0), (1, 1), (3, 3)):
        torch.testing.assert_close(data[index]["x"], whole[0][0][first : first + 2])
    assert data[0]["position"].shape == (2, 1, 3)
    assert data[4]["recording"] == open_dataset(folder).split("train").rows[1].number


def test_labels_by_name(folder):
    item = RadarDataset(folder, None, "adc", ["action", "actions", "place", "distance_m", "azimuth_deg", "seed"])[1]
    assert item["x"].dtype == torch.complex64
    assert item["x"].shape == (5, 8, 3, 4, 32)
    assert item["actions"].tolist() == [0.0, 1.0]
    assert (item["distance_m"], item["seed"]) == (pytest.approx(1.05), 101)
    assert np.isnan(item["azimuth_deg"])
    data = RadarDataset(folder, None, "drai", "place")
    assert data.places[data[0][1]] == "furnished: office"


def test_point_clouds_have_one_shape(folder):
    data = RadarDataset(folder, "train", "point_cloud", "action", max_points=3)
    x, _ = next(iter(DataLoader(data, batch_size=8)))
    assert x.shape == (8, 5, 3, 9)
    with open_dataset(folder).split("train")[0] as run:
        rows = run.representation("point_cloud").frame(0)[:3]
    np.testing.assert_array_equal(x[0, 0, : len(rows)], rows)
    assert not x[0, 0, len(rows) :].any()


def test_transform_and_decibels(folder):
    power, _ = RadarDataset(folder, "test")[0]
    level, _ = RadarDataset(folder, "test", transform=to_db)[0]
    torch.testing.assert_close(level, 10 * torch.log10(power.clamp_min(1e-20)))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"split": "validation"}, "validation.*train|train.*validation"),
        ({"representation": "range_angle"}, "'range_angle'.*'range_doppler'"),
        ({"labels": "jonts"}, "'jonts'.*joints"),
        ({"labels": ["action", "gender"]}, "'gender'.*position"),
        ({"radar": "left"}, "left"),
        ({"window_s": 2.0}, "20 frames.* 5"),
        ({"window_s": -1.0}, "more than 0"),
        ({"stride_s": 0.1}, "window_s"),
        ({"representation": "point_cloud", "max_points": 0}, "at least 1"),
    ],
)
def test_what_is_not_there_is_named(folder, options, message):
    with pytest.raises((ValueError, KeyError), match=message):
        RadarDataset(folder, **({"split": "train"} | options))


def test_lengths_that_differ_need_windows(tmp_path):
    folder = make_set(tmp_path / "set", count=2, per_shard=1, splits=("train",))
    write_part(tmp_path / "long.h5", 2, "push", "train", frames=7)
    assemble_shard(folder / "shard-00002.h5", {2: tmp_path / "long.h5"}, {})
    finish(folder)
    with pytest.raises(ValueError, match=r"5 … 7 frames.*window_s"):
        RadarDataset(folder)
    assert len(RadarDataset(folder, window_s=0.2)) == 2 + 2 + 3


def test_representations_that_were_not_stored(tmp_path):
    folder = make_set(tmp_path / "set", count=2, keep=("joints", "labels"))
    with pytest.raises(ValueError, match=r"'range_doppler'.*joints, labels"):
        RadarDataset(folder, None)
    assert RadarDataset(folder, None, lambda run, frames: np.zeros(3), "joints")[0][0].shape == (3,)


def test_several_radars_need_a_name(tmp_path):
    folder = make_set(tmp_path / "set", count=2, radars=("left", "right"))
    with pytest.raises(ValueError, match="'left', 'right'"):
        RadarDataset(folder, None)
    left = RadarDataset(folder, None, radar="left")
    torch.testing.assert_close(left[0][0], RadarDataset(folder, None, radar="right")[0][0])


def test_pickled_sets_open_files_anew(folder):
    data = RadarDataset(folder)
    torch.testing.assert_close(pickle.loads(pickle.dumps(data))[3][0], data[3][0])


def _numbers(data, workers=0):
    return [int(each) for batch in DataLoader(data, batch_size=2, num_workers=workers) for each in batch["recording"]]


@pytest.mark.parametrize("workers", [0, 1, 2])
def test_an_epoch_of_a_stream_has_each_item_once(folder, workers):
    data = StreamingRadarDataset(folder, None, "range_doppler", ["recording"], window_s=0.2, shuffle=4)
    expected = sorted(2 * list(range(12)))
    first = _numbers(data, workers)
    assert sorted(first) == expected
    assert len(first) == len(data)
    assert _numbers(data, workers) == first
    data.set_epoch(1)
    second = _numbers(data, workers)
    assert sorted(second) == expected
    assert second != first


def test_a_stream_without_shuffle_keeps_the_order(folder):
    data = StreamingRadarDataset(folder, None, "range_doppler", ["recording"], shuffle=0)
    assert _numbers(data) == list(range(12))


@pytest.mark.parametrize("ranks", [2, 5])
def test_ranks_share_a_stream(folder, ranks):
    for epoch in range(3):
        found = []
        for rank in range(ranks):
            data = StreamingRadarDataset(folder, None, "adc", ["recording"], rank=rank, world_size=ranks)
            data.set_epoch(epoch)
            found.append(_numbers(data))
        assert {len(each) for each in found} == {12 // ranks}
        flat = [number for each in found for number in each]
        assert len(set(flat)) == len(flat)


def test_a_rank_beyond_all_is_refused(folder):
    with pytest.raises(ValueError, match="world_size"):
        StreamingRadarDataset(folder, None, rank=2, world_size=2)


def test_joints_are_those_of_their_names(tmp_path):
    folder = make_set(tmp_path / "set", count=2, per_shard=2, splits=("train",))
    before = RadarDataset(folder, None, "adc", "joints")[1][1]
    with h5py.File(folder / "shard-00000.h5", "r+") as shard:
        names = shard["recordings/000001/actors/person/joint"]
        names[:] = [*JOINTS[1::-1], *JOINTS[2:-1], "tail"]
        group = shard["recordings/000001"]
        group.attrs["digest"] = recording_digest(group)
    finish(folder)
    after = RadarDataset(folder, None, "adc", "joints")[1][1]
    assert after[..., -1, :].isnan().all()
    np.testing.assert_array_equal(after[..., [1, 0], :], before[..., :2, :])
    np.testing.assert_array_equal(after[..., 2:-1, :], before[..., 2:-1, :])


def test_recordings_without_an_action_are_named(tmp_path):
    with open_dataset(make_set(tmp_path / "set", count=2, per_shard=2, splits=("train",))) as recordings:
        rows = recordings.rows[0], replace(recordings.rows[1], actions=())
        with pytest.raises(ValueError, match=r"recording 1 .* has 0 actors"):
            WindowReader(recordings._part(rows), None, "adc", ["action"])


def test_windows_have_a_frame_at_least(tmp_path):
    folder = make_set(tmp_path / "set", count=1)
    period = small_radar().waveform.frame_period
    assert len(RadarDataset(folder, None, "adc", "action", window_s=period)) == 5
    with pytest.raises(ValueError, match=r"window_s is .*: a frame takes 0\.1 s"):
        RadarDataset(folder, None, "adc", "action", window_s=0.5 * period)
