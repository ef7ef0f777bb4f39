"""Joint rotations and bone lengths from joint positions."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.ndimage import gaussian_filter1d

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion.curves import ease
from rfgen_sionna.generative.motion.rotations import (
    X,
    Z,
    about,
    basis,
    between,
    normalised,
    perpendicular,
    to_quaternions,
    transpose,
    twist_angle,
)
from rfgen_sionna.generative.motion.skeleton import (
    JOINT,
    JOINT_NAMES,
    MEAN_ADULT,
    NUM_BODY_JOINTS,
    PARENTS,
    SIDES,
    side_sign,
    two_bone,
)
from rfgen_sionna.records import Motion

_ASIDE = np.array([0.31, 0.83, 0.46])
"""Direction that no limb has: straight limbs bend across it."""
_FLEXED = np.radians(20.0)
"""Flexion from which a limb's plane of bending gets full weight [rad]; bounds the effect of position noise."""
_TURNING = 0.1
"""Smoothing time of a limb's plane of bending [s]: a third of the fastest voluntary cycle."""
_STRETCHED = 0.3
"""Relative change of a bone's length that makes its direction doubtful: limbs that point at a depth camera."""
_REACH = 0.1
"""Farthest correction of a limb's end [m]; beyond, the recorded joints are no limb's."""
_BRIDGED = 0.25
"""Smoothing time of a direction where it is doubtful [s]: half of the longest gap."""
_STANDING = (0.02, 0.08)
"""Ankle heights over their lowest at which a foot begins to leave the floor, and has left it [m]."""
_ROLLING = np.radians([8.0, 20.0])
"""Pitch of a foot over the heel or the ball from which it begins to be, and is, no noise of a standing foot [rad]."""
_LOWEST = 0.1
"""Quantile of an ankle's heights that counts as its lowest: above noise, below the share of standing in a walk."""


def motion_of_positions(
    positions: FloatArray,
    frame_rate: float,
    *,
    lengths: Mapping[str, float] | None = None,
    action: str = "",
    prompt: str = "",
) -> Motion:
    """A motion whose joints follow positions, on a skeleton with their bone lengths, at their place.

    Hips, neck, collars and vertebrae sit where they are in the median in the frames of pelvis and chest; bones of
    limbs have their median lengths and point from the joint before to the position of the next, so that errors do not
    add up. Hips and shoulders turn so that knees and elbows flex in their plane. Angles that positions do not show
    (twist of straight limbs, forearms, fingers) stay at rest. Feet near the floor are level.

    Args:
        positions: (frame, 22, 3) the body's joints [m], z up; smooth, since rotations amplify noise.
        frame_rate: poses per second [Hz].
        lengths: joint -> distance from its parent [m], of knees, ankles, elbows and wrists; None takes the medians.
        action: label.
        prompt: text of the motion.

    Raises:
        ValueError: wrong shape, no frames, values that are not finite, or a frame rate that is not positive.
    """
    p = np.asarray(positions, np.float64)
    if p.ndim != 3 or p.shape[1:] != (NUM_BODY_JOINTS, 3) or not len(p):
        raise ValueError(f"positions: shape {p.shape}; allowed is (frames, {NUM_BODY_JOINTS}, 3)")
    if not np.isfinite(p).all():
        raise ValueError("positions: values are not finite; remove those frames")
    if not (np.isfinite(frame_rate) and frame_rate > 0.0):
        raise ValueError(f"frame_rate: {frame_rate!r} Hz; allowed is more than 0")
    pelvis, chest = _trunk_frames(p)
    rest = measured_offsets(p, pelvis, chest, lengths or {})
    world, places = np.empty((*p.shape[:2], 3, 3)), np.empty_like(p)
    hips = 0.5 * (p[:, JOINT["left_hip"]] + p[:, JOINT["right_hip"]])
    middle = 0.5 * (rest[JOINT["left_hip"]] + rest[JOINT["right_hip"]])
    # the pelvis joint of other skeletons lies elsewhere between the hips
    world[:, 0], places[:, 0] = pelvis, hips - pelvis @ middle

    def put(*names: str) -> None:
        for name in names:
            j = JOINT[name]
            places[:, j] = places[:, PARENTS[j]] + world[:, PARENTS[j]] @ rest[j]

    for name, child, share in (("spine1", "spine2", 0.33), ("spine2", "spine3", 0.67)):
        put(name)
        j, c = JOINT[name], JOINT[child]
        world[:, j] = _aimed(pelvis, rest[c], p[:, c] - places[:, j])
        # the twist between pelvis and chest is spread over the spine
        axis = normalised(rest[c])
        world[:, j] = world[:, j] @ about(axis, share * twist_angle(transpose(world[:, j]) @ chest, axis))
    put("spine3")
    world[:, JOINT["spine3"]] = chest
    put("neck")
    world[:, JOINT["neck"]] = _aimed(chest, rest[JOINT["head"]], p[:, JOINT["head"]] - places[:, JOINT["neck"]])
    put("head")
    world[:, JOINT["head"]] = world[:, JOINT["neck"]]
    for side in SIDES:
        put(f"{side}_collar")
        collar, shoulder = JOINT[f"{side}_collar"], JOINT[f"{side}_shoulder"]
        world[:, collar] = _aimed(chest, rest[shoulder], p[:, shoulder] - places[:, collar])
        for names, root, bend in (
            (("hip", "knee", "ankle"), pelvis, X),
            (("shoulder", "elbow", "wrist"), world[:, collar], -X),
        ):
            a, b, c = (JOINT[f"{side}_{name}"] for name in names)
            put(f"{side}_{names[0]}")
            sizes = (float(np.linalg.norm(rest[b])), float(np.linalg.norm(rest[c])))
            first = _along(p[:, b] - places[:, a], sizes[0], frame_rate)
            second = _along(p[:, c] - places[:, a] - sizes[0] * first, sizes[1], frame_rate)
            if names[0] == "hip":
                first, second = _reaching(places[:, a], p[:, c], (first, second), sizes)
            places[:, b] = places[:, a] + sizes[0] * first
            places[:, c] = places[:, b] + sizes[1] * second
            world[:, a], world[:, b] = _limb(root, (rest[b], rest[c]), (first, second), bend, _TURNING * frame_rate)
        wrist, ankle, foot = (JOINT[f"{side}_{name}"] for name in ("wrist", "ankle", "foot"))
        world[:, wrist] = world[:, JOINT[f"{side}_elbow"]]
        world[:, ankle] = _foot(world[:, JOINT[f"{side}_knee"]], rest[foot], p[:, foot] - p[:, ankle],
                                p[:, ankle, 2], side_sign(side), _TURNING * frame_rate)  # fmt: skip
        world[:, foot] = world[:, ankle]
    places[:, 0] += _standing_shift(p, places)
    local = world.copy()
    for j in range(1, NUM_BODY_JOINTS):
        local[:, j] = transpose(world[:, PARENTS[j]]) @ world[:, j]
    return Motion(
        rotations=to_quaternions(local),
        translation=places[:, 0],
        frame_rate=float(frame_rate),
        joint_names=JOINT_NAMES[:NUM_BODY_JOINTS],
        parents=PARENTS[:NUM_BODY_JOINTS],
        offsets=rest,
        action=action,
        prompt=prompt,
    )


