"""Actors from prompts: language, motion, bodies, surroundings.

Names are imported at first use, anny (torch) with the first body.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rfgen_sionna.generative.action_definitions import DEFINED_ACTIONS, check, is_true_of
    from rfgen_sionna.generative.actor import Actor
    from rfgen_sionna.generative.bodies import Phenotype
    from rfgen_sionna.generative.manner import Manner
    from rfgen_sionna.generative.motion import ACTIONS, KinematicSource, MotionSource
    from rfgen_sionna.generative.motion_library import MotionLibrary
    from rfgen_sionna.generative.performing import PerformingSource, perform, performable
    from rfgen_sionna.generative.prompts import parse_environment, read_prompt

_HOME = {
    "DEFINED_ACTIONS": "action_definitions", "check": "action_definitions", "is_true_of": "action_definitions",
    "ACTIONS": "motion", "Actor": "actor", "KinematicSource": "motion", "MotionLibrary": "motion_library",
    "Manner": "manner", "MotionSource": "motion", "perform": "performing", "performable": "performing",
    "PerformingSource": "performing", "Phenotype": "bodies", "parse_environment": "prompts", "read_prompt": "prompts",
}  # fmt: skip

__all__ = [
    "ACTIONS",
    "DEFINED_ACTIONS",
    "Actor",
    "KinematicSource",
    "Manner",
    "MotionLibrary",
    "MotionSource",
    "PerformingSource",
    "Phenotype",
    "check",
    "is_true_of",
    "parse_environment",
    "perform",
    "performable",
    "read_prompt",
]


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
