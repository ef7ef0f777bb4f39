"""Walking, running and their kinds."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import minimum_filter1d

from rfgen_sionna.generative.action_definitions.definition import Definition, Requirements, at_least, at_most, defines
from rfgen_sionna.generative.action_definitions.motion_signals import STANDING, MotionSignals
from rfgen_sionna.generative.action_definitions.sampled_series import RATE, rate_of, share, smooth, stretches, swings
from rfgen_sionna.generative.motion.skeleton import MEAN_ADULT


def _moving(s: MotionSignals) -> np.ndarray:
    return s.speed > 0.25


def _part(s: MotionSignals, direction: int, sign: float) -> float:
    """Share of the moving time that goes along an axis of the person, more than across it."""
    moving = _moving(s)
    along, across = sign * s.velocity[moving, direction], np.abs(s.velocity[moving, 1 - direction])
    return share(along > across)


def _in_turn(s: MotionSignals) -> float:
    """Share of steps that follow one of the other foot."""
    feet = [foot for _, _, foot in s.steps]
    return float(np.mean(np.diff(feet) != 0)) if len(feet) > 1 else 0.0


def _stepping(s: MotionSignals) -> Requirements:
    return [
        at_least("steps", len(s.steps), 2),
        at_least("share of steps in turn", _in_turn(s), 0.5),
        at_least("median height of the pelvis, share of standing", np.median(s.legs), 0.82),
        at_most("median inclination of the trunk [degrees]", np.median(s.inclination), 35.0),
        at_most("flights", len(s.flights), 0),
        at_most("90th percentile of the speed [m/s]", np.percentile(s.speed, 90), 2.4),
    ]


@defines("walk", "Steps in turn, most of the time on the way ahead, upright, never off the floor.")
def walk(s: MotionSignals) -> Requirements:
    return [
        *_stepping(s),
        at_least("share of time on the way", share(_moving(s)), 0.5),
        at_least("way over the floor [m]", s.path, 0.6),
        at_least("share of the way ahead", _part(s, 0, 1.0), 0.7),
    ]


@defines("walk_straight", "A walk whose ends are as far apart as 0.92 of its way.")
def walk_straight(s: MotionSignals) -> Requirements:
    level = float(np.linalg.norm(s.displacement[:2]))
    return [*walk(s), at_least("distance of the ends over the length of the way", level / max(s.path, 1e-9), 0.92)]


def _course(s: MotionSignals) -> np.ndarray:
    """(sample,) direction of the way where the person moves, continuous [rad]."""
    step = smooth(rate_of(s.joint("pelvis")[:, :2]), 0.6)
    moving = np.linalg.norm(step, axis=1) > 0.25
    return np.unwrap(np.arctan2(step[moving, 1], step[moving, 0]))


@defines("walk_to_and_fro", "A walk that turns round and comes back along a line.")
def walk_to_and_fro(s: MotionSignals) -> Requirements:
    course = _course(s)
    turned = np.degrees(np.ptp(course)) if len(course) else 0.0
    place = smooth(s.joint("pelvis")[:, :2], 0.6)
    spread = place - place.mean(axis=0)
    axis = np.linalg.svd(spread, full_matrices=False)[2][0]
    return [
        *walk(s),
        at_least("turns of the way [degrees]", turned, 140.0),
        at_least("ways along the line", swings(spread @ axis, 0.4), 2),
    ]


@defines("walk_in_a_circle", "A walk around by 270 degrees or more in one sense.")
def walk_in_a_circle(s: MotionSignals) -> Requirements:
    course = _course(s)
    around = abs(np.degrees(course[-1] - course[0])) if len(course) else 0.0
    return [
        *walk(s),
        at_least("angle walked around [degrees]", around, 270.0),
        at_most("angle turned back [degrees]", np.degrees(np.ptp(course)) - around if len(course) else 0.0, 60.0),
    ]


@defines("walk_turn", "A walk that turns by 35 degrees or more.")
def walk_turn(s: MotionSignals) -> Requirements:
    return [*walk(s)[:-1], at_least("angle turned [degrees]", np.degrees(np.ptp(smooth(s.heading, 0.5))), 35.0)]


@defines("walk_backwards", "Steps in turn, most of the way against where the pelvis faces.")
def walk_backwards(s: MotionSignals) -> Requirements:
    return [
        *_stepping(s),
        at_least("way over the floor [m]", s.path, 0.5),
        at_least("share of the way backwards", _part(s, 0, -1.0), 0.5),
    ]


@defines("sidestep", "Steps, most of the way to a side of where the pelvis faces.")
def sidestep(s: MotionSignals) -> Requirements:
    moving = _moving(s)
    side = share(np.abs(s.velocity[moving, 1]) > np.abs(s.velocity[moving, 0]))
    return [
        at_least("steps", len(s.steps), 2),
        at_least("way to one side [m]", abs(float(np.mean(s.velocity[:, 1]))) * s.duration, 0.5),
        at_least("share of the way sideways", side, 0.6),
        at_least("median height of the pelvis, share of standing", np.median(s.legs), 0.8),
        at_most("longest flight [s]", s.longest_flight, 0.15),
        at_most("highest foot [m]", s.feet.max(), 0.5),
    ]


@defines("turn_around", "The pelvis faces 120 degrees or more away at the end, the person on the feet.")
def turn_around(s: MotionSignals) -> Requirements:
    yaw = smooth(s.heading, 0.3)
    return [
        at_least("angle turned from the first to the last pose [degrees]", abs(np.degrees(yaw[-1] - yaw[0])), 120.0),
        at_least("share of time upright", share(s.legs > 0.75), 0.9),
    ]


def _in_the_air(s: MotionSignals) -> float:
    """Share of the time at over 1.2 m/s with both feet off the floor."""
    return share(s.airborne[s.speed > 1.2])


@defines("run", "Over 1.6 m/s ahead, with times off the floor.")
def run(s: MotionSignals) -> Requirements:
    return [
        at_least("90th percentile of the speed [m/s]", np.percentile(s.speed, 90), 1.6),
        at_least("share of fast time off the floor", _in_the_air(s), 0.05),
        at_least("median height of the pelvis, share of standing", np.median(s.legs), 0.8),
        at_most("longest flight [s]", s.longest_flight, 0.4),
        at_least("share of the way ahead", _part(s, 0, 1.0), 0.7),
        at_most("median inclination of the trunk [degrees]", np.median(s.inclination), 45.0),
    ]


@defines("run_backwards", "Over 1.2 m/s, half of the way or more backwards, with times off the floor.")
def run_backwards(s: MotionSignals) -> Requirements:
    return [
        at_least("90th percentile of the speed [m/s]", np.percentile(s.speed, 90), 1.2),
        at_least("share of fast time off the floor", _in_the_air(s), 0.05),
        at_least("share of the way backwards", _part(s, 0, -1.0), 0.5),
        at_least("way over the floor [m]", s.path, 1.2),
    ]


def _heel_lifts(s: MotionSignals, size: float) -> tuple[int, float]:
    """Number of lifts of an ankle by `size` [m], and the share that follow one of the other ankle."""
    height = s.pair("ankle")[..., 2] - MEAN_ADULT.ankle_height
    found = sorted((a, foot) for foot in range(2) for a, b in stretches(height[:, foot] > size) if b - a >= 2)
    feet = [foot for _, foot in found]
    return len(feet), float(np.mean(np.diff(feet) != 0)) if len(feet) > 1 else 0.0


@defines("jog_on_the_spot", "Heels lifted in turn, four times or more and 1.2 times a second or more, in one place.")
def jog_on_the_spot(s: MotionSignals) -> Requirements:
    count, turns = _heel_lifts(s, 0.1)
    return [
        at_least("lifts of a foot a second", count / max(s.duration, 1e-9), 1.2),
        at_least("lifts of a heel", count, 4),
        at_least("share of lifts in turn", turns, 0.65),
        at_most("mean speed over the floor [m/s]", s.path / max(s.duration, 1e-9), 0.5),
        at_least("median height of the pelvis, share of standing", np.median(s.pelvis_height) / STANDING, 0.85),
        at_most("highest thigh [degrees]", np.percentile(s.thigh_elevation, 97), 85.0),
    ]


@defines("march", "Knees lifted in turn, thighs to 50 degrees or more.")
def march(s: MotionSignals) -> Requirements:
    knees = s.thigh_elevation
    lifted = sorted((a, foot) for foot in range(2) for a, b in stretches(knees[:, foot] > 50.0) if b - a >= 2)
    feet = [foot for _, foot in lifted]
    turns = float(np.mean(np.diff(feet) != 0)) if len(feet) > 1 else 0.0
    return [
        at_least("lifts of a knee a second", len(feet) / max(s.duration, 1e-9), 0.5),
        at_least("lifts of a knee", len(feet), 2),
        at_least("share of lifts in turn", turns, 0.7),
        at_least("lowest pelvis, share of standing", np.percentile(s.legs, 5), 0.85),
    ]


@defines("march_in_place", "A march in one place.")
def march_in_place(s: MotionSignals) -> Requirements:
    return [*march(s), at_most("mean speed over the floor [m/s]", s.path / max(s.duration, 1e-9), 0.35)]


@defines("limp", "A walk whose legs differ by a quarter or more, in swing time or in the bend of the knee.")
def limp(s: MotionSignals) -> Requirements:
    whole = [(a, b, foot) for a, b, foot in s.steps if a > 0 and b < len(s.time)]
    swing = [[(b - a) / RATE for a, b, foot in whole if foot == side] for side in range(2)]
    times = [float(np.mean(each)) if each else 0.0 for each in swing]
    uneven = abs(times[0] - times[1]) / max(float(np.mean(times)), 1e-9)
    bends = np.ptp(s.knee_flexion, axis=0)
    return [
        *walk(s),
        at_least("steps of each foot", min(len(each) for each in swing), 2),
        at_least(
            "difference of the legs: swing times or bends of the knees, share of the mean",
            max(uneven, abs(bends[0] - bends[1]) / max(bends.mean(), 1e-9)),
            0.25,
        ),
    ]


@defines("sneak", "Slow steps, stooped by 14 degrees or more or with bent knees.")
def sneak(s: MotionSignals) -> Requirements:
    stoop, crouch = np.median(s.inclination) / 14.0, 0.88 / np.median(s.legs)
    return [
        at_least("steps", len(s.steps), 1),
        at_least("way over the floor [m]", s.path, 0.3),
        at_most("90th percentile of the speed [m/s]", np.percentile(s.speed, 90), 1.3),
        at_least("stoop over 14 degrees, or 0.88 of standing over the pelvis' height", max(stoop, crouch), 1.0),
        at_most("flights", len(s.flights), 0),
        at_least("share of time on the feet", share(s.legs > 0.5), 0.9),
    ]


@defines("carry", "On the way with both hands held before the body, elbows bent.", "whether the hands hold something")
def carry(s: MotionSignals) -> Requirements:
    hands = s.ahead(s.pair("wrist") - s.joint("pelvis")[:, None])
    return [
        at_least("way over the floor [m]", s.path, 0.8),
        at_least("share of time on the way", share(_moving(s)), 0.5),
        at_least("wrists ahead of the pelvis, median of the nearer [m]", np.median(hands[..., 0].min(axis=1)), 0.05),
        at_least("elbow flexion, median of the straighter arm [degrees]", np.median(s.elbow_flexion.min(axis=1)), 25.0),
        at_most("spread of the distance between the wrists [m]", s.hands_apart.std(), 0.035),
        at_most("median distance between the wrists [m]", np.median(s.hands_apart), 0.75),
        at_least("share of time on the feet", share(s.legs > 0.7), 0.9),
    ]


def _climbed(s: MotionSignals) -> float:
    """Greatest height that the lower foot keeps for 0.6 s, over its lowest before [m]."""
    kept = minimum_filter1d(s.feet.min(axis=1), int(0.6 * RATE) + 1, mode="nearest")
    return float((kept - np.minimum.accumulate(kept)).max())


@defines("climb_stairs", "Steps whose lower foot rises by 0.14 m or more and stays there, hands low.")
def climb_stairs(s: MotionSignals) -> Requirements:
    return [
        at_least("rise of the lower foot for 0.6 s or more [m]", _climbed(s), 0.14),
        at_least("steps", len(s.steps), 2),
        at_least("share of time upright", share(s.legs > 0.75), 0.85),
        at_most(
            "median of the higher wrist over its shoulder [m]", np.median(s.hands_over_shoulders.max(axis=1)), -0.25
        ),
        at_least("way over the floor [m]", s.path, 0.4),
    ]


@defines("climb_ladder", "The lower foot rises by 0.25 m or more and stays there, hands raised.")
def climb_ladder(s: MotionSignals) -> Requirements:
    return [
        at_least("rise of the lower foot for 0.6 s or more [m]", _climbed(s), 0.25),
        at_least(
            "median of the higher wrist over its shoulder [m]", np.median(s.hands_over_shoulders.max(axis=1)), -0.25
        ),
    ]


DEFINITIONS: tuple[Definition, ...] = (
    walk,
    walk_straight,
    walk_to_and_fro,
    walk_in_a_circle,
    walk_turn,
    walk_backwards,
    sidestep,
    turn_around,
    run,
    run_backwards,
    jog_on_the_spot,
    march,
    march_in_place,
    limp,
    sneak,
    carry,
    climb_stairs,
    climb_ladder,
)
"""Actions of this module."""
