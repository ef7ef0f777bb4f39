"""A small run with one actor, images and labels."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from rfgen_sionna.dataset import STANDARD_LABELS, ActorInfo, Label, RunInfo, RunWriter
from rfgen_sionna.dataset.checksums import write_sums
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import Pir
from tests.benchmarks.fuzz_sets import make_set


@pytest.fixture(scope="session")
def radar():
    """mmMesh with short frames, to keep files small."""
    full = Radar.load("awr1843", preset="mmmesh", position=(0, 0, 1), look_at=(3, 1, 1))
    return replace(full, waveform=replace(full.waveform, num_loops=4, num_samples=16))


@pytest.fixture(scope="session")
def info(radar):
    faces = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]], np.int32)
    person = ActorInfo("person", "skin", faces, 4, ("torso", "arm"), np.array([0, 0, 1, 1]), ("pelvis", "hand"))
    ball = ActorInfo("ball", "metal", faces, 4)
    labels = {name: STANDARD_LABELS[name] for name in ("action", "position", "distance")}
    return RunInfo(
        radar,
        prompt="a person pushing",
        negative_prompt="furniture",
        environment="a hall",
        seeds={"motion": 3, "noise": 7, "body": None},
        actors=(person, ball),
        labels=labels | {"breath": Label("Hz", (), "rate"), "gaze": Label("1", ("eye", "axis"), "direction")},
    )


@pytest.fixture(scope="session")
def frame(radar):
    """Keyword arguments of the append of one frame."""

    def make(index):
        rng = np.random.default_rng(index)
        corners = rng.standard_normal((4, 3))
        shape = (4, 3, 4, 16)
        energy = rng.random((6, 8))
        return {
            "adc": (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)).astype(np.complex64),
            "time": 0.1 * index,
            "pir": Pir(
                energy, energy * 2e-8, energy - 0.5, (60.0, 45.0), radar.position, radar.orientation, time=0.1 * index
            ),
            "vertices": {"person": corners, "ball": corners + 1},
            "joints": {"person": corners[:2]},
            "labels": {
                "action": ["push", "roll"],
                "position": rng.random((2, 3)),
                "distance": [3.0 + index, 4.0],
                "breath": 0.3,
                "gaze": np.eye(3)[:2],
            },
            "mesh_time": 0.1 * index + 0.0138,
        }

    return make


@pytest.fixture
def write(info, frame):
    def make(path, frames=3, **options):
        with RunWriter(path, info, **options) as writer:
            for index in range(frames):
                writer.append(**frame(index))
        return path

    return make


@pytest.fixture(scope="session")
def base_set(tmp_path_factory):
    """Folder of a small data set, which no test changes."""
    folder = tmp_path_factory.mktemp("sets") / "base"
    make_set(folder)
    return folder


@pytest.fixture
def small_set(base_set, tmp_path):
    """Folder of a small data set, known as verified."""
    shutil.copytree(base_set, tmp_path / "set", ignore=shutil.ignore_patterns(".verified"))
    write_sums(tmp_path / "set")
    return tmp_path / "set"
