"""Kinematic synthesiser: motion from rules of human movement, different for every seed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.manner import Manner
from rfgen_sionna.generative.motion.actions import ACTIONS
from rfgen_sionna.generative.motion.keyed_gesture import hold_arms
from rfgen_sionna.generative.motion.rotations import to_matrices, to_quaternions, transpose
from rfgen_sionna.generative.motion.skeleton import (
    FINGERS,
    HANDS,
    JOINT,
    JOINT_NAMES,
    MEAN_ADULT,
    PARENTS,
    SIDES,
    Skeleton,
    forward_kinematics,
    global_rotations,
)
from rfgen_sionna.generative.motion.tracks import MotionTracks
from rfgen_sionna.records import Motion

SPEED_RANGE = (0.5, 2.0)
"""Factors on the usual speed within which the rules give natural motion."""
MAX_DURATION = 600.0
"""Longest motion [s]; bounds memory."""
_DENSE_RATE = 240.0
"""Least sample rate of the synthesis [Hz]; bounds the dependence of a motion on its frame rate."""
_MIRROR = np.diag([1.0, -1.0, 1.0])
_ARM = ("collar", "shoulder", "elbow", "wrist")
_HAND = tuple(f"{finger}{k}" for finger in FINGERS for k in (1, 2, 3))
_TRUNK = ("spine1", "spine2", "spine3", "neck", "head")
_BESIDE = 0.08
"""Least distance of each hand's joints from the plane between the hands [m]: half a palm's width and a gap."""
_WIDEST = 1.0
"""Largest opening angle of an arm [rad]; bounds the search."""


def _stream(action: str, seed: int) -> np.random.Generator:
    return np.random.default_rng([seed, list(ACTIONS).index(action)])


def _hand(rng: np.random.Generator) -> str:
    # 90 % of people are right-handed
    return "right" if rng.uniform() < 0.9 else "left"


def preferred_hand(action: str, seed: int) -> str:
    """Hand, "left" or "right", that :class:`KinematicSource` takes for `hand=None`."""
    return _hand(_stream(action, seed))


def check_hand(hand: str | None, action: str) -> None:
    """Check the hand of a gesture.

    Raises:
        ValueError: the action does not allow that hand.
    """
    if hand is None:
        return
    if hand not in HANDS:
        raise ValueError(f"hand: {hand!r}; allowed are {', '.join(HANDS)} and None")
    allowed = ACTIONS[action].hands if action in ACTIONS else ()
    if not allowed:
        raise ValueError(f"hand: the action {action!r} is not done with one hand; leave it out")
    if hand not in allowed:
        raise ValueError(f"hand: {hand!r} with the action {action!r}; allowed are {', '.join(allowed)}")


def _free_arms(action: str, hand: str, posture: str) -> tuple[str, ...]:
    """Sides of the arms that an action leaves free.

    Raises:
        ValueError: there are none.
    """
    free = 0 if hand == "both" else ACTIONS[action].free_arms
    if not free:
        raise ValueError(f"arm_posture: {posture!r} with the action {action!r}, which needs the arms; leave it out")
    return SIDES if free == len(SIDES) else tuple(side for side in SIDES if side != hand)


@dataclass(frozen=True)
class KinematicSource:
    """A :class:`~rfgen_sionna.generative.motion.MotionSource` without training data.

    Feet are planned on the floor and legs follow by inverse kinematics, flight is ballistic, hands move on minimum-jerk
    paths; the centre of mass stays over the feet while standing.
    """

    frame_rate: float = 120.0
    """Poses per second [Hz]."""

    def __call__(
        self,
        action: str,
        duration: float,
        seed: int,
        *,
        skeleton: Skeleton | None = None,
        hand: str | None = None,
        speed: float = 1.0,
        manner: Manner | None = None,
    ) -> Motion:
        """Synthesise an action; see :class:`~rfgen_sionna.generative.motion.MotionSource`.

        `manner` is how the action is done; `hand` and `speed` go before those of it.

        Raises:
            ValueError: unknown action; duration not in (0, 600] s; speed not in [0.5, 2]; a hand that the action does
                not allow; a posture of arms that the action needs.
        """
        if action not in ACTIONS:
            raise ValueError(f"action: {action!r} is unknown; allowed are {', '.join(ACTIONS)}")
        if not (np.isfinite(duration) and 0.0 < duration <= MAX_DURATION):
            raise ValueError(f"duration: {duration!r} s; allowed is more than 0 and at most {MAX_DURATION:g} s")
        manner = manner or Manner()
        hand = hand or manner.hand
        speed = manner.speed if speed == 1.0 and manner.speed is not None else speed
        if not SPEED_RANGE[0] <= speed <= SPEED_RANGE[1]:
            raise ValueError(f"speed: {speed!r}; allowed is a factor from {SPEED_RANGE[0]} to {SPEED_RANGE[1]}")
        check_hand(hand, action)
        skeleton = skeleton or MEAN_ADULT
        rng = _stream(action, seed)
        drawn = _hand(rng)  # drawn always, so that naming the preferred hand changes nothing
        hand = drawn if hand is None else hand
        dense = int(np.ceil(_DENSE_RATE / self.frame_rate))
        t = np.arange(int(np.ceil(duration * self.frame_rate - 1e-9)) * dense + 1) / (self.frame_rate * dense)
        tracks = MotionTracks(skeleton, t, rng.uniform(0.75, 1.5), rng.uniform(0.04, 0.25))
        if manner.tired:
            tracks.bend += rng.uniform(0.08, 0.18)
            tracks.nod += rng.uniform(0.05, 0.2)
        ACTIONS[action].write(tracks, rng, drawn if hand == "both" else hand, replace(manner, speed=speed))
        if manner.arm_posture:
            hold_arms(tracks, rng, manner.arm_posture, _free_arms(action, hand, manner.arm_posture))
        world, joints = (a[::dense] for a in tracks.solve())
        local = world.copy()
        for j, p in enumerate(PARENTS):
            if p >= 0:
                local[:, j] = transpose(world[:, p]) @ world[:, j]
        motion = Motion(
            rotations=to_quaternions(local),
            translation=joints[:, 0],
            frame_rate=self.frame_rate,
            joint_names=JOINT_NAMES,
            parents=PARENTS,
            offsets=skeleton.offsets,
            contacts=tracks.contacts[::dense],
            action=action,
            seed=seed,
        )
        return both_hands(motion, drawn) if hand == "both" else motion


def both_hands(motion: Motion, hand: str, *, still: bool = True) -> Motion:
    """The motion with both arms in step: the other arm mirrors that of `hand`.

    Both arms open at the shoulders by the smallest angle that keeps the hands apart.

    Args:
        motion: one-handed gesture, 52 joints.
        hand: its hand, "left" or "right".
        still: whether the person stands; then the trunk is made symmetric.
    """
    local = to_matrices(motion.rotations)
    if still:
        for name in _TRUNK:
            j = JOINT[name]
            local[:, j] = local[:, j] @ _half(transpose(local[:, j]) @ _MIRROR @ local[:, j] @ _MIRROR)
    shoulder, collar = JOINT[f"{hand}_shoulder"], JOINT[f"{hand}_collar"]
    opening = _opening(motion, local, hand)
    up = transpose(local[:, collar])[:, :, 2]
    local[:, shoulder] = Rotation.from_rotvec(opening * up).as_matrix() @ local[:, shoulder]
    other = "left" if hand == "right" else "right"
    for part in (*_ARM, *_HAND):
        local[:, JOINT[f"{other}_{part}"]] = _MIRROR @ local[:, JOINT[f"{hand}_{part}"]] @ _MIRROR
    return replace(motion, rotations=to_quaternions(local))


def _half(turns: FloatArray) -> FloatArray:
    """(frame, 3, 3) half of each rotation."""
    return Rotation.from_rotvec(0.5 * Rotation.from_matrix(turns).as_rotvec()).as_matrix()


def _opening(motion: Motion, local: FloatArray, hand: str) -> float:
    """Opening angle of the arm of `hand` about the trunk's axis, positive to the left [rad]."""
    world = global_rotations(local, motion.parents)
    places = forward_kinematics(world, motion.translation, motion.offsets, motion.parents)
    joints = [JOINT[f"{hand}_{part}"] for part in ("wrist", *_HAND)]
    chest, shoulder = JOINT["spine3"], places[:, JOINT[f"{hand}_shoulder"]]
    side = 1.0 if hand == "left" else -1.0
    reach = (places[:, joints] - shoulder[:, None]) @ world[:, chest]
    out = ((shoulder - places[:, chest])[:, None] @ world[:, chest])[:, :, 1] * side
    ahead, beside = reach[..., 0], reach[..., 1] * side
    for angle in np.arange(0.0, _WIDEST, 0.02):
        if (out + ahead * np.sin(angle) + beside * np.cos(angle)).min() >= _BESIDE:
            return side * float(angle)
    return side * _WIDEST