def _trunk_frames(p: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(frame, 3, 3) rotations of pelvis (along the hips, up the lower spine) and chest (up the upper one)."""
    hips = 0.5 * (p[:, JOINT["left_hip"]] + p[:, JOINT["right_hip"]])
    across = p[:, JOINT["left_hip"]] - p[:, JOINT["right_hip"]]
    pelvis = basis(across, p[:, JOINT["spine3"]] - hips)
    up = normalised(p[:, JOINT["neck"]] - p[:, JOINT["spine3"]])
    left = perpendicular(p[:, JOINT["left_shoulder"]] - p[:, JOINT["right_shoulder"]], up)
    # columns along, up, ahead of `basis` become ahead, along, up
    return pelvis[..., [2, 0, 1]], np.stack([np.cross(left, up), left, up], axis=-1)


def measured_offsets(p: FloatArray, pelvis: FloatArray, chest: FloatArray, lengths: Mapping[str, float]) -> FloatArray:
    """(22, 3) rest positions of the joints relative to their parents [m], with the lengths of positions (frame, 22, 3).

    Args:
        p: (frame, 22, 3) positions [m].
        pelvis, chest: (frame, 3, 3) their rotations.
        lengths: joint -> distance from its parent [m], where it is known better.
    """
    rest = np.zeros((NUM_BODY_JOINTS, 3))

    def within(frame: FloatArray, joint: str, parent: str) -> FloatArray:
        step = p[:, JOINT[joint]] - p[:, JOINT[parent]]
        return np.asarray(np.median(np.einsum("nji,nj->ni", frame, step), axis=0))

    def length(joint: str) -> float:
        j = JOINT[joint]
        if joint in lengths:
            return lengths[joint]
        return float(np.median(np.linalg.norm(p[:, j] - p[:, PARENTS[j]], axis=-1)))

    for joint in ("left_hip", "right_hip", "spine1", "spine2", "spine3"):
        rest[JOINT[joint]] = within(pelvis, joint, JOINT_NAMES[PARENTS[JOINT[joint]]])
    for joint in ("neck", "left_collar", "right_collar"):
        rest[JOINT[joint]] = within(chest, joint, "spine3")
    size = body_size(p)
    head = within(chest, "head", "neck")
    rest[JOINT["head"]] = head * (length("head") / np.linalg.norm(head))
    for side in SIDES:
        s = side_sign(side)
        shoulder = within(chest, f"{side}_shoulder", f"{side}_collar")
        rest[JOINT[f"{side}_shoulder"]] = shoulder * (length(f"{side}_shoulder") / np.linalg.norm(shoulder))
        for joint in ("elbow", "wrist"):
            rest[JOINT[f"{side}_{joint}"]] = [0.0, s * length(f"{side}_{joint}"), 0.0]
        # knees stand under the anatomical hips, which some layouts have further inside
        thigh, aside = length(f"{side}_knee"), size * MEAN_ADULT.offsets[JOINT[f"{side}_hip"], 1]
        aside = np.clip(aside - rest[JOINT[f"{side}_hip"], 1], -0.3 * thigh, 0.3 * thigh)
        rest[JOINT[f"{side}_knee"]] = [0.0, aside, -np.sqrt(thigh**2 - aside**2)]
        rest[JOINT[f"{side}_ankle"]] = [0.0, 0.0, -length(f"{side}_ankle")]
        rest[JOINT[f"{side}_foot"]] = _standing_foot(p, side)
    return rest


def body_size(p: FloatArray) -> float:
    """Size of a body relative to the mean adult's, by legs and trunk of positions (frame, 22, 3) [m]."""
    legs = sum(
        float(np.median(np.linalg.norm(p[:, JOINT[f"{s}_{b}"]] - p[:, JOINT[f"{s}_{a}"]], axis=-1)))
        for s in SIDES for a, b in (("hip", "knee"), ("knee", "ankle"))
    )  # fmt: skip
    trunk = float(np.median(np.linalg.norm(_trunk(p), axis=-1)))
    adult = MEAN_ADULT.rest_positions()[None]
    return (0.5 * legs + trunk) / (MEAN_ADULT.leg_length() + float(np.linalg.norm(_trunk(adult))))


def _trunk(p: FloatArray) -> FloatArray:
    shoulders = p[:, JOINT["left_shoulder"]] + p[:, JOINT["right_shoulder"]]
    return 0.5 * (shoulders - p[:, JOINT["left_hip"]] - p[:, JOINT["right_hip"]])


def over_lowest(height: FloatArray) -> FloatArray:
    """(frame,) heights of an ankle over that of its standing foot [m]."""
    return np.asarray(height - np.quantile(height, _LOWEST))


def _off_floor(height: FloatArray) -> FloatArray:
    """(frame,) 0 for a foot on the floor to 1 for one that has left it, from its ankle's heights [m]."""
    low, high = _STANDING
    return ease((over_lowest(height) - low) / (high - low))


def _standing_foot(p: FloatArray, side: str) -> FloatArray:
    """(3,) toe joint from the ankle of a level foot that points ahead [m]."""
    ankle, foot = p[:, JOINT[f"{side}_ankle"]], p[:, JOINT[f"{side}_foot"]]
    step = (foot - ankle)[_off_floor(ankle[:, 2]) < 0.5]
    ahead = float(np.median(np.linalg.norm(step[:, :2], axis=-1)))
    return np.array([max(ahead, 0.02), 0.0, float(np.median(step[:, 2]))])


def _direction(v: FloatArray) -> FloatArray:
    return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-9)


