"""Wheels that roll."""

from __future__ import annotations

import numpy as np

from rfgen_sionna.generative.things.articulated import ThingPart
from rfgen_sionna.generative.things.part_motion import Curve, Rolling, Turning
from rfgen_sionna.generative.things.thing_kind import painted_parts
from rfgen_sionna.scene.furnished.shapes import Part, block, lathe, pipe, ring


def car_wheel(radius: float, width: float, spokes: int) -> list[Part]:
    """Tyre, rim and flat spokes of a wheel about +y, its outside at +y."""
    profile = [(0.62 * radius, -width / 2), (0.93 * radius, -width / 2), (radius, -0.3 * width), (radius, 0.3 * width),
        (0.93 * radius, width / 2), (0.66 * radius, width / 2), (0.62 * radius, 0.2 * width)]  # fmt: skip
    tyre = lathe(profile, 40).of("rubber")
    well = lathe([(0.60 * radius, -0.1 * width), (0.60 * radius, 0.0), (0.58 * radius, 0.02 * width)], 40)
    hub = lathe([(0.14 * radius, 0.0), (0.14 * radius, 0.30 * width), (0.10 * radius, 0.34 * width)], 16)
    parts = [tyre, well.at(z=0.14 * width).of("dark metal"), hub.at(z=0.12 * width).of("metal")]
    for k in range(spokes):
        spoke = block(0.50 * radius, 0.13 * radius, 0.14 * width, x=0.35 * radius, z=0.2 * width)
        parts.append(spoke.turned(360.0 * k / spokes).of("metal"))
    return [part.turned(-90.0, "x") for part in parts]


def spoked_wheel(radius: float, tyre: float, spokes: int, hub_width: float = 0.06) -> list[Part]:
    """Tyre, rim and wire spokes of a wheel about +y, such as a bicycle's."""
    parts = [
        ring(radius - tyre, tyre, 48, 8).of("rubber"),
        ring(radius - 2.2 * tyre, 0.4 * tyre + 0.002, 48, 6).of("metal"),
        lathe([(0.018, -hub_width / 2), (0.018, hub_width / 2)], 12).of("metal"),
    ]
    for k in range(spokes):
        angle = 2.0 * np.pi * k / spokes
        end = (radius - 2.2 * tyre) * np.array([np.cos(angle), np.sin(angle), 0.0])
        start = np.array([0.0, 0.0, (-1) ** k * 0.4 * hub_width])
        parts.append(pipe([start, end], 0.0012 + 0.004 * (spokes < 12), 4).of("metal"))
    return [part.turned(-90.0, "x") for part in parts]


def rolling_wheel(
    name: str, shapes: list[Part], hub: tuple[float, float, float], radius: float, travelled: Curve, start: float = 0.0
) -> list[ThingPart]:
    """Parts of a wheel about y with its hub at a point [m], which rolls along +x without slipping.

    Args:
        name: name in labels.
        shapes: shapes about the origin.
        hub: centre [m].
        radius: rolling radius [m].
        travelled: distance along the way [m] at a time [s].
        start: angle at distance 0 [rad].
    """
    turning = Turning((0.0, 1.0, 0.0), hub, Rolling(travelled, radius, start))
    return painted_parts(name, [shape.at(*hub) for shape in shapes], turning)
