"""Tracks of an action (pelvis, trunk, feet, arms, fingers over time), and the joints that follow from them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion.curves import ease
from rfgen_sionna.generative.motion.rotations import X, Y, Z, about, basis, between, normalised, transpose
from rfgen_sionna.generative.motion.skeleton import (
    FINGERS,
    JOINT,
    NUM_BODY_JOINTS,
    PARENTS,
    SIDES,
    Skeleton,
    from_rest,
    side_sign,
    soft_limit,
    two_bone,
)

ARM_POLE = np.array([-1.0, 0.35, -0.6])
"""Default direction of the left elbow: back, slightly out and down; never along a hanging, lifted or stretched arm."""
_MOST_BENT = np.radians(147.0)
"""Largest flexion of an elbow [rad]."""
_WRIST_REACH = np.radians([78.0, 68.0, 19.0])
"""Pronation, flexion and deviation beyond which a hand that is aimed somewhere does not turn [rad]."""


@dataclass
class Foot:
    """One foot: place on the floor and roll."""

    place: FloatArray
    """(n, 2) floor position under the ankle of the flat foot [m]."""
    yaw: FloatArray
    """(n,) heading [rad]."""
    pitch: FloatArray
    """(n,) toes up positive, heel up negative [rad]."""
    lift: FloatArray
    """(n,) height of the pivot over the floor [m]."""
    heel: FloatArray
    """(n,) pivot of the roll: 0 the toe joint, 1 the heel."""
    loose: FloatArray
    """(n,) 0 for level toes, 1 for toes that turn with the foot."""
    posed: tuple[FloatArray, FloatArray] | None = None
    """(n, 3) ankle [m] and (n, 3, 3) rotation of a foot that is not on its sole; replaces all others."""


@dataclass
class Arm:
    """One arm, in the frame of the chest, sides mirrored (y is outwards)."""

    direction: FloatArray
    """(n, 3) from the shoulder to the wrist."""
    elbow: FloatArray
    """(n,) flexion [rad]."""
    pole: FloatArray
    """(n, 3) direction of the elbow."""
    target: FloatArray | None = None
    """(n, 3) wrist position in the frame of `anchor` [m], y outwards except on the floor; replaces `direction` and
    `elbow` with weight `target_weight`."""
    target_weight: FloatArray | None = None
    """(n,) 0 .. 1."""
    anchor: str = "floor"
    """Frame of the target: "floor" for the world, "pelvis", "head", "shoulder", or "chest" for the middle between the
    shoulders; the last two have the axes of the chest."""


@dataclass
class Hand:
    """Wrist and fingers of one hand, in radians."""

    pronation: FloatArray
    """(n,) 0 for the palm inwards, positive towards down (forearm forward)."""
    flexion: FloatArray
    """(n,) towards the palm positive."""
    deviation: FloatArray
    """(n,) towards the thumb positive."""
    curl: FloatArray
    """(n, 5, 3) flexion of the joints of `FINGERS`, from the knuckle outwards."""
    spread: FloatArray
    """(n, 5) sideways at the knuckle, towards the thumb positive."""
    aim: FloatArray | None = None
    """(n, 2, 3) directions of the fingers and of the palm in the axes of the chest, y outwards; replaces the angles of
    the wrist as far as it reaches, with the weight of the arm's target."""


