"""Prams and wheelchairs, which are pushed, and corner reflectors."""

# Tables of patterns and sizes read best with one entry to a line.
# ruff: noqa: E501

from __future__ import annotations

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.things.articulated import ArticulatedSequence
from rfgen_sionna.generative.things.thing_kind import (
    BuildRequest,
    ThingAction,
    ThingKind,
    ThingParameter,
    painted_parts,
)
from rfgen_sionna.generative.things.wheels import rolling_wheel, spoked_wheel
from rfgen_sionna.scene.furnished.piece import pick
from rfgen_sionna.scene.furnished.shapes import Part, block, cushion, joined, loft, pipe, ring

_PLATE = 2e-3
"""Thickness of a reflector's plates [m]."""


def _bar(*points: tuple[float, float, float], radius: float = 0.012, finish: str = "metal") -> Part:
    return pipe(points, radius, 10).of(finish)


def _pram(request: BuildRequest) -> ArticulatedSequence:
    rng, scale = request.rng, request.values["length"] / 1.0
    cloth = pick(rng, "fabric", "bedding")
    half, tub = 0.26, 0.19
    parts = [cushion((0.78, 0.36, 0.24), 0.10, 0.01, cells=8).at(0.02, 0.0, 0.68).of(cloth)]
    angle = np.linspace(0.0, 0.62 * np.pi, 10)
    outer, inner = 0.23, 0.215
    arcs = ((outer, angle), (inner, angle[::-1]))
    profile = [(0.17 + r * np.cos(a), 0.74 + r * np.sin(a)) for r, way in arcs for a in way]
    sections = np.array([[(x, y, z) for x, z in profile] for y in (-tub, tub)])
    parts.append(_oriented(sections).of(cloth))
    for side in (-1.0, 1.0):
        y = side * half
        parts += [_bar((0.36, y, 0.12), (0.0, side * 0.22, 0.50), (-0.30, y, 0.86), (-0.48, y, 1.02)),
            _bar((-0.34, y, 0.16), (0.0, side * 0.22, 0.50), (0.2, side * 0.2, 0.58))]  # fmt: skip
    parts += [_bar((-0.48, -half, 1.02), (-0.5, 0.0, 1.04), (-0.48, half, 1.02), radius=0.016, finish="rubber"),
        _bar((-0.34, -half - 0.03, 0.16), (-0.34, half + 0.03, 0.16)), _bar((0.36, -half - 0.03, 0.12), (0.36, half + 0.03, 0.12)),
        block(0.42, 0.36, 0.14, -0.02, 0.0, 0.20).of("fabric")]  # fmt: skip
    found = painted_parts("body", [part.scaled(scale, 1.0, 1.0) for part in parts])
    for end, x, radius in (("rear", -0.34, 0.16), ("front", 0.36, 0.12)):
        for name, y in (("left", half + 0.05), ("right", -half - 0.05)):
            wheel = spoked_wheel(radius, 0.016, 10)
            start = float(rng.uniform(0.0, 2.0 * np.pi))
            found += rolling_wheel(
                f"{end} {name} wheel", wheel, (scale * x, y, radius), radius, request.travelled, start
            )
    return ArticulatedSequence(found)


