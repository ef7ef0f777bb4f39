"""Drones and fans: twisted blades that turn."""

# Tables of patterns and sizes read best with one entry to a line.
# ruff: noqa: E501

from __future__ import annotations

import numpy as np

from rfgen_sionna.generative.things.articulated import ArticulatedSequence
from rfgen_sionna.generative.things.part_motion import Drifting, Steady, Turning
from rfgen_sionna.generative.things.thing_kind import (
    BuildRequest,
    ThingAction,
    ThingKind,
    ThingParameter,
    painted_parts,
)
from rfgen_sionna.scene.furnished.shapes import Part, ball, block, cushion, joined, lathe, loft, mirrored, pipe, ring

_SECTIONS = 9
"""Sections of a blade."""
TURNS = r"(?:at |with )?(?P<value><n>) (?P<unit>turns?|times|revolutions?|rotations?|rpm|revs?|hz|hertz)(?: (?:(?:a|per|each|every) )?(?P<per>second|s|minute|min))?"


def blade(
    radius: float, hub: float, chords: tuple[float, float, float], pitch: float, thickness: float = 1.5e-3
) -> Part:
    """A twisted thin plate along +x that turns about +z, counter-clockwise, and pushes air down.

    Args:
        radius, hub: distances of tip and root from the axis [m].
        chords: chord at the root, in the middle and at the tip [m].
        pitch: advance in one turn without slip [m]: the plate is tilted by atan(pitch / (2 pi r)).
        thickness: thickness of the plate [m].
    """
    r = np.linspace(hub, radius, _SECTIONS)
    chord = np.interp(r, [hub, 0.5 * (hub + radius), radius], chords)
    tilt = np.arctan2(pitch, 2.0 * np.pi * r)
    along = np.stack([np.zeros_like(r), np.cos(tilt), np.sin(tilt)], -1)
    normal = np.stack([np.zeros_like(r), -np.sin(tilt), np.cos(tilt)], -1)
    centre = np.stack([r, 0.0 * r, 0.0 * r], -1)
    rim = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]
    return loft(np.stack([centre + u * chord[:, None] * along + v * thickness * normal for u, v in rim], axis=1))


def rotor(radius: float, blades: int, hub: float, chords: tuple[float, float, float], pitch: float) -> Part:
    """Blades of :func:`blade` around a hub."""
    one = blade(radius, hub, chords, pitch)
    parts = [one.turned(360.0 * k / blades) for k in range(blades)]
    return joined([*parts, lathe([(1.4 * hub, -0.006), (1.4 * hub, 0.006)], 16)])