class MotionTracks:
    """Tracks of all body parts, preset to quiet standing.

    Args:
        skeleton: the person's bone lengths.
        t: (n,) times [s].
        stance: distance between the ankles over that between the hips.
        toe_out: outward turn of each foot [rad].
    """

    def __init__(self, skeleton: Skeleton, t: FloatArray, stance: float = 1.1, toe_out: float = 0.12) -> None:
        n = len(t)
        self.skeleton, self.t, self.n = skeleton, t, n
        self.pelvis = np.zeros((n, 3))
        self.pelvis[:, 2] = skeleton.standing_height() - 0.012 * skeleton.leg_length()
        self.yaw, self.pitch, self.roll = np.zeros(n), np.zeros(n), np.zeros(n)
        """Pelvis: heading, forward lean positive, lean to the right positive [rad]."""
        self.bend, self.lean, self.turn = np.zeros(n), np.zeros(n), np.zeros(n)
        """Trunk against the pelvis: forward, to the right, to the left (yaw), spread over the spine [rad]."""
        self.nod, self.tilt, self.look = np.zeros(n), np.zeros(n), np.zeros(n)
        """Head against the chest, signs as for the trunk [rad]."""
        self.shrug = np.zeros((n, 2))
        """Extra lift of the left and right collar [rad]."""
        self.knee_out = np.zeros((n, 2))
        """Outward turn of the knees [rad]."""
        self.sway = np.zeros((n, 2))
        """Sway of the centre of mass over the feet [m]."""
        self.contacts = np.ones((n, 2), bool)
        hip = abs(skeleton.offsets[JOINT["left_hip"], 1])
        rest = skeleton.rest_positions()
        self.feet: dict[str, Foot] = {}
        self.arms: dict[str, Arm] = {}
        self.hands: dict[str, Hand] = {}
        for side in SIDES:
            s = side_sign(side)
            place = np.tile([rest[JOINT[f"{side}_ankle"], 0], s * stance * hip], (n, 1))
            zeros = np.zeros(n)
            self.feet[side] = Foot(
                place, np.full(n, s * toe_out), zeros.copy(), zeros.copy(), zeros.copy(), zeros.copy()
            )
            self.arms[side] = Arm(np.tile([0.03, 0.13, -1.0], (n, 1)), np.full(n, 0.25), np.tile(ARM_POLE, (n, 1)))
            curl = np.tile([0.3, 0.35, 0.2], (n, 5, 1))
            curl[:, FINGERS.index("thumb")] = [0.1, 0.15, 0.15]
            self.hands[side] = Hand(np.full(n, 0.25), np.full(n, 0.05), np.zeros(n), curl, np.zeros((n, 5)))

    def pivot(self, side: str) -> FloatArray:
        """(2, 3) pivots of a foot, toe joint and heel, from the ankle in the flat foot's frame [m]."""
        i = SIDES.index(side)
        return np.stack([self.skeleton.offsets[JOINT[f"{side}_foot"]], self.skeleton.heel[i]])

    def foot_frames(self, side: str) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(n, 3) ankle positions [m], (n, 3, 3) rotations of the foot and of the toes."""
        foot, pivots = self.feet[side], self.pivot(side)
        if foot.posed is not None:
            return foot.posed[0], foot.posed[1], foot.posed[1]
        w = foot.heel[:, None]
        offset = (1.0 - w) * pivots[0] + w * pivots[1]
        height = (1.0 - foot.heel) * self.skeleton.toe_height
        heading = about(Z, foot.yaw)
        rotation = heading @ about(-Y, foot.pitch)
        anchor = np.zeros((self.n, 3))
        flat = np.einsum("nij,nj->ni", heading, offset)
        anchor[:, :2] = foot.place + flat[:, :2]
        anchor[:, 2] = foot.lift + height
        ankle = anchor - np.einsum("nij,nj->ni", rotation, offset)
        follow = foot.heel + (1.0 - foot.heel) * foot.loose
        toes = heading @ about(-Y, foot.pitch * follow)
        return ankle, rotation, toes

    def solve(self, *, fingers: bool = True) -> tuple[FloatArray, FloatArray]:
        """(n, 52, 3, 3) world rotations relative to the T-pose and (n, 52, 3) joint positions [m]; without `fingers`
        those of the first 22 joints, with hands in line with the forearms."""
        sk, n = self.skeleton, self.n
        g = np.empty((n, len(PARENTS), 3, 3))
        p = np.empty((n, len(PARENTS), 3))

        def place(*names: str) -> None:
            for name in names:
                j = JOINT[name]
                p[:, j] = p[:, PARENTS[j]] + g[:, PARENTS[j]] @ sk.offsets[j]

        g[:, 0] = about(Z, self.yaw) @ about(Y, self.pitch) @ about(X, self.roll)
        p[:, 0] = self.pelvis
        for name, share in (("spine1", 0.4), ("spine2", 0.35), ("spine3", 0.25)):
            place(name)
            local = np.stack([share * self.lean, share * self.bend, share * self.turn], axis=-1)
            g[:, JOINT[name]] = g[:, PARENTS[JOINT[name]]] @ _from_vector(local)
        for name, share in (("neck", 0.5), ("head", 0.5)):
            place(name)
            local = np.stack([share * self.tilt, share * self.nod, share * self.look], axis=-1)
            g[:, JOINT[name]] = g[:, PARENTS[JOINT[name]]] @ _from_vector(local)
        for i, side in enumerate(SIDES):
            self._solve_leg(side, g, p, place)
            self._solve_arm(i, side, g, p, place)
            if fingers:
                self._solve_hand(side, g, place)
        if fingers:
            return g, p
        for side in SIDES:
            g[:, JOINT[f"{side}_wrist"]] = g[:, JOINT[f"{side}_elbow"]]
        return g[:, :NUM_BODY_JOINTS], p[:, :NUM_BODY_JOINTS]

    def _solve_leg(self, side: str, g: FloatArray, p: FloatArray, place: Callable[..., None]) -> None:
        sk, i = self.skeleton, SIDES.index(side)
        hip, knee, ankle, toe = (JOINT[f"{side}_{j}"] for j in ("hip", "knee", "ankle", "foot"))
        place(f"{side}_hip")
        target, foot, toes = self.foot_frames(side)
        u = normalised(np.einsum("nji,nj->ni", g[:, 0], target - p[:, hip]))
        # the knee follows the hip's swing, turned partly with the foot
        heading = np.arctan2(np.sin(self.feet[side].yaw - self.yaw), np.cos(self.feet[side].yaw - self.yaw))
        twist = 0.6 * heading + side_sign(side) * self.knee_out[:, i]
        forward = about(Z, twist)[..., 0]
        pole = np.einsum("nij,njk,nk->ni", g[:, 0], between(-Z, u), forward)
        middle, thigh, shank = two_bone(p[:, hip], target, pole, sk.length(f"{side}_knee"), sk.length(f"{side}_ankle"))
        g[:, hip] = from_rest(thigh, normalised(sk.offsets[knee]), X)
        g[:, knee] = from_rest(shank, normalised(sk.offsets[ankle]), X)
        p[:, knee] = middle
        place(f"{side}_ankle")
        g[:, ankle] = foot
        place(f"{side}_foot")
        g[:, toe] = toes

    def _solve_arm(self, i: int, side: str, g: FloatArray, p: FloatArray, place: Callable[..., None]) -> None:
        sk, s, arm = self.skeleton, side_sign(side), self.arms[side]
        collar, shoulder, elbow, wrist = (JOINT[f"{side}_{j}"] for j in ("collar", "shoulder", "elbow", "wrist"))
        mirror = np.array([1.0, s, 1.0])
        chest = g[:, JOINT["spine3"]]
        direction = normalised(clear_of_body(arm.direction, sk.arm_slope) * mirror)
        weight = np.zeros(self.n) if arm.target is None else np.ones(self.n)
        weight = weight if arm.target_weight is None else arm.target_weight
        place(f"{side}_collar")
        still = p[:, collar] + chest @ sk.offsets[shoulder]  # the shoulder of a collar at rest
        goal = self._target(arm, mirror, g, p, still)
        toward = direction
        if goal is not None:
            toward = slerp(direction, np.einsum("nji,nj->ni", chest, goal - still), weight)
            toward = normalised(toward)
        # scapular rhythm: the collar follows an arm above the horizontal, and forwards
        raised = np.arccos(np.clip(-toward[:, 2], -1.0, 1.0))
        lift = 0.25 * np.logaddexp(0.0, 4.0 * (raised - 1.1)) / 4.0 + self.shrug[:, i]
        forward = 0.15 * toward[:, 0] * np.sin(raised) ** 2
        g[:, collar] = chest @ about(X, s * lift) @ about(Z, -s * forward)
        place(f"{side}_shoulder")
        a, b = sk.length(f"{side}_elbow"), sk.length(f"{side}_wrist")
        reach = np.sqrt(a * a + b * b + 2.0 * a * b * np.cos(arm.elbow))
        way = np.einsum("nij,nj->ni", chest, direction * reach[:, None])
        if goal is not None:
            way = slerp(way, goal - (still if arm.anchor == "shoulder" else p[:, shoulder]), weight)
            # no nearer than the most bent elbow allows
            distance = np.linalg.norm(way, axis=-1, keepdims=True)
            nearest = np.sqrt(a * a + b * b + 2.0 * a * b * np.cos(_MOST_BENT))
            soft = 0.03 * nearest
            way *= (nearest + soft * np.logaddexp(0.0, (distance - nearest) / soft)) / np.maximum(distance, 1e-6)
        target, pole = p[:, shoulder] + way, arm.pole * mirror
        middle, upper, fore = two_bone(p[:, shoulder], target, np.einsum("nij,nj->ni", chest, pole), a, b)
        u0 = normalised(sk.offsets[elbow])
        g[:, shoulder] = from_rest(upper, u0, -X)
        g[:, elbow] = from_rest(fore, normalised(sk.offsets[wrist]), -X)
        p[:, elbow] = middle
        place(f"{side}_wrist")

    def _target(
        self, arm: Arm, mirror: FloatArray, g: FloatArray, p: FloatArray, shoulder: FloatArray
    ) -> FloatArray | None:
        """(n, 3) place of the wrist in the world [m]."""
        if arm.target is None or arm.anchor == "floor":
            return arm.target
        sk, chest = self.skeleton, JOINT["spine3"]
        joint = {"pelvis": 0, "head": JOINT["head"]}.get(arm.anchor, chest)
        origin = p[:, joint]
        if arm.anchor == "shoulder":
            origin = shoulder
        elif arm.anchor == "chest":
            both = [sk.offsets[JOINT[f"{s}_collar"]] + sk.offsets[JOINT[f"{s}_shoulder"]] for s in SIDES]
            origin = origin + g[:, chest] @ np.mean(both, axis=0)
        return origin + np.einsum("nij,nj->ni", g[:, joint], arm.target * mirror)

    def _aimed(self, side: str, g: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(n,) pronation, flexion and deviation [rad] of a hand that is aimed somewhere, as far as the wrist
        reaches."""
        hand, arm, s = self.hands[side], self.arms[side], side_sign(side)
        own = np.stack([hand.pronation, hand.flexion, hand.deviation], axis=-1)
        if hand.aim is None:
            return hand.pronation, hand.flexion, hand.deviation
        frames = g[:, JOINT["spine3"]] @ basis(*np.moveaxis(hand.aim * [1.0, s, 1.0], 1, 0))
        turned = transpose(g[:, JOINT[f"{side}_elbow"]]) @ from_rest(frames, s * Y, -Z)
        # twist about the forearm, then swing: without jumps unless the hand folds back on it
        rotation = Rotation.from_matrix(turned)
        quaternion = rotation.as_quat()
        twist = np.unwrap(2.0 * np.arctan2(quaternion[:, 1], quaternion[:, 3]))
        twist -= 2.0 * np.pi * np.round(twist[0] / (2.0 * np.pi))
        swing = (Rotation.from_rotvec(-twist[:, None] * Y) * rotation).as_rotvec()
        angles = np.stack([twist, -s * swing[:, 0], -s * swing[:, 2]], axis=-1)
        angles = np.sign(angles) * soft_limit(np.abs(angles), _WRIST_REACH, 0.3)
        weight = np.ones(self.n) if arm.target_weight is None else arm.target_weight
        mixed: FloatArray = own + weight[:, None] * (angles - own)
        return mixed[:, 0], mixed[:, 1], mixed[:, 2]

    def _solve_hand(self, side: str, g: FloatArray, place: Callable[..., None]) -> None:
        sk, s, hand = self.skeleton, side_sign(side), self.hands[side]
        wrist = JOINT[f"{side}_wrist"]
        pronation, flexion, deviation = self._aimed(side, g)
        g[:, wrist] = (
            g[:, JOINT[f"{side}_elbow"]] @ about(Y, pronation) @ about(-s * X, flexion) @ about(-s * Z, deviation)
        )
        for f, finger in enumerate(FINGERS):
            axis = thumb_axis(sk, side) if finger == "thumb" else -s * X
            for k in range(3):
                j = JOINT[f"{side}_{finger}{k + 1}"]
                place(f"{side}_{finger}{k + 1}")
                local = about(axis, hand.curl[:, f, k])
                if k == 0:
                    local = about(-s * Z, hand.spread[:, f]) @ local
                g[:, j] = g[:, PARENTS[j]] @ local


