"""Runs of slots, codes and several kinds of chirps in the file and in pictures."""

from __future__ import annotations

from dataclasses import replace

import h5py
import numpy as np
import pytest

from rfgen_sionna.dataset import RunInfo, RunWriter, open_run
from rfgen_sionna.radar import Radar
from rfgen_sionna.show.run_summary import summary
from rfgen_sionna.show.run_view import view_frame, view_run

KINDS = [
    ("awr1843", "bpm", "2 slots of 2 Tx (bpm)"),
    ("awr1843", "ddm", "1 slots of 3 Tx (ddm)"),
    ("awr1843", "near_far", "4 slots of 2 Tx (tdm, 2 kinds of chirps)"),
    ("awr1843", "triangle", "6 slots of 3 Tx (tdm, 2 kinds of chirps)"),
    ("mmwcas", "steered_left", "1 slots of 9 Tx (beam)"),
]


def written(path, name, preset):
    full = Radar.load(name, preset)
    radar = replace(full, waveform=replace(full.waveform, num_loops=32, num_samples=64))
    rng = np.random.default_rng(0)
    with RunWriter(path, RunInfo(radar)) as writer:
        for index in range(2):
            shape = radar.frame_shape
            samples = rng.standard_normal(shape) + 1j * rng.standard_normal(shape)
            writer.append(samples, time=index * 0.1, full_scale=8.0, clipped=0.25)
    return radar


@pytest.mark.parametrize(("name", "preset", "said"), KINDS)
def test_every_kind_of_frame_is_stored_and_shown(tmp_path, name, preset, said):
    path = tmp_path / "run.h5"
    radar = written(path, name, preset)
    with h5py.File(path) as file:
        assert tuple(file["tx"].asstr()[:]) == radar.axis_names
        assert file["sample_time"].shape == ((len(radar.axis_names), 64) if radar.waveform.other_profiles else (64,))
        assert file["tx_phase"].shape == file["tx_advance"].shape == (len(radar.axis_names), len(radar.tx_names))
        assert file["tx_position"].dims[0].label == "tx_element"
        np.testing.assert_array_equal(np.isnan(file["tx_phase"][:]), radar.waveform.axis_weights[0] == 0)
    with open_run(path) as run:
        assert run.radar == radar
        assert run.cube().data.shape == (2, *radar.frame_shape)
        assert (run.full_scale, run.clipped) == (8.0, 2 * round(0.25 * 2 * np.prod(radar.frame_shape)))
        assert said in summary(run)
        view = view_frame(run, 1)
        assert np.all(np.isfinite(view.range_doppler))
        seen = view_run(run)
        assert seen.range_time.power.shape[0] == 2
        assert np.abs(seen.doppler_time.velocity).max() <= radar.max_velocity * 1.03


def test_a_constant_frequency_has_no_pictures(tmp_path):
    path = tmp_path / "run.h5"
    written(path, "position2go", "doppler")
    with open_run(path) as run:
        assert "cell 64.7 cm/s" in summary(run)
        with pytest.raises(ValueError, match=r"run\.h5'.*preset 'doppler' has a constant frequency"):
            view_frame(run, 0)
        with pytest.raises(ValueError, match="has a constant frequency"):
            view_run(run)


def test_frames_share_a_full_scale(tmp_path):
    radar = Radar.load("position2go")
    samples = np.zeros(radar.frame_shape, complex)
    with RunWriter(tmp_path / "run.h5", RunInfo(radar)) as writer:
        writer.append(samples, time=0.0, full_scale=1.0)
        with pytest.raises(ValueError, match=r"full_scale is 2\.0"):
            writer.append(samples, time=0.1, full_scale=2.0)
