"""Chirps: their times, and the limits that follow from them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from rfgen_sionna.radar import Radar, Waveform

C = 299_792_458.0


@pytest.fixture(scope="module")
def mmmesh() -> Waveform:
    return Radar.load("awr1843", "mmmesh").waveform


# What the two publications state, and what follows from it by hand.
PUBLISHED = [
    # preset, slope, samples, rate, idle, ramp end, loops, slots, frames/s
    ("mmmesh", 60.012e12, 256, 4.4e6, 7e-6, 65e-6, 128, 3, 10),
    ("di_gesture", 99.987e12, 128, 4e6, 340e-6, 40e-6, 64, 2, 20),
]


@pytest.mark.parametrize(("preset", "slope", "samples", "rate", "idle", "ramp", "loops", "slots", "fps"), PUBLISHED)
def test_published_configurations_and_their_limits(
    preset: str, slope: float, samples: int, rate: float, idle: float, ramp: float, loops: int, slots: int, fps: float
) -> None:
    radar = Radar.load("awr1843", preset)
    waveform = radar.waveform
    assert (waveform.start_frequency, waveform.slope, waveform.sample_rate) == (77e9, slope, rate)
    assert (waveform.num_samples, waveform.num_loops, waveform.num_slots) == (samples, loops, slots)
    assert (waveform.idle_time, waveform.ramp_end_time, waveform.adc_start_time) == (idle, ramp, 6e-6)
    assert waveform.frame_period == pytest.approx(1 / fps)

    bandwidth = slope * samples / rate
    wavelength = C / (77e9 + slope * 6e-6 + bandwidth / 2)
    loop = slots * (idle + ramp)
    assert radar.wavelength == pytest.approx(wavelength)
    assert radar.range_resolution == pytest.approx(C / (2 * bandwidth))
    assert radar.max_range == pytest.approx(samples * C / (2 * bandwidth))
    assert radar.velocity_resolution == pytest.approx(wavelength / 2 / (loops * loop))
    assert radar.max_velocity == pytest.approx(wavelength / 4 / loop)
    assert waveform.frame_length == pytest.approx(loops * loop)


def test_limits_in_plain_numbers() -> None:
    """The figures that the papers' readers know."""
    radar = Radar.load("awr1843", "mmmesh")
    assert radar.range_resolution == pytest.approx(0.0429, abs=1e-4)
    assert radar.max_range == pytest.approx(10.99, abs=0.01)
    assert radar.velocity_resolution == pytest.approx(0.0685, abs=1e-4)
    assert radar.max_velocity == pytest.approx(4.39, abs=0.01)
    radar = Radar.load("awr1843", "di_gesture")
    assert radar.range_resolution == pytest.approx(0.0468, abs=1e-4)
    assert radar.max_range == pytest.approx(6.00, abs=0.01)
    assert radar.velocity_resolution == pytest.approx(0.0389, abs=1e-4)
    assert radar.max_velocity == pytest.approx(1.245, abs=0.001)


def test_slots_follow_the_order_in_which_elements_fire() -> None:
    radar = Radar.load("awr1843", "mmmesh")
    times = radar.waveform.chirp_times
    assert times.shape == (128, 3)
    # TX1, TX3, TX2 fire in this order, 72 us apart; a loop takes 216 us.
    first = dict(zip(radar.tx_names, times[0], strict=True))
    assert first == pytest.approx({"TX1": 0.0, "TX3": 72e-6, "TX2": 144e-6})
    np.testing.assert_allclose(np.diff(times, axis=0), 216e-6, rtol=1e-12)
    assert times.max() + 72e-6 == pytest.approx(radar.waveform.frame_length)


def test_samples_begin_where_the_adc_does(mmmesh: Waveform) -> None:
    times = mmmesh.sample_times
    assert times.shape == (256,)
    assert times[0] == 6e-6
    np.testing.assert_allclose(np.diff(times), 1 / 4.4e6, rtol=1e-9)
    # The middle of the window counts whole samples, the last one included.
    assert mmmesh.center_frequency == pytest.approx(77e9 + 60.012e12 * (6e-6 + 128 / 4.4e6))


@pytest.mark.parametrize(
    ("field", "value"),
    [
        *((name, value) for name in ("start_frequency", "sample_rate", "ramp_end_time", "frame_period")
          for value in (0.0, -1.0, float("nan"), float("inf"), "1", None, True)),
        *(("slope", value) for value in (float("nan"), float("inf"), "1", None, True)),
        *((name, value) for name in ("idle_time", "adc_start_time") for value in (-1e-9, float("nan"), "0", None)),
        *((name, value) for name in ("num_samples", "num_loops") for value in (0, -1, 2.0, True, "8", None)),
        *(("tx_order", value) for value in ((), (0, 0, 1), (0, 2), (1, 2, 3), ("TX1",), (0.0, 1.0))),
    ],
)  # fmt: skip
def test_impossible_values_are_named(mmmesh: Waveform, field: str, value: Any) -> None:
    with pytest.raises(ValueError, match=rf"^waveform\.{field} is ") as caught:
        replace(mmmesh, **{field: value})
    assert repr(value) in str(caught.value)


def test_windows_and_frames_that_do_not_fit_say_what_would(mmmesh: Waveform) -> None:
    with pytest.raises(ValueError, match=r"ADC window ends at 66\.18 us .*after ramp_end_time 65 us: at most 250"):
        replace(mmmesh, adc_start_time=8e-6)
    with pytest.raises(ValueError, match=r"frame_period is 20 ms .*128 loops of 3 slots.*27\.648 ms.*at most 92 loops"):
        replace(mmmesh, frame_period=20e-3)
    assert replace(mmmesh, frame_period=mmmesh.frame_length).frame_length == mmmesh.frame_length


def test_waveforms_are_values(mmmesh: Waveform) -> None:
    listed: Any = [0, 2, 1]
    again = replace(mmmesh, tx_order=listed)
    assert again == mmmesh
    assert hash(again) == hash(mmmesh)
    assert again != replace(mmmesh, num_loops=64)
