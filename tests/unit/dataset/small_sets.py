"""Small data sets for tests, written recording by recording without a simulation."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.dataset import ActorInfo, RunInfo, RunWriter
from rfgen_sionna.dataset.card import write_card
from rfgen_sionna.dataset.checksums import write_sums
from rfgen_sionna.dataset.schema import STANDARD_LABELS, StoredArray, StoredAxis
from rfgen_sionna.dataset.set_index import write_index
from rfgen_sionna.dataset.shards import assemble_shard
from rfgen_sionna.generative.motion.skeleton import JOINT_NAMES, NUM_BODY_JOINTS, PARENTS
from rfgen_sionna.radar import Radar
from rfgen_sionna.recipes.recording_spec import BodySpec, RadarSpec, RecordingSpec, SourceSpec

RECIPE = 'title = "Two gestures"\nlicence = "CC0-1.0"\ncount = 12\nprompts = ["a person pushes", "a person waves"]\n'
ACTIONS = ("push", "wave")
JOINTS = JOINT_NAMES[:NUM_BODY_JOINTS]
_POINTS = ((0.0, 0.1, 0.1), (1.0, -0.3, 0.3), (2.0, 0.3, -0.2), (3.0, -0.1, 0.0))
"""Distance beyond the nearest point [m], azimuth and elevation [rad] of each point."""
FULL_SCALE = 1e-4
"""Largest I or Q of the ADC [sqrt(W)]."""
_RECEIVER = {"thermal_noise": True, "adc": {"bits": 16}}
STEP = FULL_SCALE / 2**15
"""Step of the ADC of 16 bits [sqrt(W)]."""
_FACES = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]], np.int32)


def small_radar(**changes):
    """mmMesh with short frames."""
    full = Radar.load("awr1843", preset="mmmesh", position=(0, 0, 1), look_at=(3, 0, 1))
    return replace(full, waveform=replace(full.waveform, **({"num_loops": 8, "num_samples": 32} | changes)))


def spec(number, action, split, keep=("adc", "joints", "labels"), **changes):
    """Specification of a recording."""
    values = {
        "number": number, "attempt": 0, "split": split, "seed": 100 + number, "motion_seed": number,
        "place": "free space" if number % 3 else "furnished: office", "place_seed": 0,
        "bodies": (BodySpec(number),), "sources": (SourceSpec("prompt", f"a person does a {action}"),),
        "radars": (RadarSpec("", "awr1843", "mmmesh"),), "duration_s": 0.5, "distance_m": 1.0 + 0.05 * number,
        "azimuth_deg": None, "keep": keep,
    }  # fmt: skip
    return RecordingSpec(**(values | changes))


def frames_of(radar, number, action, count, seed=0):
    """Samples of points that go towards the radar and back, slowly (push) or fast (wave), and joints that turn."""
    rng = np.random.default_rng([seed, number])
    wave = radar.waveform
    chirp = wave.chirp_times
    speed, period = (0.8, 2.0) if action == "push" else (1.5, 1.0)
    times = np.arange(count) * wave.frame_period
    turns = Rotation.from_rotvec(0.2 * rng.standard_normal((len(JOINTS), 3)))
    offsets = 0.2 * rng.standard_normal((len(JOINTS), 3))
    for time in times:
        away = np.abs((time + chirp) % period - 0.5 * period)
        samples = np.zeros(radar.frame_shape, complex)
        for extra, azimuth, elevation in _POINTS:
            flat = np.cos(elevation)
            direction = np.array([np.cos(azimuth) * flat, np.sin(azimuth) * flat, np.sin(elevation)])
            distance = (1.5 + 0.05 * number + extra + speed * away)[..., None, None]
            tau = (2 * distance - (radar.virtual_positions @ direction)[None, ..., None]) / SPEED_OF_LIGHT
            samples += 1e-6 * np.exp(2j * np.pi * (radar.center_frequency * tau + wave.slope * tau * wave.sample_times))
        noise = rng.standard_normal((2, *radar.frame_shape))
        adc = STEP * np.round((samples + 1e-7 * (noise[0] + 1j * noise[1])) / STEP)
        world, joints = [], []
        for joint, parent in enumerate(PARENTS[: len(JOINTS)]):
            own = turns[joint] ** (0.5 + time)
            world.append(own if parent < 0 else world[parent] * own)
            where = np.array([3.0, 0.2, 1.0]) if parent < 0 else joints[parent] + world[parent].apply(offsets[joint])
            joints.append(where)
        yield time, adc, np.stack(joints), Rotation.concatenate(world).as_quat(), offsets


def write_part(path, number, action, split, *, frames=5, keep=("adc", "joints", "labels"), radars=("",), words=False):
    """Write one recording as the builder does."""
    radar = small_radar()
    given = spec(number, action, split, keep)
    body = {
        "actors/person/body/joint_rotation": StoredArray(
            ("joint", "quaternion"), "", "world rotation", axes={"quaternion": StoredAxis(["x", "y", "z", "w"], "")}
        )
    }
    arrays = body if "body" in keep else {}
    actor = ActorInfo("person", "skin", _FACES, 4, joint_names=JOINTS)
    labels = {name: STANDARD_LABELS[name] for name in ("action", "position", "distance")}
    info = RunInfo(
        radar, prompt=f"a person does a {action}", environment=given.place, seeds={"noise": given.seed},
        actors=(actor,), labels=labels, arrays=arrays, recording=given.to_dict(), software={"rfgen_sionna": "0"},
        receiver=_RECEIVER,
    )  # fmt: skip
    infos = info if radars == ("",) else dict.fromkeys(radars, info)
    with RunWriter(path, infos, keep=keep, words=words, compressed=True, dated=False) as writer:
        for name in radars:
            for time, adc, joints, turns, _ in frames_of(radar, number, action, frames):
                more = {"radar": name} if name else {}
                writer.append(
                    adc=adc.astype(np.complex64), time=time, mesh_time=time, joints={"person": joints},
                    labels={"action": [action], "position": joints[:1], "distance": [3.0]},
                    arrays=dict.fromkeys(arrays, turns), full_scale=FULL_SCALE, **more,
                )  # fmt: skip


def make_set(folder, *, count=12, per_shard=4, actions=ACTIONS, splits=("train", "train", "test"), **options):
    """A set of `count` recordings, in the layout of the builder."""
    folder = Path(folder)
    folder.mkdir()
    (folder / "recipe.toml").write_text(RECIPE)
    for first in range(0, count, per_shard):
        parts = {}
        for number in range(first, min(count, first + per_shard)):
            parts[number] = folder / f"{number:06d}.part.h5"
            action = actions[number % len(actions)]
            write_part(parts[number], number, action, splits[number // 2 % len(splits)], **options)
        assemble_shard(folder / f"shard-{first // per_shard:05d}.h5", parts, {})
        for part in parts.values():
            part.unlink()
    return finish(folder)


def finish(folder):
    """Write index, card and checksums of a folder of shards."""
    write_index(folder)
    write_card(folder)
    write_sums(folder)
    return folder


__all__ = ["ACTIONS", "JOINTS", "RECIPE", "finish", "make_set", "small_radar", "spec", "write_part"]
