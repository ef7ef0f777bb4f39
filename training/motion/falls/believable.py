"""Whether a simulated fall looks like one of people, by what has been measured on them."""

from __future__ import annotations

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.action_definitions import MotionSignals, check
from rfgen_sionna.generative.action_definitions.sampled_series import RATE, rate_of
from rfgen_sionna.records import Motion
from training.motion.falls.simulation import Fall

# Choi, Wakeling, Robinovitch, Journal of Biomechanics 48 (2015) 911: 25 falls of older adults on video. Vertical speed
# at impact 2.91 (SD 0.86) m/s of the head, 2.14 (0.63) m/s of the pelvis; 583 (255) ms from the start of the descent to
# the impact of the pelvis. Within two standard deviations here.
HEAD_SPEED = (1.19, 4.63)
"""[m/s]"""
PELVIS_SPEED = (0.88, 3.40)
"""[m/s]"""
DESCENT = (0.07, 1.09)
"""[s]"""
_FASTEST = 9.0
"""Of a hand or a foot relative to the trunk [m/s]: that of hard kicks and punches."""
_STILL = 0.05
"""Mean speed of the joints in the last 0.5 s [m/s]."""
_OFF_THE_FLOOR, _UNDER_IT = 0.03, 0.02
"""Height of what should rest on the floor, and depth under it [m]."""
_SIDES = {"left": 1.0, "right": -1.0}
_RESTING = (
    ("head",),
    ("pelvis", "left_hip", "right_hip", "spine1"),
    ("left_wrist",),
    ("right_wrist",),
    ("left_ankle", "left_foot"),
    ("right_ankle", "right_foot"),
)
"""Segments of which one rests on the floor, or on the body, when a person lies."""


def doubts(fall: Fall) -> list[str]:
    """What speaks against a fall; empty for one that is believable."""
    s = MotionSignals(fall.motion)
    found = list(check(s, fall.scenario.action).reasons)
    sits = fall.scenario.action == "sit_down_heavily"
    head, pelvis = -rate_of(s.head_height), -rate_of(s.pelvis_height)
    if not sits:
        _within(found, "head's descent [m/s]", float(head.max()), HEAD_SPEED)
        low = (0.3, PELVIS_SPEED[1]) if fall.scenario.seat else PELVIS_SPEED
        _within(found, "pelvis' descent [m/s]", float(pelvis.max()), low)
        _within(found, "descent [s]", descent(s), DESCENT)
        for names in _RESTING:
            height = min(fall.heights[name] for name in names)
            if height > _OFF_THE_FLOOR:
                found.append(f"{names[0]} is {height:.2f} m over the floor at the end")
        way = landing(s, fall.begins)
        if fall.scenario.kind in _SIDES and way[1] * _SIDES[fall.scenario.kind] < 0.0:
            found.append("lands on the other side")
        if fall.scenario.kind == "slip" and way[0] > 0.5 * np.linalg.norm(way):
            found.append("lands ahead of the slipping foot")
    else:
        _within(found, "inclination of the trunk at the end [degrees]", float(s.inclination[-1]), (0.0, 32.0))
        _within(found, "height of the feet at the end [m]", float(s.feet[-1].max()), (-0.02, 0.05))
    if min(fall.heights.values()) < -_UNDER_IT:
        found.append("under the floor at the end")
    if fall.deepest_at_rest > 0.02 or fall.deepest > 0.06:
        found.append(f"segments are {fall.deepest:.2f} m in one another")
    for name, values in (("hand", s.wrist_speed), ("foot", s.ankle_speed)):
        if values.max() > _FASTEST:
            found.append(f"{name} at {values.max():.1f} m/s")
    late = np.linalg.norm(rate_of(s.joints[-11:]), axis=-1)
    if late.mean() > _STILL or late.max() > 0.2:
        found.append(f"moves at {late.mean():.2f} m/s at the end")
    if not 3.0 <= fall.motion.duration <= 6.0:
        found.append(f"{fall.motion.duration:.1f} s long")
    return found


def catches_itself(motion: Motion) -> bool:
    """Whether a walk with a stumble is one: feet on the floor, no faster than people, planted ones still."""
    s = MotionSignals(motion)
    turns = np.linalg.norm(np.diff(s.joints, 2, axis=0), axis=-1) * RATE**2
    slides = s.foot_speed * np.asarray(motion.contacts)
    return bool(
        check(s, "stumble").true
        and motion.duration >= 2.4
        and s.feet.min() > -_UNDER_IT
        and s.ankle_speed.max() < 5.5
        and turns.max() < 150.0
        and np.mean(slides) < 0.12
    )


def landing(s: MotionSignals, begins: int) -> FloatArray:
    """(2,) level way from pelvis to neck when the head is down, ahead and to the left of where the person faced."""
    down = begins + int(np.argmax(s.head_height[begins:] < s.head_height[-1] + 0.25))
    x, y, _ = s.joint("neck")[down] - s.joint("pelvis")[down]
    c, n = np.cos(s.heading[begins]), np.sin(s.heading[begins])
    return np.array([c * x + n * y, c * y - n * x])


def descent(s: MotionSignals) -> float:
    """Time from the start of the descent to the impact of the pelvis, as its speed shows them [s]."""
    speed = -rate_of(s.pelvis_height)
    fastest = int(np.argmax(speed))
    before, after = speed[:fastest] < 0.3, speed[fastest:] < 0.3
    start = int(np.flatnonzero(before)[-1]) if before.any() else 0
    end = fastest + int(np.argmax(after)) if after.any() else len(speed)
    return (end - start) / 20.0


def _within(found: list[str], quantity: str, value: float, bounds: tuple[float, float]) -> None:
    if not bounds[0] <= value <= bounds[1]:
        found.append(f"{quantity}: {value:.2f}")
