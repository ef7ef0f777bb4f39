"""Lying, sit-ups and push-ups: trunk on or near the floor. Lengths are a mean adult's and grow with the legs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.manner import Manner
from rfgen_sionna.generative.motion.curves import keys, wander
from rfgen_sionna.generative.motion.rotations import X, Y, Z, about, transpose
from rfgen_sionna.generative.motion.skeleton import JOINT, MEAN_ADULT, SIDES, side_sign
from rfgen_sionna.generative.motion.tracks import MotionTracks

_BACK, _BELLY, _SIDE = 0.112, 0.12, 0.235
"""Height of the pelvis joint over the floor of who lies on the back, on the stomach and on a side [m]."""
_HEEL, _INSTEP = 0.068, 0.088
"""Height of the ankle over the floor with the heel, and with the instep on it [m]."""
_WRIST = 0.062
"""Height of the wrist over the floor with the palm on it [m]."""


def _size(tracks: MotionTracks) -> float:
    return tracks.skeleton.leg_length() / MEAN_ADULT.leg_length()


def lie(tracks: MotionTracks, rng: np.random.Generator, hand: str, manner: Manner) -> None:
    """Lies on the back, on a side or on the stomach, nearly still; the manner may give which."""
    _breathe(tracks, rng)
    drawn = str(rng.choice(["back", "side", "stomach"], p=[0.5, 0.3, 0.2]))
    place = manner.lying or drawn
    if place.endswith("side"):
        _on_a_side(tracks, rng, place.removesuffix("side").strip("_"))
    else:
        {"back": _on_the_back, "stomach": _on_the_stomach}[place](tracks, rng)
    turn = rng.uniform(-np.pi, np.pi)
    _turned(tracks, turn)


def _breathe(tracks: MotionTracks, rng: np.random.Generator) -> None:
    """Small movements of who lies still; the breath moves the skin."""
    t = tracks.t
    tracks.look += wander(t, rng, 0.03, 0.05, 0.3)
    tracks.nod += wander(t, rng, 0.01, 0.05, 0.3)
    tracks.turn += wander(t, rng, 0.006)
    tracks.contacts[:] = False


def _on_the_back(tracks: MotionTracks, rng: np.random.Generator) -> None:
    size = _size(tracks)
    tracks.pelvis[:] = [0.0, 0.0, _BACK * size]
    tracks.pitch[:] = -np.pi / 2 + rng.uniform(-0.03, 0.03)
    tracks.bend += rng.uniform(0.02, 0.1)
    tracks.nod += rng.uniform(0.0, 0.25)
    tracks.look += rng.uniform(-0.6, 0.6)
    drawn = [bool(rng.uniform() < 0.25), bool(rng.uniform() < 0.25)]
    for side, up in zip(SIDES, drawn, strict=True):
        if up:
            _foot_on_sole(tracks, side, rng.uniform(0.38, 0.5) * size, rng.uniform(0.7, 1.2))
        else:
            knee = rng.uniform(0.05, 0.2)
            _stretched(tracks, side, _HEEL * size, rng.uniform(0.03, 0.25), knee, rng.uniform(0.2, 0.6), 1.0)
    _lay_arms(tracks, rng, supine=True)


def _on_the_stomach(tracks: MotionTracks, rng: np.random.Generator) -> None:
    size = _size(tracks)
    tracks.pelvis[:] = [0.0, 0.0, _BELLY * size]
    tracks.pitch[:] = np.pi / 2 + rng.uniform(-0.03, 0.02)
    tracks.bend -= rng.uniform(0.0, 0.08)
    tracks.nod -= rng.uniform(0.15, 0.4)
    tracks.look += rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 1.0)
    for side in SIDES:
        _stretched(tracks, side, _INSTEP * size, rng.uniform(0.05, 0.3), rng.uniform(0.02, 0.15), 0.9, -1.0)
    _lay_arms(tracks, rng, supine=False)


def _on_a_side(tracks: MotionTracks, rng: np.random.Generator, lower: str = "") -> None:
    """Both knees drawn up; the lower arm ahead, the upper one before the chest or along the body. Empty `lower`: the
    seed draws the side on the floor."""
    size = _size(tracks)
    drawn = SIDES[int(rng.uniform() < 0.5)]
    lower = lower or drawn
    s = side_sign(lower)
    tracks.pelvis[:] = [0.0, 0.0, _SIDE * size]
    tracks.roll[:] = -s * np.pi / 2
    tracks.pitch[:] = rng.uniform(-0.1, 0.2)
    tracks.bend += rng.uniform(0.05, 0.4)
    tracks.lean += -s * rng.uniform(0.0, 0.08)
    tracks.tilt += -s * rng.uniform(-0.1, 0.2)
    tracks.nod += rng.uniform(0.0, 0.35)
    hip, knee = rng.uniform(0.35, 1.1), rng.uniform(0.5, 1.4)
    pelvis = _pelvis(tracks)
    for side in SIDES:
        under = side == lower
        flexion = hip + (0.0 if under else rng.uniform(-0.2, 0.5))
        bend = knee + (0.0 if under else rng.uniform(-0.2, 0.4))
        # the upper leg lies on the lower one or on the floor before it
        aside = 0.02 if under else -rng.uniform(0.12, 0.22)
        _pose_leg(tracks, side, pelvis, flexion, aside, bend, rng.uniform(0.2, 0.6))
        arm = tracks.arms[side]
        if under:
            arm.direction[:] = [1.0, rng.uniform(-0.1, 0.05), rng.uniform(-0.5, 0.6)]
            arm.elbow[:] = rng.uniform(0.3, 1.6)
        else:
            arm.direction[:] = [rng.uniform(0.2, 1.0), rng.uniform(-0.5, -0.2), rng.uniform(-1.0, -0.4)]
            arm.elbow[:] = rng.uniform(0.4, 1.3)
        arm.pole[:] = [-0.3, 0.4, -1.0]


def _lay_arms(tracks: MotionTracks, rng: np.random.Generator, *, supine: bool) -> None:
    """Arms beside the body, out, bent upwards beside the head, or on the belly."""
    places = ["beside", "out", "head", "belly"] if supine else ["beside", "head", "head", "out"]
    one = rng.choice(places)
    for side in SIDES:
        place = one if rng.uniform() < 0.7 else rng.choice(places)
        arm, hand = tracks.arms[side], tracks.hands[side]
        level = rng.uniform(-0.24, -0.16) if supine else rng.uniform(0.12, 0.18)
        if place == "beside":
            arm.direction[:] = [level, rng.uniform(0.15, 0.45), -1.0]
            arm.elbow[:] = rng.uniform(0.1, 0.3)
        elif place == "out":
            arm.direction[:] = [level, 1.0, rng.uniform(-0.7, 0.2)]
            arm.elbow[:] = rng.uniform(0.1, 0.4)
        elif place == "head":
            arm.direction[:] = [level, rng.uniform(0.35, 0.6), rng.uniform(0.3, 0.7)]
            arm.elbow[:] = rng.uniform(1.5, 2.0)
        else:
            arm.direction[:] = [rng.uniform(0.35, 0.5), rng.uniform(-0.25, 0.1), -1.0]
            arm.elbow[:] = rng.uniform(1.2, 1.5)
        arm.pole[:] = [-0.2 if place == "belly" else 0.0, 1.0, -0.6]
        hand.pronation[:] = rng.uniform(0.0, 0.6) if supine else rng.uniform(-0.3, 0.4)


def _pelvis(tracks: MotionTracks) -> FloatArray:
    """(n, 3, 3) rotation of the pelvis."""
    return about(Z, tracks.yaw) @ about(Y, tracks.pitch) @ about(X, tracks.roll)


def _stretched(
    tracks: MotionTracks, side: str, height: float, aside: float, knee: float, pointed: float, front: float
) -> None:
    """A nearly straight leg whose ankle is `height` [m] over the floor; `front` 1 face up, -1 face down."""
    sk, i = tracks.skeleton, JOINT[f"{side}_hip"]
    hip = tracks.pelvis[0, 2] + (_pelvis(tracks)[0] @ sk.offsets[i])[2]
    drop = np.arcsin(np.clip((hip - height) / sk.leg_length(), -0.3, 0.3))
    # of the line from hip to ankle, from that of the body; face up, flexion raises the foot
    level = float(tracks.pitch[0] + front * np.pi / 2)
    line = level - front * drop
    share = sk.length(f"{side}_ankle") / sk.leg_length()
    _pose_leg(tracks, side, _pelvis(tracks), line + share * knee, aside, knee, pointed)


def _pose_leg(
    tracks: MotionTracks, side: str, pelvis: FloatArray, flexion: float, aside: float, knee: float, pointed: float
) -> None:
    """Leg by its angles against the pelvis [rad]: flexion of the hip, outwards, of the knee, and the pointed foot."""
    sk, s = tracks.skeleton, side_sign(side)
    out = about(X, s * aside)
    thigh, shank = out @ about(Y, -flexion), out @ about(Y, knee - flexion)
    leg = sk.offsets[JOINT[f"{side}_hip"]] + thigh @ sk.offsets[JOINT[f"{side}_knee"]]
    leg = leg + shank @ sk.offsets[JOINT[f"{side}_ankle"]]
    ankle = tracks.pelvis + np.einsum("nij,j->ni", pelvis, leg)
    tracks.feet[side].posed = (ankle, pelvis @ (out @ about(Y, knee - flexion + pointed)))


def _foot_on_sole(tracks: MotionTracks, side: str, ahead: float, spread: float) -> None:
    """A drawn-up leg of who lies on the back: the foot flat, `ahead` of the pelvis [m], `spread` of the hips apart."""
    hip = abs(tracks.skeleton.offsets[JOINT[f"{side}_hip"], 1])
    tracks.feet[side].place[:] = [ahead, side_sign(side) * spread * hip]
    tracks.contacts[:, SIDES.index(side)] = True


def _turned(tracks: MotionTracks, angle: float) -> None:
    """Turn the body about the vertical through the origin by `angle` [rad]."""
    turn = about(Z, angle)
    tracks.yaw += angle
    tracks.pelvis[:] = tracks.pelvis @ turn.T
    for foot in tracks.feet.values():
        foot.yaw += angle
        foot.place[:] = foot.place @ turn[:2, :2].T
        if foot.posed is not None:
            foot.posed = (foot.posed[0] @ turn.T, turn @ foot.posed[1])


@dataclass(frozen=True)
class _Repeats:
    """Ups and downs of an exercise."""

    course: FloatArray
    """(n,) 0 where it begins to 1 at the other end."""

    @classmethod
    def drawn(
        cls, t: FloatArray, rng: np.random.Generator, manner: Manner, seconds: tuple[float, float], start: float
    ) -> _Repeats:
        """Repeats of `seconds` [s] or by the rate of `manner`, from `start` (0 or 1); sizes of the reps vary."""
        period = 60.0 / manner.rate if manner.rate is not None else rng.uniform(*seconds) / manner.pace
        first = rng.uniform(0.45, 0.6)
        times, values = [0.0], [start]
        clock = rng.uniform(0.0, 0.08) * period
        while times[-1] <= t[-1]:
            rest = rng.uniform(0.0, 0.12)
            for share in (first * (1.0 - rest), (1.0 - first) * (1.0 - rest)):
                times += [clock + 0.5 * rest * period, clock + (0.5 * rest + share) * period]
                goal = 1.0 - round(values[-1])
                values += [values[-1], goal - (2.0 * goal - 1.0) * rng.uniform(0.0, 0.08)]
                clock += (share + 0.5 * rest) * period
        steps = np.maximum(np.diff(times), 1e-3)
        return cls(keys(t, np.concatenate([[0.0], np.cumsum(steps)]).tolist(), values))


def sit_up(tracks: MotionTracks, rng: np.random.Generator, hand: str, manner: Manner) -> None:
    """Sit-ups: on the back, feet flat; the trunk rolls up towards the knees and down again."""
    size, t = _size(tracks), tracks.t
    tracks.contacts[:] = True
    up = _Repeats.drawn(t, rng, manner, (1.7, 2.8), float(rng.uniform() < 0.3)).course
    top = np.clip(rng.uniform(0.95, 1.3) * manner.size, 0.7, 1.45)
    tracks.pelvis[:] = [0.0, 0.0, _BACK * size]
    tracks.pelvis[:, 2] -= 0.012 * size * up
    # the spine curls before the pelvis tilts
    early = np.sqrt(np.clip(up, 0.0, 1.0)) * up**0.25
    tracks.pitch[:] = -np.pi / 2 + 0.72 * top * up
    tracks.bend += rng.uniform(0.5, 0.8) * early
    tracks.nod += 0.25 * early + rng.uniform(0.0, 0.2)
    tracks.look += wander(t, rng, 0.03)
    ahead, spread = rng.uniform(0.42, 0.55) * size, rng.uniform(0.8, 1.5)
    for side in SIDES:
        _foot_on_sole(tracks, side, ahead, spread)
    place = rng.choice(["head", "chest", "knees"])
    for side in SIDES:
        arm, s = tracks.arms[side], side_sign(side)
        if place == "head":
            arm.direction[:] = [0.05, -0.35, 0.9]
            arm.elbow[:] = rng.uniform(2.0, 2.2)
            arm.pole[:] = [0.3, 1.0, 0.0]
        elif place == "chest":
            arm.direction[:] = [0.45, -0.75, -0.35]
            arm.elbow[:] = rng.uniform(1.9, 2.1)
            arm.pole[:] = [0.1, 0.8, -1.0]
        else:
            arm.direction = np.stack([0.35 + 0.6 * up, np.full_like(t, 0.1 + 0.02 * s), -0.8 + 0.3 * up], axis=-1)
            arm.elbow[:] = rng.uniform(0.15, 0.4)
            arm.pole[:] = [-0.3, 0.8, -0.6]
    _turned(tracks, rng.uniform(-np.pi, np.pi))


def push_up(tracks: MotionTracks, rng: np.random.Generator, hand: str, manner: Manner) -> None:
    """Push-ups: the straight body turns about the toes, the palms stay on the floor."""
    sk, size, t = tracks.skeleton, _size(tracks), tracks.t
    tracks.contacts[:] = True
    down = _Repeats.drawn(t, rng, manner, (1.2, 2.0), 0.0).course
    arm_length = sk.length("left_elbow") + sk.length("left_wrist")
    high = arm_length * rng.uniform(0.93, 0.985) + _WRIST * size
    depth = np.clip(rng.uniform(0.42, 0.58) * np.clip(manner.size, 0.5, 1.2), 0.28, 0.62) * arm_length
    toes = np.radians(rng.uniform(62.0, 74.0))
    hips = rng.uniform(-0.01, 0.05) * size
    for side in SIDES:
        foot = tracks.feet[side]
        foot.place[:] = [0.0, side_sign(side) * rng.uniform(0.03, 0.1) * size]
        foot.yaw[:] = 0.0
        foot.pitch[:] = -toes
    ankle, _, _ = tracks.foot_frames("left")
    leg = 0.985 * sk.leg_length()
    rest = sk.rest_positions()
    trunk = rest[JOINT["left_shoulder"], 2] - rest[JOINT["left_hip"], 2]
    # the line from ankles to shoulders
    goal = high - depth * down
    angle = np.arcsin(np.clip((goal - ankle[:, 2] - 0.02 * size) / (leg + trunk), -0.2, 0.6))
    tracks.pitch[:] = np.pi / 2 - angle + hips / leg * 1.5
    tracks.bend += -1.2 * hips / leg + 0.02 * wander(t, rng, 1.0)
    tracks.pelvis[:, 0] = ankle[:, 0] + leg * np.cos(angle)
    tracks.pelvis[:, 1] = 0.002 * wander(t, rng, 1.0)
    tracks.pelvis[:, 2] = ankle[:, 2] + leg * np.sin(angle) + hips
    tracks.nod -= rng.uniform(0.1, 0.45)
    tracks.look += wander(t, rng, 0.03)
    _, p = tracks.solve()
    shift, wide = rng.uniform(-0.08, 0.05) * size, rng.uniform(0.0, 0.14) * size
    elbows = rng.uniform(0.3, 1.2)
    for side in SIDES:
        s, arm = side_sign(side), tracks.arms[side]
        shoulder = p[:, JOINT[f"{side}_shoulder"]]
        at = np.array([np.median(shoulder[:, 0]) + shift, np.median(shoulder[:, 1]) + s * wide, _WRIST * size])
        arm.target = np.tile(at, (tracks.n, 1))
        arm.target_weight = np.ones(tracks.n)
        arm.pole = np.tile([-0.7, elbows, -1.0], (tracks.n, 1))
    _palms_down(tracks, rng.uniform(-0.1, 0.4))
    _turned_targets(tracks, rng.uniform(-np.pi, np.pi))


def _palms_down(tracks: MotionTracks, inwards: float) -> None:
    """Wrists that hold the palms level, fingers ahead and `inwards` [rad]."""
    g, _ = tracks.solve()
    for side in SIDES:
        s, hand = side_sign(side), tracks.hands[side]
        level = about(Z, -s * (np.pi / 2 + inwards))
        local = transpose(g[:, JOINT[f"{side}_elbow"]]) @ level
        pronation, flexion, deviation = np.moveaxis(Rotation.from_matrix(local).as_euler("YXZ"), -1, 0)
        hand.pronation, hand.flexion, hand.deviation = np.unwrap(pronation), -s * flexion, -s * deviation
        hand.curl[:] = 0.05


def _turned_targets(tracks: MotionTracks, angle: float) -> None:
    _turned(tracks, angle)
    turn = about(Z, angle)
    for arm in tracks.arms.values():
        if arm.target is not None:
            arm.target = arm.target @ turn.T
