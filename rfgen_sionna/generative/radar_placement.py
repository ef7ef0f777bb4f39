"""Positions and walks of a person in front of a radar."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.decisions import Decision, drawn
from rfgen_sionna.generative.prompts.scene_prompt import ScenePrompt
from rfgen_sionna.generative.repertoire import WAYS
from rfgen_sionna.records import Motion
from rfgen_sionna.scene.scene_errors import PlacementError

if TYPE_CHECKING:
    from rfgen_sionna.radar import Radar

_LOG = logging.getLogger(__name__)
NEAREST = 0.5
"""Least distance of a walker's pelvis from the radar [m]: the reach of swinging arms."""
WALKING, SHORTEST_WALK_BACK = 0.3, 0.2
"""Lower bounds of the speed [m/s] and the duration [s] of a walk back: above swaying, below half a step."""


def place_before_radar(
    radar: Radar | None, distance: float, bearing_deg: float = 0.0
) -> tuple[tuple[float, float], float]:
    """Position (x, y) [m] at a distance from the radar over the floor, and the yaw [rad] that faces the radar.

    Args:
        radar: the radar; None is one at the origin with its boresight along +x.
        distance: horizontal distance [m].
        bearing_deg: azimuth from the boresight, positive to the radar's left [degrees].

    Raises:
        ValueError: the boresight is vertical.
    """
    ahead, at = np.array([1.0, 0.0]), np.zeros(2)
    if radar is not None:
        boresight = np.asarray(radar.rotation)[:, 0]
        level = float(np.hypot(boresight[0], boresight[1]))
        if level < 1e-6:
            raise ValueError("radar: its boresight is vertical, so no direction is in front of it; give `position`")
        ahead, at = boresight[:2] / level, np.asarray(radar.position)[:2]
    c, s = np.cos(np.radians(bearing_deg)), np.sin(np.radians(bearing_deg))
    ahead = np.array([c * ahead[0] - s * ahead[1], s * ahead[0] + c * ahead[1]])
    x, y = at + distance * ahead
    return (float(x), float(y)), float(np.arctan2(-ahead[1], -ahead[0]))


def way_decisions(
    said: ScenePrompt, motion: Motion, place: tuple[float, float] | None, yaw: float, radar: Radar | None
) -> list[Decision]:
    """The way over the floor of who walks or runs, checked to stay clear of the radar where the prompt places it.

    Args:
        said: the interpreted prompt.
        motion: its motion.
        place: world position (x, y) of the motion's origin [m]; None for a place by arguments, which is not checked.
        yaw: rotation of the motion [rad].
        radar: the radar; None is one at the origin.

    Raises:
        ValueError: the way comes too near.
    """
    if said.action not in WAYS:
        return []
    straight = said.action == "walk_straight" or said.manner.path == "straight"
    if straight:
        return [] if place is None else [check_walk_path(motion, place, yaw, radar)]
    found, name = [], "extent" if said.manner.path else "path"
    if said.action in ("walk", "walk_to_and_fro") and said.manner.path in (None, "to_and_fro"):
        decision, seen = walk_back(motion)
        found.append(replace(decision, name=name))
        if not seen:
            _LOG.warning("duration: %g s are too short for the way back of the walk; take longer", motion.duration)
    else:
        wide = np.ptp(np.asarray(motion.translation)[:, :2], axis=0)
        found.append(Decision(name, f"{wide[0]:.1f} m by {wide[1]:.1f} m", drawn(motion.seed or 0)))
    if place is not None:
        away = _away(motion, place, yaw, radar)
        if away.min() < NEAREST:
            at = np.zeros(2) if radar is None else np.asarray(radar.position)[:2]
            further = np.linalg.norm(np.asarray(place) - at) + NEAREST - away.min()
            raise PlacementError(
                f"path: leads to {away.min():.2f} m from the radar; at least {NEAREST:g} m must stay free: take a "
                f"distance of at least {np.ceil(10 * further) / 10:g} m, a shorter duration, or a slower pace"
            )
    return found


def _away(motion: Motion, place: tuple[float, float], yaw: float, radar: Radar | None) -> FloatArray:
    """(frame,) distance of the pelvis from the radar over the floor [m]."""
    at = np.zeros(2) if radar is None else np.asarray(radar.position)[:2]
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    track = np.asarray(motion.translation)[:, :2] @ turn.T + np.asarray(place) - at
    return np.linalg.norm(track, axis=1)


def distance_for_way(motion: Motion, turn: float, usual: float) -> float:
    """The usual distance from the radar [m], or a larger one at which the way stays `NEAREST` away from it.

    Args:
        motion: a motion that faces the radar along +x.
        turn: rotation of the motion from facing the radar [rad].
        usual: the usual distance [m].
    """
    c, s = np.cos(turn), np.sin(turn)
    x, y = np.asarray(motion.translation)[:, :2].T
    towards, across = c * x - s * y, s * x + c * y
    needed = towards + np.sqrt(np.maximum(NEAREST**2 - across**2, 0.0))
    near = np.abs(across) < NEAREST
    return max(usual, float(np.ceil(10.0 * needed[near].max()) / 10.0) if near.any() else usual)


def check_walk_path(motion: Motion, place: tuple[float, float], yaw: float, radar: Radar | None) -> Decision:
    """Check that a straight walk stays clear of the radar, and describe its path.

    Args:
        motion: walk along +x, its middle at the origin.
        place: world position (x, y) of the origin [m].
        yaw: rotation of the walk [rad].
        radar: the radar; None is one at the origin.

    Raises:
        PlacementError: the walk comes too near; the message has a duration and a distance that fit.
    """
    at = np.zeros(2) if radar is None else np.asarray(radar.position)[:2]
    away = _away(motion, place, yaw, radar)
    length = float(np.linalg.norm((motion.translation[-1] - motion.translation[0])[:2]))
    pace = length / motion.duration
    middle = float(np.linalg.norm(np.asarray(place) - at))
    if away.min() < NEAREST:
        fits = 2.0 * (middle - NEAREST) / pace
        raise PlacementError(
            f"walk: {motion.duration:g} s at {pace:.2f} m/s are {length:.1f} m, half of it before and half beyond the "
            f"distance of {middle:g} m, and lead to {away.min():.2f} m from the radar; at least {NEAREST:g} m must "
            f"stay free: {f'at most {np.floor(10 * fits) / 10:g} s fit there, or ' if fits >= 0.1 else ''}"
            f"take a distance of at least {np.ceil(10 * (0.5 * length + NEAREST)) / 10:g} m, or a slower walk"
        )
    return Decision(
        "path",
        f"{length:.1f} m at {pace:.2f} m/s, from {away[0]:.1f} m to {away[-1]:.1f} m from the radar",
        "the distance is that of its middle, the pace is drawn",
    )


def walk_back(motion: Motion) -> tuple[Decision, bool]:
    """Path of a walk back and forth, and whether the walk back begins within the motion's duration."""
    x: FloatArray = np.asarray(motion.translation)[:, 0]
    back = np.count_nonzero(np.gradient(x) * motion.frame_rate < -WALKING) / motion.frame_rate >= SHORTEST_WALK_BACK
    value = f"{np.ptp(x):.1f} m forth and back" if back else f"{np.ptp(x):.1f} m forth, not back"
    short = f"{motion.duration:g} s are too short for the way back"
    return Decision("path", value, drawn(motion.seed or 0) if back else short), bool(back)
