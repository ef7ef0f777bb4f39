"""Cars and vans whose wheels roll."""

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
from rfgen_sionna.generative.things.wheels import car_wheel, rolling_wheel
from rfgen_sionna.scene.furnished.pieces.vehicles import WHEEL_RADIUS, WHEEL_WIDTH, car_body
from rfgen_sionna.scene.furnished.shapes import Part, loft

_CORNERS = (("rear", "left"), ("rear", "right"), ("front", "left"), ("front", "right"))
_OUTSIDE = 0.05
"""Distance from the wheels of parked cars, whose rims are in their bodies, to these [m]."""


def pane(corners: FloatArray, outwards: FloatArray, finish: str, inset: float = 0.08) -> Part:
    """A thin plate before a face with corners (4, 3) [m], smaller by a share of its size, in a direction (3,)."""
    middle = corners.mean(axis=0)
    face = middle + (1.0 - 2.0 * inset) * (corners - middle)
    normal = np.cross(face[1] - face[0], face[3] - face[0])
    normal *= np.sign(normal @ outwards) / np.linalg.norm(normal)
    rings = np.stack([face + 0.008 * normal, face + 0.016 * normal])
    turning = np.cross(face[1] - face[0], face[3] - face[0]) @ normal
    return loft(rings if turning > 0 else rings[:, ::-1]).of(finish)


def _vehicle(request: BuildRequest, name: str, kind: int, size: tuple[float, float, float]) -> ArticulatedSequence:
    """A vehicle of a kind of :func:`car_body`, stretched by factors to its length, width and height."""
    shape = car_body(request.rng, kind)
    parts = list(shape.parts)
    if kind == 2:  # a van has panels where a bus has windows
        cabin = parts[1]
        low, high = cabin.points[:4], cabin.points[4:8]  # (x, y, z) of the corners, from the belt line to the roof
        parts[1] = cabin.of(parts[0].finish)
        front_low, front_high = low[np.argsort(low[:, 1])[2:]], high[np.argsort(high[:, 1])[2:]]
        quad = np.stack([*sorted(front_low, key=lambda p: p[0]), *sorted(front_high, key=lambda p: -p[0])])
        parts.append(pane(quad, np.array([0.0, 1.0, 0.3]), "window"))
        for sign in (-1.0, 1.0):
            a, b = (ends[ends[:, 0] * sign > 0] for ends in (low, high))
            (rear_low, fore_low), (rear_high, fore_high) = (sorted(each, key=lambda p: p[1]) for each in (a, b))
            door = np.stack([0.7 * fore_low + 0.3 * rear_low, fore_low, fore_high, 0.7 * fore_high + 0.3 * rear_high])
            parts.append(pane(door, np.array([sign, 0.0, 0.0]), "window"))
    along, across, up = size
    body = [part.scaled(across, along, up).turned(-90.0) for part in parts]
    found = painted_parts("body", body)
    spokes = int(request.rng.integers(5, 9))
    for (end, side), (x, y) in zip(_CORNERS, sorted(shape.hubs, key=lambda hub: (hub[1], hub[0])), strict=True):
        radius = WHEEL_RADIUS * min(up, 1.12)
        hub = (along * y, -across * x - np.sign(x) * _OUTSIDE, radius)
        wheel = car_wheel(radius, WHEEL_WIDTH, spokes)
        if side == "right":
            wheel = [part.turned(180.0) for part in wheel]
        start = float(request.rng.uniform(0.0, 2.0 * np.pi))
        found += rolling_wheel(f"{end} {side} wheel", wheel, hub, radius, request.travelled, start)
    return ArticulatedSequence(found)


def _length(request: BuildRequest, kind: int) -> float:
    """Length of the body of a kind before it is stretched [m]."""
    rng = np.random.default_rng(0)
    rng.bit_generator.state = request.rng.bit_generator.state
    points = car_body(rng, kind).parts[0].points
    return float(np.ptp(points[:, 1]))


def _car(request: BuildRequest) -> ArticulatedSequence:
    kind = int(request.rng.integers(2))
    return _vehicle(request, "car", kind, (request.values["length"] / _length(request, kind), 1.0, 1.0))


def _van(request: BuildRequest) -> ArticulatedSequence:
    along = request.values["length"] / _length(request, 2)
    return _vehicle(request, "van", 2, (along, 1.1, 1.22))


DRIVE = r"(?:<drive|drove|driven>|<move>|<go|went>|<come|came>|<pass>|<approach>|<roll>|<travel>|<cross>|<head>)"
PARK = r"(?:is )?(?:parked|parking|parks)|(?:<stand|stood>|<stay>|<wait>|<remain>|<stop>)(?: still| there)*|still|motionless|at rest"

KINDS = (
    ThingKind(
        "car", "saloon or estate car", r"(?:cars?|automobiles?|saloons?|sedans?|estate cars?|taxis?|cabs?)",
        "4.2 to 4.7 m long, 1.7 to 1.9 m wide, 1.4 to 1.5 m high, compact and middle class (segments C and D)",
        {"drive": ThingAction("drives", DRIVE, 8.0, 60.0), "stand": ThingAction("stands", PARK)},
        _car, {"length": ThingParameter("length [m]", (4.2, 4.7), (3.2, 5.4))},
    ),
    ThingKind(
        "van", "delivery van", r"(?:(?:delivery |transit |mini)?vans?|minibus(?:es)?)",
        "4.9 to 5.6 m long, 1.9 to 2.1 m wide, 2.3 to 2.4 m high, of delivery vans of 3.5 t",
        {"drive": ThingAction("drives", DRIVE, 8.0, 45.0), "stand": ThingAction("stands", PARK)},
        _van, {"length": ThingParameter("length [m]", (4.9, 5.6), (4.2, 7.0))},
    ),
)  # fmt: skip
"""Road vehicles."""
