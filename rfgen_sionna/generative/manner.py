"""Manner of an action: pace, size, repetitions, way over the floor, posture of the arms."""

from __future__ import annotations

from dataclasses import dataclass

PATHS = ("straight", "to_and_fro", "circle", "loop")
"""Ways over the floor: one line, back and forth, round a circle, around a room."""
ARM_POSTURES = ("hanging", "on_hips", "folded", "behind_back", "in_pockets")
"""Postures of arms that the action leaves free."""
LYING = ("back", "stomach", "side", "left_side", "right_side")
"""Parts of the body that the floor carries; of "side" the seed draws which."""

_TIRED = 0.75
"""Pace and size of the movements of who is tired, of the usual ones."""


@dataclass(frozen=True)
class Manner:
    """How an action is done; None leaves a choice to the seed and the action."""

    speed: float | None = None
    """Factor on the usual pace."""
    speed_mps: float | None = None
    """Mean speed over the floor [m/s]."""
    amplitude: float | None = None
    """Factor on the usual size of the movement."""
    rate: float | None = None
    """Repetitions a minute."""
    path: str | None = None
    """Way over the floor, one of `PATHS`."""
    pauses: bool = False
    """Whether the way is interrupted by stops."""
    arm_posture: str | None = None
    """One of `ARM_POSTURES`."""
    tired: bool = False
    """Slow, stooped and with small movements."""
    lying: str | None = None
    """Part of the body that somebody lies on, one of `LYING`."""
    hand: str | None = None
    """"left", "right" or "both", where an action lets the hand be chosen."""

    @property
    def pace(self) -> float:
        """Factor on the usual pace, also of who is tired."""
        return (1.0 if self.speed is None else self.speed) * (_TIRED if self.tired else 1.0)

    @property
    def size(self) -> float:
        """Factor on the usual size of the movement, also of who is tired."""
        return (1.0 if self.amplitude is None else self.amplitude) * (_TIRED if self.tired else 1.0)