def _reaching(
    start: FloatArray, target: FloatArray, directions: tuple[FloatArray, FloatArray], lengths: tuple[float, float]
) -> tuple[FloatArray, FloatArray]:
    """(frame, 3) directions of a limb's bones, corrected so that a flexed limb ends at `target` (frame, 3) [m].

    A straight limb keeps its directions: there a millimetre of its end is a centimetre of its knee or elbow.
    """
    first, second = directions
    end = start + lengths[0] * first + lengths[1] * second
    flexion = np.arccos(np.clip(np.sum(first * second, axis=-1), -1.0, 1.0))
    share = ease((flexion - _FLEXED) / _FLEXED)[:, None]
    shift = target - end
    shift = shift * np.minimum(1.0, _REACH / np.maximum(np.linalg.norm(shift, axis=-1, keepdims=True), 1e-9))
    pole = first - second + 1e-6 * np.cross(first, _ASIDE)
    middle, _, _ = two_bone(start, end + share * shift, pole, *lengths)
    reached = share > 0.0
    first = np.where(reached, _direction(middle - start), first)
    return first, np.where(reached, _direction(end + share * shift - middle), second)


def _along(v: FloatArray, length: float, frame_rate: float) -> FloatArray:
    """(frame, 3) directions of a bone; where `v` (frame, 3) has another length than the bone, those around count."""
    trust = np.exp(-(((np.linalg.norm(v, axis=-1, keepdims=True) / length - 1.0) / _STRETCHED) ** 2))
    if len(v) < 4:
        return _direction(v)
    mean, weight = (gaussian_filter1d(x, _BRIDGED * frame_rate, axis=0, mode="nearest") for x in (trust * v, trust))
    return _direction(trust * v + (1.0 - trust) * mean / np.maximum(weight, 1e-6))


