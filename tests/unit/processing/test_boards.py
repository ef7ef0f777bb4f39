"""Boards' processing chains against point targets, loops and closed forms."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rfgen_sionna.processing.boards import BoardPoints, CfarSettings, OutOfBoxChain, mmmesh_points, out_of_box_points
from rfgen_sionna.processing.boards.range_cfar import MODES, noise_level
from rfgen_sionna.processing.boards.virtual_rows import virtual_rows
from rfgen_sionna.radar import Radar

Synthesise = Callable[..., np.ndarray]
WORDS = OutOfBoxChain(full_scale_dbm=None, second_peak=None)
"""The default chain on samples that are words of the ADC."""
NOISE = 2 * 11.5**2
"""Power of the receiver's noise, 11.5 words each of I and Q."""


@pytest.fixture(scope="module")
def radar() -> Radar:
    return Radar.load("iwr1443boost", preset="radhar")


def direction(azimuth_deg: float, elevation_deg: float) -> np.ndarray:
    azimuth, elevation = np.radians([azimuth_deg, elevation_deg])
    return np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])


def strongest(points: BoardPoints) -> BoardPoints:
    return points.select(np.array([np.argmax(points.peak)]))


@pytest.mark.parametrize(("azimuth", "elevation", "cells"), [(0, 0, 2), (20, 8, -3), (-35, -10, 0), (40, 0, 5)])
def test_a_target_lies_where_it_is(
    radar: Radar, synthesise: Synthesise, azimuth: float, elevation: float, cells: int
) -> None:
    towards = direction(azimuth, elevation)
    wave = radar.waveform
    cell = radar.wavelength / 2 / (wave.num_loops * wave.loop_period)
    middle = wave.chirp_times.mean() + wave.sample_times.mean()
    speed = cells * cell
    cube = synthesise(radar, [((2.5 - speed * middle) * towards, speed * towards, 400.0)], noise=np.sqrt(NOISE))
    found = strongest(out_of_box_points(cube, radar, WORDS))
    step = wave.range_window / 256
    assert found.doppler_bin[0] == cells
    assert found.velocity[0] == pytest.approx(speed)
    assert abs(found.range[0] - 2.5) < 1.6 * step  # the coupling of range and Doppler moves it by half a bin
    # half a bin of the azimuth transform is 1/64 of the direction cosine; elevation has no grid
    assert abs(-found.position[0, 1] / found.range[0] + towards[1]) < 1 / 64 + 0.01
    assert abs(found.position[0, 2] / found.range[0] - towards[2]) < 0.05


def test_coordinates_are_those_of_the_fixed_point(radar: Radar, synthesise: Synthesise) -> None:
    cube = synthesise(radar, [(2.0 * direction(15, 4), np.zeros(3), 400.0)], noise=np.sqrt(NOISE))
    points = out_of_box_points(cube, radar, WORDS)
    assert len(points)
    np.testing.assert_array_equal(points.position * 512 % 1, 0.0)  # 2^9 > 16 m / 0.0409 m > 2^8
    np.testing.assert_array_equal(points.peak % 1, 0.0)


def test_the_peak_is_a_quarter_of_the_windowed_sum(radar: Radar, synthesise: Synthesise) -> None:
    """Range bins have a quarter of their sum, Doppler bins the mean of a Hann window of sum (16 - 1) / 2, twice."""
    wave = radar.waveform
    distance = 48 * wave.range_window / 256
    cube = synthesise(radar, [(distance * direction(0, 0), np.zeros(3), 200.0)])
    peak = strongest(out_of_box_points(cube, radar, WORDS)).peak[0]
    assert peak == pytest.approx(200.0 * np.blackman(240).sum() / 4 * np.hanning(16).sum() / 8, rel=0.01)


