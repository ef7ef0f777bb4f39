"""What the motion library can perform: the windows of its clips that show an action, and how an action goes on."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType

from rfgen_sionna.generative.motion_library import FOLDER

WINDOWS = "windows.json"
"""Name of the index beside the clips."""


@dataclass(frozen=True)
class Window:
    """The shortest part of a clip that shows an action."""

    clip: str
    start: int
    """First frame."""
    stop: int
    """Frame after the last one."""
    mirror: bool | None
    """Whether the mirror image shows it (True), the clip itself (False), or both (None)."""
    first: int
    """First frame of the longest part about it that shows the action, too."""
    last: int
    """Frame after the last one of that part."""
    side: str
    """Side whose hand or foot moves more, or "both"."""
    speed: float
    """Mean speed of the clip over the floor [m/s]."""


@cache
def windows(folder: Path = FOLDER) -> dict[str, tuple[Window, ...]]:
    """Windows of each action that clips show.

    Raises:
        FileNotFoundError: the library of the folder has no index.
    """
    path = folder / WINDOWS
    if not path.exists():
        raise FileNotFoundError(f"'{path}' is missing: python -m training.motion.library_windows writes it")
    stored = json.loads(path.read_text(encoding="utf-8"))
    return {action: tuple(Window(*row) for row in rows) for action, rows in stored.items()}


ONCE = frozenset(
    {
        "sit_down", "stand_up", "lie_down", "get_up", "fall", "fall_forward", "fall_backward", "fall_sideways",
        "fall_from_chair", "faint", "slip", "sit_down_heavily", "turn_around", "climb_stairs",
        "climb_ladder", "put_down",
    }
)  # fmt: skip
"""Actions that are done once: the person then stays as the action ends."""
WAYS = frozenset(
    {
        "walk", "walk_straight", "walk_to_and_fro", "walk_in_a_circle", "walk_turn", "walk_backwards", "run",
        "run_backwards", "sidestep", "skip", "sneak", "carry", "crawl", "limp", "march",
    }
)  # fmt: skip
"""Actions that lead over the floor."""
OWN_PATHS: Mapping[str, str] = MappingProxyType(
    {"walk_straight": "straight", "walk_to_and_fro": "to_and_fro", "walk_in_a_circle": "circle"}
)
"""Action -> kind of way that its name gives."""
HELD = frozenset({"standing", "sit", "lie", "kneel", "t_pose", "phone", "type", "drink"})
"""Actions that are held."""
CALM = frozenset({"standing", "look_around", "bow", "both_arms_raised"})
"""Actions about one place, on the feet, whose clips hardly differ in pace and size: posture and sway vary, too."""
LEAPS = frozenset({"jump", "jump_forward", "hop", "leap", "skip"})
"""Jumps that may lead over the floor."""
JUMPS = LEAPS | {"jump_twist"}
"""Actions that leave the floor; their height grows with their size."""
BALLISTIC = JUMPS | frozenset(
    {
        "fall", "fall_forward", "fall_backward", "fall_sideways", "fall_from_chair", "faint", "slip", "stumble",
        "sit_down_heavily", "cartwheel", "flip",
    }
)  # fmt: skip
"""Actions whose pace gravity gives."""
OFF_THE_FLOOR = frozenset({"climb_stairs", "climb_ladder", "handstand", "cartwheel", "flip"})
"""Actions whose feet and pelvis are not set on the floor z = 0."""
SIDED = frozenset(
    {
        "drink", "kick", "phone", "pick_up", "point", "punch", "put_down", "reach", "throw", "wash_window", "wave",
        "arm_circles", "lunge", "knee_to_elbow",
    }
)  # fmt: skip
"""Actions that one hand or foot does, which can be chosen."""
ARMS_FREE = WAYS - {"carry", "crawl"} | frozenset(
    {
        "standing", "sit", "sit_down", "stand_up", "sit_and_stand", "turn_around", "jog_on_the_spot", "march_in_place",
        "hop", "jump", "jump_forward", "jump_twist", "leap", "squat", "kick", "left_kick", "right_kick", "lunge",
        "look_around", "nod", "shake_head", "left_leg_raised", "right_leg_raised", "bow", "climb_stairs",
    }
)  # fmt: skip
"""Actions whose arms may do something else, or be held."""
POSTURES: Mapping[str, str] = MappingProxyType(
    {
        "hanging": "standing",
        "on_hips": "arms_on_hips",
        "folded": "arms_folded",
        "behind_back": "hands_behind_back",
        "in_pockets": "hands_in_pockets",
    }
)
"""Posture of the arms -> action by rules whose arms show it."""