def _standing_shift(p: FloatArray, places: FloatArray) -> FloatArray:
    """(frame, 3) shift of the body that puts the ankles of standing feet where they were measured [m]."""
    total, weight = np.zeros((len(p), 3)), np.zeros((len(p), 1))
    for side in SIDES:
        ankle = JOINT[f"{side}_ankle"]
        down = 1.0 - _off_floor(p[:, ankle, 2])[:, None]
        total += down * (p[:, ankle] - places[:, ankle])
        weight += down
    return total / np.maximum(weight, 1.0)


def _aimed(parent: FloatArray, rest: FloatArray, direction: FloatArray) -> FloatArray:
    """(n, 3, 3) parent's rotation, turned by the smallest angle so that its bone `rest` points along `direction`."""
    if np.linalg.norm(rest) < 1e-6:
        return parent
    return between(parent @ normalised(rest), _direction(direction)) @ parent


def _limb(
    root: FloatArray,
    rest: tuple[FloatArray, FloatArray],
    directions: tuple[FloatArray, FloatArray],
    bend: FloatArray,
    smoothing: float,
) -> tuple[FloatArray, FloatArray]:
    """(n, 3, 3) rotations of a limb's two bones; `bend` (3,) is the bend direction at rest, `smoothing` in frames."""
    first, second = directions
    neutral = _aimed(root, rest[0], first) @ bend
    seen = first - second
    flexion = np.arccos(np.clip(np.sum(first * second, axis=-1), -1.0, 1.0))
    weight = ease(flexion / _FLEXED)[:, None]
    # position noise would spin a straight limb: average the bend direction over time, weighted by flexion
    side = weight * _direction(seen) + (1.0 - weight) * neutral
    side = gaussian_filter1d(side, smoothing, axis=0, mode="nearest") if len(side) > 3 else side
    turned = []
    for bone, direction in zip(rest, directions, strict=True):
        u0 = normalised(bone)
        frame = basis(direction, side + 1e-6 * neutral)
        turned.append(frame @ transpose(basis(u0, perpendicular(bend, u0))))
    return turned[0], turned[1]


def _foot(
    shank: FloatArray, rest: FloatArray, direction: FloatArray, height: FloatArray, side: int, smoothing: float
) -> FloatArray:
    """(n, 3, 3) rotation of a foot along `direction`, without roll against the shank, level near the floor and nowhere
    under it; `smoothing` of its heading in frames."""
    left = np.array([0.0, float(side), 0.0])
    u0, free = normalised(rest), _off_floor(height)[:, None]
    level = direction * [1.0, 1.0, 0.0]
    if len(level) > 3:
        level = gaussian_filter1d(level, smoothing, axis=0, mode="nearest")
    size = np.linalg.norm(level, axis=-1, keepdims=True)
    # a foot that points down has no heading of its own: the shank's
    heading = level + np.maximum(0.02 - size, 0.0) * (shank @ X) * [1.0, 1.0, 0.0]
    heading = normalised(heading + 1e-9 * X)
    flat = heading * np.linalg.norm(rest[:2]) + rest[2] * Z
    pitch = np.arcsin(np.clip(_direction(direction)[:, 2:], -1.0, 1.0)) - np.arcsin(u0[2])
    free = np.maximum(free, ease((np.abs(pitch) - _ROLLING[0]) / (_ROLLING[1] - _ROLLING[0])))
    if len(free) > 3:
        free = gaussian_filter1d(free, smoothing, axis=0, mode="nearest")
    along = _direction(free * _direction(direction) + (1.0 - free) * normalised(flat))
    # toes reach down to the floor, with a smooth knee of two millimetres
    length = np.linalg.norm(rest)
    toe, lowest = along[:, 2] * length, rest[2] - np.maximum(over_lowest(height), 0.0)
    sine = np.clip(0.5 * (toe + lowest + np.hypot(toe - lowest, 0.002)) / length, -0.99, 0.99)[:, None]
    along = _direction(along * [1.0, 1.0, 0.0] + 0.1 * heading) * np.sqrt(1.0 - sine**2) + sine * Z
    across = free * (shank @ left) + (1.0 - free) * side * np.cross(Z, heading)
    return basis(along, across) @ transpose(basis(u0, perpendicular(left, u0)))
