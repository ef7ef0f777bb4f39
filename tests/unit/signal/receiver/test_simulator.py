"""The simulator's runs go through the receiver."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from rfgen_sionna.dataset import RunInfo, RunWriter, open_run
from rfgen_sionna.pipeline import generate
from rfgen_sionna.processing import point_cloud
from rfgen_sionna.radar import Adc, Radar
from rfgen_sionna.scene import MeshActor
from rfgen_sionna.scene.mitsuba_backend import has_cuda
from rfgen_sionna.signal import DcOffset, Leakage, Mismatch, Receiver, synthesize
from rfgen_sionna.simulation import Simulator


@pytest.fixture(scope="module")
def simulator(tiny_toml):
    radar = Radar.load(tiny_toml, position=(0, 0, 1), look_at=(3, 0, 1))
    mesh = trimesh.creation.icosphere(subdivisions=1, radius=0.05)
    return Simulator(
        None, radar, [MeshActor.from_mesh(mesh, material="metal", position=(3, 0, 1), name="ball")], rtol=0.01
    )


def test_noise_and_receiver_together(simulator):
    """noise=False takes the thermal noise out of a receiver; without one it means an ideal receiver."""
    clean = simulator.adc(0.05, noise=False)
    offset = Receiver(dc_offset=DcOffset(-60.0, 0.0), adc=None)
    quiet = simulator.adc(0.05, noise=False, receiver=offset).data
    np.testing.assert_allclose(quiet - clean.data, np.sqrt(1e-9), rtol=1e-5)
    noisy = simulator.adc(0.05, receiver=offset, seed=2)
    alone = simulator.adc(0.05, receiver=Receiver(adc=None), seed=2)
    np.testing.assert_allclose(noisy.data - alone.data, np.sqrt(1e-9), rtol=1e-5)
    assert (clean.seed, noisy.seed) == (None, 2)
    frames = list(simulator.frames(0.05, noise=False))
    assert (frames[0].full_scale, frames[0].clipped) == (None, 0.0)


def test_presets_quantise_with_one_scale_for_all_frames(simulator):
    frames = list(simulator.frames(0.15, seed=1))
    scales = {frame.full_scale for frame in frames}
    assert len(scales) == 1
    lsb = scales.pop() / 2**15
    for frame in frames:
        words = np.stack([frame.samples.real, frame.samples.imag]) / lsb
        np.testing.assert_array_equal(words, np.rint(words))
    coarse = list(simulator.frames(0.05, receiver=Receiver(adc=Adc(8, -120.0))))
    assert coarse[0].clipped > 0.01
    assert coarse[0].full_scale == pytest.approx(10 ** (-150 / 20))


def test_a_device_keeps_its_faults_from_frame_to_frame(simulator):
    receiver = Receiver(leakage=Leakage(-30), mismatch=Mismatch(gain_spread_db=1.0), thermal_noise=False, adc=None)
    cube = simulator.adc(0.15, receiver=receiver, seed=4).data
    np.testing.assert_allclose(cube[1], cube[0], rtol=1e-3, atol=1e-6 * np.abs(cube).max())


def test_what_does_not_fit_is_refused_before_the_work(simulator):
    with pytest.raises(ValueError, match="receiver file 'noisy' does not exist"):
        simulator.frames(0.05, receiver="noisy")
    with pytest.raises(ValueError, match=r"mismatch.rx_gain_db has 3 values"):
        simulator.frames(0.05, receiver=replace(Receiver(), mismatch=Mismatch(rx_gain_db=(0, 1, 2))))


@pytest.fixture
def devices(monkeypatch):
    """The devices that runs hand to the synthesiser, which computes on the CPU all the same."""
    found = []

    def here(*arguments, device, **options):
        found.append(device)
        return synthesize(*arguments, device="cpu", **options)

    monkeypatch.setattr("rfgen_sionna.frame_loop.synthesize", here)
    return found


@pytest.mark.parametrize(
    ("cuda", "device", "used"), [(True, "auto", "cuda"), (True, "cpu", "cpu"), (False, "auto", "cpu")]
)
def test_the_device_goes_through_to_the_synthesiser(simulator, devices, monkeypatch, cuda, device, used):
    monkeypatch.setattr("rfgen_sionna.signal.synthesis.has_cuda", lambda: cuda)
    simulator.adc(0.05, device=device)
    assert set(devices) == {used}


def test_a_device_that_is_not_there_is_refused_before_the_work(simulator, devices, monkeypatch):
    monkeypatch.setattr("rfgen_sionna.signal.synthesis.has_cuda", lambda: False)
    with pytest.raises(ValueError, match="device is 'gpu'; allowed"):
        simulator.frames(0.05, device="gpu")
    with pytest.raises(ValueError, match="device is 'cuda', but no CUDA driver"):
        simulator.adc(0.05, device="cuda")
    with pytest.raises(ValueError, match="device is 'cuda', but no CUDA driver"):
        generate("a person waving at 3 m", device="cuda")
    assert not devices


@pytest.mark.gpu
def test_a_run_on_a_gpu_is_the_run_on_the_cpu(simulator):
    if not has_cuda():
        pytest.fail("this test was asked for by -m gpu, but there is no CUDA device")
    here, there = (simulator.adc(0.05, noise=False, device=device).data for device in ("cpu", "cuda"))
    assert np.abs(there - here).max() < 0.01 * np.abs(here).max()  # the simulator's tolerance
    np.testing.assert_array_equal(there, simulator.adc(0.05, noise=False, device="cuda").data)


def test_a_real_adc_sees_the_ball_where_a_complex_one_does(simulator, tmp_path):
    """From the echoes through the file to the point cloud, with the noise and words of one converter."""
    whole = simulator.radar
    radar = replace(whole, adc=Adc(12, real=True))
    run = Simulator(None, radar, simulator.actors, rtol=0.01)
    ideal, quiet = run.adc(0.05, noise=False), simulator.adc(0.05, noise=False)
    assert ideal.data.dtype == np.float32
    np.testing.assert_allclose(
        ideal.data, np.sqrt(2) * quiet.data.real, rtol=1e-5, atol=1e-6 * np.abs(ideal.data).max()
    )
    cube = run.adc(0.05, seed=3)
    clouds = [point_cloud(each.data[0], each.radar, static=True) for each in (cube, simulator.adc(0.05, seed=3))]
    # A ball of 5 cm at 3 m reflects at its front.
    for cloud in clouds:
        assert cloud.range[0] == pytest.approx(2.95, abs=0.1 * radar.range_resolution)
        assert abs(cloud.azimuth[0]) < np.radians(1)
    assert clouds[0].snr_db[0] == pytest.approx(clouds[1].snr_db[0], abs=2.0)
    with RunWriter(tmp_path / "run.h5", RunInfo(radar)) as writer:
        for frame in run.frames(0.05, seed=3):
            writer.append(frame.samples, time=frame.time, full_scale=frame.full_scale, clipped=frame.clipped)
    with open_run(tmp_path / "run.h5") as kept:
        assert kept.radar == radar
        assert kept.adc.dtype == np.float32
        np.testing.assert_array_equal(kept.cube().data, cube.data)


def test_phases_of_feeds_are_in_the_samples_and_not_in_the_angles(simulator):
    radar = replace(simulator.radar, tx_phases_deg=(0, 180), rx_phases_deg=(0, 180, 180, 0))
    ball = [MeshActor.from_mesh(trimesh.creation.icosphere(1, 0.05), material="metal", position=(3, 0.8, 1))]
    receiver = Receiver(leakage=Leakage(-30), thermal_noise=False, adc=None)
    turned, plain = (Simulator(None, each, ball).adc(0.05, receiver=receiver) for each in (radar, simulator.radar))
    signs = np.outer([1, -1], [1, -1, -1, 1])[..., None]
    np.testing.assert_allclose(turned.data, plain.data * signs, rtol=1e-5, atol=1e-6 * np.abs(plain.data).max())
    cloud = point_cloud(turned.data[0], radar, static=True, range_limits=(2.0, 4.0))
    assert cloud.azimuth[0] == pytest.approx(np.arctan2(0.8, 3), abs=np.radians(1))
