"""Slots, codes, profiles and slopes: the synthesiser against the direct sum."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.radar import ElementPattern, Profile, Radar, Slot
from rfgen_sionna.radar.slots import coded_slots, doppler_slot, hadamard_code
from rfgen_sionna.records import PathKind, RadarPaths
from rfgen_sionna.signal import synthesize
from tests.reference.direct_sum import direct_sum

PATHS = 12


def short(name, preset, loops=6, **changes):
    """A shipped configuration in a frame of a few loops, isotropic, 1 W."""
    radar = Radar.load(name, preset)
    waveform = replace(radar.waveform, num_loops=loops, num_samples=min(radar.waveform.num_samples, 128), **changes)
    return replace(radar, waveform=waveform, pattern=ElementPattern(0.0), tx_power_dbm=30.0)


def phased(radar, *slots, **changes):
    """The same radar with slots of one's own."""
    return replace(radar, waveform=replace(radar.waveform, tx_order=(), slots=slots, **changes))


def down(radar):
    """The same ramp from its end to its start."""
    wave = radar.waveform
    end = wave.start_frequency + wave.slope * wave.ramp_end_time
    return replace(radar, waveform=replace(wave, start_frequency=end, slope=-wave.slope))


MMMESH = short("awr1843", "mmmesh")
RADARS = {
    "tdm": MMMESH,
    "bpm": short("awr1843", "bpm"),
    "bpm of three": phased(MMMESH, *coded_slots(hadamard_code(3), (0, 1, 2), 3)),
    "ddm": short("awr1843", "ddm", loops=8),
    "ddm in steps": phased(MMMESH, doppler_slot(3, (0, 2, 1), 3), phase_step_deg=5.625),
    "beam": phased(MMMESH, Slot((0.0, 61.0, None)), Slot((10.0, None, 200.0)), phase_step_deg=5.625),
    "steered": short("mmwcas", "steered_left", loops=2),
    "near and far": short("awr1843", "near_far"),
    "triangle": short("awr1843", "triangle"),
    "down": down(MMMESH),
    "feeds": replace(MMMESH, tx_phases_deg=(0.0, 180.0, 30.0), rx_phases_deg=(90.0, 0.0, 180.0, -45.0)),
    "bpm of feeds": replace(
        phased(MMMESH, *coded_slots(hadamard_code(3), (0, 1, 2), 3)),
        tx_phases_deg=(0.0, 180.0, 30.0),
        rx_phases_deg=(90.0, 0.0, 180.0, -45.0),
    ),
    "constant": short("position2go", "doppler"),
    "profiles of other Tx": replace(
        MMMESH,
        waveform=replace(
            MMMESH.waveform,
            tx_order=(),
            slots=(Slot((0.0, None, None)), Slot((None, 0.0, 180.0), 1), Slot((None, 0.0, 0.0), 1)),
            other_profiles=(Profile(78e9, -30e12, 5e6, 9e-6, 2e-6, 60e-6),),
        ),
        tx_phases_deg=(0.0, 180.0, 30.0),
    ),
}


@pytest.mark.parametrize("speed", [0.0, 5.0, 50.0])
@pytest.mark.parametrize("kind", RADARS)
def test_every_waveform_agrees_with_the_direct_sum(kind, speed):
    """Paths of 0.05 … 60 m at up to `speed` m/s: default tolerance: relative error at most 1e-6."""
    radar = RADARS[kind]
    rng = np.random.default_rng(list(RADARS).index(kind))
    shape = (len(radar.tx_names), len(radar.rx_names), PATHS)
    gain = rng.normal(size=shape) + 1j * rng.normal(size=shape)
    tau = 2 * rng.uniform(0.05, 60, shape) / SPEED_OF_LIGHT
    rate = 2 * rng.uniform(-speed, speed, shape) / SPEED_OF_LIGHT
    direction = np.broadcast_to([1.0, 0, 0], (PATHS, 1, 3))
    paths = RadarPaths(
        a=gain[..., None],
        tau=tau[..., None],
        tau_rate=rate[..., None],
        times=np.array([0.3]),
        frequency=radar.center_frequency,
        direction=direction,
        arrival=direction,
        object_id=np.zeros(PATHS, np.int32),
        part_id=np.zeros(PATHS, np.int32),
        kind=np.full(PATHS, PathKind.FACET, np.uint8),
        bounces=np.ones(PATHS, np.uint8),
        object_names=("thing",),
        part_names=("thing",),
        facet=np.arange(PATHS, dtype=np.int32),
    )

    def delay(t, tx, rx):
        return tau[tx, rx][:, None] + rate[tx, rx][:, None] * (t - 0.3)

    found = synthesize(radar, paths, 0.3)
    truth = direct_sum(radar, delay, gain, 0.3)
    assert found.shape == truth.shape == radar.frame_shape
    assert np.linalg.norm(found - truth) < 1e-6 * np.linalg.norm(truth)


def test_gains_of_the_tx_chains_go_into_the_sum():
    """What a slot of two Tx holds cannot be corrected afterwards."""
    radar = RADARS["bpm"]
    rng = np.random.default_rng(2)
    gain = rng.normal(size=(2, 4, 1)) + 0j
    tau = np.full((2, 4, 1, 1), 2e-8)
    direction = np.broadcast_to([1.0, 0, 0], (1, 1, 3))
    zero = np.zeros(1, np.int32)
    paths = RadarPaths(
        gain[..., None], tau, 0 * tau, np.zeros(1), 77e9, direction, direction, zero, zero,
        zero.astype(np.uint8), zero.astype(np.uint8), ("thing",), ("thing",), zero,
    )  # fmt: skip
    factors = np.array([1.0, 0.5j])
    found = synthesize(radar, paths, 0.0, tx_gains=factors, eps=1e-9)
    plain = synthesize(radar, replace(paths, a=paths.a * np.conj(factors)[:, None, None, None]), 0.0, eps=1e-9)
    np.testing.assert_allclose(found, plain, rtol=1e-7, atol=1e-9)
    with pytest.raises(ValueError, match=r"tx_gains has shape \(3,\)"):
        synthesize(radar, paths, 0.0, tx_gains=np.ones(3))
