"""A board with wrong gains, phases and cables measures like an ideal one after a look at a corner reflector."""

from dataclasses import replace

import numpy as np
import pytest

from rfgen_sionna.processing import Calibration, estimate_calibration, point_cloud
from rfgen_sionna.processing.spectrum import observation_time
from rfgen_sionna.radar import Adc
from rfgen_sionna.radar.slots import doppler_slot
from rfgen_sionna.signal import Mismatch, RangeBias, Receiver, receive

BIAS = 0.067
C = 299_792_458.0


def errors(radar, seed=0):
    """(tx, rx) errors of a board without any calibration: 1.5 dB and any phase."""
    rng = np.random.default_rng(seed)
    shape = len(radar.tx_names), len(radar.rx_names)
    return 10 ** (rng.normal(0, 1.5, shape) / 20) * np.exp(2j * np.pi * rng.uniform(size=shape))


def measured(synthesise, radar, targets, gains, bias, noise=0.0, seed=0):
    """Cube of targets behind the board's errors, exact: a bias is a line of that length, in the cross terms too."""
    ideal = replace(radar, adc=Adc())
    cube = synthesise(ideal, targets)[0].astype(complex)
    wave = radar.waveform
    fast = wave.adc_start_time + np.arange(wave.num_samples) / wave.sample_rate
    delay = 2 * bias / C
    turns = wave.start_frequency * delay + wave.slope * fast * delay - 0.5 * wave.slope * delay**2
    cube *= gains[..., None] * np.exp(2j * np.pi * (turns % 1))
    rng = np.random.default_rng(seed)
    cube += noise * (rng.standard_normal(cube.shape) + 1j * rng.standard_normal(cube.shape))
    return (np.sqrt(2) * cube.real).astype(np.float32) if radar.adc.real else cube.astype(np.complex64)


@pytest.fixture(params=["complex", "real", "down"])
def radar(mmmesh, request):
    if request.param == "down":
        wave = mmmesh.waveform
        start = wave.start_frequency + wave.slope * wave.ramp_end_time
        return replace(mmmesh, waveform=replace(wave, start_frequency=start, slope=-wave.slope), adc=Adc(real=True))
    return replace(mmmesh, adc=Adc(real=request.param == "real"))


def test_a_reflector_in_the_near_field_gives_gains_and_bias(synthesise, radar):
    gains = errors(radar)
    place = np.array([1.1, 0.2, -0.1])
    cube = measured(synthesise, radar, [(place, (0, 0, 0), 1e-3)], gains, BIAS, noise=1e-4)
    found = estimate_calibration(cube, radar, place)
    assert found.range_bias == pytest.approx(BIAS, abs=0.01 * radar.range_resolution)
    ratio = found.gains / gains
    np.testing.assert_allclose(ratio / ratio[0, 0], 1.0, atol=0.01)
    assert np.mean(np.abs(found.gains) ** 2) == pytest.approx(1)
    assert found.gains[0, 0].imag == pytest.approx(0, abs=1e-12)


def test_a_calibrated_cube_has_angle_and_range_within_a_hundredth_of_a_cell(synthesise, radar):
    gains = errors(radar, 1)
    reflector = np.array([2.0, -0.3, 0.1])
    look = measured(synthesise, radar, [(reflector, (0, 0, 0), 1e-3)], gains, BIAS, noise=1e-4)
    calibration = estimate_calibration(look, radar, reflector)
    where = np.array([3.2, 1.4, 0.5])
    speed = np.array([0.9, 0.0, 0.0])
    targets = [(where - speed * observation_time(radar), speed, 1e-3)]
    cube = measured(synthesise, radar, targets, gains, BIAS)
    ideal = point_cloud(measured(synthesise, radar, targets, np.ones_like(gains), 0.0), radar, static=True)
    raw = point_cloud(cube, radar, static=True)
    mended = point_cloud(calibration.apply(cube, radar), radar, static=True)
    cell = radar.range_resolution
    assert abs(raw.range[0] - ideal.range[0]) > cell, "the test has something to mend"
    assert abs(mended.range[0] - ideal.range[0]) < 0.01 * cell
    for axis in (1, 2):
        cosines = (cloud.device[0, axis] / cloud.range[0] for cloud in (mended, ideal))
        assert abs(np.subtract(*cosines)) < 0.01 / 4, "a cell of eight elements is a quarter"
    np.testing.assert_allclose(mended.device[0], where, atol=0.1 * cell)


def test_the_pose_of_the_radar_counts(synthesise, mmmesh):
    gains = errors(mmmesh)
    device = np.array([1.5, 0.3, 0.2])
    cube = measured(synthesise, mmmesh, [(device, (0, 0, 0), 1e-3)], gains, 0.0)
    placed = mmmesh.placed(position=(4.0, 1.0, 1.2), orientation=(0.7, 0.1, 0.0))
    world = placed.rotation @ device + np.array(placed.position)
    found = estimate_calibration(cube, placed, world)
    assert found.range_bias == pytest.approx(0, abs=1e-4)
    ratio = found.gains / gains
    # These targets have one amplitude in all channels; that of a real one falls with both distances.
    np.testing.assert_allclose(np.angle(ratio / ratio[0, 0]), 0.0, atol=1e-6)
    np.testing.assert_allclose(np.abs(ratio / ratio[0, 0]), 1.0, atol=3e-3)