def test_points_come_by_doppler_bin_then_range_and_are_cut(radar: Radar, synthesise: Synthesise) -> None:
    cell = radar.wavelength / 2 / (16 * radar.waveform.loop_period)
    targets = [
        (distance * direction(0, 0), cells * cell * direction(0, 0), 400.0)
        for distance, cells in ((1.5, -2), (2.5, 0), (3.5, 2), (4.5, 0), (5.5, -1))
    ]
    cube = synthesise(radar, targets, noise=np.sqrt(NOISE))
    points = out_of_box_points(cube, radar, WORDS)
    key = (points.doppler_bin % 16) * 1000 + points.range_bin
    assert list(key) == sorted(key)
    assert set(points.doppler_bin) == {0, 2, -2, -1}
    cut = out_of_box_points(cube, radar, replace(WORDS, max_points=4))
    assert len(cut) == 4
    np.testing.assert_array_equal(cut.range_bin, points.range_bin[:4])


def test_clutter_removal_leaves_what_moves(radar: Radar, synthesise: Synthesise) -> None:
    cell = radar.wavelength / 2 / (16 * radar.waveform.loop_period)
    still, walker = (2.0 * direction(0, 0), np.zeros(3), 2000.0), (3.0 * direction(0, 0), [3 * cell, 0, 0], 400.0)
    cube = synthesise(radar, [still, walker], noise=np.sqrt(NOISE))
    assert {0, 3} <= set(out_of_box_points(cube, radar, WORDS).doppler_bin)
    assert set(out_of_box_points(cube, radar, replace(WORDS, clutter_removal=True)).doppler_bin) == {3}


def test_static_clutter_hides_slower_and_weaker_returns_of_its_range(radar: Radar, synthesise: Synthesise) -> None:
    """The main lobe of Hann's window reaches one Doppler bin, 6 dB down, where grouping in Doppler drops the point."""
    cell = radar.wavelength / 2 / (16 * radar.waveform.loop_period)
    walker = (2.0 * direction(0, 0), [cell, 0, 0], 300.0)
    alone = out_of_box_points(synthesise(radar, [walker], noise=np.sqrt(NOISE)), radar, WORDS)
    assert 1 in alone.doppler_bin
    wall = (2.0 * direction(5, 0), np.zeros(3), 1500.0)
    hidden = out_of_box_points(synthesise(radar, [walker, wall], noise=np.sqrt(NOISE)), radar, WORDS)
    assert 1 not in hidden.doppler_bin


def test_two_azimuths_in_a_cell_are_two_points(radar: Radar, synthesise: Synthesise) -> None:
    pair = [(2.0 * direction(side, 0), np.zeros(3), 300.0) for side in (30, -30)]
    cube = synthesise(radar, pair, noise=np.sqrt(NOISE))
    one = out_of_box_points(cube, radar, WORDS)
    both = out_of_box_points(cube, radar, replace(WORDS, second_peak=0.5))
    assert len(both) > len(one)
    first, second = both.select(np.arange(len(one))), both.select(np.arange(len(one), len(both)))
    for twin in range(len(second)):
        owner = first.range_bin == second.range_bin[twin]
        assert np.sign(first.position[owner, 1]) == -np.sign(second.position[twin, 1])


def test_frames_do_not_depend_on_their_batch(radar: Radar) -> None:
    rng = np.random.default_rng(0)
    cube = rng.normal(0, 12, (70, 16, 3, 4, 240, 2)).view(np.complex128)[..., 0].astype(np.complex64)
    cube += 300 * np.exp(2j * np.pi * 0.2 * np.arange(240)).astype(np.complex64)
    whole = out_of_box_points(cube, radar, WORDS)
    alone = out_of_box_points(cube[66:67], radar, WORDS)
    np.testing.assert_array_equal(whole.position[whole.frame == 66], alone.position)
    assert whole.frames == 70
    assert whole.counts.sum() == len(whole)


def test_samples_in_watts_have_the_steps_of_the_full_scale(radar: Radar, synthesise: Synthesise) -> None:
    words = synthesise(radar, [(2.0 * direction(0, 0), np.zeros(3), 300.0)], noise=np.sqrt(NOISE))
    chain = OutOfBoxChain(second_peak=None)
    assert chain.step == pytest.approx(np.sqrt(10 ** (-5.6)) / 2**15)
    points = out_of_box_points(words * chain.step, radar, chain)
    np.testing.assert_array_equal(points.position, out_of_box_points(words, radar, WORDS).position)


