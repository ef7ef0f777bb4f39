"""Where a person stands and walks before a radar."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.decisions import Decision, drawn
from rfgen_sionna.records import Motion

if TYPE_CHECKING:
    from rfgen_sionna.radar import Radar

NEAREST = 0.5
"""How near the middle of somebody who walks may come to the radar [m]: arms swing in front of it."""
WALKING, SHORTEST_WALK_BACK = 0.3, 0.2
"""Speed [m/s] above which somebody walks back, and how long [s] it must last to be seen."""


def place_before_radar(
    radar: Radar | None, distance: float, bearing_deg: float = 0.0
) -> tuple[tuple[float, float], float]:
    """Place (x, y) [m] at `distance` [m] from the radar over the floor, and the yaw [rad] that faces it from there.

    Args:
        radar: None is a radar at the origin looking along +x.
        distance: [m].
        bearing_deg: angle to the level part of the boresight, positive to the radar's left [degrees].

    Raises:
        ValueError: the radar looks straight up or down.
    """
    ahead, at = np.array([1.0, 0.0]), np.zeros(2)
    if radar is not None:
        boresight = np.asarray(radar.rotation)[:, 0]
        level = float(np.hypot(boresight[0], boresight[1]))
        if level < 1e-6:
            raise ValueError("radar: it looks straight up or down, so there is no place before it; give `position`")
        ahead, at = boresight[:2] / level, np.asarray(radar.position)[:2]
    c, s = np.cos(np.radians(bearing_deg)), np.sin(np.radians(bearing_deg))
    ahead = np.array([c * ahead[0] - s * ahead[1], s * ahead[0] + c * ahead[1]])
    x, y = at + distance * ahead
    return (float(x), float(y)), float(np.arctan2(-ahead[1], -ahead[0]))


def check_walk_path(motion: Motion, place: tuple[float, float], yaw: float, radar: Radar | None) -> Decision:
    """Whether somebody who walks straight ahead keeps clear of the radar; says the way.

    Args:
        motion: along +x, its middle at the origin.
        place: where that is in the world [m].
        yaw: and how it is turned [rad].
        radar: None is a radar at the origin.

    Raises:
        ValueError: with the time and the distance that fit.
    """
    at = np.zeros(2) if radar is None else np.asarray(radar.position)[:2]
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    track = np.asarray(motion.translation)[:, :2] @ turn.T + np.asarray(place) - at
    away = np.linalg.norm(track, axis=1)
    length = float(np.linalg.norm(track[-1] - track[0]))
    pace = length / motion.duration
    middle = float(np.linalg.norm(np.asarray(place) - at))
    if away.min() < NEAREST:
        fits = 2.0 * (middle - NEAREST) / pace
        raise ValueError(
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
    """The stretch somebody walks back and forth, and whether the way back is seen within the motion's duration."""
    x: FloatArray = np.asarray(motion.translation)[:, 0]
    back = np.count_nonzero(np.gradient(x) * motion.frame_rate < -WALKING) / motion.frame_rate >= SHORTEST_WALK_BACK
    value = f"{np.ptp(x):.1f} m forth and back" if back else f"{np.ptp(x):.1f} m forth, not back"
    short = f"{motion.duration:g} s are too short for the way back"
    return Decision("path", value, drawn(motion.seed or 0) if back else short), bool(back)
