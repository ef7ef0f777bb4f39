"""Motion sources by name."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from rfgen_sionna.generative.manner import Manner
from rfgen_sionna.generative.motion import ACTIONS, KinematicSource, MotionSource, Skeleton
from rfgen_sionna.generative.performing import PerformingSource
from rfgen_sionna.generative.prompts.prompt_error import PromptError
from rfgen_sionna.generative.prompts.scene_prompt import ScenePrompt
from rfgen_sionna.records import Motion

SOURCES = ("kinematic", "diffusion", "auto")
"""Names of motion sources."""
_BY_RULES = {"walk_to_and_fro": "walk"}
"""Actions that rules do under another name."""


def motion_source(name: str) -> MotionSource:
    """Motion source of a name.

    Args:
        name: "kinematic", "diffusion", or "auto", clips of the motion library and rules.

    Raises:
        ValueError: unknown name.
        ImportError: packages of the learned model are missing.
        FileNotFoundError: its weights are missing.
    """
    if name == "auto":
        return PerformingSource()
    if name == "kinematic":
        return KinematicSource()
    if name == "diffusion":
        try:
            from rfgen_sionna.generative.diffusion.diffusion_source import DiffusionSource
        except ImportError as error:
            raise ImportError(
                f"motion 'diffusion' needs {error.name}: pip install 'rfgen-sionna[diffusion]'; 'auto' does without"
            ) from error
        source = DiffusionSource()
        _ = source.model
        return source
    raise ValueError(f"motion: {name!r}; allowed are 'kinematic', 'diffusion' and 'auto', or the path of a clip")


def check_source(said: ScenePrompt, duration: float, source: MotionSource) -> None:
    """Check that `source` can carry out an interpreted prompt for `duration` [s].

    Raises:
        PromptError: the rules of movement lack the action.
        ValueError: the duration is not positive.
    """
    if not (np.isfinite(duration) and duration > 0.0):
        raise ValueError(f"duration: {duration!r} s; allowed is more than 0")
    if not isinstance(source, KinematicSource):
        return
    action, manner = _BY_RULES.get(said.action, said.action), said.manner
    path = "straight" if action == "walk_straight" else "to_and_fro" if action == "walk" else None
    done = (
        repr(action) if action not in ACTIONS
        else f"{action!r} with the arms of {said.arms!r}" if said.arms
        else f"{action!r} with arms held {manner.arm_posture!r}" if manner.arm_posture
        else f"{action!r} with pauses" if manner.pauses
        else f"{action!r} along the path {manner.path!r}" if manner.path not in (None, path)
        else ""
    )  # fmt: skip
    if done:
        raise PromptError(
            f"motion: 'kinematic', the rules of movement alone, cannot do {done}; motion 'auto' takes captured "
            "clips, too"
        )


def performed_motion(said: ScenePrompt, duration: float, seed: int, skeleton: Skeleton, source: MotionSource) -> Motion:
    """Motion of a prompt by its source; manner and arms go to it where the prompt has more than a hand and a speed.

    Raises:
        PromptError: the source cannot do it that way.
    """
    more: dict[str, Any] = {}
    if replace(said.manner, hand=None, speed=None) != Manner():
        more["manner"] = said.manner
    if said.arms:
        more["arms"] = said.arms
    action = _BY_RULES.get(said.action, said.action) if isinstance(source, KinematicSource) else said.action
    motion = source(action, duration, seed, skeleton=skeleton, hand=said.hand, speed=said.speed or 1.0, **more)
    return replace(motion, action=said.action)
