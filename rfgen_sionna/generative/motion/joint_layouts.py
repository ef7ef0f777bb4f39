"""Layouts of joint positions: names and orders of other programs, and their joints in terms of the package's."""

from __future__ import annotations

import re
from collections.abc import Sequence

from rfgen_sionna.generative.motion.clip_error import ClipError
from rfgen_sionna.generative.motion.skeleton import JOINT_NAMES, NUM_BODY_JOINTS

_KINECT = (
    "SpineBase SpineMid Neck Head ShoulderLeft ElbowLeft WristLeft HandLeft ShoulderRight ElbowRight WristRight "
    "HandRight HipLeft KneeLeft AnkleLeft FootLeft HipRight KneeRight AnkleRight FootRight SpineShoulder HandTipLeft "
    "ThumbLeft HandTipRight ThumbRight"
)
_AZURE = (
    "Pelvis SpineNavel SpineChest Neck ClavicleLeft ShoulderLeft ElbowLeft WristLeft HandLeft HandTipLeft ThumbLeft "
    "ClavicleRight ShoulderRight ElbowRight WristRight HandRight HandTipRight ThumbRight HipLeft KneeLeft AnkleLeft "
    "FootLeft HipRight KneeRight AnkleRight FootRight Head Nose EyeLeft EarLeft EyeRight EarRight"
)
_KINECT_V1 = (
    "HipCenter Spine ShoulderCenter Head ShoulderLeft ElbowLeft WristLeft HandLeft ShoulderRight ElbowRight WristRight "
    "HandRight HipLeft KneeLeft AnkleLeft FootLeft HipRight KneeRight AnkleRight FootRight"
)
_MEDIAPIPE = (
    "nose left_eye_inner left_eye left_eye_outer right_eye_inner right_eye right_eye_outer left_ear right_ear "
    "mouth_left mouth_right left_shoulder right_shoulder left_elbow right_elbow left_wrist right_wrist left_pinky "
    "right_pinky left_index right_index left_thumb right_thumb left_hip right_hip left_knee right_knee left_ankle "
    "right_ankle left_heel right_heel left_foot_index right_foot_index"
)
_COCO = (
    "nose left_eye right_eye left_ear right_ear left_shoulder right_shoulder left_elbow right_elbow left_wrist "
    "right_wrist left_hip right_hip left_knee right_knee left_ankle right_ankle"
)
_H36M = (
    "Hip RHip RKnee RFoot LHip LKnee LFoot Spine Thorax Nose HeadTop LShoulder LElbow LWrist RShoulder RElbow RWrist"
)
_BODY_25 = (
    "Nose Neck RShoulder RElbow RWrist LShoulder LElbow LWrist MidHip RHip RKnee RAnkle LHip LKnee LAnkle REye LEye "
    "REar LEar LBigToe LSmallToe LHeel RBigToe RSmallToe RHeel"
)
_SMPL = JOINT_NAMES[:NUM_BODY_JOINTS]

LAYOUTS: dict[str, tuple[str, ...]] = {
    "kinect_v2": tuple(_KINECT.split()),
    "kinect25": tuple(_KINECT.split()),
    "azure_kinect": tuple(_AZURE.split()),
    "kinect_v1": tuple(_KINECT_V1.split()),
    "mediapipe33": tuple(_MEDIAPIPE.split()),
    "smpl22": _SMPL,
    "smpl24": (*_SMPL, "left_hand", "right_hand"),
    "coco17": tuple(_COCO.split()),
    "h36m17": tuple(_H36M.split()),
    "body25": tuple(_BODY_25.split()),
}
"""Layout -> names of its joints in their order: Microsoft's Kinect SDKs (v1, v2, Azure), MediaPipe Pose, SMPL (Loper et
al. 2015), COCO, Human3.6M's 17 joints, OpenPose BODY_25."""