def _oriented(sections: FloatArray) -> Part:
    """Loft through two sections of any sense of rotation."""
    made = loft(sections)
    corners = made.points[made.faces]
    volume = np.einsum("fi,fi->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    return made if volume > 0 else loft(sections[:, ::-1])


def _wheelchair(request: BuildRequest) -> ArticulatedSequence:
    rng, seat = request.rng, request.values["seat_width"]
    half, radius, caster = 0.5 * seat, 0.305, 0.09
    parts = [
        cushion((0.43, seat, 0.06), 0.025, cells=6).at(0.03, 0.0, 0.50).of("fabric"),
        cushion((0.04, seat, 0.42), 0.018, cells=6).turned(-8.0, "y").at(-0.22, 0.0, 0.74).of("fabric"),
        _bar((-0.02, -half, 0.24), (-0.02, half, 0.47)), _bar((-0.02, half, 0.24), (-0.02, -half, 0.47)),
    ]  # fmt: skip
    for side in (-1.0, 1.0):
        y = side * (half + 0.015)
        parts += [
            _bar((-0.34, y, 0.95), (-0.22, y, 0.93), (-0.18, y, 0.47), (-0.16, y, 0.22)),
            _bar((-0.18, y, 0.47), (0.26, y, 0.47), (0.38, side * half, 0.30), (0.44, side * half, 0.14)),
            _bar((-0.16, y, 0.30), (0.26, y, 0.30), (0.26, y, 0.47)),
            _bar((0.26, y, 0.30), (0.26, y, 2.0 * caster), (0.22, y, caster), radius=0.010),
            _bar((-0.19, y, 0.68), (0.16, y, 0.68), (0.18, y, 0.47)),
            block(0.26, 0.05, 0.03, 0.0, y, 0.69).of("plastic"), block(0.15, 0.14, 0.01, 0.48, side * 0.55 * half, 0.12).of("plastic"),
            _bar((-0.34, y, 0.95), (-0.44, y, 0.95), radius=0.016, finish="rubber"),
        ]  # fmt: skip
    found = painted_parts("frame", parts)
    for name, sign in (("left", 1.0), ("right", -1.0)):
        y = sign * (half + 0.06)
        wheel = [
            *spoked_wheel(radius, 0.013, 24),
            ring(radius - 0.03, 0.009, 48, 8).turned(90.0, "x").at(y=sign * 0.035).of("dark metal"),
        ]
        found += rolling_wheel(
            f"{name} wheel", wheel, (-0.14, y, radius), radius, request.travelled, float(rng.uniform(0.0, 6.28))
        )
        small = spoked_wheel(caster, 0.014, 5, 0.03)
        found += rolling_wheel(f"{name} caster", small, (0.22, sign * (half - 0.01), caster), caster, request.travelled)
    return ArticulatedSequence(found)


def corner_reflector(edge: float) -> Part:
    """Three thin triangular plates at right angles, with inner edges of a length [m] from the apex at the origin; its
    axis of symmetry is +x."""
    plates = []
    for k in range(3):
        a, b, c = np.roll(np.eye(3), k, axis=0)  # inner edges and outward normal's opposite
        inner = edge * np.array([np.zeros(3), a, b])
        plates.append(_oriented(np.stack([inner - _PLATE * c, inner])))
    made = joined(plates)
    axis, up = np.ones(3) / np.sqrt(3.0), np.array([-1.0, -1.0, 2.0]) / np.sqrt(6.0)
    frame = np.stack([axis, np.cross(up, axis), up])  # rows: x, y, z of the turned reflector
    return Part(made.points @ frame.T, made.faces)


def _reflector(request: BuildRequest) -> ArticulatedSequence:
    return ArticulatedSequence(painted_parts("plates", [corner_reflector(request.values["edge"]).of("metal")]))


_PUSHED = (
    r"<roll>|<move>|<go|went>|<come|came>|<pass>|<approach>|<cross>|<drive|drove|driven>|(?:is )?(?:being )?pushed"
)
_REST = r"<stand|stood>(?: still)?|<wait>|<stay>|still|motionless|at rest|parked"

KINDS = (
    ThingKind(
        "pram", "pram with a hood, alone", r"(?:prams?|pushchairs?|strollers?|baby (?:carriages?|bugg(?:y|ies))|bugg(?:y|ies))",
        "0.95 to 1.05 m long, 0.6 m wide, handle at 1.04 m, typical of prams for babies",
        {"roll": ThingAction("rolls", _PUSHED, 1.1, 4.0), "stand": ThingAction("stands", _REST)},
        _pram, {"length": ThingParameter("length [m]", (0.95, 1.05), (0.7, 1.3))},
    ),
    ThingKind(
        "wheelchair", "manual wheelchair, empty", r"wheel ?chairs?",
        "seat 0.40 to 0.46 m wide and 0.5 m high, wheels of 24 inches; within ISO 7193 (1.2 x 0.7 x 1.09 m)",
        {"roll": ThingAction("rolls", _PUSHED, 1.0, 4.0), "stand": ThingAction("stands", _REST)},
        _wheelchair, {"seat_width": ThingParameter("width of the seat [m]", (0.40, 0.46), (0.3, 0.6))},
    ),
    ThingKind(
        "corner_reflector", "trihedral corner reflector of metal, without a stand",
        r"(?:(?:metal |radar |triangular )*(?:corner |trihedral |corner cube )+reflectors?|trihedrals?|(?:metal|radar) reflectors?|corner cubes?)",
        "inner edges of 0.10 m: 27 m² at 77 GHz, as 4 pi a^4 / (3 lambda^2) (Knott, Radar Cross Section, 2004)",
        {
            "stand": ThingAction("is at rest", rf"{_REST}|<hang|hung>|<mount>|placed|<face>", height=1.0),
            "move": ThingAction("moves", _PUSHED, 1.0, 60.0, 1.0),
        },
        _reflector,
        {"edge": ThingParameter("inner edge [m]", (0.10, 0.10), (0.02, 1.0), r"(?:of |with |edges? of )*(?P<value><n>) (?P<unit>cm|centimet(?:re|er)s?)(?: edges?)?")},
        bounces=3,
    ),
)  # fmt: skip
"""Things that are pushed or set up."""
