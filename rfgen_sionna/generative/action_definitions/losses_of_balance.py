"""Fainting, slipping, stumbling, sinking heavily onto a seat."""

from __future__ import annotations

import numpy as np

from rfgen_sionna.generative.action_definitions.changes_of_level import LAST, fastest_descent, seated
from rfgen_sionna.generative.action_definitions.definition import (
    Definition,
    Requirements,
    at_least,
    at_most,
    defines,
    easiest,
)
from rfgen_sionna.generative.action_definitions.motion_signals import STANDING, MotionSignals
from rfgen_sionna.generative.action_definitions.sampled_series import RATE, rate_of, share


def _upright_before(s: MotionSignals, when: int) -> Requirements:
    return [at_least("highest pelvis before, share of standing", s.pelvis_height[: when + 1].max() / STANDING, 0.8)]


@defines(
    "faint",
    "From upright the body goes down, head at 1.5 m/s or more, on knees that give way by 45 degrees or more; pelvis "
    "and head under 0.35 m at the end.",
    "whether the person is conscious: a fall on bent knees looks alike",
)
def syncope(s: MotionSignals) -> Requirements:
    when, speed = fastest_descent(s)
    sinking = (s.pelvis_height < 0.85 * STANDING) & (s.pelvis_height > 0.35)
    return [
        *_upright_before(s, when),
        at_least("fastest descent of the head over 0.2 s [m/s]", speed, 1.5),
        at_least("bend of a knee on the way down [degrees]", s.knee_flexion[sinking].max(initial=0.0), 45.0),
        at_most("height of the pelvis at the end [m]", s.pelvis_height[LAST].mean(), 0.35),
        at_most("height of the head at the end [m]", s.head_height[LAST].mean(), 0.35),
    ]


@defines(
    "slip",
    "From upright a foot near the floor slides by 0.35 m or more in 0.5 s while the pelvis drops by 0.2 m or more; the "
    "head drops at 2 m/s or more, and the pelvis is at the floor at the end.",
    "whether the floor is slippery",
)
def slip(s: MotionSignals) -> Requirements:
    step = min(round(0.5 * RATE), len(s.time) - 1)
    place = s.pair("ankle")[..., :2]
    slid = np.linalg.norm(place[step:] - place[:-step], axis=-1)
    low = np.stack([s.feet[k : len(s.feet) - step + k] < 0.15 for k in range(step + 1)]).all(axis=0)
    drop = s.pelvis_height[:-step] - s.pelvis_height[step:]
    sinks = (drop > 0.2) & (s.pelvis_height[:-step] > 0.6 * STANDING)
    moments = np.where(low & sinks[:, None], slid, 0.0).max(axis=1)
    return [
        *_upright_before(s, int(np.argmax(moments))),
        at_least("slide of a low foot in 0.5 s while the pelvis drops [m]", moments.max(), 0.35),
        at_least("fastest descent of the head over 0.2 s [m/s]", fastest_descent(s)[1], 2.0),
        at_most("height of the pelvis at the end [m]", s.pelvis_height[LAST].mean(), 0.35),
    ]


@defines(
    "stumble",
    "On the way ahead the trunk pitches forward by 20 degrees or more within 0.6 s; steps catch the body, or it falls, "
    "head at 2 m/s or more.",
    "whether there is an obstacle",
)
def stumble(s: MotionSignals) -> Requirements:
    step = min(round(0.6 * RATE), len(s.time) - 1)
    trunk = s.ahead(s.joint("neck") - s.joint("pelvis"))
    pitch = np.degrees(np.arctan2(trunk[:, 0], trunk[:, 2]))
    when = int(np.argmax(pitch[step:] - pitch[:-step]))
    way = s.velocity[max(when - 12, 0) : when + step, 0]
    end = s.pelvis_height[LAST].mean()
    caught = [
        at_least("height of the pelvis at the end, share of standing", end / STANDING, 0.8),
        at_most("inclination of the trunk at the end [degrees]", s.inclination[LAST].mean(), 20.0),
        at_least("lowest wrist [m]", s.hand_height.min(), 0.5),
        at_least("slowest way ahead as the trunk pitches [m/s]", way[-step:].min(), 0.4),
        at_most("fastest way over the floor [m/s]", s.speed.max(), 2.4),
        at_most("flights", len(s.flights), 0),
    ]
    fallen = [
        at_most("height of the pelvis at the end [m]", end, 0.35),
        at_least("fastest descent of the head over 0.2 s [m/s]", fastest_descent(s)[1], 2.0),
    ]
    return [
        *_upright_before(s, when),
        at_least("pitch of the trunk ahead in 0.6 s [degrees]", pitch[when + step] - pitch[when], 20.0),
        at_least("fastest way ahead then and before [m/s]", way.max(initial=0.0), 0.5),
        *easiest([caught, fallen]),
    ]


@defines(
    "sit_down_heavily",
    "Upright at first; the pelvis drops at 1 m/s or more and stops within 0.35 s; on a seat at the end.",
    "whether the legs give way or the person lets go",
)
def sit_down_heavily(s: MotionSignals) -> Requirements:
    speed = -rate_of(s.pelvis_height)
    fastest = int(np.argmax(speed))
    return [
        *_upright_before(s, fastest),
        at_least("fastest descent of the pelvis [m/s]", speed[fastest], 1.0),
        at_most("slowest descent in the 0.35 s after it [m/s]", speed[fastest : fastest + 8].min(), 0.3),
        at_least("share of the last 0.3 s on a seat", share(seated(s)[LAST]), 0.8),
    ]


DEFINITIONS: tuple[Definition, ...] = (syncope, slip, stumble, sit_down_heavily)
"""Actions of this module."""
