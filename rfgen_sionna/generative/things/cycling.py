"""A bicycle with its rider: legs follow the pedals."""

# Tables of patterns and sizes read best with one entry to a line.
# ruff: noqa: E501, RUF005  (arrays are added to tuples here, not joined)

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.prompts.human_nouns import PERSON
from rfgen_sionna.generative.things.articulated import ArticulatedSequence, ThingPart
from rfgen_sionna.generative.things.generalized_cylinders import TubePath, tube
from rfgen_sionna.generative.things.part_motion import Curve, Rolling, Turning
from rfgen_sionna.generative.things.thing_kind import (
    BuildRequest,
    ThingAction,
    ThingKind,
    ThingParameter,
    painted_parts,
)
from rfgen_sionna.generative.things.wheels import rolling_wheel, spoked_wheel
from rfgen_sionna.scene.furnished.piece import pick
from rfgen_sionna.scene.furnished.shapes import Part, block, cushion, lathe, pipe
from rfgen_sionna.scene.materials import material

WHEEL = 0.34
"""Radius of a wheel [m]: 28 inches with its tyre."""
DEVELOPMENT = 5.0
"""Way of one turn of the pedals [m]: middle gear of a city bicycle."""
_CRANK, _BASE = 0.17, 1.05
_AXLE = np.array([-0.08, 0.0, 0.29])
"""Middle of the crank [m]."""
_THIGH, _SHANK, _UPPER_ARM, _FOREARM = 0.245, 0.246, 0.186, 0.146
"""Shares of the stature (Winter, Biomechanics of Human Movement, 1990)."""
_ANKLE = np.array([-0.09, 0.0, 0.10])
"""Ankle above the pedal [m]."""
JOINTS = (
    "pelvis", "chest", "neck", "head", "left_shoulder", "right_shoulder", "left_elbow", "right_elbow", "left_wrist",
    "right_wrist", "left_hip", "right_hip", "left_knee", "right_knee", "left_ankle", "right_ankle", "left_foot",
    "right_foot",
)  # fmt: skip


def middle_joint(start: FloatArray, end: FloatArray, first: float, second: float, towards: FloatArray) -> FloatArray:
    """Joint (3,) between two bones of lengths `first` and `second` [m] from `start` to `end`, bent towards a side.

    A distance beyond both lengths stretches the bones.
    """
    line = end - start
    distance = float(np.linalg.norm(line))
    stretch = max(1.0, distance / (0.999 * (first + second)))
    a, b = stretch * first, stretch * second
    along = 0.5 * (distance + (a * a - b * b) / distance)
    side = towards - (towards @ line) / distance**2 * line
    return np.asarray(start + along / distance * line + np.sqrt(a * a - along * along) * side / np.linalg.norm(side))


