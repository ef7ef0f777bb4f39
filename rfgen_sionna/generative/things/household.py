"""Doors, curtains and robot vacuums."""

# Tables of patterns and sizes read best with one entry to a line.
# ruff: noqa: E501

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import j0, jn_zeros

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.things.articulated import ArticulatedSequence, ThingPart
from rfgen_sionna.generative.things.part_motion import Steady, Swing, Turning
from rfgen_sionna.generative.things.thing_kind import (
    BuildRequest,
    ThingAction,
    ThingKind,
    ThingParameter,
    finish_material,
    painted_parts,
)
from rfgen_sionna.generative.things.wheels import rolling_wheel
from rfgen_sionna.scene.furnished.shapes import box, cushion, lathe, loft, pipe

_GRAVITY = 9.81
"""[m/s²]"""
_FOLD_POINTS, _ROWS = 12, 28
"""Points of a fold, rows of a curtain."""
_CLOTH = 2e-3
"""Thickness of a curtain's mesh [m]."""


def _door(request: BuildRequest) -> ArticulatedSequence:
    values = request.values
    width, height, thick = values["width"], values["height"], 0.04
    side = 1.0 if request.rng.random() < 0.5 else -1.0  # side of the hinges, from the front
    opened = np.radians(values["angle_deg"])
    first, last = {"open": (0.0, opened), "close": (opened, 0.0), "stand": (0.0, 0.0)}[request.action]
    half = 0.5 * width
    leaf = [
        box((-thick, -half, 0.005), (0.0, half, height)).of("painted wood"),
        lathe([(0.010, 0.0), (0.010, 0.12)], 12).turned(-90.0 * side, "x").at(0.05, -side * (half - 0.05), 1.05).of("metal"),
        lathe([(0.010, 0.0), (0.010, 0.045)], 12).turned(90.0, "y").at(0.0, -side * (half - 0.06), 1.05).of("metal"),
    ]  # fmt: skip
    frame = [
        *(box((-0.09, s * (half + 0.005) - 0.06 * (s < 0), 0.0), (0.0, s * (half + 0.005) + 0.06 * (s > 0), height + 0.065))
            for s in (-1, 1)),
        box((-0.09, -half - 0.005, height + 0.005), (0.0, half + 0.005, height + 0.065)),
    ]  # fmt: skip
    angle = Swing(side * first, side * last, values["start"], values["seconds"])
    swing = Turning((0.0, 0.0, 1.0), (0.0, side * half, 0.0), angle)
    return ArticulatedSequence(
        painted_parts("frame", [part.of("painted wood") for part in frame]) + painted_parts("leaf", leaf, swing)
    )


@dataclass(frozen=True, eq=False)
class SwayingCloth:
    """A curtain that swings as a hanging chain does, in its first mode, with waves along its width.

    Deflections follow J0(2.405 sqrt(s / length)) of the height s over the lower hem, and the period is
    2 pi / 1.2024 sqrt(length / g) (D. Bernoulli 1732; Lamb, Higher Mechanics, 1920, § 85).
    """

    rest: FloatArray
    """(vertex, 3) positions at rest [m]."""
    length: float
    """From the rail to the hem [m]."""
    amplitude: float
    """Root mean square of the deflection of the hem [m]."""
    phases: FloatArray
    """(wave,) [rad]."""
    widths: FloatArray
    """(wave,) wave numbers along the width [rad/m]."""

    def __call__(self, t: float) -> FloatArray:
        zero = float(jn_zeros(0, 1)[0])
        share = np.clip(self.rest[:, 2] / self.length, 0.0, 1.0)
        mode = j0(zero * np.sqrt(share))
        rate = 0.5 * zero * np.sqrt(_GRAVITY / self.length) * (1.0 + 0.07 * np.arange(len(self.phases)))
        waves = np.sin(rate * t + self.phases + self.widths * self.rest[:, 1:2]).sum(axis=1)
        found = self.rest.copy()
        found[:, 0] += self.amplitude * np.sqrt(2.0 / len(self.phases)) * mode * waves
        return found


def _curtain(request: BuildRequest) -> ArticulatedSequence:
    values, rng = request.values, request.rng
    width, length = values["width"], values["length"]
    folds = max(2, round(width / 0.14))
    y = np.linspace(-0.5 * width, 0.5 * width, folds * _FOLD_POINTS + 1)
    z = np.linspace(0.02, length, _ROWS)
    depth = 0.03 * (1.0 + 0.25 * np.sin(np.linspace(0.0, 2.0 * np.pi, len(y)) + rng.uniform(0.0, 6.28)))
    fold = depth * np.sin(2.0 * np.pi * folds * (y / width + 0.5))
    tangent = np.gradient(fold, y)
    normal = np.stack([np.ones_like(y), -tangent], 1) / np.sqrt(1.0 + tangent**2)[:, None]  # (x, y)
    line = np.stack([fold, y], 1)
    outline = np.concatenate([line + 0.5 * _CLOTH * normal, (line - 0.5 * _CLOTH * normal)[::-1]])
    rings = [np.column_stack([outline, np.full(len(outline), level)]) for level in z]
    cloth = loft(np.stack(rings))
    amplitude = values["sway"] if request.action == "sway" else 0.0
    sway = SwayingCloth(cloth.points, length, amplitude, rng.uniform(0.0, 6.28, 3), rng.uniform(-2.0, 2.0, 3))
    rail = pipe([(0.0, -0.5 * width - 0.1, length + 0.02), (0.0, 0.5 * width + 0.1, length + 0.02)], 0.012, 12)
    return ArticulatedSequence(
        [ThingPart("cloth", sway, cloth.faces, finish_material("curtain")), *painted_parts("rail", [rail.of("metal")])]
    )


