"""Ground truth of actors: the values of :data:`rfgen_sionna.dataset.STANDARD_LABELS`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene.checks.radar_distance import surface_of
from rfgen_sionna.scene.mesh_actor import MeshActor

LABEL_STEP = 1e-3
"""Half the interval of the differences of label velocities [s]."""


def actor_labels(actors: Sequence[MeshActor], radar: Radar, t: float) -> dict[str, Any]:
    """Labels at `t` [s], one row per actor; empty without actors.

    Places are those of the centre of an actor's vertices; distances and directions are seen from the radar at `t`.
    """
    here = radar.at(t)
    before, after = (np.asarray(radar.pose(t + step)[0]) for step in (-LABEL_STEP, LABEL_STEP))
    rows = [_one(actor, here, (after - before) / (2 * LABEL_STEP), t) for actor in actors]
    return {name: [row[name] for row in rows] for name in rows[0]} if rows else {}


def _one(actor: MeshActor, radar: Radar, radar_velocity: FloatArray, t: float) -> dict[str, Any]:
    surface = surface_of(actor)
    now = surface.vertices(t)
    # Motions hold still before their beginning and after their end.
    begins, ends = (0.0, actor.duration) if 0.0 <= t < actor.duration else (-math.inf, math.inf)
    first, last = max(t - LABEL_STEP, begins), min(t + LABEL_STEP, ends)
    before, after = (surface.vertices(each).mean(axis=0) for each in (first, last))
    centre, velocity = now.mean(axis=0), (after - before) / (last - first)
    offset = centre - np.asarray(radar.position)
    distance = float(np.linalg.norm(offset))
    device = offset @ radar.rotation / distance
    signs = getattr(actor.sequence, "vital_signs", None)
    return {
        "action": actor.action,
        "position": centre,
        "velocity": velocity,
        "bounding_box": np.stack([now.min(axis=0), now.max(axis=0)]),
        "orientation": _facing(actor, t),
        "distance": distance,
        "radial_velocity": float((velocity - radar_velocity) @ offset / distance),
        "in_range": float((np.linalg.norm(now - np.asarray(radar.position), axis=1) <= radar.max_range).mean()),
        "azimuth": float(np.arctan2(device[1], device[0])),
        "elevation": float(np.arcsin(np.clip(device[2], -1.0, 1.0))),
        "breathing_rate": np.nan if signs is None else signs.breathing_rate,
        "heart_rate": np.nan if signs is None else signs.heart_rate,
        "chest_displacement": np.nan if signs is None else signs.chest_displacement(t),
    }


def _facing(actor: MeshActor, t: float) -> float:
    """Yaw [rad] of the direction an actor faces: normal to its hips, or its own +x without hips."""
    names = actor.joint_names
    if "left_hip" in names and "right_hip" in names:
        joints = actor.joints(t)
        left = joints[names.index("left_hip")] - joints[names.index("right_hip")]
        return float(np.arctan2(-left[0], left[1]))
    forward = actor.pose(t)[1][:, 0]
    return float(np.arctan2(forward[1], forward[0]))