def clear_of_body(direction: FloatArray, slope: float) -> FloatArray:
    """Arm directions (n, 3), y outwards; hanging ones lead outwards by at least `slope`."""
    u = normalised(direction)
    hanging = ease((-u[:, 2] - 0.7) / 0.25)
    wanted = -slope * u[:, 2]
    soft = 0.03
    aside = wanted + soft * np.logaddexp(0.0, (u[:, 1] - wanted) / soft)
    return np.stack([u[:, 0], u[:, 1] + hanging * (aside - u[:, 1]), u[:, 2]], axis=-1)


def slerp(a: FloatArray, b: FloatArray, weight: FloatArray) -> FloatArray:
    """(n, 3) from `a` (`weight` 0) to `b` (`weight` 1, (n,)) around the origin: directions along a great circle."""
    long_a, long_b = (np.linalg.norm(v, axis=-1, keepdims=True) for v in (a, b))
    u = a / np.maximum(long_a, 1e-9)
    side = b / np.maximum(long_b, 1e-9)
    cosine = np.clip(np.sum(u * side, axis=-1, keepdims=True), -0.999, 1.0)
    angle = np.arccos(cosine) * weight[:, None]
    turned = np.cos(angle) * u + np.sin(angle) * _perpendicular_or_none(side, u)
    return turned * (long_a + weight[:, None] * (long_b - long_a))


def _perpendicular_or_none(v: FloatArray, u: FloatArray) -> FloatArray:
    rest = v - np.sum(v * u, axis=-1, keepdims=True) * u
    return rest / np.maximum(np.linalg.norm(rest, axis=-1, keepdims=True), 1e-9)


def thumb_axis(skeleton: Skeleton, side: str) -> FloatArray:
    """(3,) axis of the thumb's flexion over the palm, T-pose frame."""
    tip = skeleton.offsets[JOINT[f"{side}_thumb3"]]
    across = np.array([-0.3, side_sign(side) * 0.5, -0.8])
    return normalised(np.cross(tip, across))


def _from_vector(v: FloatArray) -> FloatArray:
    angle = np.linalg.norm(v, axis=-1)
    axis = v / np.where(angle > 0.0, angle, 1.0)[:, None]
    return about(axis, angle)
