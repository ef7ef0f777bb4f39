"""Definitions of actions that a program checks: what must be true of joints and contacts."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from rfgen_sionna.generative.action_definitions import (
    arm_movements,
    changes_of_level,
    daily_actions,
    exercises,
    flights,
    hand_gestures,
    held_poses,
    losses_of_balance,
    ways_over_the_floor,
)
from rfgen_sionna.generative.action_definitions.definition import Definition, Requirement, Verdict
from rfgen_sionna.generative.action_definitions.motion_signals import MotionSignals
from rfgen_sionna.records import Motion

__all__ = ["DEFINED_ACTIONS", "Definition", "MotionSignals", "Requirement", "Verdict", "check", "is_true_of"]

DEFINED_ACTIONS: Mapping[str, Definition] = MappingProxyType(
    {
        each.action: each
        for module in (
            changes_of_level,
            losses_of_balance,
            ways_over_the_floor,
            flights,
            held_poses,
            hand_gestures,
            arm_movements,
            daily_actions,
            exercises,
        )
        for each in module.DEFINITIONS
    }
)
"""Definitions by the name of the action."""


def check(motion: Motion | MotionSignals, action: str) -> Verdict:
    """Whether a motion shows an action by its definition, and what is against it.

    Parameters
    ----------
    motion
        A motion on the floor z = 0, of any rate, body, place and heading; or its signals, to check several actions.
    action
        One of `DEFINED_ACTIONS`.

    Raises
    ------
    ValueError
        The action has no definition, or the motion has other joints or is too short.
    """
    if action not in DEFINED_ACTIONS:
        raise ValueError(f"action: {action!r} has no definition; allowed are {', '.join(sorted(DEFINED_ACTIONS))}")
    signals = motion if isinstance(motion, MotionSignals) else MotionSignals(motion)
    failed = tuple(str(each) for each in DEFINED_ACTIONS[action].requirements(signals) if not each.holds)
    return Verdict(action, not failed, failed)


def is_true_of(motion: Motion | MotionSignals, action: str) -> bool:
    """Whether a motion shows an action; see :func:`check`."""
    return check(motion, action).true