def test_noise_alone_gives_hardly_a_point(radar: Radar) -> None:
    rng = np.random.default_rng(1)
    cube = (rng.normal(0, 11.5, (8, 16, 3, 4, 240)) + 1j * rng.normal(0, 11.5, (8, 16, 3, 4, 240))).astype(np.complex64)
    assert len(out_of_box_points(cube, radar, WORDS)) <= 2  # 20 dB over the mean logarithm of 12 channels


@given(st.sampled_from(MODES), st.integers(1, 5), st.integers(0, 3), st.booleans(), st.integers(0, 50))
@settings(deadline=None, max_examples=40)
def test_noise_level_equals_a_loop(mode: str, train: int, guard: int, cyclic: bool, seed: int) -> None:
    level = np.random.default_rng(seed).normal(size=(2, 24))
    found = noise_level(level, CfarSettings(mode, train, guard, 10.0, cyclic))
    for row in range(2):
        for cell in range(24):
            sides = []
            for sign in (-1, 1):
                place = [cell + sign * (guard + k) for k in range(1, train + 1)]
                if cyclic:
                    sides.append(np.mean([level[row, p % 24] for p in place]))
                elif all(0 <= p < 24 for p in place):
                    sides.append(np.mean([level[row, p] for p in place]))
            expected = {"ca": np.mean, "cago": max, "caso": min}[mode](sides)
            assert found[row, cell] == pytest.approx(expected)


@pytest.mark.parametrize(
    ("board", "offset", "height"), [("iwr1443boost", 2, 1), ("awr1843", 2, 1), ("iwr6843isk", 2, 1)]
)
def test_rows_of_the_boards(board: str, offset: float, height: float) -> None:
    rows = virtual_rows(Radar.load(board))
    assert (len(rows.azimuth), len(rows.elevation)) == (8, 4)
    assert rows.offset == pytest.approx(offset)
    assert rows.height == pytest.approx(height, rel=0.05)


def test_what_the_chains_do_not_take_is_named(radar: Radar) -> None:
    with pytest.raises(ValueError, match=r"processing\.point_cloud takes any array"):
        virtual_rows(Radar.load("iwr6843aop"))
    with pytest.raises(ValueError, match="train 20 and guard 4 span 49 cells"):
        noise_level(np.zeros((1, 16)), CfarSettings(train=20))
    with pytest.raises(ValueError, match="allowed: ca, cago, caso"):
        CfarSettings("os")
    with pytest.raises(ValueError, match="two ascending bins"):
        OutOfBoxChain(range_bins=(5, 2))
    with pytest.raises(ValueError, match="are needed"):
        out_of_box_points(np.zeros((16, 3, 4, 240), np.complex64), radar)


def test_points_of_mmmesh_lie_on_a_slow_target(synthesise: Synthesise) -> None:
    radar = Radar.load("awr1843", preset="mmmesh")
    radar = replace(radar, waveform=replace(radar.waveform, num_loops=32))
    wave = radar.waveform
    cell = radar.wavelength / 2 / (32 * wave.loop_period)
    # the elevation row's transform has four bins: its phase is right at direction cosines of 0 and 1/2 alone
    towards = direction(float(np.degrees(np.arcsin(0.5 / np.cos(np.radians(6))))), 6)
    cube = synthesise(radar, [(3.0 * towards, cell * towards, 300.0)], noise=1.0)
    (points,) = mmmesh_points(cube, radar, points=128)
    assert points.shape[1] == 6
    assert len(points) <= 128
    best = points[points[:, 4].argmax()]
    assert best[3] == pytest.approx(cell)
    assert best[5] == pytest.approx(3.0, abs=wave.range_window / 256)
    # a third of a Doppler cell between slots turns the phase by 2 pi / 3 / 32, which is not compensated
    assert best[:3] / best[5] == pytest.approx([-towards[1], towards[0], towards[2]], abs=0.06)
    near = mmmesh_points(cube, radar, points=16, range_bins=(100, 200))[0]
    assert near[:, 5].min() >= 100 * wave.range_window / 256 - 1e-9
    with pytest.raises(ValueError, match="fewer points than cells"):
        mmmesh_points(cube, radar, points=10**6)
