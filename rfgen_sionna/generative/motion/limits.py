"""Human joint limits, and anatomical joint angles of a pose."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion.rotations import Z, between, transpose
from rfgen_sionna.generative.motion.skeleton import FINGERS, JOINT, SIDES, side_sign

_AAOS = (
    "American Academy of Orthopaedic Surgeons, Joint Motion (1965), as tabulated in Norkin and White, "
    "Measurement of Joint Motion, 5th ed. (2016)"
)
_LUNGE = "weight-bearing lunge: Bennell et al., Australian Journal of Physiotherapy 44 (1998) 175"
_SQUAT = "weight-bearing: Hemmerich et al., Journal of Orthopaedic Research 24 (2006) 770, deep squats"

_Columns = dict[str, list[FloatArray]]


@dataclass(frozen=True)
class JointLimit:
    """Range of one joint angle."""

    low: float
    """[degrees]"""
    high: float
    """[degrees]"""
    source: str


LIMITS: Mapping[str, JointLimit] = MappingProxyType(
    {
        "trunk flexion": JointLimit(-25.0, 80.0, _AAOS),
        "trunk lateral flexion": JointLimit(-35.0, 35.0, _AAOS),
        "trunk rotation": JointLimit(-45.0, 45.0, _AAOS),
        "neck flexion": JointLimit(-45.0, 45.0, _AAOS),
        "neck lateral flexion": JointLimit(-45.0, 45.0, _AAOS),
        "neck rotation": JointLimit(-60.0, 60.0, _AAOS),
        "hip flexion": JointLimit(-30.0, 120.0, _AAOS),
        "hip abduction": JointLimit(-30.0, 45.0, _AAOS),
        "hip external rotation": JointLimit(-45.0, 45.0, _AAOS),
        "knee flexion": JointLimit(0.0, 150.0, _SQUAT),
        "ankle dorsiflexion": JointLimit(-50.0, 45.0, f"{_AAOS} (plantarflexion); {_LUNGE} (dorsiflexion)"),
        "ankle eversion": JointLimit(-35.0, 15.0, _AAOS),
        "ankle toe-out": JointLimit(-35.0, 35.0, "tibial and subtalar rotation together, an estimate"),
        "toe extension": JointLimit(-45.0, 70.0, _AAOS),
        "shoulder extension": JointLimit(-180.0, 60.0, _AAOS),
        "shoulder cross-body adduction": JointLimit(-180.0, 45.0, _AAOS),
        "shoulder external rotation": JointLimit(-90.0, 90.0, _AAOS + "; internal rotation as at the side of the body"),
        "elbow flexion": JointLimit(0.0, 150.0, _AAOS),
        "forearm pronation": JointLimit(-80.0, 80.0, _AAOS),
        "wrist flexion": JointLimit(-70.0, 80.0, _AAOS),
        "wrist radial deviation": JointLimit(-30.0, 20.0, _AAOS),
        "finger knuckle flexion": JointLimit(-45.0, 90.0, _AAOS),
        "finger spread": JointLimit(-25.0, 25.0, "an estimate"),
        "finger middle joint flexion": JointLimit(0.0, 100.0, _AAOS),
        "finger end joint flexion": JointLimit(0.0, 90.0, _AAOS),
    }
)
"""Angle -> range; opposite directions (extension, adduction) are negative."""


def joint_angles(rotations: FloatArray) -> dict[str, FloatArray]:
    """Anatomical angles of poses.

    Args:
        rotations: (frame, 52, 3, 3) world rotations of the joints relative to the T-pose.

    Returns:
        angle -> (frame, k) [degrees], k counts sides and fingers; keys as in `LIMITS`.
    """
    out: dict[str, list[FloatArray]] = {name: [] for name in LIMITS}

    def relative(parent: str, joint: str) -> FloatArray:
        return transpose(rotations[:, JOINT[parent]]) @ rotations[:, JOINT[joint]]

    for region, lower, upper in (("trunk", "pelvis", "spine3"), ("neck", "spine3", "head")):
        vector = np.degrees(Rotation.from_matrix(relative(lower, upper)).as_rotvec())
        for name, component in (("lateral flexion", 0), ("flexion", 1), ("rotation", 2)):
            out[f"{region} {name}"].append(vector[:, component])
    for side in SIDES:
        s = side_sign(side)
        _leg(out, relative, side, s)
        _arm(out, relative, side, s)
    return {name: np.stack(columns, axis=-1) for name, columns in out.items()}


def _leg(out: _Columns, relative: Callable[[str, str], FloatArray], side: str, s: int) -> None:
    hip = relative("pelvis", f"{side}_hip")
    thigh = -hip[..., 2]
    out["hip flexion"].append(_angle(thigh[:, 0], -thigh[:, 2]))
    out["hip abduction"].append(np.degrees(np.arcsin(np.clip(s * thigh[:, 1], -1.0, 1.0))))
    twist = transpose(between(-Z, thigh)) @ hip
    out["hip external rotation"].append(s * _angle(twist[:, 1, 0], twist[:, 0, 0]))
    knee = relative(f"{side}_hip", f"{side}_knee")
    out["knee flexion"].append(_angle(knee[:, 0, 2], knee[:, 2, 2]))
    foot = relative(f"{side}_knee", f"{side}_ankle")
    # intrinsic order: about the shank, flexion, roll
    turn, flex, roll = np.degrees(np.moveaxis(Rotation.from_matrix(foot).as_euler("ZYX"), -1, 0))
    out["ankle dorsiflexion"].append(-flex)
    out["ankle toe-out"].append(s * turn)
    out["ankle eversion"].append(s * roll)
    toe = relative(f"{side}_ankle", f"{side}_foot")
    out["toe extension"].append(_angle(toe[:, 2, 0], toe[:, 0, 0]))


def _arm(out: _Columns, relative: Callable[[str, str], FloatArray], side: str, s: int) -> None:
    shoulder = relative("spine3", f"{side}_shoulder")
    arm = s * shoulder[..., 1]
    out["shoulder extension"].append(np.degrees(np.arcsin(np.clip(-arm[:, 0], -1.0, 1.0))))
    out["shoulder cross-body adduction"].append(np.degrees(np.arcsin(np.clip(-s * arm[:, 1], -1.0, 1.0))))
    # axial rotation relative to the hanging arm swung by the smallest rotation, elbow back
    swung = between(-Z, arm)
    bend = np.einsum("nji,nj->ni", swung, -shoulder[..., 0])
    rotation = s * _angle(bend[:, 1], -bend[:, 0])
    # undefined overhead
    out["shoulder external rotation"].append(np.where(arm[:, 2] < np.cos(np.radians(45.0)), rotation, 0.0))
    elbow = relative(f"{side}_shoulder", f"{side}_elbow")
    out["elbow flexion"].append(_angle(elbow[:, 0, 1] * s, elbow[:, 1, 1]))
    wrist = relative(f"{side}_elbow", f"{side}_wrist")
    pronation, flexion, deviation = np.degrees(np.moveaxis(Rotation.from_matrix(wrist).as_euler("YXZ"), -1, 0))
    out["forearm pronation"].append(pronation)
    out["wrist flexion"].append(-s * flexion)
    out["wrist radial deviation"].append(-s * deviation)
    for finger in FINGERS:
        if finger == "thumb":
            continue
        parent = f"{side}_wrist"
        for k, name in ((1, "knuckle"), (2, "middle joint"), (3, "end joint")):
            joint = f"{side}_{finger}{k}"
            spread, flexion, _ = np.degrees(
                np.moveaxis(Rotation.from_matrix(relative(parent, joint)).as_euler("ZXY"), -1, 0)
            )
            out[f"finger {name} flexion"].append(-s * flexion)
            if k == 1:
                out["finger spread"].append(-s * spread)
            parent = joint


def _angle(sine: FloatArray, cosine: FloatArray) -> FloatArray:
    return np.degrees(np.arctan2(sine, cosine))
