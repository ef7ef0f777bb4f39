"""Kinds of things: actions, parameters, sizes, and the rules that build them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from rfgen_sionna.generative.things.articulated import ArticulatedSequence, Pose, ThingPart
from rfgen_sionna.generative.things.part_motion import Curve
from rfgen_sionna.scene.furnished.finishes import FINISHES
from rfgen_sionna.scene.furnished.piece import merge
from rfgen_sionna.scene.furnished.shapes import Part
from rfgen_sionna.scene.materials import Material, material


@dataclass(frozen=True)
class ThingParameter:
    """A number that a caller may give; the seed draws it otherwise."""

    meaning: str
    """With its unit."""
    usual: tuple[float, float]
    """Interval of the draw."""
    allowed: tuple[float, float]
    """Interval of given values."""
    words: str = ""
    """Pattern of the parameter in prompts, with the group `value`."""


@dataclass(frozen=True)
class ThingAction:
    """Something that a thing does."""

    description: str
    """Third person: "runs"."""
    words: str
    """Pattern of its words in prompts (:mod:`rfgen_sionna.generative.prompts.text_reader`)."""
    speed: float = 0.0
    """Usual speed over the ground [m/s]; 0 stays in place."""
    fastest: float = 0.0
    """Largest speed over the ground [m/s]."""
    height: float = 0.0
    """Usual height of its origin over the floor [m]."""


@dataclass(frozen=True)
class BuildRequest:
    """Choices for one thing."""

    rng: np.random.Generator
    action: str
    travelled: Curve
    """Distance along its way [m] at a time [s]."""
    values: Mapping[str, float]
    """Value of each parameter."""


@dataclass(frozen=True)
class ThingKind:
    """A kind of animal or thing. Its front is +x, z is up, the floor z = 0."""

    name: str
    description: str
    nouns: str
    """Pattern of its nouns in prompts."""
    size: str
    """Usual size, with its source."""
    actions: Mapping[str, ThingAction]
    """The first one is the default."""
    build: Callable[[BuildRequest], ArticulatedSequence]
    parameters: Mapping[str, ThingParameter] = field(default_factory=dict)
    bounces: int = 1
    """Surfaces on the paths of its return."""
    alone: str = ""
    """Action of a prompt without one; empty is "stand", else the first."""

    def values(self, given: Mapping[str, float], rng: np.random.Generator) -> dict[str, float]:
        """Value of each parameter: given, or drawn.

        Raises:
            ValueError: an unknown parameter, or a value that is not allowed.
        """
        unknown = [name for name in given if name not in self.parameters]
        if unknown:
            known = ", ".join(self.parameters) or "none"
            raise ValueError(f"{unknown[0]}: a {self.name} has no such parameter; it has {known}")
        found = {}
        for name, parameter in self.parameters.items():
            low, high = parameter.usual
            value = low + (high - low) * float(rng.random())  # drawn in any case: others stay what they are
            if name in given:
                value = given[name]
                least, most = parameter.allowed
                number = isinstance(value, (int, float, np.number)) and not isinstance(value, bool)
                if not number or not (math.isfinite(value) and least <= value <= most):
                    raise ValueError(
                        f"{name}: {value!r} for a {self.name} ({parameter.meaning}); allowed are {least:g} to {most:g}"
                    )
            found[name] = float(value)
        return found


def finish_material(finish: str) -> Material:
    """Material of a finish, with the thickness of its slab."""
    found = FINISHES[finish]
    return material(found.material) if found.thickness is None else material(found.material, thickness=found.thickness)


def painted_parts(name: str, shapes: Sequence[Part], pose: Pose | None = None) -> list[ThingPart]:
    """Parts of shapes with finishes, one for each finish: "name, finish", or "name" where there is one finish."""
    merged = merge(shapes)
    return [
        ThingPart(
            name if len(merged) == 1 else f"{name}, {shape.finish}",
            shape.points,
            shape.faces,
            finish_material(shape.finish),
            pose,
        )
        for shape in merged
    ]
