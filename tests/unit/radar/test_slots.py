"""Slots: what they make of a frame, of its times and of the axis "tx"."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from rfgen_sionna.radar import Profile, Radar, Slot, Waveform
from rfgen_sionna.radar.slots import coded_slots, doppler_slot, hadamard_code, multiplexing_of
from rfgen_sionna.resources import available

SHIPPED = [(name, preset) for name in available("radars") for preset in Radar.available()[name]]


@pytest.fixture(scope="module")
def mmmesh() -> Waveform:
    return Radar.load("awr1843", "mmmesh").waveform


@pytest.mark.parametrize(("name", "preset"), SHIPPED)
def test_records_bring_every_configuration_back(name: str, preset: str) -> None:
    radar = Radar.load(name, preset, position=(1, 2, 3))
    record = json.loads(json.dumps(radar.to_dict()))
    again = Radar.from_dict(record)
    assert again == radar
    assert hash(again) == hash(radar)
    assert again.waveform == radar.waveform
    record["waveform"]["speed"] = 3
    with pytest.raises(ValueError, match="'speed'"):
        Radar.from_dict(record)


def test_a_common_frame_is_recorded_as_ever(mmmesh: Waveform) -> None:
    record = Radar.load("awr1843", "mmmesh").to_dict()["waveform"]
    assert set(record) == {
        *("start_frequency", "slope", "sample_rate", "num_samples", "idle_time", "adc_start_time", "ramp_end_time"),
        *("num_loops", "tx_order", "frame_period", "phase_step_deg"),
    }
    del record["phase_step_deg"]  # older records have none
    assert Radar.from_dict(Radar.load("awr1843").to_dict() | {"waveform": record}).waveform.phase_step_deg == 0.0


def test_slots_of_several_profiles_follow_each_other(mmmesh: Waveform) -> None:
    """Idle time and ramp are those of the slot's own profile; the loop ends with the last ramp."""
    far = Profile(77e9, 15e12, 5e6, 11e-6, 2e-6, 60e-6)
    slots = (Slot((0.0, None)), Slot((None, 0.0), 1), Slot((0.0, None), 1))
    wave = replace(mmmesh, tx_order=(), slots=slots, other_profiles=(far,))
    # Starts of the ramps: the first, 65 us later plus 11 us idle, 60 us later plus 11 us idle.
    np.testing.assert_allclose(wave.slot_times, [0.0, 76e-6, 147e-6], rtol=1e-12)
    assert wave.loop_period == pytest.approx(72e-6 + 71e-6 + 71e-6)
    assert wave.sampled_band == pytest.approx((77e9 + 15e12 * 2e-6, 77e9 + 60.012e12 * (6e-6 + 256 / 4.4e6)))
    assert wave.max_range == pytest.approx(5e6 * 299_792_458 / 2 / 15e12)
    assert wave.range_resolution == pytest.approx(0.0429, abs=1e-4)

    second = wave.of_profile(1)
    assert (second.slope, second.sample_rate, second.num_tx, second.other_profiles) == (15e12, 5e6, 2, ())
    np.testing.assert_allclose(second.chirp_times[1], wave.chirp_times[1, 1:], rtol=1e-12)
    assert second.loop_period == wave.loop_period
    assert wave.profile_axis(1) == (1, 2)
    first = wave.of_profile(0)
    assert (first.num_tx, wave.profile_tx(0)) == (1, (0,))
    with pytest.raises(ValueError, match="profile is 2: a whole number in 0 … 1"):
        wave.of_profile(2)


def test_what_slots_make_of_their_elements() -> None:
    assert multiplexing_of([Slot((None, 0.0)), Slot((0.0, None))]) == "tdm"
    assert multiplexing_of([Slot((None, 0.0)), Slot((90.0, None))]) == "bpm"
    assert multiplexing_of(coded_slots(hadamard_code(3), (0, 1, 2), 3)) == "bpm"
    assert multiplexing_of([Slot((0.0, 120.0)), Slot((0.0, 240.0))]) == "bpm"
    assert multiplexing_of([Slot((0.0, 90.0))]) == "beam"
    assert multiplexing_of([doppler_slot(4, (0, 1, 2), 3)]) == "ddm"


