"""What a person moved by the learned model returns: Doppler as fast as the mesh moves, and no faster."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rfgen_sionna.radar import Radar
from rfgen_sionna.signal import synthesize
from rfgen_sionna.tracing.tracer import Tracer

pytest.importorskip("anny")
pytest.importorskip("torch")

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.actor import Actor
from rfgen_sionna.generative.bodies import Phenotype, Rig, animate, person
from rfgen_sionna.generative.diffusion.diffusion_source import DiffusionSource
from rfgen_sionna.generative.motion.rotations import to_matrices
from rfgen_sionna.generative.motion.skeleton import JOINT, SIDES, forward_kinematics, global_rotations
from rfgen_sionna.records import Motion, RadarPaths


@pytest.mark.slow
def test_generated_walking_shows_the_speeds_of_its_mesh_and_no_others() -> None:
    """Legs faster than the trunk; a thousandth of the power at most beyond the fastest visible vertices.

    Stairs or clicks between the model's poses (20 Hz) would spread power over the whole band.
    """
    radar = Radar.load("awr1843", "mmmesh", position=(0, 0, 1), look_at=(3, 0, 1))
    fast = replace(
        radar,
        waveform=replace(radar.waveform, tx_order=(0,), num_loops=384, num_samples=32),
        tx_positions=radar.tx_positions[:1],
        tx_names=radar.tx_names[:1],
        rx_positions=radar.rx_positions[:1],
        rx_names=radar.rx_names[:1],
    )
    person = Actor.from_prompt("a person walking back and forth", seed=1, radar=fast, duration=4.0, motion="diffusion")
    tracer = Tracer(None, fast, [person], rtol=1e-3)
    resolution = fast.wavelength / (2 * fast.waveform.frame_length)
    axis = np.fft.fftshift(np.fft.fftfreq(384, fast.waveform.loop_period)) * fast.wavelength / 2
    legs, trunk = [], []
    for start in np.arange(0.6, 1.8, 0.2):  # a whole step: at any one moment a leg may just be turning
        parts = tracer.trace(start, start + fast.waveform.frame_length).actors
        paths = RadarPaths.concatenate([each.at(parts[-1].times) for each in parts])
        middle = start + 0.5 * fast.waveform.frame_length
        offset = person.vertices(middle) - np.asarray(fast.position)
        velocity = (person.vertices(middle + 1e-3) - person.vertices(middle - 1e-3)) / 2e-3
        speed = np.einsum("ij,ij->i", velocity, offset) / np.linalg.norm(offset, axis=1)
        slow = synthesize(fast, paths, start)[:, 0, 0]
        spectrum = np.fft.fftshift(np.abs(np.fft.fft(slow * np.hanning(384)[:, None], axis=0)) ** 2, axes=0).sum(axis=1)
        visible = speed[np.unique(person.faces[paths.facet])]
        outside = (axis < visible.min() - 3 * resolution) | (axis > visible.max() + 3 * resolution)
        assert spectrum[outside].sum() < 1e-3 * spectrum.sum()
        for group, names in ((legs, ("shank", "foot")), (trunk, ("torso",))):
            parts = [k for k, name in enumerate(paths.part_names) if any(n in name for n in names)]
            own = speed[np.unique(person.faces[np.isin(person.face_parts, parts)])]
            group.append(np.abs(own).max())
    assert max(legs) > 1.5 * max(trunk) > 0.0


@pytest.fixture(scope="module")
def rig() -> Rig:
    return person(Phenotype(height=1.75), seed=0)


def walker(rig: Rig, speed: float = 1.0, seed: int = 4) -> Motion:
    return DiffusionSource()("walk_straight", 3.5, seed, skeleton=rig.skeleton, speed=speed)


def find_period(signal: FloatArray, rate: float, longest: float) -> tuple[float, float]:
    """Period [s] and height of the highest peak of the autocorrelation of a signal, up to `longest` [s]."""
    centred = signal - signal.mean()
    lags = np.arange(int(0.25 * rate), int(longest * rate) + 1)
    heights = [float(np.corrcoef(centred[:-k], centred[k:])[0, 1]) for k in lags]
    best = int(np.argmax(heights))
    return float(lags[best] / rate), heights[best]


def limb_speed(motion: Motion, times: FloatArray, place: FloatArray, eye: FloatArray) -> FloatArray:
    """(time,) greatest radial speed of knees, ankles and toes away from `eye` [m/s], of a motion put at `place`."""
    world = global_rotations(to_matrices(motion.rotations), motion.parents)
    joints = forward_kinematics(world, motion.translation + place, motion.offsets, motion.parents)
    legs = [JOINT[f"{side}_{joint}"] for side in SIDES for joint in ("knee", "ankle", "foot")]
    reach = np.linalg.norm(joints[:, legs] - eye, axis=-1)
    speed = np.gradient(reach, 1.0 / motion.frame_rate, axis=0).max(axis=1)
    return np.interp(times, np.arange(len(speed)) / motion.frame_rate, speed)


def test_skin_passes_through_poses_without_a_kick(rig: Rig) -> None:
    """Accelerations over a fifth of a millisecond are no greater than over four: poses are 17 ms apart, and straight
    lines between them would make them twenty times as great where one meets the next."""
    motion = walker(rig)
    body = animate(rig, motion)
    any_visible = np.arange(0, len(body.vertices(0.0)), 40)

    def greatest(step: float) -> float:
        poses = np.arange(60, 76) / motion.frame_rate
        return max(
            float(np.linalg.norm(a - 2.0 * b + c, axis=-1).max()) / step**2
            for a, b, c in ((body.vertices(t - step)[any_visible], body.vertices(t)[any_visible], body.vertices(t +
            step)[any_visible])
                            for t in poses)
        )  # fmt: skip

    smooth = greatest(4e-3)
    assert 5.0 < smooth < 500.0
    assert greatest(2e-4) < 1.5 * smooth


@pytest.mark.slow
def test_micro_doppler_of_generated_walking_has_the_cadence_and_speed_of_its_legs(rig: Rig) -> None:
    """The edge of the spectrum goes up and down with the fastest joint of the legs, as often and as far."""
    full = Radar.load("awr1843", "mmmesh", position=(0, 0, 1), look_at=(3, 0, 1))
    radar = replace(
        full,
        waveform=replace(full.waveform, tx_order=(0,), num_loops=256, num_samples=32),
        tx_positions=full.tx_positions[:1],
        tx_names=full.tx_names[:1],
        rx_positions=full.rx_positions[:1],
        rx_names=full.rx_names[:1],
    )
    motion = walker(rig)
    place = np.array([2.0, 0.0, 0.0])
    body = Actor.from_motion(motion, body=rig, position=place, orientation=(0, 0, 0))
    tracer = Tracer(None, radar, [body], rtol=1e-2)
    axis = np.fft.fftshift(np.fft.fftfreq(256, radar.waveform.loop_period)) * radar.wavelength / 2
    length = radar.waveform.frame_length
    starts = np.arange(0.8, 3.2, 0.05)
    edge = []
    for start in starts:
        slow = sum(synthesize(radar, each, start) for each in tracer.trace(start, start + length).actors)[:, 0, 0]
        window = np.blackman(256)[:, None]
        power = np.fft.fftshift(np.abs(np.fft.fft(slow * window, axis=0)) ** 2, axes=0).sum(axis=1)
        # What moves away fastest, down to forty decibels under the whole: feet that swing, seen from behind,
        # return thirty less than a trunk at most times.
        share = np.cumsum(power[::-1])[::-1] / power.sum()
        edge.append(axis[np.flatnonzero(share > 1e-4)[-1]])
    visible = np.array(edge)
    times = starts + 0.5 * length
    eye = np.asarray(radar.position)
    legs = limb_speed(motion, times, place, eye)
    period, height = find_period(visible, 20.0, 1.0)
    true, _ = find_period(legs, 20.0, 1.0)
    other, _ = find_period(limb_speed(walker(rig, speed=0.7), times, place, eye), 20.0, 1.0)
    later = limb_speed(motion, times + 0.5 * true, place, eye)
    alike, apart = (float(np.corrcoef(visible, s)[0, 1]) for s in (legs, later))
    print(f"step {period:.3f} s (joints {true:.3f}, other walk {other:.3f}), autocorrelation {height:.2f}")
    print(
        f"alike {alike:.2f}, half a step later {apart:.2f}, fastest {visible.max():.2f} m/s (joints {legs.max():.2f})"
    )
    assert period == pytest.approx(true, rel=0.05)
    assert height > 0.5
    assert abs(other / true - 1.0) > 0.1
    assert alike > 0.6
    assert apart < 0.1
    assert np.percentile(visible, 95) == pytest.approx(np.percentile(legs, 95), rel=0.2)
