"""Stumbles that are caught: a real walk whose swinging foot is held up, and what follows from it.

Catching oneself takes skill, which a body with springs for muscles has not. So the walk is real and goes on, and four
things are changed: the foot stays where it is caught and comes down later and further ahead, the trunk pitches forward
over it and comes back, the arms go up, the pelvis dips and is carried further by the longer step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.spatial.transform import Rotation, Slerp

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion.curves import bump, ease
from rfgen_sionna.generative.motion.rotations import X, Z, about, normalised, to_matrices, to_quaternions, transpose
from rfgen_sionna.generative.motion.skeleton import (
    JOINT,
    MEAN_ADULT,
    NUM_BODY_JOINTS,
    PARENTS,
    SIDES,
    forward_kinematics,
    from_rest,
    global_rotations,
    side_sign,
    two_bone,
)
from rfgen_sionna.records import Motion
from training.motion.falls.simulation import placed
from training.motion.falls.starts import Start

_PARENTS = PARENTS[:NUM_BODY_JOINTS]
_AFTER = 44
"""Most frames after the trip that are kept."""
_PITCHED = {"pelvis": 0.3, "spine1": 0.5, "spine2": 0.75, "head": 0.55}
"""Share of the trunk's pitch that a joint takes; the chest and the rest all of it."""


@dataclass(frozen=True)
class Stumble:
    """Numbers of one stumble."""

    held: float
    """Time for which the foot is caught [s]."""
    late: float
    """By how much later it comes down [s]."""
    further: float
    """By how much further ahead [m]."""
    pitch: float
    """Of the trunk [degrees]."""
    dip: float
    """Of the pelvis [m]."""
    arms: tuple[float, float, float]
    """Sideways and forward elevation of the upper arms, and flexion of the elbows [degrees]."""

    @classmethod
    def drawn(cls, random: np.random.Generator) -> Stumble:
        """Numbers as they come."""
        arms = random.uniform(15.0, 45.0), random.uniform(10.0, 45.0), random.uniform(10.0, 45.0)
        return cls(
            held=random.uniform(0.1, 0.2),
            late=random.uniform(0.08, 0.16),
            further=random.uniform(0.08, 0.22),
            pitch=random.uniform(24.0, 38.0),
            dip=random.uniform(0.02, 0.05),
            arms=arms,
        )


