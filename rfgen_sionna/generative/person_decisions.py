"""Decisions about people: those of their prompt, with the attributes of their bodies."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rfgen_sionna.generative.bodies import Phenotype, Rig, VitalSigns
from rfgen_sionna.generative.decisions import DEFAULT, Decision, argument, drawn
from rfgen_sionna.generative.motion import MotionSource
from rfgen_sionna.generative.prompts import ScenePrompt
from rfgen_sionna.generative.prompts.prompt_error import PromptError
from rfgen_sionna.records import Motion


def prompt_decisions(said: ScenePrompt, seed: int, person: Phenotype, given: Mapping[str, Any]) -> list[Decision]:
    """Decisions of the prompt, with the arguments that replace them and the attributes of the body `person`."""
    found = []
    for decision in said.decisions():
        name = decision.name
        if name in ("distance", "azimuth") and given["position"] is not None:
            continue
        if name == "orientation" and given["orientation"] is not None:
            decision = triple_decision(name, given[name], "rad")
        elif name in _TRAITS:
            value = getattr(person, name)
            origin = said.origins.get(name, drawn(seed))
            body = given["body"]
            if isinstance(body, Rig) or (body is not None and getattr(body, name) is not None):
                origin = argument("body")
            elif body is not None:
                origin = drawn(seed)
            decision = Decision(name, "unknown" if value is None else _TRAITS[name](value), origin)
        found.append(decision)
    if given["position"] is not None:
        found.append(triple_decision("position", given["position"], "m"))
    return found


def vital_signs_of(said: ScenePrompt, seed: int) -> VitalSigns | None:
    """Vital signs that a prompt gives; of rates that it leaves open, those of a resting adult."""
    if said.breathing_rate is None and said.heart_rate is None:
        return None
    given = {"breathing_rate": said.breathing_rate, "heart_rate": said.heart_rate}
    try:
        return VitalSigns(**{name: value for name, value in given.items() if value is not None}, seed=seed)
    except ValueError as error:
        raise PromptError(f"prompt: {error}") from error


def triple_decision(name: str, values: ArrayLike, unit: str, origin: str | None = None) -> Decision:
    """Decision of three numbers, by default of an argument."""
    return Decision(name, f"({', '.join(f'{x:g}' for x in np.ravel(values))}) {unit}", origin or argument(name))


def motion_decision(source: MotionSource, motion: Motion) -> Decision:
    """Decision of the source of a person's motion, with the clips that it is made of."""
    name = {"KinematicSource": "kinematic", "DiffusionSource": "diffusion", "PerformingSource": "auto"}.get(
        type(source).__name__, "given"
    )
    strength = getattr(source, "strength", None)
    shown = name if strength is None else f"{name}, strength {strength:g}"
    made = f", clips {', '.join(motion.clips)}" if motion.clips else ", rules" if name == "auto" else ""
    usual = name == "auto" and strength is None
    origin = DEFAULT if usual else argument("source" if name in ("given", "auto") else "motion")
    return Decision("motion", shown + made, origin)


def material_decision(material: str) -> Decision:
    """Decision of the material of a person."""
    return Decision("material", material, DEFAULT if material == "skin" else argument("material"))


def _gender(value: float) -> str:
    return {0.0: "male", 1.0: "female"}.get(value, f"{value:.2f} from male to female")


_TRAITS: Mapping[str, Callable[[Any], str]] = {
    "gender": _gender,
    "age": lambda value: f"{value:.0f} years",
    "height": lambda value: f"{value:.2f} m",
    "weight": lambda value: f"{value:.0f} kg",
    "muscle": lambda value: f"{value:.2f} (0 to 1)",
}