@dataclass(frozen=True, eq=False)
class Rider:
    """Joints of a rider over time."""

    stature: float
    """[m]"""
    crank: Curve
    """Angle of the crank [rad], turning forwards."""
    bar: FloatArray
    """Middle of the grips [m]."""

    @property
    def saddle(self) -> FloatArray:
        """(3,) place of the pelvis [m], for a leg that is nearly straight at the lowest pedal."""
        leg = 0.94 * (_THIGH + _SHANK) * self.stature
        return np.array([_AXLE[0] - 0.21, 0.0, _AXLE[2] - _CRANK + _ANKLE[2] + leg * 0.97])

    def pedal(self, t: float, side: float) -> FloatArray:
        """(3,) middle of a pedal [m]; `side` is 1 on the left."""
        angle = self.crank(t) + (np.pi if side > 0 else 0.0)
        return _AXLE + np.array([_CRANK * np.sin(angle), side * 0.12, _CRANK * np.cos(angle)])

    def __call__(self, t: float) -> FloatArray:
        h = self.stature
        pelvis = self.saddle
        lean = np.radians(40.0)
        chest = pelvis + 0.17 * h * np.array([np.sin(lean), 0.0, np.cos(lean)])
        neck = pelvis + 0.29 * h * np.array([np.sin(lean), 0.0, np.cos(lean)])
        head = neck + 0.10 * h * np.array([0.25, 0.0, 0.97])
        points: dict[str, FloatArray] = {"pelvis": pelvis, "chest": chest, "neck": neck, "head": head}
        for name, side in (("left", 1.0), ("right", -1.0)):
            across = np.array([0.0, side, 0.0])
            shoulder = neck + 0.115 * h * across - np.array([0.0, 0.0, 0.03 * h])
            wrist = self.bar + 0.25 * across
            hip = pelvis + 0.05 * h * across
            foot = self.pedal(t, side)
            ankle = foot + _ANKLE
            elbow = middle_joint(shoulder, wrist, _UPPER_ARM * h, _FOREARM * h, across + np.array([-0.2, 0.0, -0.6]))
            knee = middle_joint(hip, ankle, _THIGH * h, _SHANK * h, np.array([1.0, 0.1 * side, 0.3]))
            for part, place in (("shoulder", shoulder), ("elbow", elbow), ("wrist", wrist), ("hip", hip),
                ("knee", knee), ("ankle", ankle), ("foot", foot + np.array([0.05, 0.0, 0.035]))):  # fmt: skip
                points[f"{name}_{part}"] = place
        return np.stack([points[name] for name in JOINTS])


_TUBES: Sequence[tuple[str, Sequence[str], Sequence[float], Sequence[float] | None, str]] = (
    ("torso", ("pelvis", "chest", "neck"), (0.155, 0.165, 0.11), (0.10, 0.115, 0.075), "clothing"),
    ("head", ("neck", "head"), (0.055, 0.085), (0.055, 0.10), "skin"),
    *(
        (f"{side} {part}", tuple(f"{side}_{joint}" for joint in joints), radii, None, cover)
        for side in ("left", "right")
        for part, joints, radii, cover in (
            ("arm", ("shoulder", "elbow", "wrist"), (0.058, 0.042, 0.033), "clothing"),
            ("leg", ("hip", "knee", "ankle"), (0.088, 0.058, 0.042), "clothing"),
            ("foot", ("ankle", "foot"), (0.042, 0.036), "rubber"),
        )
    ),
)
"""(part, joints, half widths, half depths [m], material)."""


def _frame(steel: str, seat: FloatArray, bar: FloatArray) -> list[Part]:
    rear, front = np.array([-0.5 * _BASE, 0.0, WHEEL]), np.array([0.5 * _BASE, 0.0, WHEEL])
    head, post = np.array([0.37, 0.0, 0.82]), np.array([-0.25, 0.0, 0.78])
    parts = [pipe([_AXLE, post], 0.016, 10), pipe([_AXLE, head], 0.018, 10), pipe([post, head], 0.016, 10)]
    for side in (-1, 1):
        out = np.array([0.0, 0.05 * side, 0.0])
        parts += [pipe([_AXLE + 0.4 * out, rear + out], 0.009, 8), pipe([post + 0.4 * out, rear + out], 0.008, 8)]
        parts.append(pipe([head, front + out], 0.011, 8))
    parts = [part.of(steel) for part in parts]
    parts += [
        pipe([post, seat - (0.0, 0.0, 0.05)], 0.013, 8).of("metal"),
        pipe([head, bar - (0.05, 0.0, 0.0)], 0.013, 8).of("metal"),
    ]
    parts.append(cushion((0.26, 0.15, 0.06), 0.028, cells=6).at(*(seat - (0.0, 0.0, 0.03))).of("leather"))
    line = [bar + (0.0, -0.29, 0.0), bar + (-0.05, -0.2, 0.0), bar + (-0.05, 0.2, 0.0), bar + (0.0, 0.29, 0.0)]
    parts.append(pipe(line, 0.012, 8).of("metal"))
    return parts