def stumbled(start: Start, numbers: Stumble) -> Motion | None:
    """The walk of a start in mid-swing with a stumble; None if the clip ends too early for it."""
    clip, f, rate = start.motion, start.frame, start.motion.frame_rate
    world = global_rotations(to_matrices(clip.rotations), _PARENTS)
    places = forward_kinematics(world, clip.translation, np.asarray(clip.offsets), _PARENTS)
    ahead = normalised((clip.translation[f + 2] - clip.translation[f - 2]) * [1.0, 1.0, 0.0])
    swing, other = start.swing, SIDES[1 - SIDES.index(start.swing)]
    apart = (places[f:, JOINT[f"{swing}_ankle"]] - places[f:, JOINT[f"{other}_ankle"]]) @ ahead
    down = float(np.argmax(apart[:14])) / rate
    last = min(len(places), f + _AFTER)
    if down < 0.15 or (last - f) / rate < down + 1.0:
        return None
    rows = np.arange(max(f - start.lead, 0), last)
    t = (rows - f) / rate
    land = down + numbers.late
    own = np.arange(len(places)) / rate
    # the caught foot stays, then runs after its own time, which it has again before it leaves the floor
    clock = PchipInterpolator(
        [-1e3, 0.0, numbers.held, land, land + 0.35, 1e3], [-1e3, 0.0, 0.02, down, land + 0.35, 1e3]
    )(t)
    at = np.clip(clock + f / rate, 0.0, own[-1])
    ankles = {side: places[rows, JOINT[f"{side}_ankle"]] for side in SIDES}
    feet = {side: world[rows][:, [JOINT[f"{side}_ankle"], JOINT[f"{side}_foot"]]] for side in SIDES}
    ankles[swing] = CubicSpline(own, places[:, JOINT[f"{swing}_ankle"]])(at)
    for k, name in enumerate((f"{swing}_ankle", f"{swing}_foot")):
        feet[swing][:, k] = Slerp(own, Rotation.from_matrix(world[:, JOINT[name]]))(at).as_matrix()
    ankles[swing] = ankles[swing] + _step(numbers.further, t, numbers.held, land)[:, None] * ahead
    ankles[other] = ankles[other] + _step(numbers.further, t, land, land + 0.42)[:, None] * ahead
    root = clip.translation[rows] + _step(numbers.further, t, 0.1, land + 0.3)[:, None] * ahead
    root = root - (numbers.dip * bump((t - land + 0.25) / 0.6))[:, None] * Z
    turned = _pitched(world[rows], numbers, t, land, ahead)
    local = np.array(
        [turned[:, j] if p < 0 else transpose(turned[:, p]) @ turned[:, j] for j, p in enumerate(_PARENTS)]
    )
    moved = forward_kinematics(turned, root, np.asarray(clip.offsets), _PARENTS)
    for side in SIDES:
        hip, knee, ankle, foot = (JOINT[f"{side}_{name}"] for name in ("hip", "knee", "ankle", "foot"))
        bend = world[rows, hip] @ X + world[rows, knee] @ X
        _, thigh, shank = two_bone(
            moved[:, hip], ankles[side], bend, MEAN_ADULT.length(f"{side}_knee"), MEAN_ADULT.length(f"{side}_ankle")
        )
        turned[:, hip] = from_rest(thigh, normalised(MEAN_ADULT.offsets[knee]), X)
        turned[:, knee] = from_rest(shank, normalised(MEAN_ADULT.offsets[ankle]), X)
        turned[:, ankle], turned[:, foot] = feet[side][:, 0], feet[side][:, 1]
        for j in (hip, knee, ankle, foot):
            local[j] = transpose(turned[:, _PARENTS[j]]) @ turned[:, j]
    return placed(to_quaternions(np.swapaxes(local, 0, 1)), root, "stumble")


def _step(size: float, t: FloatArray, start: float, end: float) -> FloatArray:
    return np.asarray(size * ease((t - start) / (end - start)))


def _pitched(world: FloatArray, numbers: Stumble, t: FloatArray, land: float, ahead: FloatArray) -> FloatArray:
    """(frame, joint, 3, 3) rotations with the trunk pitched forward and the arms raised."""
    across = np.cross(Z, ahead)
    peak = land + 0.08
    pitch = np.radians(numbers.pitch) * ease((t - 0.02) / peak) * (1.0 - ease((t - peak) / 0.85))
    raised = ease((t - 0.1) / peak) * (1.0 - ease((t - peak - 0.1) / 0.9))
    aside, forward, flexion = np.radians(numbers.arms)
    turned = world.copy()
    legs = {JOINT[f"{side}_{name}"] for side in SIDES for name in ("hip", "knee", "ankle", "foot")}
    for name, j in list(JOINT.items())[:NUM_BODY_JOINTS]:
        if j not in legs:
            turned[:, j] = about(across, _PITCHED.get(name, 1.0) * pitch) @ world[:, j]
    for side in SIDES:
        sign, arm = side_sign(side), JOINT[f"{side}_shoulder"]
        lift = about(ahead, sign * aside * raised) @ about(across, -forward * raised)
        turned[:, arm] = lift @ turned[:, arm]
        bent = about(Z, -sign * flexion * raised)
        for name in ("elbow", "wrist"):
            j, parent = JOINT[f"{side}_{name}"], _PARENTS[JOINT[f"{side}_{name}"]]
            own = transpose(world[:, parent]) @ world[:, j]
            turned[:, j] = turned[:, parent] @ own @ (bent if name == "elbow" else np.eye(3))
    return turned
