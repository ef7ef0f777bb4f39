"""Room for a way before the radar, where a prompt leaves the distance open."""

from __future__ import annotations

import numpy as np
import pytest

from rfgen_sionna.generative.motion import KinematicSource
from rfgen_sionna.generative.radar_placement import NEAREST, distance_for_way


@pytest.mark.parametrize("turn_deg", [0.0, 40.0, 90.0, 180.0])
@pytest.mark.parametrize("duration", [2.0, 12.0])
def test_a_walk_keeps_its_distance_from_the_radar(turn_deg: float, duration: float) -> None:
    motion = KinematicSource()("walk_straight", duration, 0)
    turn = np.radians(turn_deg)
    distance = distance_for_way(motion, turn, 3.0)
    assert distance >= 3.0
    c, s = np.cos(turn + np.pi), np.sin(turn + np.pi)  # it faces the radar at the origin
    track = np.asarray(motion.translation)[:, :2] @ np.array([[c, -s], [s, c]]).T + (distance, 0.0)
    assert np.linalg.norm(track, axis=1).min() > NEAREST - 1e-9
    if turn_deg == 0.0 and duration == 12.0:
        assert distance > 4.0
    if turn_deg == 90.0:
        assert distance == 3.0
