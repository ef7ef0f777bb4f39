"""Kinect joints of the MARS data set (An and Ogras 2021) drive a body. Run with `--data FOLDER`, which has `mars/`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from rfgen_sionna.generative.actor import Actor
from rfgen_sionna.generative.bodies import Phenotype, Rig, person
from rfgen_sionna.generative.motion.joint_files import read_joints
from rfgen_sionna.generative.motion.joint_layouts import package_joints
from rfgen_sionna.generative.motion.skeleton import JOINT

RATE = 10.0
BONES = [(f"{side}_{a}", f"{side}_{b}") for side in ("left", "right")
         for a, b in (("hip", "knee"), ("knee", "ankle"), ("shoulder", "elbow"), ("elbow", "wrist"))]  # fmt: skip


@pytest.fixture(scope="module")
def body() -> Rig:
    return person(Phenotype(height=1.75), seed=0)


@pytest.mark.parametrize(
    ("subject", "first"), [("subject2", 0), ("subject2", 2408), ("subject3", 530), ("subject3", 2120)]
)
def test_a_body_follows_the_kinect(recordings: Path, body: Rig, subject: str, first: int) -> None:
    """Arms extended (two clips of people who stand) and squats and lunges (two)."""
    track = read_joints(recordings / "mars" / subject / "timesplit" / "kinect_data_train.csv")
    clip = track.positions[first : first + 300]
    actor = Actor.from_joints(clip, names=track.names, frame_rate=RATE, body=body)
    assert actor.residual is not None
    smooth = gaussian_filter1d(clip, 0.5, axis=0)
    own, names = package_joints(track.names), list(actor.residual.median)
    theirs = smooth[:, [own[name] for name in names]]
    ours = np.stack([actor.joints(k / RATE) for k in range(len(clip))])[:, [JOINT[name] for name in names]]
    error = np.linalg.norm(ours - theirs, axis=-1)
    assert np.median(error) < 0.05
    assert np.median(error, axis=0).max() < 0.05
    assert actor.residual.overall_median == pytest.approx(np.median(error), abs=0.005)
    for a, b in BONES:
        recorded = np.median(np.linalg.norm(clip[:, own[a]] - clip[:, own[b]], axis=-1))
        made = np.linalg.norm(ours[0, names.index(a)] - ours[0, names.index(b)])
        assert made == pytest.approx(recorded, rel=0.03), (a, b)
    for k, name in enumerate(names):
        fastest, recorded = (
            np.quantile(np.linalg.norm(np.diff(p[:, k], axis=0), axis=-1) * RATE, 0.99) for p in (ours, theirs)
        )
        # a Kinect's toes jump under the ankle, where a foot has no heading
        assert fastest < 1.2 * recorded + (0.25 if name.endswith("foot") else 0.02), name
    if first in (0, 530):
        fine = np.stack([actor.joints(t) for t in np.arange(0.0, (len(clip) - 1) / RATE, 1.0 / 60.0)])
        shins = [JOINT[f"{side}_{joint}"] for side in ("left", "right") for joint in ("knee", "ankle")]
        assert np.linalg.norm(np.diff(fine[:, shins], axis=0), axis=-1).max() * 60.0 < 0.33
