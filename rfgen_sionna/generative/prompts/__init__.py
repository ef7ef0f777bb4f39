"""Prompts: sentences and keywords about people, animals, things and surroundings, read into values.

Names are imported at first use.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rfgen_sionna.generative.prompts.body_prompt import BodyPrompt
    from rfgen_sionna.generative.prompts.environment_prompt import EnvironmentPrompt, parse_environment
    from rfgen_sionna.generative.prompts.prompt_error import PromptError
    from rfgen_sionna.generative.prompts.prompt_reader import read_prompt
    from rfgen_sionna.generative.prompts.scene_prompt import (
        CLIP,
        DECIDED,
        DEFAULT_DISTANCE,
        ScenePrompt,
        check_seed,
    )
    from rfgen_sionna.generative.prompts.thing_prompt import ThingPrompt

_HOME = {
    "BodyPrompt": "body_prompt", "CLIP": "scene_prompt", "DECIDED": "scene_prompt", "DEFAULT_DISTANCE": "scene_prompt",
    "EnvironmentPrompt": "environment_prompt", "PromptError": "prompt_error", "ScenePrompt": "scene_prompt",
    "ThingPrompt": "thing_prompt", "check_seed": "scene_prompt", "parse_environment": "environment_prompt",
    "read_prompt": "prompt_reader",
}  # fmt: skip

__all__ = [
    "CLIP",
    "DECIDED",
    "DEFAULT_DISTANCE",
    "BodyPrompt",
    "EnvironmentPrompt",
    "PromptError",
    "ScenePrompt",
    "ThingPrompt",
    "check_seed",
    "parse_environment",
    "read_prompt",
]


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
