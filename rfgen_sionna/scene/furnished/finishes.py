"""Finishes of furnished places: material, thickness of the slab, roughness of the surface.

A surface of height deviation h [m, root mean square] reflects a share exp(-(4 pi h / lambda)^2) of its energy
coherently at normal incidence (Ament, Proc. IRE 41 (1953) 142; Beckmann and Spizzichino, The Scattering of
Electromagnetic Waves from Rough Surfaces, 1963). Sionna's scattering coefficient S is the square root of the rest. The
heights below are assumptions for common finishes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.scene.materials import Material, material


@dataclass(frozen=True)
class Finish:
    """A kind of surface."""

    material: str
    """Name in :data:`~rfgen_sionna.scene.materials.MATERIALS`."""
    thickness: float | None
    """Thickness of the slab behind the surface [m]; None for a half-space."""
    roughness: float
    """Root mean square of the height [m]."""
    colour: tuple[float, float, float]
    """Red, green, blue, 0 … 1, for pictures."""


def _finish(name: str, thickness: float | None, millimetres: float, colour: tuple[float, float, float]) -> Finish:
    return Finish(name, thickness, 1e-3 * millimetres, colour)


FINISHES: Mapping[str, Finish] = MappingProxyType(
    {
        # walls, floors, ceilings
        "plaster": _finish("plasterboard", 0.0125, 0.22, (0.88, 0.85, 0.79)),
        "masonry": _finish("concrete", 0.2, 0.35, (0.78, 0.74, 0.68)),
        "brickwork": _finish("concrete", 0.24, 0.8, (0.66, 0.36, 0.28)),
        "bare concrete": _finish("concrete", 0.2, 0.3, (0.62, 0.62, 0.61)),
        "ceiling": _finish("ceiling_board", None, 0.4, (0.95, 0.95, 0.94)),
        "floorboards": _finish("floorboard", 0.02, 0.12, (0.62, 0.44, 0.28)),
        "linoleum": _finish("plastic", None, 0.10, (0.55, 0.58, 0.56)),
        "tiles": _finish("concrete", None, 0.08, (0.80, 0.80, 0.78)),
        "carpet": _finish("clothing", None, 1.2, (0.45, 0.42, 0.50)),
        "rug": _finish("clothing", 0.01, 1.0, (0.62, 0.25, 0.22)),
        # furniture
        "wood": _finish("wood", 0.03, 0.12, (0.50, 0.32, 0.18)),
        "pale wood": _finish("wood", 0.03, 0.12, (0.80, 0.66, 0.46)),
        "painted wood": _finish("wood", 0.04, 0.10, (0.90, 0.89, 0.85)),
        "board": _finish("chipboard", 0.018, 0.10, (0.82, 0.80, 0.76)),
        "paper": _finish("wood", 0.03, 0.35, (0.60, 0.28, 0.22)),
        "fabric": _finish("clothing", None, 0.6, (0.35, 0.42, 0.52)),
        "bedding": _finish("clothing", None, 0.9, (0.92, 0.92, 0.95)),
        "curtain": _finish("clothing", 0.002, 0.4, (0.72, 0.62, 0.48)),
        "leather": _finish("leather", None, 0.2, (0.30, 0.18, 0.12)),
        "plastic": _finish("plastic", 0.003, 0.06, (0.16, 0.16, 0.17)),
        "white plastic": _finish("plastic", 0.003, 0.06, (0.88, 0.88, 0.86)),
        "bright plastic": _finish("plastic", 0.004, 0.10, (0.90, 0.45, 0.12)),
        "screen": _finish("glass", 0.003, 0.03, (0.04, 0.04, 0.06)),
        "window": _finish("glass", 0.006, 0.02, (0.65, 0.80, 0.90)),
        "ceramic": _finish("glass", 0.01, 0.05, (0.93, 0.93, 0.92)),
        "blackboard": _finish("metal", 0.002, 0.08, (0.10, 0.24, 0.18)),
        "metal": _finish("metal", 0.002, 0.05, (0.62, 0.63, 0.65)),
        "dark metal": _finish("metal", 0.002, 0.06, (0.22, 0.22, 0.24)),
        "painted metal": _finish("metal", 0.002, 0.06, (0.70, 0.12, 0.10)),
        "car paint": _finish("metal", 0.001, 0.05, (0.15, 0.28, 0.55)),
        "rubber": _finish("rubber", None, 0.35, (0.08, 0.08, 0.08)),
        "cardboard": _finish("wood", 0.005, 0.25, (0.72, 0.56, 0.36)),
        # simplified places
        "plain concrete": _finish("concrete", None, 0.2, (0.7, 0.7, 0.7)),
        "plain wood": _finish("wood", None, 0.2, (0.6, 0.5, 0.4)),
        # outdoors
        "asphalt": _finish("asphalt_concrete", None, 0.8, (0.28, 0.28, 0.29)),
        "paving": _finish("concrete", None, 0.6, (0.66, 0.64, 0.60)),
        "soil": _finish("soil", None, 3.0, (0.42, 0.32, 0.22)),
        "sand": _finish("soil", None, 1.0, (0.86, 0.76, 0.55)),
        "grass": _finish("vegetation", None, 5.0, (0.36, 0.52, 0.22)),
        "leaf": _finish("vegetation", 0.0005, 0.5, (0.22, 0.46, 0.18)),
        "bark": _finish("wood", None, 2.0, (0.34, 0.26, 0.18)),
        "stone": _finish("concrete", None, 1.5, (0.55, 0.54, 0.52)),
        "rendered wall": _finish("concrete", 0.24, 0.7, (0.84, 0.76, 0.62)),
        "roof tiles": _finish("concrete", 0.02, 0.8, (0.58, 0.26, 0.20)),
    }
)
"""All finishes by name."""


def scattering_coefficient(roughness: float, frequency: float) -> float:
    """Sionna's S at normal incidence, from the height [m, root mean square] and the frequency [Hz]."""
    return float(np.sqrt(-np.expm1(-((4 * np.pi * roughness * frequency / SPEED_OF_LIGHT) ** 2))))


def surface_material(finish: str, frequency: float) -> Material:
    """Material of a finish, with its thickness and its scattering coefficient at `frequency` [Hz]."""
    found = FINISHES[finish]
    return replace(
        material(found.material),
        thickness=found.thickness,
        scattering_coefficient=scattering_coefficient(found.roughness, frequency),
    )