def _drone(request: BuildRequest) -> ArticulatedSequence:
    values, rng = request.values, request.rng
    arm, radius = 0.5 * values["diagonal"], 0.5 * values["rotor_diameter"]
    blades = round(values["blades"])
    drift = Drifting(
        0.5 * values["drift"], 2.0 * np.pi * rng.uniform(0.1, 0.6, (2, 3)), rng.uniform(0.0, 2.0 * np.pi, (2, 3))
    )
    places = [(s * arm * np.sqrt(0.5), c * arm * np.sqrt(0.5)) for s, c in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
    shell = [cushion((1.0 * arm, 0.5 * arm, 0.36 * arm), 0.12 * arm, 0.01, cells=6).of("white plastic")]
    shell += [pipe([(0.0, 0.0, 0.0), (x, y, 0.03)], 0.012, 10).of("white plastic") for x, y in places]
    shell += [lathe([(0.014, 0.0), (0.014, 0.034)], 16).at(x, y, 0.022).of("metal") for x, y in places]
    shell.append(ball(0.028, 5).at(0.45 * arm, 0.0, -0.21 * arm).of("plastic"))
    for side in (-1, 1):
        y = side * 0.35 * arm
        line = [(0.3 * arm, y, -0.1 * arm), (0.25 * arm, 1.3 * y, -0.7 * arm), (-0.25 * arm, 1.3 * y, -0.7 * arm),
            (-0.3 * arm, y, -0.1 * arm)]  # fmt: skip
        shell.append(pipe(line, 0.005, 8).of("plastic"))
    parts = painted_parts("body", shell, drift)
    for k, (x, y) in enumerate(places):
        sense = (1.0, -1.0, 1.0, -1.0)[k]
        turns = values["turns_per_second"] * (1.0 + 0.015 * float(rng.uniform(-1.0, 1.0)))
        shape = rotor(radius, blades, 0.012, (0.016, 0.13 * radius * 2, 0.011), 0.53 * radius * 2)
        shape = (shape if sense > 0 else mirrored(shape)).turned(float(rng.uniform(0.0, 360.0))).at(x, y, 0.064)
        angle = Steady(2.0 * np.pi * sense * turns)
        parts += painted_parts(
            f"rotor {k + 1}", [shape.of("plastic")], Turning((0.0, 0.0, 1.0), (x, y, 0.0), angle, drift)
        )
    return ArticulatedSequence(parts)


def _fan(request: BuildRequest) -> ArticulatedSequence:
    values, rng = request.values, request.rng
    radius, height = 0.5 * values["diameter"], values["height"]
    blades = round(values["blades"])
    shape = rotor(radius, blades, 0.03, (0.06, 0.17, 0.13), 0.24)
    shape = shape.turned(float(rng.uniform(0.0, 360.0))).turned(90.0, "y").at(0.05, 0.0, height)
    turns = values["turns_per_second"] if request.action == "turn" else 0.0
    stand = [
        lathe([(0.18, 0.0), (0.18, 0.02), (0.05, 0.04)], 32).of("white plastic"),
        lathe([(0.014, 0.03), (0.014, height - 0.07)], 16).of("metal"),
        lathe([(0.05, -0.14), (0.06, -0.1), (0.055, -0.01)], 24).turned(90.0, "y").at(0.0, 0.0, height).of("white plastic"),
        block(0.07, 0.05, 0.06, -0.06, 0.0, height - 0.09).of("white plastic"),
    ]  # fmt: skip
    cage = []
    for x, size in ((0.0, radius + 0.02), (0.1, radius + 0.02), (0.12, 0.55 * radius)):
        cage.append(ring(size, 0.003, 40, 5).turned(90.0, "y").at(x, 0.0, height).of("metal"))
    for angle in 2.0 * np.pi * np.arange(16) / 16:
        way = np.array([0.0, np.cos(angle), np.sin(angle)])
        line = [(0.12, 0.0, height) + 0.03 * way, (0.12, 0.0, height) + 0.55 * radius * way,
            (0.1, 0.0, height) + (radius + 0.02) * way, (0.0, 0.0, height) + (radius + 0.02) * way]  # fmt: skip
        cage.append(pipe(line, 0.0012, 4).of("metal"))
    parts = painted_parts("stand", stand) + painted_parts("cage", cage)
    spin = Turning((1.0, 0.0, 0.0), (0.0, 0.0, height), Steady(2.0 * np.pi * turns))
    return ArticulatedSequence([*parts, *painted_parts("blades", [shape.of("plastic")], spin)])


_STOPPED = r"(?:is )?(?:switched |turned )?off|<stand|stood>(?: still)?|still|motionless|at rest"

KINDS = (
    ThingKind(
        "drone", "quadcopter with turning rotors", r"(?:drones?|quad ?copters?|quad ?rotors?|multi ?copters?|uavs?)",
        "0.35 m between motors across, rotors of 0.24 m: as of a DJI Phantom 4 (350 mm, 9450 propellers)",
        {
            "hover": ThingAction("hovers", r"<hover>|<float>|(?:<stay>|<hang|hung>)(?: still)?(?: in (?:the )?air)?", height=1.5),
            "fly": ThingAction("flies", r"<fly|flew|flown>|<move>|<come|came>|<go|went>|<pass>|<approach>", 3.0, 25.0, 1.5),
        },
        _drone,
        {
            "turns_per_second": ThingParameter("turns of a rotor a second", (80.0, 95.0), (0.0, 400.0), TURNS),
            "diagonal": ThingParameter("distance of opposite motors [m]", (0.34, 0.38), (0.08, 1.5)),
            "rotor_diameter": ThingParameter("diameter of a rotor [m]", (0.235, 0.245), (0.03, 0.8)),
            "blades": ThingParameter("blades of a rotor", (2.0, 2.0), (2.0, 6.0), r"(?P<value><n>) blades?"),
            "drift": ThingParameter("drift in hover, root mean square along an axis [m]", (0.01, 0.03), (0.0, 0.5)),
        },
    ),
    ThingKind(
        "fan", "pedestal fan", r"(?:(?:pedestal |electric |standing |stand |table )?fans?|ventilators?)",
        "blades of 0.38 to 0.42 m (sold as 40 cm or 16 inches), hub at 0.9 to 1.2 m",
        {
            "turn": ThingAction("turns", r"<turn>|<rotate>|<spin|spun>|<run|ran>|<blow|blew|blown>|(?:is )?on|<whirl>"),
            "stand": ThingAction("stands still", _STOPPED),
        },
        _fan,
        {
            "turns_per_second": ThingParameter("turns of the blades a second", (16.0, 22.0), (0.0, 60.0), TURNS),
            "diameter": ThingParameter("diameter of the blades [m]", (0.38, 0.42), (0.1, 1.6)),
            "blades": ThingParameter("blades", (3.0, 5.0), (2.0, 9.0), r"(?P<value><n>) blades?"),
            "height": ThingParameter("height of the hub [m]", (0.9, 1.2), (0.2, 2.5)),
        },
        alone="turn",
    ),
)  # fmt: skip
"""Things with rotors."""
