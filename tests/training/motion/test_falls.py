"""Falls by physics: the body, and one fall made again."""

from __future__ import annotations

import numpy as np
import pytest

from rfgen_sionna.generative import MotionLibrary
from rfgen_sionna.generative.action_definitions import MotionSignals, check

mujoco = pytest.importorskip("mujoco")
pytestmark = pytest.mark.slow


def test_the_body_has_the_mass_and_stature_of_an_adult() -> None:
    from training.motion.falls.body import model_xml

    model = mujoco.MjModel.from_xml_string(model_xml(1.05, 80.0, {}))
    assert model.body_mass.sum() == pytest.approx(80.0, rel=0.01)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    # Winter (2009), table 4.1: the centre of mass is 0.55 of the stature over the soles; arms are level here, 2 % more
    foot, head = data.body("left_ankle").xpos[2] - 0.0762 * 1.05, data.body("head").xpos[2]
    height = data.subtree_com[1, 2] - foot
    assert height / (head - foot + 0.14) == pytest.approx(0.57, abs=0.03)


def test_a_fall_is_made_again() -> None:
    from training.motion.falls.__main__ import entry, simulate
    from training.motion.falls.starts import all_starts

    starts = all_starts(MotionLibrary())
    first, second = (next(simulate("faint", 1, starts, 0)) for _ in range(2))
    assert np.array_equal(first.motion.rotations, second.motion.rotations)
    record, motion = entry(first, 0)
    assert record.kind == "simulated"
    assert check(motion, "faint").true
    s = MotionSignals(motion)
    # until physics takes over it is the clip
    clip, frame = first.scenario.start.motion, first.scenario.start.frame
    steps = np.diff(motion.translation[: first.begins, 2])
    assert np.allclose(steps, np.diff(clip.translation[frame - first.begins : frame, 2]))
    assert s.pelvis_height[-1] < 0.2