_LIMBS = {
    "hip": "hip upleg upperleg thigh hipjoint",
    "knee": "knee leg lowerleg lowleg shin calf",
    "ankle": "ankle",
    "foot": "foot toe toes toebase bigtoe footindex ball toe0",
    "heel": "heel",
    "collar": "collar clavicle",
    "shoulder": "shoulder arm upperarm uparm shldr",
    "elbow": "elbow forearm lowerarm lowarm",
    "wrist": "wrist",
    "hand": "hand",
    "ear": "ear",
}
_CENTRAL = {
    "pelvis": "pelvis spinebase hipcenter hipscenter midhip hip hips root centerhip",
    "spine1": "spine1",
    "spine2": "spine2 spine spinenaval",
    "spine3": "spine3 spinemid spinechest chest",
    "neck": "neck shouldercenter thorax",
    "head": "head",
    "nose": "nose",
}
_WORDS = {word: joint for joint, words in _LIMBS.items() for word in words.split()}
_CENTRAL_WORDS = {word: joint for joint, words in _CENTRAL.items() for word in words.split()}
_NEEDED = ("hip", "knee", "ankle", "shoulder", "elbow", "wrist")


def layout_names(layout: str) -> tuple[str, ...]:
    """Names of a layout's joints, in their order.

    Raises:
        ClipError: an unknown layout.
    """
    key = re.sub(r"[^a-z0-9]", "", str(layout).lower())
    found = {re.sub("_", "", name): names for name, names in LAYOUTS.items()}
    if key not in found:
        raise ClipError(f"layout: {layout!r}; allowed are {', '.join(LAYOUTS)}, or names=[...] for joints of your own")
    return found[key]


def package_joints(names: Sequence[str]) -> dict[str, int]:
    """Joint of the package (also head, nose, ears, hands and heels) -> index in `names`.

    Raises:
        ClipError: hips, knees, ankles, shoulders, elbows or wrists are missing, or a name comes twice.
    """
    split = [split_name(str(name)) for name in names]
    found: dict[str, int] = {}
    of_limbs = {(side, bare) for side, bare in split if side}
    for k, (side, bare) in enumerate(split):
        joint = _WORDS.get(bare, "") if side else _CENTRAL_WORDS.get(bare, "")
        if side and joint == "foot" and bare == "foot" and (side, "ankle") not in of_limbs:
            joint = "ankle"
        elif side and joint == "hand" and (side, "wrist") not in of_limbs:
            joint = "wrist"
        elif side and bare == "shoulder" and any((side, arm) in of_limbs for arm in ("arm", "upperarm", "uparm")):
            joint = "collar"
        if not joint:
            continue
        key = f"{side}_{joint}" if side else joint
        if key in found and names[found[key]] == names[k]:
            raise ClipError(f"names: {names[k]!r} comes twice")
        found.setdefault(key, k)
    missing = [f"{side}_{joint}" for joint in _NEEDED for side in ("left", "right") if f"{side}_{joint}" not in found]
    if missing:
        raise ClipError(
            f"names: no joint is recognised as {', '.join(missing)}; given are {', '.join(map(str, names))}. Use the "
            f"package's names, such as left_hip, or a layout ({', '.join(LAYOUTS)})"
        )
    return found


def split_name(name: str) -> tuple[str, str]:
    """Side ("left", "right" or "") and bare name, in small letters, of a joint such as LeftUpLeg, thigh.L, r_knee."""
    words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", name.split(":")[-1]).lower()
    parts = [part for part in re.split(r"[^a-z0-9]+", words) if part]
    if len(parts) > 1 and parts[0] == "c":
        return "", "".join(parts[1:])  # "C_Hips" of VRM
    for part in (*parts[:1], *parts[-1:]):
        side = {"left": "left", "l": "left", "right": "right", "r": "right"}.get(part)
        if side:
            parts.remove(part)
            return side, "".join(parts)
    bare = "".join(parts)
    for side in ("left", "right"):
        if bare.startswith(side) or bare.endswith(side):
            return side, bare.removeprefix(side).removesuffix(side)
    return "", bare