def test_feeds_of_the_radar_are_no_errors(synthesise, mmmesh):
    turned = replace(mmmesh, tx_phases_deg=(0, 180, 0), rx_phases_deg=(0, 180, 0, 180))
    place = (2.0, 0.4, 0.1)
    found = estimate_calibration(synthesise(turned, [(place, (0, 0, 0), 1.0)]), turned, place)
    np.testing.assert_allclose(found.gains, 1.0, atol=3e-3)


def test_a_file_holds_a_calibration(mmmesh, tmp_path):
    kept = Calibration(errors(mmmesh), mmmesh.tx_names, mmmesh.rx_names, BIAS)
    kept.save(tmp_path / "board.json")
    read = Calibration.load(tmp_path / "board.json")
    np.testing.assert_array_equal(read.gains, kept.gains)
    assert (read.tx_names, read.rx_names, read.range_bias) == (kept.tx_names, kept.rx_names, BIAS)
    (tmp_path / "other.json").write_text('{"gains": []}', encoding="utf-8")
    with pytest.raises(ValueError, match=r"other.json' has gains: the keys format, tx_names"):
        Calibration.load(tmp_path / "other.json")


def test_elements_count_by_name(synthesise, mmmesh, di_gesture):
    """Another preset of the board, with fewer elements, takes its own gains; another board is refused."""
    kept = Calibration(errors(mmmesh), mmmesh.tx_names, mmmesh.rx_names)
    chosen = [mmmesh.tx_names.index(name) for name in di_gesture.tx_names]
    assert len(chosen) < len(mmmesh.tx_names)
    cube = synthesise(di_gesture, [((1.0, 0.1, 0), (0, 0, 0), 1.0)])
    given = cube * kept.gains[chosen][..., None].astype(np.complex64)
    np.testing.assert_allclose(kept.apply(given, di_gesture), cube, atol=1e-5)
    other = replace(mmmesh, rx_names=("A", "B", "C", "D"))
    with pytest.raises(ValueError, match=r"Rx elements RX1, RX2, RX3, RX4; .* has A, B, C, D besides"):
        kept.apply(np.zeros(mmmesh.frame_shape, np.complex64), other)
    with pytest.raises(ValueError, match="entries along 'tx'"):
        kept.apply(np.zeros(di_gesture.frame_shape, np.complex64), mmmesh)


def test_slots_are_separated_first(mmmesh):
    wave = replace(mmmesh.waveform, tx_order=(), slots=(doppler_slot(4, range(3), 3),))
    radar = replace(mmmesh, waveform=wave)
    kept = Calibration(errors(mmmesh), mmmesh.tx_names, mmmesh.rx_names)
    with pytest.raises(ValueError, match=r"processing.demultiplex\(cube, radar\)"):
        kept.apply(np.zeros(radar.frame_shape, np.complex64), radar)


def test_what_is_no_reflector_at_rest_is_refused(synthesise, mmmesh):
    place = np.array([2.0, 0.0, 0.0])
    noise = synthesise(mmmesh, [], noise=1.0)
    with pytest.raises(ValueError, match=r"no reflector within 0.5 m of 2.0\d\d m"):
        estimate_calibration(noise, mmmesh, place)
    passing = synthesise(mmmesh, [((2.0, 0, 0), (0.001, 0, 0), 1.0)], frames=10)
    passing = np.concatenate([passing, -passing + 0.05 * passing])
    with pytest.raises(ValueError, match="% of the power of single ones"):
        estimate_calibration(passing, mmmesh, place)
    with pytest.raises(ValueError, match=r"position is 20 m away: radar 'awr1843' has ranges of .* 11 m"):
        estimate_calibration(noise, mmmesh, (20.0, 0, 0))
    with pytest.raises(ValueError, match=r"gains have shape \(2, 2\)"):
        Calibration(np.ones((2, 2)), mmmesh.tx_names, mmmesh.rx_names)


def test_it_mends_what_the_receiver_of_a_simulation_does(synthesise, mmmesh):
    """Chains of Tx and Rx, cables, thermal noise and words of the ADC."""
    receiver = Receiver(mismatch=Mismatch(gain_spread_db=2.0, phase_spread_deg=60.0), range_bias=RangeBias(BIAS))

    def taken(targets, frame):
        return receive(synthesise(mmmesh, targets)[0].astype(complex), mmmesh, receiver, seed=5, frame=frame).samples

    reflector = np.array([2.0, 0.2, 0.1])
    look = np.stack([taken([(reflector, (0, 0, 0), 1e-5)], frame) for frame in range(2)])
    calibration = estimate_calibration(look, mmmesh, reflector)
    assert calibration.range_bias == pytest.approx(BIAS, abs=0.01 * mmmesh.range_resolution)
    tx, rx = receiver.mismatch.factors(mmmesh, 5)
    ratio = calibration.gains / np.outer(tx, rx)
    np.testing.assert_allclose(ratio / ratio[0, 0], 1.0, atol=0.01)
    where = np.array([4.0, -1.5, 0.6])
    cloud = point_cloud(calibration.apply(taken([(where, (0, 0, 0), 1e-5)], 2), mmmesh), mmmesh, static=True)
    np.testing.assert_allclose(cloud.device[0], where, atol=0.2 * mmmesh.range_resolution)