def _bicycle(request: BuildRequest) -> ArticulatedSequence:
    rng, stature = request.rng, request.values["stature"]
    steel = pick(rng, "painted metal", "metal", "dark metal")
    phase = float(rng.uniform(0.0, 2.0 * np.pi))
    crank = Rolling(request.travelled, DEVELOPMENT / (2.0 * np.pi), phase)
    bar = np.array([0.36, 0.0, 1.02 + 0.2 * (stature - 1.75)])
    rider = Rider(stature, crank, bar)
    seat = rider.saddle - np.array([0.0, 0.0, 0.11])
    parts = painted_parts("frame", _frame(steel, seat, bar))
    for name, x in (("rear wheel", -0.5 * _BASE), ("front wheel", 0.5 * _BASE)):
        start = float(rng.uniform(0.0, 2.0 * np.pi))
        parts += rolling_wheel(name, spoked_wheel(WHEEL, 0.018, 28), (x, 0.0, WHEEL), WHEEL, request.travelled, start)
    arms = [lathe([(0.09, -0.004), (0.09, 0.004)], 24).turned(-90.0, "x").at(*_AXLE)]
    pedals = []
    for side in (-1.0, 1.0):
        end = _AXLE + (0.0, side * 0.075, -side * _CRANK)  # the left pedal is down at angle 0
        arms.append(pipe([_AXLE + (0.0, side * 0.01, 0.0), _AXLE + (0.0, side * 0.06, 0.0), end], 0.010, 8))
        name = "left pedal" if side > 0 else "right pedal"
        shape = block(0.09, 0.10, 0.025).at(0.0, 0.0, -0.0125).of("plastic")
        pedals += painted_parts(name, [shape], PedalPose(rider, side))
    parts += painted_parts("cranks", [arm.of("metal") for arm in arms], Turning((0.0, 1.0, 0.0), tuple(_AXLE), crank))
    parts += pedals
    rest = rider(0.0)
    scale = stature / 1.75
    for name, chain, wide, deep, cover in _TUBES:
        points = np.zeros((len(chain), len(JOINTS)))
        points[np.arange(len(chain)), [JOINTS.index(joint) for joint in chain]] = 1.0
        shape_ = tube(
            points, rest, [scale * w for w in wide], None if deep is None else [scale * d for d in deep],
            step=0.02, sides=28 if name == "torso" else 20,
        )  # fmt: skip
        parts.append(ThingPart(f"rider's {name}", TubePath(shape_, rider), shape_.faces, material(cover)))
    return ArticulatedSequence(parts, JOINTS, rider)


@dataclass(frozen=True, eq=False)
class PedalPose:
    """A pedal stays level on its crank."""

    rider: Rider
    side: float

    def __call__(self, t: float) -> tuple[FloatArray, FloatArray]:
        return np.eye(3), self.rider.pedal(t, self.side)


KINDS = (
    ThingKind(
        "bicycle", "bicycle with a rider who pedals",
        rf"(?:{PERSON} (?:who )?(?:is )?(?:(?P<verb><ride|rode|ridden>|<cycle>)|on)(?: on)? <a>(?:bicycle|bike)|"
        r"(?:bicycles?|bikes?|push ?bikes?)(?: with (?:a|its) rider)?|(?:bi)?cyclists?)",
        "wheels of 28 inches, wheelbase 1.05 m; rider of 1.60 to 1.88 m with Winter's proportions",
        {
            "ride": ThingAction("rides", r"<ride|rode|ridden>|<cycle>|<pedal>|<drive|drove|driven>|<move>|<go|went>|<come|came>|<pass>|<approach>|<roll>|<cross>|<head>", 4.5, 15.0),
            "stand": ThingAction("stands", r"<stand|stood>(?: still)?|<stop>|<wait>|still|motionless|at rest"),
        },
        _bicycle, {"stature": ThingParameter("height of the rider [m]", (1.60, 1.88), (1.3, 2.1))},
    ),
)  # fmt: skip
"""Cycles."""