def test_phases_are_those_of_the_shifters() -> None:
    """To the nearest of 64 steps of a turn; quarters of a turn exactly."""
    slot = Slot((0.0, 61.0, None), advance_deg=(0.0, 90.0, 0.0))
    weights = slot.weights(4, 5.625)
    np.testing.assert_allclose(np.degrees(np.angle(weights[:, 1])) % 360, [61.875, 151.875, 241.875, 331.875])
    np.testing.assert_array_equal(weights[:, [0, 2]], [[1, 0]] * 4)
    np.testing.assert_array_equal(doppler_slot(4, (0, 1), 2).weights(4)[:, 1], [1, 1j, -1, -1j])
    np.testing.assert_allclose(np.degrees(np.angle(Slot((61.0,)).weights(1)))[0], [61.0])


def test_doppler_bands_share_the_velocities(mmmesh: Waveform) -> None:
    wave = replace(mmmesh, tx_order=(), slots=(doppler_slot(4, (0, 1, 2), 3),))
    assert wave.doppler_bands == pytest.approx(4.0)
    assert wave.max_velocity == pytest.approx(wave.wavelength / (4 * 72e-6) / 4)
    assert wave.velocity_resolution == pytest.approx(wave.wavelength / (2 * 128 * 72e-6))
    with pytest.raises(ValueError, match=r"num_loops is 6: 4 Doppler bands of at least 2 bins need 8 loops"):
        replace(wave, num_loops=6)


def test_a_constant_frequency_reaches_as_far_as_it_says(mmmesh: Waveform) -> None:
    wave = replace(mmmesh, slope=0.0, range_limit=25.0)
    assert (wave.bandwidth, wave.range_resolution, wave.range_window, wave.max_range) == (0.0, np.inf, np.inf, 25.0)
    assert replace(mmmesh, range_limit=5.0).max_range == 5.0
    assert replace(mmmesh, range_limit=50.0).max_range == mmmesh.max_range
    with pytest.raises(ValueError, match=r"slope is 0.*range_limit"):
        replace(mmmesh, slope=0.0)


def test_a_ramp_downwards_has_the_same_limits(mmmesh: Waveform) -> None:
    wave = replace(mmmesh, slope=-mmmesh.slope, start_frequency=80.9e9)
    assert wave.bandwidth == mmmesh.bandwidth
    assert wave.max_range == mmmesh.max_range
    low, high = wave.sampled_band
    assert low == pytest.approx(80.9e9 - 60.012e12 * (6e-6 + 256 / 4.4e6))
    assert wave.center_frequency == pytest.approx((low + high) / 2)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"slots": (Slot((0.0, 0.0)),)}, "tx_order and slots"),
        ({"tx_order": (), "slots": (Slot((0.0, 0.0)), Slot((0.0,)))}, "all of them need 2 phases"),
        ({"tx_order": (), "slots": (Slot((0.0, None)),)}, "Tx element 1 never fires"),
        ({"tx_order": (), "slots": (Slot((0.0,), 1),)}, "use the profiles [1]; there are 1"),
        ({"other_profiles": (Profile(77e9, 15e12, 5e6, 7e-6, 6e-6, 60e-6),)}, "other_profiles needs slots"),
        (
            {"tx_order": (), "slots": (Slot((0.0,)), Slot((0.0,))), "slot_starts": (0.0, 60e-6)},
            "slot 1 starts at 60 us, before slot 0 ends at 65 us: slots must not overlap",
        ),
        ({"slot_starts": (0.0,)}, "for each of 3 slots"),
        ({"loop_time": 200e-6}, "loop_time is 0.0002 s: its slots take 0.000216 s"),
        ({"phase_step_deg": -1.0}, "0 … 180 degrees"),
        ({"range_limit": 0.0}, "range_limit is 0.0"),
        ({"slope": -2e15}, "ramp ends at -5.3e+10 Hz"),
        ({"separated": True}, "a single slot"),
    ],
)
def test_impossible_frames_say_why(mmmesh: Waveform, changes: dict[str, object], said: str) -> None:
    with pytest.raises(ValueError) as caught:  # noqa: PT011
        replace(mmmesh, **changes)  # type: ignore[arg-type]
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((()), "one entry for each"),
        (((None, None),), "at least one Tx"),
        (((0.0, "90"),), "has the entry '90'"),
        (((0.0, float("nan")),), "has the entry nan"),
        (((0.0,), -1), "slot.profile is -1"),
        (((0.0,), 0, (1.0, 2.0)), "for each of 1 Tx"),
    ],
)
def test_impossible_slots_say_why(arguments: tuple[object, ...], said: str) -> None:
    with pytest.raises(ValueError) as caught:  # noqa: PT011
        Slot(*(arguments or ((),)))  # type: ignore[arg-type]
    assert said in str(caught.value)
