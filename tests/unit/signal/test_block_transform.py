"""The block transform against the direct sum, and what it leaves to the transform per chirp."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.radar import ElementPattern, Radar
from rfgen_sionna.signal import synthesis, synthesize
from tests.reference.direct_sum import direct_sum
from tests.unit.signal.test_synthesis import make_paths, random_gains, relative
from tests.unit.signal.test_waveforms import RADARS

PATHS = 20


def short(name, preset=None, loops=None, **changes):
    """A shipped configuration in a frame of a few loops, isotropic, 1 W."""
    radar = Radar.load(name, preset) if preset else Radar.load(name)
    waveform = replace(radar.waveform, num_loops=loops or radar.waveform.num_loops, **changes)
    return replace(radar, waveform=waveform, pattern=ElementPattern(0.0), tx_power_dbm=30.0)


def scene(radar, speed=1.5, acceleration=10.0, count=PATHS, seed=0, near=1.0, far=5.0):
    """Delays `delay(times, tx, rx)` [s] of points 60 degrees about boresight, and gains (tx, rx, path)."""
    rng = np.random.default_rng(seed)
    azimuth, distance = rng.uniform(-1, 1, count), rng.uniform(near, far, count)
    place = distance[:, None] * np.stack([np.cos(azimuth), np.sin(azimuth), rng.uniform(-0.2, 0.2, count)], axis=1)
    velocity, bend = (scale * rng.uniform(-1, 1, (count, 3)) for scale in (speed, acceleration))

    def delay(t, tx, rx):
        t = np.atleast_1d(t)[:, None]
        at = place[:, None] + velocity[:, None] * t + 0.5 * bend[:, None] * t**2
        elements = radar.tx_positions[tx], radar.rx_positions[rx]
        ways = (np.linalg.norm(at - np.asarray(element), axis=2) for element in elements)
        return sum(ways) / SPEED_OF_LIGHT

    one = rng.normal(size=(1, 1, count)) + 1j * rng.normal(size=(1, 1, count))
    return delay, np.repeat(np.repeat(one, len(radar.tx_names), 0), len(radar.rx_names), 1)


def knots(radar, count=5, start=0.0):
    return start + np.linspace(0, radar.waveform.frame_length, count)


def keeps_to_tolerances(radar, paths, truth):
    for eps in (0.3, 3e-2, 5e-3, 1e-3):
        assert relative(synthesize(radar, paths, 0.0, eps=eps, device="cpu"), truth) <= eps


@pytest.fixture
def blocks(monkeypatch):
    """No transform per chirp."""

    def refused(*arguments):
        raise AssertionError("a transform per chirp")

    monkeypatch.setattr(synthesis, "_synthesize_in_parts", refused)


@pytest.fixture
def forms(monkeypatch):
    """Whether each sum was made in blocks."""
    made = []
    before = synthesis.block_sums

    def noted(*arguments):
        found = before(*arguments)
        made.append(found is not None)
        return found

    monkeypatch.setattr(synthesis, "block_sums", noted)
    return made


@pytest.mark.usefixtures("blocks")
@pytest.mark.parametrize(("speed", "acceleration"), [(0.5, 0.0), (1.5, 10.0), (5.0, 0.0), (5.0, 60.0), (20.0, 0.0)])
def test_the_error_is_at_most_the_tolerance(speed, acceleration):
    """Walking, running and faster: range migration and acceleration."""
    radar = short("awr1843", "mmmesh", loops=40)
    delay, gain = scene(radar, speed, acceleration)
    keeps_to_tolerances(radar, make_paths(radar, gain, delay, knots(radar)), direct_sum(radar, delay, gain))


@pytest.mark.usefixtures("blocks")
@pytest.mark.parametrize(
    "kind", ["bpm of three", "ddm in steps", "beam", "near and far", "down", "bpm of feeds", "constant"]
)
def test_every_waveform(kind):
    radar = RADARS[kind]
    delay, gain = scene(radar)
    keeps_to_tolerances(radar, make_paths(radar, gain, delay, knots(radar)), direct_sum(radar, delay, gain))


@pytest.mark.usefixtures("blocks")
@pytest.mark.parametrize(
    ("name", "preset", "loops"),
    [("bgt60tr13c", None, None), ("position2go", None, None), ("mmwcas", "ti_default", 9), ("awr1843", "mmmesh", 1),
     ("awr1843", "mmmesh", 2), ("awr1843", "mmmesh", 3), ("awr1843", "mmmesh", 5), ("awr1843", "mmmesh", 37)],
)  # fmt: skip
def test_every_array_and_number_of_loops(name, preset, loops):
    """One, two and sixteen Rx, real samples, frames that are no whole number of blocks."""
    radar = short(name, preset, loops)
    delay, gain = scene(radar, count=8, near=2.0)
    keeps_to_tolerances(radar, make_paths(radar, gain, delay, knots(radar)), direct_sum(radar, delay, gain))


@pytest.mark.usefixtures("blocks")
def test_beats_beyond_the_window_wrap():
    radar = short("awr1843", "mmmesh", loops=16)
    delay, gain = scene(radar, near=0.5, far=200.0)
    found = synthesize(radar, make_paths(radar, gain, delay, knots(radar)), 0.0, eps=1e-3, device="cpu")
    assert relative(found, direct_sum(radar, delay, gain)) <= 1e-3


@pytest.mark.usefixtures("blocks")
@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_few_knots_are_a_polynomial_in_the_delay(count):
    radar = short("awr1843", "mmmesh", loops=40)
    rng = np.random.default_rng(2)
    first, speed, bend = rng.uniform(1, 5, PATHS), rng.uniform(-2, 2, PATHS), 10.0 * (count > 2)
    start = 1e3

    def delay(t, tx, rx):
        t = np.atleast_1d(t) - start
        return 2 * (first[:, None] + 0.001 * (tx + rx) + speed[:, None] * t + 0.5 * bend * t**2) / SPEED_OF_LIGHT

    at = np.array([start]) if count == 1 else knots(radar, count, start)
    gain = random_gains(rng, radar, PATHS)
    paths = make_paths(radar, gain, delay, at)
    paths = (
        paths
        if count > 1
        else replace(paths, tau_rate=np.broadcast_to(2 * speed[:, None] / SPEED_OF_LIGHT, paths.tau.shape))
    )
    found = synthesize(radar, paths, start, eps=1e-3, device="cpu")
    assert relative(found, direct_sum(radar, delay, gain, start)) <= 1e-3


@pytest.mark.usefixtures("blocks")
def test_gains_change_over_the_band_and_the_frame():
    radar = short("awr1843", "mmmesh", loops=64)
    delay, gain = scene(radar)
    rng = np.random.default_rng(1)
    slope, at = gain * rng.normal(size=PATHS), knots(radar, 9)
    omega, phase = 2 * np.pi * 20, rng.uniform(0, 6, PATHS)[:, None]

    def course(t):
        return 1 + 0.9 * np.exp(1j * (omega * np.atleast_1d(t) + phase))

    still = make_paths(radar, gain, delay, at, dispersion=np.repeat(slope[None, ..., None], len(at), axis=4))
    paths = replace(still, a=still.a * course(at), dispersion=still.dispersion * course(at))
    truth = direct_sum(radar, delay, gain, 0.0, course)
    truth = truth + direct_sum(radar, delay, slope, 0.0, course, (still.frequency, still.half_band))
    keeps_to_tolerances(radar, paths, truth)


@pytest.mark.parametrize("chirp", [3, 4])
@pytest.mark.parametrize("eps", [5e-3, 0.05])
def test_gains_that_flash_within_a_chirp_keep_to_the_tolerance(chirp, eps):
    """Pulses a third of the window wide over a steady return, as of a plate that turns fast, in a chirp that six evenly
    spaced ones include and in one that they leave out."""
    radar = short("position2go", loops=16)
    wave = radar.waveform
    window = wave.num_samples / wave.sample_rate
    middle, flash = wave.chirp_times[chirp, 0] + wave.adc_start_time + 0.5 * window, window / 3
    at = knots(radar, 1 + int(4 * wave.frame_length / flash))
    delay, gain = scene(radar, count=4)
    still = make_paths(radar, gain, delay, at)
    paths = replace(still, a=still.a * (0.1 + np.exp(-(((at - middle) / flash) ** 2))))
    truth = synthesize(radar, paths, 0.0, eps=1e-7, device="cpu")
    assert relative(synthesize(radar, paths, 0.0, eps=eps, device="cpu"), truth) <= eps


@pytest.mark.parametrize("orders", [2, 4])
def test_higher_orders_of_dispersion(orders, forms):
    radar = short("awr1843", "mmmesh", loops=16)
    delay, gain = scene(radar)
    size = 0.3 ** np.arange(1, orders + 1)
    dispersion = size[:, None, None, None, None] * np.repeat(gain[None, ..., None], 5, axis=4)
    paths = make_paths(radar, gain, delay, knots(radar), dispersion=dispersion)
    truth = synthesize(radar, paths, 0.0, eps=1e-7, device="cpu")
    assert relative(synthesize(radar, paths, 0.0, eps=2e-2, device="cpu"), truth) <= 2e-2
    assert forms == [True]


def test_what_blocks_cannot_do_is_summed_chirp_by_chirp(forms):
    """Elements whose delays have nothing in common, many orders of dispersion, and tight tolerances."""
    radar = short("awr1843", "mmmesh", loops=8)
    rng = np.random.default_rng(3)
    gain, tau0 = random_gains(rng, radar, PATHS), rng.uniform(1e-8, 8e-8, (3, 4, PATHS))

    def apart(t, tx, rx):
        return tau0[tx, rx][:, None] + 1e-8 * np.atleast_1d(t)

    found = synthesize(radar, make_paths(radar, gain, apart, knots(radar)), 0.0, eps=5e-3, device="cpu")
    assert relative(found, direct_sum(radar, apart, gain)) <= 5e-3
    delay, gain = scene(radar)
    dispersion = np.repeat(np.repeat(gain[None, ..., None], 5, axis=4), 8, axis=0)
    synthesize(radar, make_paths(radar, gain, delay, knots(radar), dispersion), 0.0, eps=5e-3, device="cpu")
    assert forms == [False, False]
    synthesize(radar, make_paths(radar, gain, delay, knots(radar)), 0.0, eps=9e-4, device="cpu")
    assert len(forms) == 2


def test_the_same_bits_every_time():
    radar = short("awr1843", "mmmesh", loops=20)
    delay, gain = scene(radar)
    paths = make_paths(radar, gain, delay, knots(radar))
    first, second = (synthesize(radar, paths, 0.0, eps=5e-3, device="cpu") for _ in range(2))
    np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize("eps", [5e-3, 1e-6])
def test_no_tx_no_signal(eps):
    radar = short("awr1843", "mmmesh", loops=4)
    delay, gain = scene(radar)
    paths = make_paths(radar, gain, delay, knots(radar))
    assert not synthesize(radar, paths, 0.0, eps=eps, tx_gains=np.zeros(3), device="cpu").any()


def test_blocks_need_no_tracer():
    code = (
        "import sys; from tests.unit.signal.test_block_transform import *\n"
        "radar = short('awr1843', 'mmmesh', loops=4); delay, gain = scene(radar)\n"
        "synthesize(radar, make_paths(radar, gain, delay, knots(radar)), 0.0, eps=5e-3, device='cpu')\n"
        "print('numba' in sys.modules, 'drjit' in sys.modules)"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout.split() == ["True", "False"]