def _robot_vacuum(request: BuildRequest) -> ArticulatedSequence:
    radius, height = 0.5 * request.values["diameter"], request.values["height"]
    profile = [(radius - 0.02, 0.012), (radius, 0.03), (radius, height - 0.012), (radius - 0.012, height)]
    body = [
        lathe(profile, 64).of("plastic"),
        lathe([(0.045, 0.0), (0.045, 0.018)], 32).at(-0.05, 0.0, height).of("plastic"),
    ]
    parts = painted_parts("body", body)
    for side, y in (("left", 0.62 * radius), ("right", -0.62 * radius)):
        wheel = [lathe([(0.033, -0.012), (0.033, 0.012)], 24).turned(-90.0, "x").of("rubber")]
        parts += rolling_wheel(f"{side} wheel", wheel, (0.0, y, 0.033), 0.033, request.travelled)
    place = (0.75 * radius, -0.55 * radius, 0.01)
    bristles = [
        pipe([(0.008, 0.0, 0.0), (0.085, 0.0, -0.006)], 0.002, 6).turned(120.0 * k).at(*place).of("plastic") for k in range(3)
    ]  # fmt: skip
    turns = request.values["brush_turns_per_second"] * (request.action == "drive")
    brush = Turning((0.0, 0.0, 1.0), place, Steady(2.0 * np.pi * turns))
    bumper = cushion((0.02, 1.2 * radius, 0.05), 0.008).at(radius - 0.018, 0.0, 0.5 * height)
    return ArticulatedSequence(
        [*parts, *painted_parts("bumper", [bumper.of("white plastic")]), *painted_parts("side brush", bristles, brush)]
    )


KINDS = (
    ThingKind(
        "robot_vacuum", "robot vacuum cleaner with a side brush",
        r"(?:robot(?:ic)? (?:vacuum(?: cleaner)?s?|cleaners?|hoovers?)|vacuum(?: cleaning)? robots?|roombas?|cleaning robots?)",
        "0.33 to 0.35 m wide, 0.09 to 0.10 m high, as of iRobot's Roomba",
        {
            "drive": ThingAction("drives", r"<drive|drove|driven>|<move>|<go|went>|<clean>(?: (?:up )?<a>floor)?|<vacuum>(?: <a>floor)?|<come|came>|<roll>|<approach>|<cross>|<pass>", 0.3, 0.6),
            "stand": ThingAction("stands", r"<stand|stood>(?: still)?|<charge>|still|motionless|at rest|<stop>"),
        },
        _robot_vacuum,
        {
            "diameter": ThingParameter("diameter [m]", (0.33, 0.35), (0.2, 0.5)),
            "height": ThingParameter("height [m]", (0.09, 0.10), (0.06, 0.15)),
            "brush_turns_per_second": ThingParameter("turns of the side brush a second", (2.0, 3.0), (0.0, 20.0)),
        },
    ),
    ThingKind(
        "door", "door leaf on hinges in its frame", r"doors?", "leaf of 0.86 x 1.985 m: DIN 18101",
        {
            "open": ThingAction("opens", r"<swing|swung> open|<open>|(?:is )?(?:being )?opened"),
            "close": ThingAction("closes", r"<swing|swung> (?:shut|closed)|<close>|<shut|shutting>|<slam>"),
            "stand": ThingAction("stays shut", r"(?:<stay>|<remain>)(?: (?:shut|closed|still))?|(?:is )?(?:closed|shut)|still|motionless|at rest"),
        },
        _door,
        {
            "angle_deg": ThingParameter("angle [degrees]", (80.0, 95.0), (1.0, 180.0), r"(?:by |to |an angle of )*(?P<value><n>) degrees?"),
            "seconds": ThingParameter("time of the swing [s]", (1.5, 2.5), (0.2, 60.0), r"(?:in|within|over|for|takes) (?P<value><n>) (?:seconds?|s)"),
            "start": ThingParameter("time before it moves [s]", (0.2, 0.4), (0.0, 60.0), r"after (?P<value><n>) (?:seconds?|s)"),
            "width": ThingParameter("width of the leaf [m]", (0.86, 0.86), (0.5, 1.4)),
            "height": ThingParameter("height of the leaf [m]", (1.985, 1.985), (1.0, 3.0)),
        },
    ),
    ThingKind(
        "curtain", "curtain in folds that sways in a draught", r"(?:curtains?|drapes?)",
        "1.2 to 1.6 m wide in folds of 14 cm, 2.2 to 2.4 m long, typical of rooms",
        {
            "sway": ThingAction("sways", r"<sway>|<move>|<swing|swung>|<wave>|<flutter>|<billow>|<blow|blew|blown>|<flap>"),
            "stand": ThingAction("hangs still", r"<hang|hung>(?: still)?|still|motionless|at rest"),
        },
        _curtain,
        {
            "sway": ThingParameter("root mean square of the hem's deflection [m]", (0.04, 0.08), (0.0, 0.4)),
            "width": ThingParameter("width [m]", (1.2, 1.6), (0.3, 6.0)),
            "length": ThingParameter("length [m]", (2.2, 2.4), (0.5, 5.0)),
        },
    ),
)  # fmt: skip
"""Things of the household."""
